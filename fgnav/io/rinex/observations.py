"""RINEX observations of one antenna: whole epochs; what is not used is counted.

Epochs that are cut, have more or fewer satellites than they announce, or break another rule are
left out and counted with the first line that does so.
"""

from collections import Counter
from typing import Any, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, IntArray, quoted, unused_of
from fgnav.io.antennas import nominal_epochs
from fgnav.io.gps_time import TICKS_PER_S, gps_of, to_ticks
from fgnav.io.rinex import scan as rules
from fgnav.io.rinex.constellations import CONSTELLATIONS, USED
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.scan import A_LINE, FLAG, TICKS, Body, ScanArrays, line_ends, scan
from fgnav.io.rinex.signals import Wanted, fields_of, is_kept
from fgnav.io.rinex.text import Bytes
from fgnav.io.tables import increasing
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK, Observations

_ENDS = b" \r\n\x1a\0"  # blank lines, the end of a text of DOS, a block that was not filled
_NOT_KEPT = "its carrier is not in use; gnss.signals names others"
_QUANTITIES = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")
_LETTERS = 128  # a letter of a constellation is less
_Counts: TypeAlias = Counter[tuple[str, str]]  # of what is not used, by what and reason
_EVENTS = {2: "antenna starts to move", 3: "new site", 4: "header lines", 5: "external event"}
_EVENTS[6] = "cycle slip records"
# Labels that change what the numbers mean; inside the body they must repeat the header's lines.
_MEANING: tuple[str, ...] = ("# / TYPES OF OBSERV", "SYS / # / OBS TYPES", "SYS / SCALE FACTOR")
_MEANING += ("TIME OF FIRST OBS",)
_RULES = {
    rules.NO_EPOCH: "no epoch begins where one must (date, event flag or number of satellites)",
    rules.COUNT: "announces another number of satellites than it has",
    rules.CUT: "cut at the end of the file",
    rules.SATELLITE: "names a satellite that the header does not, or twice",
    rules.VALUE: "a value must be a number with three decimals, column {column}",
}


def to_observations(
    header: Header, text: Bytes, start_gps_s: float, wanted: Wanted
) -> Observations:
    """Return the observations of a whole plain file: signals that are wanted, or usual ones."""
    body, is_ended = _body(header, text)
    scanned, name = _scanned(body), header.path.name
    ticks = scanned.epochs[:, TICKS]
    kept = increasing(ticks)
    counts = _Counts()
    _count_faults(header, body, scanned.faults, counts)
    counts[f"{name} epoch", "its time does not increase"] += int((~kept).sum())
    if not kept.any():
        reason = next((why for (_, why), n in counts.items() if n), "has none after its header")
        raise BadInputError(f"{header.path}: must hold an epoch, {reason}")
    if not (is_ended or counts.total()):
        counts[f"{name} line end", "the last line has no line end: it may be cut"] = 1
    ticks = ticks[kept]
    _count_events(header, body, scanned.events, counts)
    _count_end(header, ticks, counts)
    epoch = np.where(kept, np.cumsum(kept) - 1, -1)
    channels, blocks = list[tuple[str, str]](), list[dict[str, Any]]()
    for letter in header.types:
        names, block = _channels(header, letter, scanned, epoch, wanted, counts)
        channels += names
        blocks.append(block)
    order = sorted(range(len(channels)), key=channels.__getitem__)
    channels = [channels[k] for k in order]
    arrays: dict[str, Any] = {
        name: np.concatenate([block[name] for block in blocks], axis=1)[:, None, order]
        for name in (*_QUANTITIES, "lock_flags")
    }
    arrays["lock_flags"][scanned.epochs[kept, FLAG] == 1] |= LOST_LOCK
    for m, (satellite, signal) in enumerate(channels):
        if header.half_cycles & {(satellite, signal[0]), ("", signal[0])}:
            arrays["lock_flags"][np.isfinite(arrays["phase_cycles"][..., m]), m] |= HALF_CYCLE
    second_s = (ticks // TICKS_PER_S).astype(np.float64)
    shift = (gps_of(second_s, header.time_system) - second_s).astype(np.int64) * TICKS_PER_S
    tag_s = (ticks + shift - to_ticks(start_gps_s)) / TICKS_PER_S
    return Observations(
        t_s=nominal_epochs(tag_s, start_gps_s),
        tag_s=tag_s[:, None],
        satellites=tuple(satellite for satellite, _ in channels),
        signals=tuple(signal for _, signal in channels),
        unused=unused_of(counts),
        **arrays,
    )


def _body(header: Header, text: Bytes) -> tuple[Body, bool]:
    """Return the text behind the header without what ends a file, and whether its last line ends.

    Blank lines stay: they may be a satellite's.
    """
    size = len(text)
    while size > header.size and text[size - 1] in _ENDS:
        size -= 1
    last = text[size:][text[size:] == ord("\n")]
    content = np.concatenate([text[header.size : size], last])
    ends = np.flatnonzero(content == ord("\n"))
    if len(content) and content[-1] != ord("\n"):
        ends = np.append(ends, len(content))
    begins = np.append(0, ends + 1)[:-1]
    line_ends(content, begins, ends)
    types = np.zeros(_LETTERS, np.int64)
    units = np.full((_LETTERS, max(map(len, header.types.values()))), 1000.0)
    for letter, names in header.types.items():
        types[ord(letter)] = len(names)
        units[ord(letter), : len(names)] *= [header.scales.get((letter, n), 1) for n in names]
    lines = -(-int(types.max()) // A_LINE) if header.version < 3 else 0
    return Body(content, begins, ends, lines, types, units), bool(len(last))


def _scanned(body: Body) -> ScanArrays:
    """Return the observations of a scan."""
    n, types = len(body.begins), body.units.shape[1]
    epochs, records, faults, events = (np.empty((n, width), np.int64) for width in (4, 3, 3, 4))
    values, locks = np.empty((n, types)), np.empty((n, types), np.int64)
    scanned = ScanArrays(epochs, records, faults, events, values, locks)
    counts = scan(body, scanned)
    of = counts[[0, 1, 2, 3, 1, 1]].tolist()  # values and locks are those of records
    return ScanArrays._make(table[:count] for table, count in zip(scanned, of, strict=True))


def _channels(
    header: Header,
    letter: str,
    scanned: ScanArrays,
    epoch: IntArray,
    wanted: Wanted,
    counts: _Counts,
) -> tuple[list[tuple[str, str]], dict[str, Any]]:
    """Return a constellation's channels that have code or phase, and their arrays, (n, m)."""
    types = header.types[letter]
    rows = scanned.records[:, 1] == ord(letter)
    n, epoch, number = epoch.max() + 1, epoch[scanned.records[rows, 0]], scanned.records[rows, 2]
    is_used = (epoch >= 0) & (number <= CONSTELLATIONS[letter].satellites)
    _count_satellites(letter, number[(epoch >= 0) & ~is_used], counts)
    satellites, column = np.unique(number[is_used], return_inverse=True)
    epoch = epoch[is_used]
    values = scanned.values[rows, : len(types)][is_used]
    locks = scanned.locks[rows, : len(types)][is_used] & 3
    fields = fields_of(header, letter)
    names = sorted({s for field in fields for s in field.signals if is_kept(letter, s, wanted)})
    shape = n, len(satellites), len(names)
    dense: dict[str, Any] = {name: np.full(shape, np.nan) for name in _QUANTITIES[:3]}
    dense["cn0_dbhz"] = np.full(shape, np.nan, np.float32)
    dense["lock_flags"] = np.zeros(shape, np.uint8)
    unused = Counter[str]()
    for k, field in reversed(list(enumerate(fields))):  # the first field of a signal counts
        is_code = values[:, field.codes] != 0
        index = is_code.argmax(axis=1) if len(field.signals) > 1 else np.zeros(len(values), int)
        for j, signal in enumerate(field.signals):
            some = (index == j) & (values[:, k] != 0)
            if field.quantity < 0 or signal not in names:
                what = f"{signal} observation" if field.quantity >= 0 else f"{types[k]} value"
                unused[what] = max(unused[what], int(some.sum()))
                continue
            m = names.index(signal)
            dense[_QUANTITIES[field.quantity]][epoch[some], column[some], m] = values[some, k]
            if field.quantity == 1:
                some = (index == j) & (locks[:, k] != 0)
                dense["lock_flags"][epoch[some], column[some], m] = locks[some, k]
    has = (np.isfinite(dense["code_m"]) | np.isfinite(dense["phase_cycles"])).any(axis=0)
    alone = sum(int(np.isfinite(dense[name][:, ~has]).sum()) for name in _QUANTITIES[2:])
    counts["Doppler or density", "neither code nor phase of its carrier is in the file"] += alone
    for what, count in unused.items():
        counts[f"{letter} {what}", _NOT_KEPT] += count
    channels = [(f"{letter}{satellites[i]:02d}", names[j]) for i, j in np.argwhere(has).tolist()]
    return channels, {name: array[:, has] for name, array in dense.items()}


def _count_faults(header: Header, body: Body, faults: IntArray, counts: _Counts) -> None:
    """Count the epochs that were left out, by the rule that they break, with its first line."""
    broken = np.where(faults[:, 1] >= len(body.begins) - 1, rules.CUT, faults[:, 0])
    for rule in np.unique(broken).tolist():
        some = faults[broken == rule]
        reason = _RULES[rule].format(column=some[0, 2])
        reason += f", line {header.lines + 1 + some[0, 1]} first"
        counts[f"{header.path.name} epoch", reason] = len(some)


def _count_satellites(letter: str, numbers: IntArray, counts: _Counts) -> None:
    """Count a constellation that is not used, or satellites that are not."""
    if letter not in USED:
        what = f"{CONSTELLATIONS[letter].name} observation"
        counts[what, "constellation not used"] += len(numbers)
        return
    for number, count in zip(*np.unique(numbers, return_counts=True), strict=True):
        counts[f"{letter}{number:02d} observation", "of a number that is not used"] += int(count)


def _count_events(header: Header, body: Body, events: IntArray, counts: _Counts) -> None:
    """Count events; refuse those that change the meaning of what follows."""
    for flag, announced, line, after in events.tolist():
        for k in range(line + 1, min(after, len(body.begins))):
            content = body.text[body.begins[k] : body.ends[k]].tobytes().decode("latin-1")
            label = content[60:].strip()
            if flag in (3, 4) and label in _MEANING and content not in header.content:
                raise BadInputError(
                    f"{header.path}: line {header.lines + 1 + k}: header inside the body must "
                    f"not change the observation types, got {quoted(label)}; split the file there"
                )
        counts[f"event {flag} record", f"{_EVENTS[flag]}: not used"] += max(1, announced)


def _count_end(header: Header, ticks: IntArray, counts: _Counts) -> None:
    """Count the epochs between the last one and the last one that the header announces."""
    if not np.isfinite(header.last_gps_s):
        return
    remainder = to_ticks(header.last_gps_s) - int(ticks[-1])
    if len(ticks) > 1:
        missing = round(remainder / int(np.median(np.diff(ticks))))
    elif header.interval_s:
        missing = round(remainder / (header.interval_s * TICKS_PER_S))
    else:  # of one epoch nothing tells the interval: one at least
        missing = int(remainder > 0)
    reason = "the header announces a later end: the file may be cut"
    counts[f"{header.path.name} epoch", reason] += max(missing, 0)
