"""Observations of the antennas: code, phase, Doppler, by epoch, antenna and channel."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.checks import (
    BadInputError,
    BoolArray,
    FloatArray,
    IntArray,
    Unused,
    freeze,
    freeze_times,
)

LOST_LOCK = 1  # RINEX loss-of-lock indicator, bit 0: a slip is possible
HALF_CYCLE = 2  # bit 1: half-cycle ambiguity not resolved
BY_EPOCH = ("t_s", "tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class EarlierEpochs:
    """Decisions of epochs that are no longer kept, for those to come.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    bands : dict
        RINEX band of the code of each constellation, by its letter.
    signals : dict
        That antennas use, by constellation's letter and band; None of those that have none yet.
    """

    t_s: FloatArray
    bands: dict[str, str]
    signals: dict[tuple[str, str], tuple[str | None, ...]]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Observations:
    """GNSS observations of one or more antennas on a common set of epochs and channels.

    A channel is one signal of one satellite. Every array is dense, NaN where nothing was measured.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Nominal epochs, GPS time since the flight's start, strictly increasing.
    tag_s : ndarray, shape (n, a)
        Reception time as each antenna's receiver wrote it (its clock error included); equal to
        ``t_s`` for receivers that steer their clock. Never NaN.
    satellites : tuple of str, length m
        RINEX satellite of each channel: ``"G05"``.
    signals : tuple of str, length m
        RINEX 3 signal of each channel, band and attribute: ``"1C"``.
    code_m, phase_cycles, doppler_hz : ndarray, shape (n, a, m)
        Pseudorange, carrier phase (RINEX sign: grows with range), Doppler (RINEX sign: positive
        when approaching).
    cn0_dbhz : ndarray, shape (n, a, m)
        Carrier-to-noise density.
    lock_flags : ndarray of uint8, shape (n, a, m)
        Bits ``LOST_LOCK`` and ``HALF_CYCLE``.
    unused : tuple of Unused
        What the reader saw and did not keep.
    earlier : EarlierEpochs or None
        Of a record that has gone on for long.
    """

    t_s: FloatArray
    tag_s: FloatArray
    satellites: tuple[str, ...]
    signals: tuple[str, ...]
    code_m: FloatArray
    phase_cycles: FloatArray
    doppler_hz: FloatArray
    cn0_dbhz: FloatArray
    lock_flags: IntArray
    unused: tuple[Unused, ...] = ()
    earlier: EarlierEpochs | None = None

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        n, m = freeze_times("observations", self), len(self.satellites)
        if m != len(self.signals):
            raise BadInputError(f"observations: {m} satellites but {len(self.signals)} signals")
        freeze("observations", self, {"tag_s": (n, None)})
        shape = (n, self.tag_s.shape[1], m)
        values = {"code_m": shape, "phase_cycles": shape, "doppler_hz": shape}
        freeze("observations", self, values, gaps=True)
        freeze("observations", self, {"cn0_dbhz": shape}, dtype=np.float32, gaps=True)
        freeze("observations", self, {"lock_flags": shape}, dtype=np.uint8)

    def __getitem__(self, epochs: slice | IntArray | BoolArray) -> "Observations":
        """Return the observations of selected epochs."""
        rows: dict[str, Any] = {name: getattr(self, name)[epochs] for name in BY_EPOCH}
        return replace(self, **rows)

    def of_antennas(self, antennas: slice | IntArray) -> "Observations":
        """Return the observations of selected antennas, in that order."""
        columns: dict[str, Any] = {name: getattr(self, name)[:, antennas] for name in BY_EPOCH[1:]}
        return replace(self, **columns)

    @property
    def tracked(self) -> BoolArray:
        """Mask of links with both code and phase, (n, a, m)."""
        return np.isfinite(self.code_m) & np.isfinite(self.phase_cycles)
