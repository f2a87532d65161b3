"""What an estimate leaves of GNSS observations, satellite by satellite."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.scores import finite_mean
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.undifferenced import Undifferenced
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Estimate

_SWEEPS = 30  # of clocks and ambiguities in turn; the rest of a flight of half-hour arcs is 1e-4


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Residuals:
    """Residuals of one kind of observation, (n, m): epochs by channels, NaN where there is none."""

    t_s: FloatArray
    channels: tuple[str, ...]
    value_m: FloatArray


def array_phase_residuals(differences: DoubleDifferences, estimate: Estimate) -> Residuals:
    """Return what an attitude leaves of the array's phase, RMS over its baselines.

    Double differences less the array as the attitude turns it, less the nearest whole cycles: they
    need no integers of the method's, and a wrong attitude cannot hide behind wrong ones. The mean
    of a group's channels, the reference among them, is taken off each baseline, so that noise of
    the reference satellite does not stand in all others.
    """
    rows, own = common_epochs(differences.t_s, estimate.t_s)
    R_nb = np.zeros((len(differences.t_s), 3, 3))
    R_nb[rows] = estimate.R_nb[own]
    left_m = (differences.phase_m - differences.array_m(R_nb))[rows]
    left_m -= differences.wavelength_m * np.round(left_m / differences.wavelength_m)
    for group in range(differences.reference.shape[1]):
        members = differences.group == group
        left_m[:, :, members] -= finite_mean(left_m[:, :, members], 2)[:, :, None]
    squared = finite_mean(left_m**2, 1)
    return Residuals(
        t_s=differences.t_s[rows],
        channels=tuple(
            map(" ".join, zip(differences.satellites, differences.signals, strict=True))
        ),
        value_m=np.where(differences.elevation_rad[rows] > 0, np.sqrt(squared), np.nan),
    )


def antenna_residuals(
    observed: Undifferenced, estimate: Estimate, arm_b_m: FloatArray, *, of_phase: bool
) -> Residuals | None:
    """Return what a position leaves of the first antenna's code, or of its phase.

    Clocks of each epoch are taken off, of phase also a constant for each arc. What drifts within
    an arc is in it: errors of messages, of the atmosphere's models, of the position.

    Parameters
    ----------
    arm_b_m : ndarray, shape (3,)
        The antenna in body axes.

    Returns
    -------
    Residuals or None
        None without positions.
    """
    if estimate.p_n_m is None:
        return None
    rows, answers = common_epochs(observed.t_s, estimate.t_s)
    antenna_n_m = estimate.p_n_m[answers] + estimate.R_nb[answers] @ arm_b_m
    # How much longer the way is than from the place that the observations were modelled for.
    way_m = np.einsum("kmi,ki->km", observed.e_n[rows], antenna_n_m - observed.place_n_m[rows])
    value_m = (observed.phase_m if of_phase else observed.code_m)[rows] + way_m
    groups = [observed.group == k for k in np.unique(observed.group)]
    for sweep in range(1 + _SWEEPS * of_phase):
        if sweep:
            _take_off_arcs(value_m, observed.arc[rows])
        for members in groups:
            value_m[:, members] -= finite_mean(value_m[:, members], 1)[:, None]
    return Residuals(t_s=observed.t_s[rows], channels=_carriers(observed), value_m=value_m)


def _take_off_arcs(value_m: FloatArray, arc: IntArray) -> None:
    """Take the mean of each arc off."""
    is_valid = np.isfinite(value_m) & (arc >= 0)
    label = (arc + (1 + arc.max(initial=0)) * np.arange(arc.shape[1]))[is_valid]
    _, label = np.unique(label, return_inverse=True)
    if len(label):
        mean = np.bincount(label, value_m[is_valid]) / np.bincount(label)
        value_m[is_valid] -= mean[label]


def _carriers(observed: Undifferenced) -> tuple[str, ...]:
    """Return what channels of one antenna are called: satellite, and carrier in MHz."""
    carrier_mhz = C_MPS / observed.wavelength_m / 1e6
    return tuple(
        f"{name} {mhz:.0f}"
        for name, mhz in zip(observed.satellites, carrier_mhz.tolist(), strict=True)
    )
