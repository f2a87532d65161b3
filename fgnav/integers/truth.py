"""Integers from the true attitude: what a perfect resolver would say, where truth is known."""

from dataclasses import dataclass

import numpy as np

from fgnav import rotations
from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.flight import Flight
from fgnav.flight import Truth as FlightTruth
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.resolver import Integers
from fgnav.integers.validation import not_fixed, phase_links

_SAME_S = (
    1e-3  # epochs this far outside the truth's span count as its ends: times are rounded in files
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """Integers of the flight's true attitude, interpolated at the epochs."""

    @property
    def name(self) -> str:
        """Return the name the command line knows."""
        return "truth"

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every link that has phase, at the epochs that truth covers.

        Raises
        ------
        BadInputError
            If the flight has no truth.
        """
        if flight.truth is None:
            raise BadInputError(
                f"flight {flight.name}: integers 'truth' need truth, which it has not"
            )
        R_nb, covered = attitude_at(flight.truth, differences.t_s)
        links = phase_links(differences)
        fixed = links & covered[:, None, None]
        return Integers(
            resolver=self.name,
            cycles=np.where(fixed, true_integers(differences, R_nb), 0),
            fixed=fixed,
            ratio=np.full(fixed.shape[:2], np.nan),
            losses=not_fixed({"truth does not cover the epoch": links & ~fixed}),
        )


def true_integers(differences: DoubleDifferences, R_nb: FloatArray) -> IntArray:
    """Return the integers that an attitude makes of the phase.

    Parameters
    ----------
    differences : DoubleDifferences
    R_nb : ndarray, shape (n, 3, 3)
        Attitude at its epochs.

    Returns
    -------
    ndarray of int64, shape (n, b, m)
        Phase minus the modelled array, rounded to cycles; 0 without phase and at references.
    """
    residual_m = differences.phase_m - differences.array_m(R_nb)
    cycles = np.where(phase_links(differences), residual_m / differences.wavelength_m, 0.0)
    return np.rint(cycles).astype(np.int64)


def attitude_at(truth: FlightTruth, t_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return R_nb, (n, 3, 3), at times (n,), turning evenly between samples, and where it is known.

    Outside the truth's span the nearest sample is repeated.
    """
    last = len(truth.t_s) - 1
    before = np.clip(np.searchsorted(truth.t_s, t_s, side="right") - 1, 0, max(last - 1, 0))
    after = np.minimum(before + 1, last)
    span_s = np.maximum(truth.t_s[after] - truth.t_s[before], np.finfo(np.float64).tiny)
    part = np.clip((t_s - truth.t_s[before]) / span_s, 0.0, 1.0)
    R_before = truth.R_nb[before]
    turn_rad = rotations.log(rotations.transpose(R_before) @ truth.R_nb[after])
    covered = (t_s >= truth.t_s[0] - _SAME_S) & (t_s <= truth.t_s[last] + _SAME_S)
    return R_before @ rotations.exp(part[:, None] * turn_rad), covered
