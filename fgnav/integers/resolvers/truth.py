"""Answers of a perfect resolver, where truth is known: by its integers or its attitude."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.geometry import rotations
from fgnav.integers.acceptance import not_fixed, phase_links
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.flight import Truth as FlightTruth
from fgnav.types.integers import Integers

_SAME_S = (
    1e-3  # epochs this far outside the truth's span count as its ends: times are rounded in files
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """True integers: those kept with the flight, elsewhere those of the true attitude.

    The attitude is interpolated at the epochs.
    """

    name: ClassVar[str] = "truth"
    looks_ahead: ClassVar[bool] = False

    def __call__(self, differences: DoubleDifferences, flight: Flight) -> Integers:
        """Resolve every link that has phase, at the epochs that truth covers.

        ``Integers.resolver`` is ``truth`` where all integers are kept ones, else it says how many
        are of the attitude.

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
        cycles, kept = kept_integers(differences, flight)
        kept &= links
        half = kept & (cycles % 1 != 0)
        fixed = (kept & ~half) | (links & ~kept & covered[:, None, None])
        of_attitude = true_integers(differences, R_nb)
        return Integers(
            resolver=self.name + _source(kept, fixed & ~kept),
            cycles=np.where(fixed, np.where(kept, cycles, of_attitude), 0),
            fixed=fixed,
            ratio=np.full(fixed.shape[:2], np.nan),
            unused=not_fixed(
                {
                    "slipped by half a cycle": half,
                    "truth does not cover the epoch": links & ~half & ~fixed,
                }
            ),
        )


def _source(kept: BoolArray, of_attitude: BoolArray) -> str:
    """Return in words what is not of kept integers."""
    if not kept.any():
        return " of the attitude"
    if not of_attitude.any():
        return ""
    return f", {of_attitude.sum()} of {(kept | of_attitude).sum()} of the attitude"


def kept_integers(differences: DoubleDifferences, flight: Flight) -> tuple[FloatArray, BoolArray]:
    """Return double differences of the integers kept with a flight's truth, and where they are.

    Parameters
    ----------
    differences : DoubleDifferences
        Of the flight.

    Returns
    -------
    cycles : ndarray, shape (n, b, m)
        Whole, or halves where a link has slipped by half a cycle.
    known : ndarray of bool, shape (n, b, m)
        Where all four links have one.
    """
    shape = (len(differences.t_s), len(flight.antennas), len(differences.satellites))
    cycles, valid = np.zeros(shape), np.zeros(shape, dtype=bool)
    rows: dict[tuple[str, str, str], list[int]] = {}
    kept = flight.truth.integers if flight.truth is not None else None
    for k, link in enumerate(kept.links if kept is not None else ()):
        rows.setdefault(link, []).append(k)
    channels = list(zip(differences.satellites, differences.signals, strict=True))
    for i, j in np.ndindex(shape[1:]):
        of_link = rows.get((flight.antennas[i].name, *channels[j]))
        if of_link is None or kept is None:
            continue
        at = np.searchsorted(kept.from_s[of_link], differences.t_s + _SAME_S, side="right") - 1
        valid[:, i, j] = at >= 0
        cycles[:, i, j] = kept.cycles[of_link][at.clip(0)]
    single, both = cycles[:, 1:] - cycles[:, :1], valid[:, 1:] & valid[:, :1]
    reference = differences.reference[:, differences.group]
    of_reference = reference.clip(0)[:, None]
    double = single - np.take_along_axis(single, of_reference, axis=2)
    all_four = both & np.take_along_axis(both, of_reference, axis=2) & (reference >= 0)[:, None]
    return double, all_four


def true_integers(differences: DoubleDifferences, R_nb: FloatArray) -> IntArray:
    """Return the integers that an attitude makes of the phase.

    Parameters
    ----------
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
    fraction = np.clip((t_s - truth.t_s[before]) / span_s, 0.0, 1.0)
    R_before = truth.R_nb[before]
    turn_rad = rotations.log(rotations.transpose(R_before) @ truth.R_nb[after])
    covered = (t_s >= truth.t_s[0] - _SAME_S) & (t_s <= truth.t_s[last] + _SAME_S)
    return R_before @ rotations.exp(fraction[:, None] * turn_rad), covered
