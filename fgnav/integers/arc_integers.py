"""Integers of whole arcs against a base: all of a flight's arcs searched at once."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.gnss.arc_solution import ArcAdjustment
from fgnav.integers.partial import partial_integer_least_squares

_FALSE_ALARM = 1e-4  # of the test of integers against the float solution


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArcIntegers:
    """An adjustment with the integers that can be trusted.

    Attributes
    ----------
    adjustment : ArcAdjustment
        Given these integers.
    fixed : ndarray of bool, shape (a,)
        Arcs whose integer against the reference arc of their carrier is known, references included.
    wrong_probability : float
        That the integers are not all right; 0 where there are none.
    reason : str
        Why some are not known; empty where all are.
    """

    adjustment: ArcAdjustment
    fixed: BoolArray
    wrong_probability: float
    reason: str


def resolve_arcs(adjustment: ArcAdjustment, wrong_max: float) -> ArcIntegers:
    """Fix as many integers of arcs as are right, all together, but for ``wrong_max``.

    Differences of the constants of two arcs of one carrier are integers, in cycles. They are
    searched in the metric of all code and phase of the flight, those that reach the success rate
    are fixed, and refused if they lie further from the float solution than noise can be.
    """
    own, a = adjustment.epochs, len(adjustment.epochs.channel)
    D, wavelength_m = _differences(adjustment)
    none = np.zeros(a, dtype=np.bool_)
    if not len(D):
        return _without(adjustment, "too few arcs of phase")
    offset = D @ own.offset_m / wavelength_m
    whole = np.rint(offset)
    floats = D @ adjustment.constant_m[:-1] / wavelength_m + (offset - whole)
    scaled = D / wavelength_m[:, None]
    covariance = scaled @ adjustment.covariance_m2[:-1, :-1] @ scaled.T
    found = partial_integer_least_squares(floats, (covariance + covariance.T) / 2, 1 - wrong_max)
    if not len(found.integers):
        return _without(adjustment, f"chance of wrong integers above {wrong_max:g}")
    Z = found.combinations
    apart = Z @ floats - found.integers
    squares = float(apart @ np.linalg.solve(Z @ covariance @ Z.T, apart))
    if squares > _largest(len(Z)):
        return _without(adjustment, "the integers do not fit code and phase")
    # combinations of cycles as combinations of constants in metres
    value = found.integers - Z @ (offset - whole)
    fixed = none | (D[found.fixed] != 0).any(axis=0)
    return ArcIntegers(
        adjustment=adjustment.given(Z @ scaled, value),
        fixed=fixed,
        wrong_probability=1 - found.success,
        reason="" if found.fixed.all() else f"chance of wrong integers above {wrong_max:g}",
    )


def _without(adjustment: ArcAdjustment, reason: str) -> ArcIntegers:
    none = np.zeros(len(adjustment.epochs.channel), dtype=np.bool_)
    return ArcIntegers(adjustment=adjustment, fixed=none, wrong_probability=0.0, reason=reason)


def _largest(freedom: int) -> float:
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: keeps the command line quick

    return float(chdtri(freedom, _FALSE_ALARM))


def _differences(adjustment: ArcAdjustment) -> tuple[FloatArray, FloatArray]:
    """Return arcs against the longest one of their carrier and stretch, (d, a); wavelengths."""
    own, single = adjustment.epochs, adjustment.equations.single
    used = own.weight[:, own.phases] > 0
    arcs, epoch = own.arc[:, own.phases][used], np.nonzero(used)[0]
    a = len(own.channel)
    length = np.bincount(arcs, minlength=a)
    piece = np.zeros(a, dtype=np.int64)
    piece[arcs] = adjustment.piece[epoch]
    family = piece * (1 + single.group.max(initial=0)) + single.group[own.channel]
    rows, wavelength_m = [], []
    for one in np.unique(family[length > 0]):
        members = np.flatnonzero((family == one) & (length > 0))
        longest = members[length[members].argmax()]
        for other in members[members != longest]:
            row = np.zeros(a)
            row[other], row[longest] = 1.0, -1.0
            rows.append(row)
            wavelength_m.append(single.wavelength_m[own.channel[other]])
    return np.array(rows).reshape(-1, a), np.array(wavelength_m)
