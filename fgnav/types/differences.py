"""Double differences of an antenna array, with what is needed to weigh and to resolve them."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Unused, freeze, freeze_times

_BY_EPOCH = (
    *("t_s", "reference", "e_n", "elevation_rad", "code_m", "phase_m", "arc"),
    *("code_variance_m2", "phase_variance_m2"),
)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, weakref_slot=True)
class DoubleDifferences:
    """Double differences of every baseline from the reference antenna, epoch by epoch.

    A *link* is one antenna's tracking of one channel. Differences are taken against the reference
    antenna and against one reference channel per group (constellation and signal), after the
    modelled range to the reference antenna at each receiver's own transmission time has been
    removed, so that only the array is left::

        code_m  =  -(e_j - e_r) . (R_nb l_i)                            + noise
        phase_m =  -(e_j - e_r) . (R_nb l_i)  +  wavelength_m N_ij      + noise

    with ``l_i`` in ``baselines_b_m``, ``e_j`` in ``e_n`` and ``r`` the reference channel of j's
    group. The link of the reference channel itself is exactly 0 wherever the antenna tracks it;
    every other value is NaN where a link is missing. Noise of undifferenced links is independent,
    with variance per channel and epoch.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    baselines_b_m : ndarray, shape (b, 3)
        Antennas 2, 3, … minus antenna 1, body axes.
    satellites, signals : tuple of str, length m
    wavelength_m : ndarray, shape (m,)
    group : ndarray of int, shape (m,)
        Constellation and signal of each channel, numbered from 0.
    reference : ndarray of int, shape (n, g)
        Reference channel of each group; -1 where the group has none.
    e_n : ndarray, shape (n, m, 3)
        Unit vectors from the reference antenna to the satellites; 0 where a channel is not used.
    elevation_rad : ndarray, shape (n, m)
        NaN where a channel is not used.
    code_m, phase_m : ndarray, shape (n, b, m)
    code_variance_m2, phase_variance_m2 : ndarray, shape (n, m)
        Of one undifferenced link; 1 where a channel is not used.
    arc : ndarray of int, shape (n, b, m)
        Number of the link's arc, from slip to slip: within one arc the integer of an unchanged
        reference is constant. It counts slips of any of the four links involved. -1 without phase.
    unused : tuple of Unused
        Links and epochs that were measured and are not here.
    """

    t_s: FloatArray
    baselines_b_m: FloatArray
    satellites: tuple[str, ...]
    signals: tuple[str, ...]
    wavelength_m: FloatArray
    group: IntArray
    reference: IntArray
    e_n: FloatArray
    elevation_rad: FloatArray
    code_m: FloatArray
    phase_m: FloatArray
    code_variance_m2: FloatArray
    phase_variance_m2: FloatArray
    arc: IntArray
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        n = freeze_times("double differences", self)
        m, b = len(self.satellites), len(self.baselines_b_m)
        g = 1 + int(self.group.max()) if m else 0
        finite: dict[str, tuple[int, ...]] = {
            "baselines_b_m": (b, 3),
            "wavelength_m": (m,),
            "e_n": (n, m, 3),
            "code_variance_m2": (n, m),
            "phase_variance_m2": (n, m),
        }
        freeze("double differences", self, finite)
        measured = {"elevation_rad": (n, m), "code_m": (n, b, m), "phase_m": (n, b, m)}
        freeze("double differences", self, measured, gaps=True)
        numbers = {"group": (m,), "reference": (n, g), "arc": (n, b, m)}
        freeze("double differences", self, numbers, dtype=np.int64)

    def __getitem__(self, epochs: slice | IntArray | BoolArray) -> "DoubleDifferences":
        """Return the differences of selected epochs."""
        rows: dict[str, Any] = {name: getattr(self, name)[epochs] for name in _BY_EPOCH}
        return replace(self, **rows)

    def resampled(self, epochs: IntArray) -> "DoubleDifferences":
        """Return any of the epochs, repeated or not; times then count from 0 in steps of 1 s."""
        rows: dict[str, Any] = {name: getattr(self, name)[epochs] for name in _BY_EPOCH}
        return replace(self, **{**rows, "t_s": np.arange(float(len(epochs)))})

    def without_code(self, links: BoolArray) -> "DoubleDifferences":
        """Return a copy without the code of some links, (n, b, m), which nobody then resolves."""
        return replace(self, code_m=np.where(links, np.nan, self.code_m))

    @property
    def is_reference(self) -> BoolArray:
        """Mask of the channels that are the reference of their group, (n, m)."""
        return np.asarray(self.reference[:, self.group] == np.arange(len(self.satellites)))

    @property
    def resolvable(self) -> BoolArray:
        """Links that carry an unknown integer, (n, b, m): phase and code, not the reference."""
        both = np.isfinite(self.phase_m) & np.isfinite(self.code_m)
        return both & ~self.is_reference[:, None, :]

    def array_m(self, R_nb: FloatArray) -> FloatArray:
        """Return modelled double differences without integers, (n, b, m), of attitudes."""
        return self.ranges_m(np.einsum("nij,bj->nbi", R_nb, self.baselines_b_m))

    def ranges_m(self, baselines_n_m: FloatArray) -> FloatArray:
        """Return modelled double differences without integers, (n, b, m), of (n, b, 3)."""
        ranges_m = -np.einsum("nbi,nmi->nbm", baselines_n_m, self.e_n)
        of_reference = self.reference[:, self.group].clip(0)
        return np.asarray(ranges_m - np.take_along_axis(ranges_m, of_reference[:, None, :], axis=2))
