"""RTKLIB's observation records: compared with the scan of the file, then spread over channels."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, IntArray, Loss
from fgnav.io.antennas import nominal_epochs
from fgnav.io.decoder import Decoded
from fgnav.io.gps_time import BDT_BEHIND_GPS_S, TICKS_PER_S, UNIX_OF_GPS_S, to_ticks
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.scan import KNOWN_SATELLITES, Scan
from fgnav.io.signal_choice import SignalChoice
from fgnav.types.observations import LOST_LOCK, Observations

_ONE_SIGNAL = "RTKLIB keeps one signal each of L1/E1/B1I, L2/E5b/B2 and L5/E5a/B2a"


def to_observations(
    header: Header,
    scan: Scan,
    choice: SignalChoice,
    records: NDArray[Any],
    decoded: Decoded,
    start_gps_s: float,
) -> Observations:
    """Spread records over epochs and channels, after comparing them with the scan.

    Parameters
    ----------
    choice : SignalChoice
        The signal of each slot; empty for RINEX 2, where each record names its own.
    records : ndarray of RTKLIB's ``Record``, shape (k,)
    decoded : Decoded
        The names of RTKLIB's numbers.

    Returns
    -------
    Observations
        Of one antenna.

    Raises
    ------
    BadInputError
        If RTKLIB decoded something else than stands in the file.
    """
    from fgnav.io.rinex.records_kernel import count_records  # noqa: PLC0415  # lazy: numba

    letters, used = _satellite_tables(decoded.satellites)
    if not used[records["sat"]].all():
        records = records[used[records["sat"]]]
        records.flags.writeable = False  # as the map is: one compiled kernel serves both
    _compare_counts(header, scan, letters, records["sat"])
    epoch = np.repeat(np.arange(len(scan.ticks)), scan.kept)
    ticks = scan.ticks + _time_shift(header, scan, records, epoch)
    signals = _signals(choice, decoded.signals, letters)
    totals = np.zeros((len(letters), 3, 7), np.int64)
    present = np.zeros((len(letters), len(decoded.signals)), bool)
    count_records(records, signals, totals, present)
    losses = (*scan.losses, *_compare_values(header, scan, choice, letters, totals))
    present[:, 0] = False
    tag_s = (ticks - to_ticks(start_gps_s)) / TICKS_PER_S
    channels, arrays = _spread(records, signals, epoch, len(tag_s), present, decoded)
    arrays["lock_flags"][scan.power_failure] |= LOST_LOCK
    return Observations(
        t_s=nominal_epochs(tag_s, start_gps_s),
        tag_s=tag_s[:, None],
        satellites=tuple(satellite for satellite, _ in channels),
        signals=tuple(signal for _, signal in channels),
        losses=losses,
        earlier=None,
        **arrays,
    )


def _satellite_tables(names: NDArray[np.str_]) -> tuple[IntArray, NDArray[np.bool_]]:
    """Return, by RTKLIB's number, the letter of the constellation and whether it is in use."""
    satellites = {f"{c}{k:02d}" for c, last in KNOWN_SATELLITES.items() for k in range(1, last + 1)}
    letters = np.array([ord(name[0]) if name else 0 for name in names.tolist()])
    return letters, np.array([name in satellites for name in names.tolist()])


def _compare_counts(header: Header, scan: Scan, letters: IntArray, sat: IntArray) -> None:
    """Raise unless RTKLIB found as many observations of each constellation as the scan."""
    by_satellite = np.bincount(sat, minlength=len(letters))
    for name, last in KNOWN_SATELLITES.items():
        here = int(scan.satellites[ord(name), 1 : last + 1].sum())
        there = int(by_satellite[letters == ord(name)].sum())
        if here != there:
            raise BadInputError(
                f"{header.path}: RTKLIB decoded {there} {name} observations, the file holds "
                f"{here}; please report this file"
            )


def _time_shift(header: Header, scan: Scan, records: NDArray[Any], epoch: IntArray) -> int:
    """Return what to add to the file's epochs for GPS time; raise if RTKLIB read other epochs."""
    read = (records["time"]["time"] - UNIX_OF_GPS_S) * TICKS_PER_S
    read += np.round(records["time"]["sec"] * TICKS_PER_S).astype(np.int64)
    shift = read - scan.ticks[epoch]
    offset = int(shift[0]) if len(shift) else 0
    leap_seconds = header.time_system == "GLO" and offset % TICKS_PER_S == 0
    if (shift != offset).any() or not (offset == 0 or leap_seconds):
        raise BadInputError(
            f"{header.path}: RTKLIB decoded other epochs than the file holds; "
            "please report this file"
        )
    # RTKLIB takes BDT epochs for GPS time.
    return offset + BDT_BEHIND_GPS_S * TICKS_PER_S * (header.time_system == "BDT")


def _signals(choice: SignalChoice, names: NDArray[np.str_], letters: IntArray) -> IntArray:
    """Return the code of each satellite's slots, for ``count_records``."""
    if not choice.kept:
        return np.full((len(letters), 3), 255, np.uint8)
    number = {name: k for k, name in enumerate(names.tolist())}
    signals = np.zeros((len(letters), 3), np.uint8)
    for constellation, kept in choice.kept.items():
        signals[letters == ord(constellation)] = [number[signal or ""] for signal in kept]
    return signals


def _compare_values(
    header: Header, scan: Scan, choice: SignalChoice, letters: IntArray, totals: IntArray
) -> list[Loss]:
    """Raise unless each kept signal's values are those of the file; return what was not kept."""
    if header.version < 3:
        return _compare_values_2(header, scan, letters, totals)
    losses = []
    for name, kept in choice.kept.items():
        types = header.types.get(name, ())
        tally = dict(zip(types, scan.tally[ord(name)].tolist(), strict=False))
        decoded = totals[letters == ord(name)].sum(axis=0)
        for slot, signal in enumerate(kept):
            if signal is None:
                continue
            held = np.array([tally.get(f"{c}{signal}", (0, 0, 0)) for c in "CLDS"])
            expected = [*held[:, 0], held[0, 1], held[1, 1], held[1, 2]]
            if decoded[slot].tolist() != expected:
                raise BadInputError(
                    f"{header.path}: RTKLIB decoded other {name} {signal} values than the file "
                    "holds; please report this file"
                )
        losses += [
            Loss(what=f"{name} {t[1:]} observation", reason=_ONE_SIGNAL, count=row[0])
            for t, row in tally.items()
            if t[0] == "C" and t[1:] not in kept and row[0]
        ]
    return losses


def _compare_values_2(
    header: Header, scan: Scan, letters: IntArray, totals: IntArray
) -> list[Loss]:
    """Compare the GPS phases of a RINEX 2 file; count the values that share a carrier.

    Which of two pseudoranges (C1, P1) RTKLIB keeps is decided record by record, so the sums of
    codes cannot be told beforehand.
    """
    types = header.types["G"]
    decoded = totals[letters == ord("G")].sum(axis=0)
    for slot, name in enumerate(("L1", "L2", "L5")):
        count, total, _ = scan.tally[ord("G"), types.index(name)] if name in types else (0, 0, 0)
        if (decoded[slot, 1], decoded[slot, 5]) != (count, total):
            raise BadInputError(
                f"{header.path}: RTKLIB decoded other {name} values than the file holds; "
                "please report this file"
            )
    held = sum(int(scan.tally[ord(name), :, 0].sum()) for name in KNOWN_SATELLITES)
    lost = held - int(totals[:, :, :4].sum())
    return [Loss(what="second value of a carrier", reason=_ONE_SIGNAL, count=lost)] if lost else []


def _spread(
    records: NDArray[Any],
    signals: IntArray,
    epoch: IntArray,
    epochs: int,
    present: NDArray[np.bool_],
    decoded: Decoded,
) -> tuple[list[tuple[str, str]], dict[str, NDArray[Any]]]:
    """Return the channels, satellite and signal, and dense arrays by field of ``Observations``."""
    from fgnav.io.rinex.records_kernel import spread_records  # noqa: PLC0415  # lazy: numba

    pairs = {
        (str(decoded.satellites[sat]), str(decoded.signals[code])): (sat, code)
        for sat, code in np.argwhere(present)
    }
    channels = sorted(pairs)
    column = np.full(present.shape, -1)
    for k, channel in enumerate(channels):
        column[pairs[channel]] = k
    shape = (epochs, len(channels))
    values, flags = np.full((3, *shape), np.nan), np.zeros(shape, np.uint8)
    density = np.full(shape, np.nan, np.float32)
    spread_records(records, signals, epoch, column, values, flags, density)
    arrays = {
        name: value[:, None]
        for name, value in zip(("code_m", "phase_cycles", "doppler_hz"), values, strict=True)
    }
    return channels, arrays | {"cn0_dbhz": density[:, None], "lock_flags": flags[:, None]}
