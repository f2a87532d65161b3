"""RINEX observations of one antenna: whole epochs; what is not used is counted.

Epochs that are cut, have more or fewer satellites than they announce, or break another rule are
left out and counted with the first line that does so.
"""

from collections import Counter
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, unused_of
from fgnav.io.antennas import nominal_epochs
from fgnav.io.gps_time import TICKS_PER_S, gps_of, to_ticks
from fgnav.io.rinex.constellations import CONSTELLATIONS
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.scan import A_LINE, FLAG, TICKS, Body, Found, line_ends, scan
from fgnav.io.rinex.signals import Wanted, fields_of, is_kept
from fgnav.io.rinex.text import Bytes
from fgnav.io.rinex.unused import Counts, count_end, count_events, count_faults, count_satellites
from fgnav.io.tables import increasing
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK, Observations

_ENDS = b" \r\n\x1a\0"  # blank lines, the end of a text of DOS, a block that was not filled
_NOT_KEPT = "its carrier is not in use; gnss.signals names others"
_QUANTITIES = ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz")
_LETTERS = 128  # a letter of a constellation is less


class _Block(NamedTuple):
    """The channels of one constellation."""

    channels: list[tuple[str, str]]  # satellite, signal
    arrays: dict[str, Any]  # (n, m), by the names of ``Observations``


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
    """
    body, is_ended = _body(header, text)
    found = _scanned(body)
    ticks = found.epochs[:, TICKS]
    kept = increasing(ticks)
    counts = Counts()
    count_faults(header, body, found.faults, counts)
    counts[f"{header.path.name} epoch", "its time does not increase"] += int((~kept).sum())
    if not kept.any():
        reason = next((why for (_, why), n in counts.items() if n), "has none after its header")
        raise BadInputError(f"{header.path}: must hold an epoch, {reason}")
    if not (is_ended or counts.total()):
        counts[f"{header.path.name} line end", "the last line has no line end: it may be cut"] = 1
    ticks = ticks[kept]
    count_events(header, body, found.events, counts)
    count_end(header, ticks, counts)
    epoch = np.where(kept, np.cumsum(kept) - 1, -1)
    blocks = [_block(header, one, found, epoch, len(ticks), wanted, counts) for one in header.types]
    channels = [channel for block in blocks for channel in block.channels]
    order = sorted(range(len(channels)), key=channels.__getitem__)
    channels = [channels[k] for k in order]
    arrays: dict[str, Any] = {
        name: np.concatenate([block.arrays[name] for block in blocks], axis=1)[:, None, order]
        for name in (*_QUANTITIES, "lock_flags")
    }
    arrays["lock_flags"][found.epochs[kept, FLAG] == 1] |= LOST_LOCK
    for m, (satellite, signal) in enumerate(channels):
        if header.half_cycles & {(satellite, signal[0]), ("", signal[0])}:
            arrays["lock_flags"][np.isfinite(arrays["phase_cycles"][..., m]), m] |= HALF_CYCLE
    whole_s = (ticks // TICKS_PER_S).astype(np.float64)
    shift = (gps_of(whole_s, header.time_system) - whole_s).astype(np.int64) * TICKS_PER_S
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
        units[ord(letter), : len(names)] *= [header.scales.get((letter, one), 1) for one in names]
    rows = -(-int(types.max()) // A_LINE) if header.version < 3 else 0
    return Body(content, begins, ends, rows, types, units), bool(len(last))


def _scanned(body: Body) -> Found:
    """Return the observations of a scan."""
    n, types = len(body.begins), body.units.shape[1]
    epochs, records, faults, events = (np.empty((n, width), np.int64) for width in (4, 3, 3, 4))
    values, locks = np.empty((n, types)), np.empty((n, types), np.int64)
    found = Found(epochs, records, faults, events, values, locks)
    counts = scan(body, found)
    of = counts[[0, 1, 2, 3, 1, 1]].tolist()  # values and locks are those of records
    return Found._make(table[:count] for table, count in zip(found, of, strict=True))


def _block(
    header: Header,
    letter: str,
    found: Found,
    epoch: IntArray,
    n: int,
    wanted: Wanted,
    counts: Counts,
) -> _Block:
    """Spread a constellation's values over epochs and channels; channels have code or phase."""
    types = header.types[letter]
    rows = found.records[:, 1] == ord(letter)
    epoch, number = epoch[found.records[rows, 0]], found.records[rows, 2]
    is_used = (epoch >= 0) & (number <= CONSTELLATIONS[letter].satellites)
    count_satellites(letter, number[(epoch >= 0) & ~is_used], counts)
    satellites, place = np.unique(number[is_used], return_inverse=True)
    epoch = epoch[is_used]
    values = found.values[rows, : len(types)][is_used]
    locks = found.locks[rows, : len(types)][is_used] & 3
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
                what = f"{signal} observation" if field.quantity >= 0 else f"{types[k]} value"
                unused[what] = max(unused[what], int((values[rows, k] != 0).sum()))
                continue
            spread(_QUANTITIES[field.quantity], values[:, k], rows, signal)
            if field.quantity == 1:
                spread("lock_flags", locks[:, k], rows, signal)
    has = (np.isfinite(dense["code_m"]) | np.isfinite(dense["phase_cycles"])).any(axis=0)
    alone = sum(int(np.isfinite(dense[name][:, ~has]).sum()) for name in _QUANTITIES[2:])
    counts["Doppler or density", "neither code nor phase of its carrier is in the file"] += alone
    for what, count in unused.items():
        counts[f"{letter} {what}", _NOT_KEPT] += count
    channels = [(f"{letter}{satellites[i]:02d}", names[j]) for i, j in np.argwhere(has).tolist()]
    return _Block(channels, {name: array[:, has] for name, array in dense.items()})
