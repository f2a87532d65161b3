"""Signals by their RINEX 3 names: carrier frequencies, and which signal of a band is used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Unused
from fgnav.geometry.earth import C_MPS
from fgnav.types.observations import Observations

CONSTELLATIONS = {"G": "GPS", "E": "Galileo", "C": "BeiDou", "J": "QZSS"}

# Hz by constellation letter and RINEX band: RINEX 3.05, tables 4, 6, 7 and 9.
_FREQUENCY_HZ = {
    "G": {"1": 1575.42e6, "2": 1227.60e6, "5": 1176.45e6},
    "E": {"1": 1575.42e6, "5": 1176.45e6, "7": 1207.14e6, "8": 1191.795e6, "6": 1278.75e6},
    "C": {
        "2": 1561.098e6,  # B1I
        "1": 1575.42e6,  # B1C
        "5": 1176.45e6,  # B2a
        "7": 1207.14e6,  # B2I, B2b
        "8": 1191.795e6,  # B2a + B2b
        "6": 1268.52e6,  # B3I
    },
    "J": {"1": 1575.42e6, "2": 1227.60e6, "5": 1176.45e6, "6": 1278.75e6},
}
# Of GLONASS each satellite has a carrier of its own, these plus 0.56 and 0.44 MHz a channel, -7 to
# 6 (ICD L1, L2, edition 5.1): near enough for delays of codes in the ionosphere, not for phases.
_CODE_ALONE_HZ = {"R": {"1": 1602.0e6, "2": 1246.0e6, "3": 1202.025e6}}
_OLD_B1I = ("1I", "1Q")  # what RINEX 3.02 called B1I, now 2I


def constellation(satellite: str) -> str:
    """Return the constellation of a RINEX satellite: ``"G05"`` gives ``"GPS"``.

    Raises
    ------
    BadInputError
        If it is not one of GPS, Galileo, BeiDou and QZSS.
    """
    name = CONSTELLATIONS.get(satellite[:1])
    if name is None:
        raise BadInputError(f"satellite {satellite!r}: only GPS, Galileo, BeiDou, QZSS are known")
    return name


def band(satellite: str, signal: str) -> str:
    """Return the band of a signal: the RINEX 3 digit of its carrier."""
    return "2" if satellite[:1] == "C" and signal in _OLD_B1I else signal[:1]


def known(satellite: str, signal: str) -> bool:
    """Return True if the signal's carrier frequency is known."""
    return band(satellite, signal) in _FREQUENCY_HZ.get(satellite[:1], {})


def frequency_hz(satellite: str, signal: str) -> float:
    """Return the carrier frequency of a satellite's signal.

    Raises
    ------
    BadInputError
        If constellation or band is not known.
    """
    by_band = _CODE_ALONE_HZ.get(satellite[:1], {})
    if signal[:1] in by_band:
        return by_band[signal[:1]]
    constellation(satellite)
    if not known(satellite, signal):
        raise BadInputError(f"signal {signal!r} of {satellite}: its carrier is not known")
    return _FREQUENCY_HZ[satellite[0]][band(satellite, signal)]


def wavelengths_m(satellites: tuple[str, ...], signals: tuple[str, ...]) -> FloatArray:
    """Return the carrier wavelength of each channel, (m,)."""
    pairs = zip(satellites, signals, strict=True)
    return np.array([C_MPS / frequency_hz(*pair) for pair in pairs], dtype=np.float64)


def carriers(satellites: Sequence[str], signals: Sequence[str]) -> IntArray:
    """Return a number of each channel's constellation and carrier, (m,), from 0 as they come."""
    pairs = zip(satellites, signals, strict=True)
    names = [(satellite[0], band(satellite, signal)) for satellite, signal in pairs]
    distinct = list(dict.fromkeys(names))
    return np.array([distinct.index(name) for name in names], dtype=np.int64)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Selection:
    """One channel per satellite and band, and where each antenna's observations of it stand.

    Two receivers may track one carrier through different components: Galileo E1 as 1C (pilot) by
    one, as 1X (both) by the other. RINEX 3 aligns the phases of one carrier: they form integers.
    """

    # The signal is that of the first antenna that has the channel.
    satellites: tuple[str, ...]
    signals: tuple[str, ...]
    # Column of the observations that holds it; -1 where an antenna never tracks the band.
    channel: IntArray  # (a, m)
    unused: tuple[Unused, ...]  # observations of signals that are not used
    # Signal that each antenna uses, or None, by constellation's letter and band.
    chosen: dict[tuple[str, str], tuple[str | None, ...]]


def select(
    observations: Observations,
    *,
    causal: bool = False,
    code_alone: bool = False,
    preferred: Mapping[tuple[str, str], str] | None = None,
) -> Selection:
    """Choose for every constellation and band the signal each antenna uses.

    The signal that the most antennas track goes first, then the one with the most codes and phases:
    two signals on one carrier come from the same tracking loops and are not two measurements.

    Parameters
    ----------
    code_alone : bool
        Whether signals are wanted, too, of which nothing but the code is used: GLONASS.
    causal : bool
        Each antenna by the epochs up to the first at which it has code of that band: what it
        chooses there it keeps.
    preferred : mapping or None
        Signals by constellation's letter and band that go before all others: those of a receiver
        that is compared with this one.
    """
    coded, phased = np.isfinite(observations.code_m), np.isfinite(observations.phase_cycles)
    counts = np.stack([coded.sum(axis=0), phased.sum(axis=0)])  # (2, a, c)
    columns: dict[tuple[str, str], dict[str, dict[str, int]]] = {}
    for column, (satellite, signal) in enumerate(
        zip(observations.satellites, observations.signals, strict=True)
    ):
        if known(satellite, signal) or (
            code_alone and signal[:1] in _CODE_ALONE_HZ.get(satellite[:1], {})
        ):
            key = (satellite[0], band(satellite, signal))
            columns.setdefault(key, {}).setdefault(signal, {})[satellite] = column
    rows, signals = [], {}
    decided = {} if observations.earlier is None else observations.earlier.signals
    for key, by_signal in columns.items():
        first = (preferred or {}).get(key)
        chosen = decided.get(key) or (
            _chosen_first(coded, phased, by_signal, first)
            if causal
            else _chosen(counts, by_signal, first)
        )
        signals[key] = tuple(chosen)
        for satellite in sorted({satellite for of in by_signal.values() for satellite in of}):
            row = [by_signal[s].get(satellite, -1) if s else -1 for s in chosen]
            names = [s for s, column in zip(chosen, row, strict=True) if s and column >= 0]
            if names:
                rows.append((satellite, names[0], row))
    channel = (
        np.array([columns for _, _, columns in rows], dtype=np.int64).reshape(-1, coded.shape[1]).T
    )
    return Selection(
        satellites=tuple(satellite for satellite, _, _ in rows),
        signals=tuple(signal for _, signal, _ in rows),
        channel=channel,
        chosen=signals,
        unused=_unused(observations, counts[0], channel),
    )


def _chosen(
    counts: IntArray, by_signal: dict[str, dict[str, int]], preferred: str | None
) -> Sequence[str | None]:
    """Return the signal of one band that each antenna takes, by its codes and phases, (2, a, c)."""
    of_signal = {s: counts[:, :, list(of.values())].sum(axis=2) for s, of in by_signal.items()}

    def rank(signal: str) -> tuple[bool, int, int]:
        of = of_signal[signal]
        return signal == preferred, int((of[0] > 0).sum()), int(of.sum())

    order = sorted(of_signal, key=rank, reverse=True)
    antennas = range(counts.shape[1])
    return [next((s for s in order if of_signal[s][0, i] > 0), None) for i in antennas]


def _chosen_first(
    coded: BoolArray, phased: BoolArray, by_signal: dict[str, dict[str, int]], preferred: str | None
) -> Sequence[str | None]:
    """Return the choice by the signals that each antenna, (n, a, c), has first."""
    by_name = {signal: by_signal[signal] for signal in sorted(by_signal)}
    columns = [column for of in by_name.values() for column in of.values()]
    tracks = coded[:, :, columns].any(axis=2)
    first = np.where(tracks.any(axis=0), tracks.argmax(axis=0), -1)
    chosen: list[str | None] = []
    for i, k in enumerate(first.tolist()):
        counts = np.stack([x[: k + 1].sum(axis=0) for x in (coded, phased)])
        chosen.append(_chosen(counts, by_name, preferred)[i] if k >= 0 else None)
    return chosen


def _unused(observations: Observations, counts: IntArray, channel: IntArray) -> tuple[Unused, ...]:
    """Count, by signal, the code observations that no channel takes."""
    taken = np.zeros(counts.shape, dtype=bool)
    antenna, at = np.nonzero(channel >= 0)
    taken[antenna, channel[antenna, at]] = True
    unused = np.where(taken, 0, counts).sum(axis=0)
    lost: dict[tuple[str, str], int] = {}
    for column in np.nonzero(unused)[0]:
        satellite, signal = observations.satellites[column], observations.signals[column]
        reason = (
            "another signal of the same carrier is used"
            if known(satellite, signal)
            else "the carrier differs from satellite to satellite: code alone serves, for positions"
            if satellite[:1] in _CODE_ALONE_HZ
            else "constellation or carrier is not supported"
        )
        key = (f"{satellite[0]} {signal} observation", reason)
        lost[key] = lost.get(key, 0) + int(unused[column])
    return tuple(Unused(what=what, reason=why, count=count) for (what, why), count in lost.items())
