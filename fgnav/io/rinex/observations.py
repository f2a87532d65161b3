"""RINEX observations of one antenna: whole epochs; what is not used is counted.

Epochs that are cut, have more or fewer satellites than they announce, or break another rule are
left out and counted with the first line that does so.
"""

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Loss, quoted
from fgnav.io.antennas import nominal_epochs
from fgnav.io.gps_time import BDT_BEHIND_GPS_S, TICKS_PER_S, UNIX_OF_GPS_S, gps_of_utc, to_ticks
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.signals import SignalChoice
from fgnav.io.rinex.text import Bytes
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK, Observations

if TYPE_CHECKING:
    from fgnav.io.rinex.kernels import Plan, Scanned

# Highest satellite number of each constellation in use.
KNOWN_SATELLITES = {"G": 32, "E": 36, "C": 46, "J": 10, "R": 27}
CONSTELLATIONS = {"R": "GLONASS", "S": "SBAS", "I": "NavIC"}
_EVENTS = {2: "antenna starts to move", 3: "new site", 4: "header lines", 5: "external event"}
_EVENTS[6] = "cycle slip records"
# Labels that change what the numbers mean; inside the body they must repeat the header's lines.
_MEANING: tuple[str, ...] = ("# / TYPES OF OBSERV", "SYS / # / OBS TYPES", "SYS / SCALE FACTOR")
_MEANING += ("TIME OF FIRST OBS",)
_ENDS = b" \r\n\x1a\0"  # blank lines, the end of a text of DOS, a block that was not filled
_RULES = {  # by number, as of ``kernels``
    1: "no epoch begins where one must (date, event flag or number of satellites)",
    2: "announces another number of satellites than it has",
    3: "cut at the end of the file",
    4: "names a satellite that the header does not, or twice",
    5: "a value must be a number with three decimals, column {column}",
}
_NOT_KEPT = "one signal each of three carriers is kept; gnss.signals names others"
_ARRAYS = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")


def to_observations(
    header: Header, text: Bytes, choice: SignalChoice, start_gps_s: float
) -> Observations:
    """Return the observations of a file's body.

    Parameters
    ----------
    text : ndarray of uint8
        The whole file, plain.
    choice : SignalChoice
        The signals that are kept.

    Raises
    ------
    BadInputError
        If no epoch is whole, or the types of observations change.
    """
    body, is_ended = _body(header, text)
    names, plan, defaults = _plan(header, choice)
    into, rows, lines = _scanned(header, body, plan, defaults.shape[1])
    epochs = into.epochs[:rows]
    measured = epochs[:, 1] <= 1
    kept = measured.copy()
    kept[measured] = in_order(epochs[measured, 0])
    losses = _faults(header, into.faults, int(measured.sum() - kept.sum()))
    if not kept.any():
        reason = losses[0].reason if losses else "has none after its header"
        raise BadInputError(f"{header.path}: must hold an epoch, {reason}")
    if not (is_ended or losses):
        reason = "the last line has no line end: it may be cut"
        losses.append(Loss(what=f"{header.path.name} line end", reason=reason, count=1))
    losses += _unused_satellites(into.satellites)
    losses += _events(header, body, lines, epochs[~measured])
    losses += _missing_end(header, epochs[kept, 0])
    count = into.taken[0]
    used: slice | IntArray = slice(count)  # a view, where all are kept
    if not kept[measured].all():
        used = np.flatnonzero(kept[into.records[:count, 0]])
    records, signals = into.records[used], into.signals[used]
    losses += _unused_types(header, choice, into.tally, int((into.values[:count, :, 0] != 0).sum()))
    ticks = epochs[kept, 0] + _time_shift(header, epochs[kept, 0])
    tag_s = (ticks - to_ticks(start_gps_s)) / TICKS_PER_S
    signals = np.where(signals > 0, signals, defaults[records[:, 1]])
    epoch = (np.cumsum(kept) - 1)[records[:, 0]]
    values, locks = into.values[used], into.locks[used]
    channels, arrays, alone = _dense(epoch, len(ticks), records, signals, values, locks, names)
    arrays["lock_flags"][epochs[kept, 1] == 1] |= LOST_LOCK
    for m, (satellite, signal) in enumerate(channels):
        if header.half_cycles & {(satellite, signal[0]), ("", signal[0])}:
            arrays["lock_flags"][np.isfinite(arrays["phase_cycles"][..., m]), m] |= HALF_CYCLE
    return Observations(
        t_s=nominal_epochs(tag_s, start_gps_s),
        tag_s=tag_s[:, None],
        satellites=tuple(satellite for satellite, _ in channels),
        signals=tuple(signal for _, signal in channels),
        losses=(*losses, *alone),
        earlier=None,
        **arrays,
    )


def _body(header: Header, text: Bytes) -> tuple[Bytes, bool]:
    """Return the text behind the header without what ends a file, and whether its last line ends.

    Blank lines stay: they may be a satellite's.
    """
    size = len(text)
    while size > header.size and text[size - 1] in _ENDS:
        size -= 1
    rest = text[size:]
    line_ends = rest[rest == ord("\n")]
    return np.append(text[header.size : size], line_ends), bool(len(line_ends))


def _plan(header: Header, choice: SignalChoice) -> tuple[tuple[str, ...], "Plan", IntArray]:
    """Return signals by number, what becomes of each field, and signals of phases without code."""
    from fgnav.io.rinex.kernels import Plan  # noqa: PLC0415  # lazy: numba

    widest = max(len(types) for types in header.types.values())
    carriers = max([len(some) for some in choice.kept.values()] + [1])
    plan = Plan(
        limits=np.zeros((128, 2), np.int64),
        fields=np.full((128, widest, 3), -1, np.int64),
        units=np.full((128, widest), 1000.0),
    )
    kept = [signal for some in choice.kept.values() for one in some for signal in one]
    names = ("", *dict.fromkeys(kept))
    numbers = {name: k for k, name in enumerate(names)}
    defaults = np.zeros((128, carriers), np.int64)
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
    header: Header, body: Bytes, plan: "Plan", carriers: int
) -> tuple["Scanned", int, IntArray]:
    """Return what a body holds, how many epochs and events, and the offsets of its lines."""
    from fgnav.io.rinex.kernels import Scanned, line_ends, scan  # noqa: PLC0415  # lazy: numba

    ends = np.flatnonzero(body == ord("\n"))
    if len(body) and body[-1] != ord("\n"):
        ends = np.append(ends, len(body))
    lines = np.stack([np.append(0, ends + 1)[:-1], ends], axis=1)
    line_ends(body, lines)
    most = epochs = len(lines) + 2
    if header.version >= 3:
        epochs = int((body[lines[:, 0]] == ord(">")).sum()) + 3
    into = Scanned(
        tally=np.zeros(plan.fields.shape[:2], np.int64),
        satellites=np.zeros((128, 100), np.int64),
        epochs=np.zeros((epochs, 6), np.int64),
        taken=np.zeros(1, np.int64),
        records=np.zeros((most, 3), np.int64),
        signals=np.zeros((most, carriers), np.int64),
        values=np.zeros((most, carriers, 4)),
        locks=np.zeros((most, carriers), np.int64),
        faults=np.zeros((len(_RULES) + 1, 3), np.int64),
    )
    return into, scan(body, lines, 4 if header.version >= 3 else 2, plan, into), lines


def in_order(ticks: IntArray | FloatArray) -> BoolArray:
    """Return which epochs are later than all before, or earlier than all after, whichever is more.

    One date that is wrong must not cost the epochs on one side of it.
    """
    if not len(ticks):
        return np.ones(0, np.bool_)
    later, earlier = np.ones((2, len(ticks)), np.bool_)
    later[1:] = ticks[1:] > np.maximum.accumulate(ticks)[:-1]
    earlier[:-1] = ticks[:-1] < np.minimum.accumulate(ticks[::-1])[::-1][1:]
    return later if later.sum() >= earlier.sum() else earlier


def _faults(header: Header, faults: IntArray, unordered: int) -> list[Loss]:
    """Return the epochs that were left out."""
    what = f"{header.path.name} epoch"
    losses = []
    for rule, (count, line, column) in enumerate(faults.tolist()):
        if count:
            reason = f"{_RULES[rule].format(column=column)}, line {header.lines + 1 + line} first"
            losses.append(Loss(what=what, reason=reason, count=count))
    if unordered:
        losses.append(Loss(what=what, reason="its time does not increase", count=unordered))
    return losses


def _dense(
    epoch: IntArray,
    n: int,
    records: IntArray,
    signals: IntArray,
    values: FloatArray,
    locks: IntArray,
    names: tuple[str, ...],
) -> tuple[list[tuple[str, str]], dict[str, np.ndarray], list[Loss]]:
    """Spread records over epochs and channels, (n, 1, m); channels have code or phase."""
    tracks = (values[..., 0] != 0) | (values[..., 1] != 0)
    row, carrier = np.nonzero(tracks | (values[..., 2] != 0) | (values[..., 3] != 0) | (locks != 0))
    keys = (records[:, 1] * 100 + records[:, 2])[row] * len(names) + signals[row, carrier]
    is_channel = np.bincount(keys[tracks[row, carrier]], minlength=12_800 * len(names)) > 0
    channel_keys = np.flatnonzero(is_channel)
    column = (np.cumsum(is_channel) - 1)[keys]
    kept = is_channel[keys]
    alone = int((values[row[~kept], carrier[~kept]] != 0).sum())
    reason = "neither code nor phase of its carrier is in the file"
    losses = [Loss(what="Doppler or density", reason=reason, count=alone)] if alone else []
    row, carrier, column = row[kept], carrier[kept], column[kept]
    satellites, of = np.divmod(channel_keys, len(names))
    channels = [
        (f"{chr(satellite // 100)}{satellite % 100:02d}", names[signal])
        for satellite, signal in zip(satellites.tolist(), of.tolist(), strict=True)
    ]
    order = sorted(range(len(channels)), key=channels.__getitem__)
    where = epoch[row], np.argsort(order)[column] if order else column
    arrays: dict[str, np.ndarray] = {}
    for k, name in enumerate(_ARRAYS):
        dense = np.full((n, len(channels)), np.nan, np.float32 if k == 3 else np.float64)
        some = values[row, carrier, k]
        dense[where] = np.where(some != 0, some, np.nan)
        arrays[name] = dense[:, None]
    flags = np.zeros((n, len(channels)), np.uint8)
    flags[where] = locks[row, carrier]
    return [channels[k] for k in order], arrays | {"lock_flags": flags[:, None]}, losses


def _time_shift(header: Header, ticks: IntArray) -> IntArray:
    """Return what to add to the file's epochs for GPS time."""
    if header.time_system == "BDT":
        return np.full(len(ticks), BDT_BEHIND_GPS_S * TICKS_PER_S)
    if header.time_system != "GLO":
        return np.zeros(len(ticks), np.int64)
    utc_s = ticks // TICKS_PER_S + float(UNIX_OF_GPS_S)  # GLONASS's time is UTC in RINEX
    return (gps_of_utc(utc_s) + UNIX_OF_GPS_S - utc_s).astype(np.int64) * TICKS_PER_S


def _unused_types(header: Header, choice: SignalChoice, tally: IntArray, codes: int) -> list[Loss]:
    """Return the values of signals that are not kept."""
    losses = []
    for letter, types in header.types.items():
        counts = Counter[str]()
        for name, count in zip(types, tally[ord(letter)].tolist(), strict=False):
            carrier, place, signal = choice.column(letter, name)
            if carrier < 0 and count:
                what = f"{letter} {signal} observation" if place >= 0 else f"{letter} {name} value"
                counts[what] = max(counts[what], count)
            codes -= count * (carrier >= 0 and place == 0)
        losses += [Loss(what=what, reason=_NOT_KEPT, count=n) for what, n in counts.items()]
    if codes < 0:
        losses.append(Loss(what="second code of a carrier", reason=_NOT_KEPT, count=-codes))
    return losses


def _unused_satellites(satellites: IntArray) -> list[Loss]:
    """Return the losses of constellations and satellites that are not used."""
    counts = Counter[tuple[str, str]]()
    for letter, number in np.argwhere(satellites).tolist():
        name, limit = chr(letter), KNOWN_SATELLITES.get(chr(letter))
        what, reason = f"{name}{number:02d} observation", "of a number that is not used"
        if limit is None:
            what, reason = f"{CONSTELLATIONS[name]} observation", "constellation not used"
        if limit is None or number > limit:
            counts[what, reason] += int(satellites[letter, number])
    return [Loss(what=what, reason=why, count=n) for (what, why), n in counts.items()]


def _events(header: Header, body: Bytes, lines: IntArray, rows: IntArray) -> list[Loss]:
    """Return the count of events; refuse those that change the meaning of what follows."""
    counts = Counter[int]()
    for _, flag, announced, line, end, _ in rows.tolist():
        if flag in (3, 4):
            for k in range(line + 1, min(end, len(lines))):
                content = body[slice(*lines[k])].tobytes().decode("latin-1")
                label = content[60:].strip()
                if label in _MEANING and content.rstrip() not in header.content:
                    raise BadInputError(
                        f"{header.path}: line {header.lines + 1 + k}: header inside the body must "
                        f"not change the observation types, got {quoted(label)}; split the file "
                        "there"
                    )
        counts[flag] += max(1, announced)
    return [
        Loss(what=f"event {flag} record", reason=f"{_EVENTS[flag]}: not used", count=count)
        for flag, count in counts.items()
    ]


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
