"""RINEX observations of one antenna: whole epochs; what is not used is counted.

Epochs that are cut, have more or fewer satellites than they announce, or break another rule are
left out and counted with the first line that does so.
"""

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Loss
from fgnav.io.antennas import nominal_epochs
from fgnav.io.gps_time import BDT_BEHIND_GPS_S, TICKS_PER_S, UNIX_OF_GPS_S, gps_of_utc, to_ticks
from fgnav.io.rinex import kernels
from fgnav.io.rinex.epochs import (
    COUNT,
    PADDING,
    SATELLITE,
    VALUE,
    Body,
    Epochs,
    Fault,
    find_epochs,
)
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.losses import (
    KNOWN_SATELLITES,
    losses_of_end,
    losses_of_events,
    losses_of_faults,
    losses_of_unused_satellites,
)
from fgnav.io.rinex.signals import Wanted, fields_of, is_kept
from fgnav.io.rinex.text import Bytes
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK, Observations

_ENDS = b" \r\n\x1a\0"  # blank lines, the end of a text of DOS, a block that was not filled
_NOT_KEPT = "its carrier is not in use; gnss.signals names others"
_FIELDS = 5  # of a line of RINEX 2
_QUANTITIES = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")


@dataclass(frozen=True, eq=False, slots=True)
class _Records:
    """The satellites of one constellation, in the order of the file."""

    letter: str
    rows: IntArray  # (r,), among all satellites of the file
    values: FloatArray  # (r, types), 0 where there is none
    locks: IntArray  # (r, types)


@dataclass(frozen=True, eq=False, slots=True)
class _Block:
    """The channels of one constellation."""

    channels: list[tuple[str, str]]  # satellite, signal
    arrays: dict[str, Any]  # (n, m), by the names of ``Observations``
    losses: list[Loss]


def to_observations(
    header: Header, text: Bytes, start_gps_s: float, wanted: Wanted
) -> Observations:
    """Return the observations of a file's body.

    Parameters
    ----------
    text : ndarray of uint8
        The whole file, plain.
    wanted : mapping of str to sequence of str
        Signals by constellation letter; all of usual carriers without any.

    Raises
    ------
    BadInputError
        If no epoch is whole, or the types of observations change.
    """
    body, is_ended = _body(header, text)
    epochs = find_epochs(body)
    records, faults = _records(header, body, epochs)
    is_whole = np.ones(len(epochs.ticks), np.bool_)
    is_whole[epochs.epoch[list(faults)]] = False
    kept = is_whole.copy()
    kept[is_whole] = in_order(epochs.ticks[is_whole])
    losses = losses_of_faults(header, body, [*epochs.faults, *faults.values()])
    unordered = int((is_whole & ~kept).sum())
    reason = "its time does not increase"
    losses += [Loss(what=f"{header.path.name} epoch", reason=reason, count=unordered)]
    losses = [one for one in losses if one.count]
    if not kept.any():
        reason = losses[0].reason if losses else "has none after its header"
        raise BadInputError(f"{header.path}: must hold an epoch, {reason}")
    if not (is_ended or losses):
        reason = "the last line has no line end: it may be cut"
        losses.append(Loss(what=f"{header.path.name} line end", reason=reason, count=1))
    ticks = epochs.ticks[kept]
    losses += losses_of_events(header, body, epochs.events)
    losses += losses_of_end(header, ticks)
    epoch = np.where(kept, np.cumsum(kept) - 1, -1)[epochs.epoch]
    blocks = [_block(header, one, epoch, epochs.number, len(ticks), wanted) for one in records]
    channels = [channel for block in blocks for channel in block.channels]
    order = sorted(range(len(channels)), key=channels.__getitem__)
    channels = [channels[k] for k in order]
    arrays: dict[str, Any] = {
        name: np.concatenate([block.arrays[name] for block in blocks], axis=1)[:, None, order]
        for name in (*_QUANTITIES, "lock_flags")
    }
    arrays["lock_flags"][epochs.flag[kept] == 1] |= LOST_LOCK
    for m, (satellite, signal) in enumerate(channels):
        if header.half_cycles & {(satellite, signal[0]), ("", signal[0])}:
            arrays["lock_flags"][np.isfinite(arrays["phase_cycles"][..., m]), m] |= HALF_CYCLE
    tag_s = (ticks + _time_shift(header, ticks) - to_ticks(start_gps_s)) / TICKS_PER_S
    return Observations(
        t_s=nominal_epochs(tag_s, start_gps_s),
        tag_s=tag_s[:, None],
        satellites=tuple(satellite for satellite, _ in channels),
        signals=tuple(signal for _, signal in channels),
        losses=(*losses, *(loss for block in blocks for loss in block.losses)),
        **arrays,
    )


def _body(header: Header, text: Bytes) -> tuple[Body, bool]:
    """Return the text behind the header without what ends a file, and whether its last line ends.

    Blank lines stay: they may be a satellite's.
    """
    size = len(text)
    while size > header.size and text[size - 1] in _ENDS:
        size -= 1
    rest = text[size:]
    line_ends = rest[rest == ord("\n")]
    blanks = np.full(PADDING, ord(" "), np.uint8)
    content = np.concatenate([text[header.size : size], line_ends, blanks])
    length = len(content) - PADDING
    ends = np.flatnonzero(content[:length] == ord("\n"))
    if length and content[length - 1] != ord("\n"):
        ends = np.append(ends, length)
    begins = np.append(0, ends + 1)[:-1]
    kernels.line_ends(content, begins, ends)
    types = len(next(iter(header.types.values()))) if header.version < 3 else 0
    return Body(content, begins, ends, types), bool(len(line_ends))


def _records(header: Header, body: Body, epochs: Epochs) -> tuple[list[_Records], dict[int, Fault]]:
    """Return satellites by constellation, and the first fault of each epoch by its row."""
    letter, number = epochs.letter, epochs.number
    names = (epochs.epoch * 256 + letter) * 100 + number
    is_known = np.isin(letter, [ord(one) for one in header.types]) & (number >= 1) & (number <= 99)
    is_known &= first_of_each(names)
    rules = np.where(epochs.is_named, np.where(is_known, 0, SATELLITE), COUNT)
    lines, columns = epochs.line.copy(), np.zeros(len(rules), np.int64)
    records = []
    for name, types in header.types.items():
        rows = np.flatnonzero((letter == ord(name)) & (rules == 0))
        a_line, skipped = (_FIELDS, 0) if body.types else (len(types), 3)  # the satellite's name
        of = epochs.line[rows, None] + np.arange(-(-len(types) // a_line))
        spans = np.stack([body.begins[of] + skipped, body.ends[of]], axis=2)
        units = np.array([1000.0 * header.scales.get((name, one), 1) for one in types])
        values, locks = np.zeros((len(rows), len(types))), np.zeros((len(rows), len(types)), int)
        broken = kernels.fields(body.text, spans, a_line, units, values, locks)
        rules[rows[broken[:, 1] > 0]] = VALUE
        lines[rows] += broken[:, 0]
        columns[rows] = broken[:, 1] + skipped
        records.append(_Records(name, rows, values, locks))
    faulty = np.flatnonzero(rules)
    faulty = faulty[first_of_each(epochs.epoch[faulty])]
    table = np.stack([rules, lines, columns], axis=1)[faulty].tolist()
    return records, {row: Fault(*fault) for row, fault in zip(faulty.tolist(), table, strict=True)}


def first_of_each(keys: IntArray) -> BoolArray:
    """Return which of equal keys are the first."""
    first = np.zeros(len(keys), np.bool_)
    first[np.unique(keys, return_index=True)[1]] = True
    return first


def _block(
    header: Header, of: _Records, epoch: IntArray, number: IntArray, n: int, wanted: Wanted
) -> _Block:
    """Spread a constellation's values over epochs and channels; channels have code or phase."""
    letter = of.letter
    epoch, number = epoch[of.rows], number[of.rows]
    is_used = (epoch >= 0) & (number <= KNOWN_SATELLITES.get(letter, 0))
    losses = losses_of_unused_satellites(letter, number[(epoch >= 0) & ~is_used])
    satellites, place = np.unique(number[is_used], return_inverse=True)
    epoch, values, locks = epoch[is_used], of.values[is_used], of.locks[is_used] & 3
    fields = fields_of(header, letter)
    names = sorted({s for one in fields for s in one.signals if is_kept(letter, s, wanted)})
    shape = n, len(satellites), len(names)
    dense: dict[str, Any] = {name: np.full(shape, np.nan) for name in _QUANTITIES[:3]}
    dense["cn0_dbhz"] = np.full(shape, np.nan, np.float32)
    dense["lock_flags"] = np.zeros(shape, np.uint8)
    unused = Counter[str]()

    def spread(name: str, column: IntArray | FloatArray, rows: BoolArray, signal: str) -> None:
        some = rows & (column != 0)
        dense[name][epoch[some], place[some], names.index(signal)] = column[some]

    for k, field in reversed(list(enumerate(fields))):  # the first field of a signal counts
        is_code = values[:, field.codes] != 0
        index = is_code.argmax(axis=1) if len(field.signals) > 1 else np.zeros(len(values), int)
        for j, signal in enumerate(field.signals):
            rows = index == j
            if field.quantity < 0 or signal not in names:
                value = f"{header.types[letter][k]} value"
                what = f"{signal} observation" if field.quantity >= 0 else value
                unused[what] = max(unused[what], int((values[rows, k] != 0).sum()))
                continue
            spread(_QUANTITIES[field.quantity], values[:, k], rows, signal)
            if field.quantity == 1:
                spread("lock_flags", locks[:, k], rows, signal)
    has = (np.isfinite(dense["code_m"]) | np.isfinite(dense["phase_cycles"])).any(axis=0)
    alone = sum(int(np.isfinite(dense[name][:, ~has]).sum()) for name in _QUANTITIES[2:])
    reason = "neither code nor phase of its carrier is in the file"
    losses.append(Loss(what="Doppler or density", reason=reason, count=alone))
    losses += [
        Loss(what=f"{letter} {what}", reason=_NOT_KEPT, count=count)
        for what, count in unused.items()
    ]
    channels = [(f"{letter}{satellites[i]:02d}", names[j]) for i, j in np.argwhere(has).tolist()]
    arrays = {name: array[:, has] for name, array in dense.items()}
    return _Block(channels, arrays, [loss for loss in losses if loss.count])


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


def _time_shift(header: Header, ticks: IntArray) -> IntArray:
    """Return what to add to the file's epochs for GPS time."""
    if header.time_system == "BDT":
        return np.full(len(ticks), BDT_BEHIND_GPS_S * TICKS_PER_S)
    if header.time_system != "GLO":
        return np.zeros(len(ticks), np.int64)
    utc_s = ticks // TICKS_PER_S + float(UNIX_OF_GPS_S)  # GLONASS's time is UTC in RINEX
    return (gps_of_utc(utc_s) + UNIX_OF_GPS_S - utc_s).astype(np.int64) * TICKS_PER_S
