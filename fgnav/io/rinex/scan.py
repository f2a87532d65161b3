"""Strict check of a RINEX observation file, before and against what RTKLIB makes of it.

RTKLIB's reader never complains: half of the damages to a file silently change the number of
observations. So every line is checked here first, and what must come out is counted.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, BoolArray, IntArray, Loss, quoted
from fgnav.io.gps_time import TICKS_PER_S
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.text import Bytes

# Highest satellite number of each constellation in use that RTKLIB's reader knows.
KNOWN_SATELLITES = {"G": 32, "E": 36, "C": 46, "J": 10, "R": 27}
CONSTELLATIONS = {"R": "GLONASS", "S": "SBAS", "I": "NavIC"}
_EVENTS = {2: "antenna starts to move", 3: "new site", 4: "header lines", 5: "external event"}
_EVENTS[6] = "cycle slip records"
# Labels that may stand inside the body without changing what the numbers mean.
_HARMLESS: tuple[str, ...] = (
    "COMMENT",
    "INTERVAL",
    "PGM / RUN BY / DATE",
    "OBSERVER / AGENCY",
    "LEAP SECONDS",
)
_HARMLESS += ("SIGNAL STRENGTH UNIT", "RCV CLOCK OFFS APPL", "GLONASS SLOT / FRQ #")
_HARMLESS += ("GLONASS COD/PHS/BIS", "SYS / PHASE SHIFT", "# OF SATELLITES", "PRN / # OF OBS")

PROBLEMS = {
    1: "an epoch line must start with '>' here",
    2: "epoch line is malformed (date, event flag or number of satellites)",
    3: "time must increase from epoch to epoch, it does not",
    4: "the epoch ends after {number} of the satellites it announced",
    5: "the last line is cut, it has no line end",
    6: "satellite must be of a constellation in the header, with a number",
    7: "satellite appears twice in one epoch",
    8: "column {column}: value must be a number with three decimals, indicators digits",
}
_MENDS = {4: "the file is truncated or a line is missing, fetch it again"}
_MENDS[5] = "fetch the file again, or append a line end if it is whole"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Scan:
    """What stands in an observation file, counted without decoding it.

    Attributes
    ----------
    ticks : ndarray of int, shape (n,)
        Epochs, 1e-7 s since 1980-01-06 in the file's own time system.
    power_failure : ndarray of bool, shape (n,)
        Whether the receiver reported a power failure before the epoch.
    kept : ndarray of int, shape (n,)
        Satellite records in use of each epoch.
    tally : ndarray of int, shape (128, types, 3)
        By constellation letter and observation type, of satellites in use: values other than zero,
        their sum in thousandths, sum of loss-of-lock indicators.
    satellites : ndarray of int, shape (128, 100)
        Records by constellation letter and number.
    events : tuple of (int, int)
        Ranges of bytes that hold no observations.
    losses : tuple of Loss
        What stands in the file and is not used.
    """

    ticks: IntArray
    power_failure: BoolArray
    kept: IntArray
    tally: IntArray
    satellites: IntArray
    events: tuple[tuple[int, int], ...]
    losses: tuple[Loss, ...]


def scan_observations(header: Header, text: Bytes) -> Scan:
    """Check the body of an observation file, and count what it holds.

    Parameters
    ----------
    text : ndarray of uint8
        The whole file, plain.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value, at the first fault.
    """
    from fgnav.io.rinex.kernels import Scanned, scan_2, scan_3  # noqa: PLC0415  # lazy: numba

    limits = np.zeros((128, 2), np.int64)
    for letter, types in header.types.items():
        limits[ord(letter)] = len(types), KNOWN_SATELLITES.get(letter, 0)
    widest = max(len(types) for types in header.types.values())
    tally = np.zeros((128, widest, 3), np.int64)
    satellites = np.zeros((128, 100), np.int64)
    rows = _most_epochs(header, text)
    epochs, problem = np.zeros((rows, 7), np.int64), np.zeros(4, np.int64)
    start = np.array([header.size, header.lines + 1])
    scan = scan_3 if header.version >= 3 else scan_2
    into = Scanned(tally, satellites, epochs)
    epochs = epochs[: scan(text, start, limits, into, problem)]
    if problem[0]:
        raise BadInputError(_problem(header, text, problem))
    measured = epochs[:, 1] <= 1
    if not measured.any():
        raise BadInputError(f"{header.path}: must hold an epoch, has none after its header")
    events, of_events = _events(header, text, epochs[~measured])
    epochs = epochs[measured]
    losses = (*_unused_satellites(satellites), *of_events, *_missing_end(header, epochs[:, 0]))
    return Scan(
        ticks=epochs[:, 0],
        power_failure=epochs[:, 1] == 1,
        kept=epochs[:, 3],
        tally=tally,
        satellites=satellites,
        events=events,
        losses=losses,
    )


def _most_epochs(header: Header, text: Bytes) -> int:
    """Return a bound on the number of epochs and events, without reading the lines."""
    body = text[header.size :]
    if header.version >= 3:
        return int(np.count_nonzero(body == ord(">"))) + 1
    return int(np.count_nonzero(body == ord("\n"))) + 1


def _problem(header: Header, text: Bytes, problem: IntArray) -> str:
    """Return the sentence that tells what is wrong in which line."""
    code, line, column, number = (int(k) for k in problem)
    rule = PROBLEMS[code].format(number=number, column=column)
    mend = _MENDS.get(code, "repair or remove the line")
    return line_fault(header, text, line, rule, mend)


def line_fault(header: Header, text: Bytes, line: int, rule: str, mend: str) -> str:
    """Return the sentence that names file and line, the rule, what stands there and the mend."""
    return f"{header.path}: line {line}: {rule}, got {quoted(line_text(text, line))}; {mend}"


def line_text(text: Bytes, line: int) -> str:
    """Return the beginning of a line, counted from 1, for an error text."""
    ends = np.flatnonzero(text == ord("\n"))
    start = 0 if line == 1 else int(ends[line - 2]) + 1 if line - 2 < len(ends) else len(text)
    stop = int(ends[line - 1]) if line - 1 < len(ends) else len(text)
    shown = text[start:stop].tobytes().decode("latin-1").rstrip()
    return shown if len(shown) <= 60 else shown[:57] + "..."


def _unused_satellites(satellites: IntArray) -> list[Loss]:
    """Return the losses of constellations and satellites that are not used."""
    losses = []
    for letter in np.flatnonzero(satellites.any(axis=1)):
        name, counts = chr(letter), satellites[letter]
        limit = KNOWN_SATELLITES.get(name)
        if limit is None:
            what = f"{CONSTELLATIONS[name]} observation"
            losses.append(Loss(what=what, reason="constellation not used", count=int(counts.sum())))
            continue
        losses += [
            Loss(
                what=f"{name}{k:02d} observation",
                reason="satellite unknown to RTKLIB",
                count=int(c),
            )
            for k, c in enumerate(counts)
            if k > limit and c
        ]
    return losses


def _events(
    header: Header, text: Bytes, rows: IntArray
) -> tuple[tuple[tuple[int, int], ...], list[Loss]]:
    """Return the byte ranges of events, and count them; refuse those that change the meaning."""
    losses: dict[int, int] = {}
    for _, flag, announced, _, line, start, end in rows.tolist():
        if flag in (3, 4):
            lines = text[start:end].tobytes().decode("latin-1").splitlines()[1:]
            for k, content in enumerate(lines, line + 1):
                label = content[60:].strip()
                if not label.startswith(_HARMLESS):
                    raise BadInputError(
                        f"{header.path}: line {k}: header inside the body must not change the "
                        f"station or the observation types, got "
                        f"{quoted(label)}; split the file there"
                    )
        losses[flag] = losses.get(flag, 0) + max(1, announced)
    counted = [
        Loss(what=f"event {flag} record", reason=f"{_EVENTS[flag]}: not used", count=count)
        for flag, count in losses.items()
    ]
    return tuple((row[5], row[6]) for row in rows.tolist()), counted


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
