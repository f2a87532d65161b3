"""Attitudes of the array and the track of its reference antenna, each epoch by the past alone.

What a filter is given. The truncation test is the definition: of a flight cut at any time
(``fgnav.frontend.causal.truncation``), everything here that is due before the cut stays the same.
"""

from dataclasses import dataclass, fields

import numpy as np

from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.robust import robust_attitudes
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.single_point.solution import CodeSolution, code_solution
from fgnav.integers.epochs import epochs_at
from fgnav.integers.resolvers.resolve import resolve
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, Resolver, fixed_ranges_m

_LINK_SIGMAS = 4.5  # beyond, a link contradicts its array
_EXCLUDED_AT_MOST = 0.25  # of an epoch's links; an epoch with more to say against is refused
_ROUNDS = 3  # of excluding links


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CausalArray:
    """Phases of the array, their integers, and attitudes of single epochs.

    Attributes
    ----------
    differences : DoubleDifferences
    integers : Integers
        Of the resolver's causal form.
    ranges_m : ndarray, shape (n, b, m)
        Double differences without integers that the form is of; NaN where excluded.
    excluded : ndarray of bool, shape (n, b + 1, m)
        Links, the reference antenna's first, that contradict the others of their epoch.
    form : RotationQuadratic
        Of the remaining links, the noise raised to what residuals so far ask for.
    attitude : AttitudeSolution
        Of the form.
    variance_factor : ndarray, shape (n,)
        By which the noise is raised.
    refused : ndarray of bool, shape (n,)
        Epochs whose links contradict each other whatever is excluded.
    """

    differences: DoubleDifferences
    integers: Integers
    ranges_m: FloatArray
    excluded: BoolArray
    form: RotationQuadratic
    attitude: AttitudeSolution
    variance_factor: FloatArray
    refused: BoolArray


def causal_track(flight: Flight) -> CodeSolution:
    """Return positions and velocities of the reference antenna, each epoch by the past alone.

    Raises
    ------
    NoSolutionError
        If the flight lacks observations or orbits, or no epoch has a solution.
    """
    return code_solution(flight, causal=True)


def causal_array(flight: Flight, resolver: Resolver, false_alarm: float) -> CausalArray:
    """Return attitudes of the array, each epoch by epochs up to it alone.

    An epoch that fails the chi-square test is searched for the attitude that most of its links
    share, from its own and from the last epoch that passed; links beyond 4.5 sigmas of it are
    excluded, a quarter of the epoch's at most. One that fails again is refused whole.

    Parameters
    ----------
    flight : Flight
    resolver : Resolver
        Its causal form is used.
    false_alarm : float
        Share of right epochs that the chi-square test may turn away.

    Raises
    ------
    NoSolutionError
        If the flight has no observations of two antennas, or no position can be computed.
    BadInputError
        If the resolver has no causal form.
    """
    differences, integers = resolve(flight, resolver, causal=True)
    ranges_m = fixed_ranges_m(differences, integers)
    excluded, form, attitude = _excluding(differences, ranges_m, false_alarm)
    factor = attitude.variance_factor_so_far()
    form = _with_variance_factor(form, factor)
    attitude = _again(attitude, form, np.flatnonzero(factor != 1.0))
    return CausalArray(
        differences=differences,
        integers=integers,
        ranges_m=_without(ranges_m, excluded),
        excluded=excluded,
        form=form,
        attitude=attitude,
        variance_factor=factor,
        refused=attitude.solved & ~attitude.consistent(false_alarm),
    )


def _with_variance_factor(form: RotationQuadratic, factor: FloatArray) -> RotationQuadratic:
    """Return the form with the variances of each epoch multiplied by its factor, (n,)."""
    return RotationQuadratic(
        information=form.information / factor[:, None, None],
        vector=form.vector / factor[:, None],
        constant=form.constant / factor,
        count=form.count,
    )


def _excluding(
    differences: DoubleDifferences, ranges_m: FloatArray, false_alarm: float
) -> tuple[BoolArray, RotationQuadratic, AttitudeSolution]:
    """Return the links, (n, a, m), without which others of their epoch agree; form and attitudes.

    Nothing is excluded where that would take too many.
    """
    n, b, m = ranges_m.shape
    excluded, hopeless = np.zeros((n, b + 1, m), dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    most = _EXCLUDED_AT_MOST * np.isfinite(ranges_m).sum(axis=(1, 2))
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    attitude = maximum_likelihood(form)
    for _ in range(_ROUNDS):
        factor = attitude.variance_factor_so_far()
        passes = attitude.solved & attitude.consistent(false_alarm, factor)
        fails = attitude.solved & ~passes & ~hopeless
        if not fails.any():
            break
        rest_m = _without(ranges_m, excluded)
        sigmas = _sigmas_off(differences, rest_m, attitude.R_nb, fails, passes)
        sigmas /= np.sqrt(factor[fails, None, None])
        worst = sigmas.max(axis=(1, 2), keepdims=True)
        excluded[fails] |= sigmas >= np.minimum(worst, _LINK_SIGMAS)
        taken = np.isfinite(ranges_m) & np.isnan(_without(ranges_m, excluded))
        hopeless |= taken.sum(axis=(1, 2)) > most
        excluded[hopeless] = False
        form = RotationQuadratic.of_ranges(differences, _without(ranges_m, excluded))
        attitude = _again(attitude, form, np.flatnonzero(fails))
    return excluded, form, attitude


def _again(attitude: AttitudeSolution, form: RotationQuadratic, rows: IntArray) -> AttitudeSolution:
    """Return attitudes, those of some epochs, (k,), searched again; others do not move at all."""
    if not len(rows):
        return attitude
    found = maximum_likelihood(form[rows], attitude.R_nb[rows])
    parts = {one.name: getattr(attitude, one.name).copy() for one in fields(attitude)}
    for name, values in parts.items():
        values[rows] = getattr(found, name)
    return AttitudeSolution(**parts)


def _without(ranges_m: FloatArray, links: BoolArray) -> FloatArray:
    """Return ranges without some links, (n, a, m); the reference antenna takes all."""
    return np.where(links[:, 1:] | links[:, :1], np.nan, ranges_m)


def _sigmas_off(
    differences: DoubleDifferences,
    ranges_m: FloatArray,
    R_nb: FloatArray,
    epochs: BoolArray,
    passes: BoolArray,
) -> FloatArray:
    """Return by how many sigmas links of some epochs, (k, a, m), are off the others.

    Robust weights tell which are the worst; the rest with its full covariance is three times as
    accurate, and an attitude that is off makes links look off.
    """
    rows = np.flatnonzero(epochs)
    last = np.maximum.accumulate(np.where(passes, np.arange(len(passes)), -1))[rows]
    beside = np.where(last >= 0, last, rows)
    # Each epoch between two copies of the last that passed: its neighbours lend their attitudes.
    three = np.stack([beside, rows, beside], axis=1).ravel()
    middle = np.tile([False, True, False], len(rows))
    found = robust_attitudes(epochs_at(differences, three), ranges_m[three], R_nb[three], middle)
    part, ranges_m = epochs_at(differences, rows), ranges_m[rows]
    sigmas = _link_sigmas(part, ranges_m, found[middle])
    suspects = sigmas > sigmas.max(axis=(1, 2), keepdims=True) / 2
    rest = RotationQuadratic.of_ranges(part, _without(ranges_m, suspects))
    return _link_sigmas(part, ranges_m, maximum_likelihood(rest, found[middle]).R_nb)


def _link_sigmas(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray
) -> FloatArray:
    """Return by how many sigmas each link is off the others, (n, a, m).

    Medians over channels take the receiver terms off, medians over antennas the satellites'. So a
    bad link shows as itself, be it of the reference antenna or of the reference channel.
    """
    off_m = ranges_m - differences.array_m(R_nb)
    off_m = np.concatenate([np.zeros_like(off_m[:, :1]), off_m], axis=1)
    off_m[:, 0][np.isnan(off_m[:, 1:]).all(axis=1)] = np.nan
    for g in np.unique(differences.group):
        channels = differences.group == g
        off_m[:, :, channels] -= _median(off_m[:, :, channels], axis=2)
    off_m -= _median(off_m, axis=1)
    return np.nan_to_num(np.abs(off_m) / np.sqrt(differences.phase_variance_m2)[:, None, :])


def _median(values: FloatArray, axis: int) -> FloatArray:
    """Return the median along an axis, kept; of a NaN slice 0."""
    middle = np.sort(values, axis=axis)  # NaN last
    count = np.isfinite(values).sum(axis=axis, keepdims=True)
    low, high = (count - 1).clip(0) // 2, np.minimum(count // 2, (count - 1).clip(0))
    pair = [np.take_along_axis(middle, at, axis=axis) for at in (low, high)]
    return np.asarray(np.where(count > 0, (pair[0] + pair[1]) / 2, 0.0))
