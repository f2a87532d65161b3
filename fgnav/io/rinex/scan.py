"""Strict reading of a RINEX observation file.

Every line is checked. Epochs that are cut at the end of the file, or have more or fewer satellites
than they announce, are left out and counted; whatever else breaks a rule is an error.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Loss, quoted
from fgnav.io.gps_time import TICKS_PER_S
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.text import Bytes
from fgnav.io.signal_choice import SignalChoice

if TYPE_CHECKING:
    from fgnav.io.rinex.kernels import Plan, Scanned

# Highest satellite number of each constellation in use.
KNOWN_SATELLITES = {"G": 32, "E": 36, "C": 46, "J": 10, "R": 27}
CONSTELLATIONS = {"R": "GLONASS", "S": "SBAS", "I": "NavIC"}
_EVENTS = {2: "antenna starts to move", 3: "new site", 4: "header lines", 5: "external event"}
_EVENTS[6] = "cycle slip records"
# Labels that change what the numbers mean; inside the body they must repeat the header's lines.
_MEANING: tuple[str, ...] = ("# / TYPES OF OBSERV", "SYS / # / OBS TYPES", "SYS / SCALE FACTOR")
_MEANING += ("WAVELENGTH FACT L1/2", "TIME OF FIRST OBS")
_ENDS = b" \r\n\x1a\0"  # blank lines, the end of a text of DOS, a block that was not filled

PROBLEMS = {
    1: "an epoch line must start with '>' here",
    2: "epoch line is malformed (date, event flag or number of satellites)",
    3: "time must increase from epoch to epoch, it does not",
    6: "satellite must be of a constellation in the header, with a number",
    7: "satellite appears twice in one epoch",
    8: "column {column}: value must be a number with three decimals, indicators digits",
}


_NOT_KEPT = "one signal each of L1/E1/B1I, L2/E5b/B2 and L5/E5a/B2a is kept"
_EPOCH_2 = re.compile(rb"(?: [ \d]\d){5}[ \d]{2}\d\.\d{7}  [ 0-6][ \d]{2}\d")
_FIELD_2 = rb"(?:[ \d-]{10}\.\d{3}[ \d]{2}| {16})"
_FIELDS_2 = re.compile(_FIELD_2 + rb"{0,4}(?:[ \d-]{10}\.\d{3}[ \d]{0,2})?[ \r]*")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Scan:
    """What stands in an observation file.

    Attributes
    ----------
    ticks : ndarray of int, shape (n,)
        Epochs, 1e-7 s since 1980-01-06 in the file's own time system.
    power_failure : ndarray of bool, shape (n,)
        Whether the receiver reported a power failure before the epoch.
    names : tuple of str
        Signals by number; the first is none.
    records : ndarray of int, shape (r, 3)
        Epoch, constellation letter and number, of satellites in use.
    signals : ndarray of int, shape (r, 3)
        Numbers of the signals of each carrier.
    values : ndarray, shape (r, 3, 4)
        Code in m, phase in cycles, Doppler in Hz, density in dB-Hz; 0: not measured.
    locks : ndarray of int, shape (r, 3)
        Loss-of-lock indicators.
    losses : tuple of Loss
        What stands in the file and is not used.
    """

    ticks: IntArray
    power_failure: BoolArray
    names: tuple[str, ...]
    records: IntArray
    signals: IntArray
    values: FloatArray
    locks: IntArray
    losses: tuple[Loss, ...]


def scan_observations(header: Header, text: Bytes, choice: SignalChoice) -> Scan:
    """Check and take the body of an observation file.

    Parameters
    ----------
    text : ndarray of uint8
        The whole file, plain.
    choice : SignalChoice
        The signals that are kept.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value, at the first fault that is no damaged epoch.
    """
    trimmed, is_cut = _trimmed(header, text)
    names, plan, defaults = _plan(header, choice)
    body, losses = trimmed, list[Loss]()
    into, rows, problem = _scanned(header, body, plan, header.size, header.lines + 1)
    if problem[0]:
        damaged, losses = _damaged_epochs(header, trimmed, plan)
        body = _without(trimmed, damaged)
        into, rows, _ = _scanned(header, body, plan, header.size, header.lines + 1)
    epochs = into.epochs[:rows]
    measured = epochs[:, 1] <= 1
    if not measured.any():
        reason = losses[0].reason if losses else "has none after its header"
        raise BadInputError(f"{header.path}: must hold an epoch, {reason}")
    if is_cut and not losses:
        reason = "the last line has no line end: it may be cut"
        losses.append(Loss(what=f"{header.path.name} line end", reason=reason, count=1))
    losses += _unused_satellites(into.satellites)
    losses += _events(header, body, epochs[~measured])
    losses += _missing_end(header, epochs[measured, 0])
    count = into.taken[0]
    records, signals, values = into.records[:count], into.signals[:count], into.values[:count]
    losses += _unused_types(header, choice, into.tally, int((values[:, :, 0] != 0).sum()))
    return Scan(
        ticks=epochs[measured, 0],
        power_failure=epochs[measured, 1] == 1,
        names=names,
        records=np.column_stack([np.cumsum(measured)[records[:, 0]] - 1, records[:, 1:]]),
        signals=np.where(signals > 0, signals, defaults[records[:, 1]]),
        values=values,
        locks=into.locks[:count],
        losses=tuple(losses),
    )


def _trimmed(header: Header, text: Bytes) -> tuple[Bytes, bool]:
    """Return the text without what follows its last line, and whether that line has no end."""
    size = len(text)
    while size > header.size and text[size - 1] in _ENDS:
        size -= 1
    newline = np.flatnonzero(text[size:] == ord("\n"))
    return text[: size + newline[0] + 1 if len(newline) else size], not len(newline)


def _plan(header: Header, choice: SignalChoice) -> tuple[tuple[str, ...], "Plan", IntArray]:
    """Return signals by number, what becomes of each field, and signals of phases without code."""
    from fgnav.io.rinex.kernels import Plan  # noqa: PLC0415  # lazy: numba

    widest = max(len(types) for types in header.types.values())
    plan = Plan(
        limits=np.zeros((128, 2), np.int64),
        fields=np.full((128, widest, 3), -1, np.int64),
        units=np.full((128, widest), 1000.0),
    )
    kept = [signal for some in choice.kept.values() for one in some for signal in one]
    names = ("", *dict.fromkeys(kept))
    numbers = {name: k for k, name in enumerate(names)}
    defaults = np.zeros((128, 3), np.int64)
    for letter, types in header.types.items():
        at = ord(letter)
        plan.limits[at] = len(types), KNOWN_SATELLITES.get(letter, 0)
        for k, name in enumerate(types):
            carrier, place, signal = choice.column(letter, name)
            plan.fields[at, k] = carrier, place, numbers.get(signal, 0)
            plan.units[at, k] = 1000.0 * header.scales.get((letter, name), 1)
        for carrier, some in enumerate(choice.kept.get(letter, ())):
            defaults[at, carrier] = numbers[some[0]] if some else 0
    return names, plan, defaults


def _scanned(
    header: Header, text: Bytes, plan: "Plan", offset: int, line: int
) -> tuple["Scanned", int, IntArray]:
    """Return what a body holds from an offset on, rows of epochs, and the problem it ends at."""
    from fgnav.io.rinex.kernels import Scanned, scan_2, scan_3  # noqa: PLC0415  # lazy: numba

    body = text[offset:]
    lines = int(np.count_nonzero(body == ord("\n"))) + 2
    most = int(np.count_nonzero(body == ord(">"))) + 1 if header.version >= 3 else lines
    into = Scanned(
        tally=np.zeros(plan.fields.shape[:2], np.int64),
        satellites=np.zeros((128, 100), np.int64),
        epochs=np.zeros((most, 6), np.int64),
        taken=np.zeros(1, np.int64),
        records=np.zeros((lines, 3), np.int64),
        signals=np.zeros((lines, 3), np.int64),
        values=np.zeros((lines, 3, 4)),
        locks=np.zeros((lines, 3), np.int64),
    )
    problem = np.zeros(3, np.int64)
    scan = scan_3 if header.version >= 3 else scan_2
    rows = scan(text, np.array([offset, line]), plan, into, problem)
    return into, rows, problem


def _damaged_epochs(
    header: Header, text: Bytes, plan: "Plan"
) -> tuple[list[tuple[int, int]], list[Loss]]:
    """Return the bytes of epochs that are not whole, and their count."""
    ranges: list[tuple[int, int]] = []
    reasons: dict[str, int] = {}
    offset, line = header.size, header.lines + 1
    while True:
        into, rows, problem = _scanned(header, text, plan, offset, line)
        if not problem[0]:
            break
        begin, end, reason = _damaged_epoch(header, text, into.epochs[: rows + 1], problem)
        ranges.append((begin, end))
        reasons[reason] = reasons.get(reason, 0) + 1
        line += int(np.count_nonzero(text[offset:end] == ord("\n")))
        offset = end
        if offset >= len(text):
            break
    what = f"{header.path.name} epoch"
    return ranges, [Loss(what=what, reason=reason, count=n) for reason, n in reasons.items()]


def _damaged_epoch(
    header: Header, text: Bytes, epochs: IntArray, problem: IntArray
) -> tuple[int, int, str]:
    """Return the bytes of the epoch that a scan ends at, and what is wrong with it."""
    start, before = int(epochs[-1, 4]), int(epochs[-2, 4]) if len(epochs) > 1 else -1
    at, code = _offset_of(text, int(problem[1])), int(problem[0])
    reason = f"announces another number of satellites than it has, line {problem[1]} first"
    is_3 = header.version >= 3
    if before >= 0 and (
        (is_3 and code == 1 and _is_record_3(header, text, at))
        or (not is_3 and code == 2 and _FIELDS_2.fullmatch(_line(text, at)))
    ):
        return before, _next_epoch(header, text, at), reason
    if at >= len(text) or not (text[at:-1] == ord("\n")).any():
        return start, len(text), f"cut at the end of the file, line {problem[1]}"
    if (is_3 and code == 4) or (not is_3 and code == 8 and _EPOCH_2.match(_line(text, at))):
        return start, at, reason
    if not is_3 and code == 6 and _lists_fewer(text, start, int(epochs[-1, 2])):
        return start, _next_epoch(header, text, start + 1), reason
    raise BadInputError(_problem(header, text, problem))


def _next_epoch(header: Header, text: Bytes, at: int) -> int:
    """Return where the next epoch begins, from a place on, or the end of the text."""
    pattern = rb"\n>" if header.version >= 3 else rb"\n" + _EPOCH_2.pattern
    match = re.compile(pattern).search(text.tobytes(), max(at - 1, 0))
    return match.start() + 1 if match else len(text)


def _lists_fewer(text: Bytes, start: int, announced: int) -> bool:
    """Return True if an epoch of RINEX 2 lists fewer satellites than it announces."""
    first, *others = text[start : start + 80 * (announced // 12 + 2)].tobytes().split(b"\n")
    listed = len(first[32:68].rstrip())
    for k, line in enumerate(others, 1):
        if line[:32].strip() or not line.strip():
            return listed <= 3 * announced - 3 and _FIELDS_2.fullmatch(line) is not None
        listed = 36 * k + len(line[32:68].rstrip())
    return False


def _offset_of(text: Bytes, line: int) -> int:
    """Return where a line, counted from 1, begins."""
    begins = np.append(0, np.flatnonzero(text == ord("\n")) + 1)
    return int(begins[line - 1]) if line <= len(begins) else len(text)


def _line(text: Bytes, at: int) -> bytes:
    """Return a line from its beginning on."""
    piece = text[at : at + 4096].tobytes()
    return piece.split(b"\n", 1)[0]


def _is_record_3(header: Header, text: Bytes, at: int) -> bool:
    """Return True if a line begins as a satellite's does."""
    line = _line(text, at)
    return chr(line[0]) in header.types and line[1:3].strip().isdigit() if line else False


def _unused_types(header: Header, choice: SignalChoice, tally: IntArray, codes: int) -> list[Loss]:
    """Return the values of signals that are not kept."""
    losses = []
    for letter, types in header.types.items():
        counts: dict[str, int] = {}
        for name, count in zip(types, tally[ord(letter)].tolist(), strict=False):
            carrier, place, signal = choice.column(letter, name)
            if carrier < 0 and count:
                what = f"{letter} {signal} observation" if place >= 0 else f"{letter} {name} value"
                counts[what] = max(counts.get(what, 0), count)
            codes -= count * (carrier >= 0 and place == 0)
        losses += [Loss(what=what, reason=_NOT_KEPT, count=n) for what, n in counts.items()]
    if codes < 0:
        losses.append(Loss(what="second code of a carrier", reason=_NOT_KEPT, count=-codes))
    return losses


def _problem(header: Header, text: Bytes, problem: IntArray) -> str:
    """Return the sentence that tells what is wrong in which line."""
    code, line, column = problem.tolist()
    rule = PROBLEMS[code].format(column=column)
    return line_fault(header, text, line, rule, "repair or remove the line")


def line_fault(header: Header, text: Bytes, line: int, rule: str, mend: str) -> str:
    """Return the sentence that names file and line, the rule, what stands there and the mend."""
    return f"{header.path}: line {line}: {rule}, got {quoted(line_text(text, line))}; {mend}"


def line_text(text: Bytes, line: int) -> str:
    """Return the beginning of a line, counted from 1, for an error text."""
    shown = _line(text, _offset_of(text, line)).decode("latin-1").rstrip()
    return shown if len(shown) <= 60 else shown[:57] + "..."


def _unused_satellites(satellites: IntArray) -> list[Loss]:
    """Return the losses of constellations and satellites that are not used."""
    losses = []
    for letter, number in np.argwhere(satellites).tolist():
        name, limit = chr(letter), KNOWN_SATELLITES.get(chr(letter))
        if limit is None and number == np.flatnonzero(satellites[letter])[0]:
            what, reason = f"{CONSTELLATIONS[name]} observation", "constellation not used"
            losses.append(Loss(what=what, reason=reason, count=int(satellites[letter].sum())))
        elif limit is not None and number > limit:
            what, reason = f"{name}{number:02d} observation", "of a number that is not used"
            losses.append(Loss(what=what, reason=reason, count=int(satellites[letter, number])))
    return losses


def _events(header: Header, text: Bytes, rows: IntArray) -> list[Loss]:
    """Return the count of events; refuse those that change the meaning of what follows."""
    losses: dict[int, int] = {}
    head = {one.rstrip() for one in text[: header.size].tobytes().decode("latin-1").splitlines()}
    for _, flag, announced, line, start, end in rows.tolist():
        if flag in (3, 4):
            lines = text[start:end].tobytes().decode("latin-1").splitlines()[1:]
            for k, content in enumerate(lines, line + 1):
                label = content[60:].strip()
                if label in _MEANING and content.rstrip() not in head:
                    raise BadInputError(
                        f"{header.path}: line {k}: header inside the body must not change the "
                        f"observation types, got {quoted(label)}; split the file there"
                    )
        losses[flag] = losses.get(flag, 0) + max(1, announced)
    return [
        Loss(what=f"event {flag} record", reason=f"{_EVENTS[flag]}: not used", count=count)
        for flag, count in losses.items()
    ]


def _without(text: Bytes, ranges: Sequence[tuple[int, int]]) -> Bytes:
    """Return the text without ranges of bytes."""
    if not ranges:
        return text
    keep = np.ones(len(text), bool)
    for start, end in ranges:
        keep[start:end] = False
    return text[keep]


def _missing_end(header: Header, ticks: IntArray) -> list[Loss]:
    """Count the epochs between the last one and the last one that the header announces."""
    if header.last_us is None:
        return []
    rest = header.last_us * 10 - int(ticks[-1])
    if len(ticks) > 1:
        missing = round(rest / int(np.median(np.diff(ticks))))
    elif header.interval_s is not None:
        missing = round(rest / (header.interval_s * TICKS_PER_S))
    else:  # of one epoch nothing tells the interval: one at least
        missing = int(rest > 0)
    if missing <= 0:
        return []
    reason = "the header announces a later end: the file may be cut"
    return [Loss(what=f"{header.path.name} epoch", reason=reason, count=missing)]
