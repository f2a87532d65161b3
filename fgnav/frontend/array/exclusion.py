"""Phases that contradict their array: integers mended arc by arc, links left out one by one.

A wrong integer is a property of its arc. The links of an epoch vote on its attitude first, the
epochs of an arc on its integer then, and what is left enters with its full covariance.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.attitude.array import AttitudeSolution, agreeing, maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.robust import robust_attitudes
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.array.consensus import majority_integers
from fgnav.geometry.rotations import skew
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected, open_angle_variance_rad2
from fgnav.types.integers import Integers, fixed_ranges_m

_NEAR_CYCLES = 0.15  # a residual this near to a whole number says which one it is
_MOSTLY = 0.75  # of an epoch's links are that near when its attitude is right; a third by chance
_MENDED_AT_MOST = 0.4  # of an epoch's links: the majority knows the attitude, not a minority
_PLACED_CYCLES = 0.1  # 1-sigma of where an antenna is, before its integers are rounded
_LINK_SIGMAS = 4.5  # beyond, a link contradicts its array
_LEFT_OUT_AT_MOST = 0.25  # of an epoch's links; an epoch with more to say against is refused
_ROUNDS = 3  # of leaving links out


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ConsistentArray:
    """Phases of the array that agree, epoch by epoch.

    Attributes
    ----------
    integers : Integers
        Mended, and without the links that were left out.
    form : RotationQuadratic
        Of the links that take part, the noise raised to what their residuals ask for.
    attitude : AttitudeSolution
        Of the form.
    ranges_m : ndarray, shape (n, b, m)
        Double differences without integers that the form is of.
    refused : ndarray of bool, shape (n,)
        Epochs that nothing brings to agree.
    rejections : tuple of Rejected
    notes : tuple of str
    """

    integers: Integers
    form: RotationQuadratic
    attitude: AttitudeSolution
    ranges_m: FloatArray
    refused: BoolArray
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]


def exclude_faults(
    differences: DoubleDifferences,
    integers: Integers,
    antennas: tuple[str, ...],
    false_alarm: float,
) -> ConsistentArray:
    """Return what agrees of an array's fixed phases; of epochs that agree at once, everything.

    Epochs that fail the chi-square test are searched for the attitude that most of their links
    share. Residuals of whole cycles there are wrong integers, and mended if the epochs of their arc
    vote for it; other residuals beyond 4.5 sigmas are left out link by link. The chi-square test
    judges the result; an epoch that fails again is refused whole.

    Parameters
    ----------
    differences : DoubleDifferences
    integers : Integers
    antennas : tuple of str, length b + 1
        Names, the reference first.
    false_alarm : float
        Share of right epochs that the chi-square test may turn away.
    """
    ranges_m = fixed_ranges_m(differences, integers)
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    attitude = maximum_likelihood(form)
    doubtful = (form.count > 0) & ~(attitude.solved & attitude.consistent(false_alarm))
    if not doubtful.any():
        form, attitude, notes = agreeing(form, attitude)
        return ConsistentArray(
            integers=integers,
            form=form,
            attitude=attitude,
            ranges_m=ranges_m,
            refused=np.zeros(len(doubtful), dtype=np.bool_),
            rejections=(),
            notes=notes,
        )
    cycles, R_nb = _mended(differences, integers, attitude.R_nb, doubtful)
    ranges_m = fixed_ranges_m(differences, replace(integers, cycles=cycles))
    left_out, R_nb = _left_out(differences, ranges_m, R_nb, false_alarm)
    rest_m = _rest(ranges_m, left_out)
    form = RotationQuadratic.of_ranges(differences, rest_m)
    form, attitude, notes = agreeing(form, maximum_likelihood(form, R_nb))
    refused = attitude.solved & ~attitude.consistent(false_alarm)
    believed = ~refused[:, None, None]
    fixed = integers.fixed & ~left_out[:, 1:]
    change = np.where(fixed & believed, cycles - integers.cycles, 0)
    return ConsistentArray(
        integers=replace(integers, fixed=fixed, cycles=np.where(fixed, cycles, 0)),
        form=form,
        attitude=attitude,
        ranges_m=rest_m,
        refused=refused,
        rejections=_listed(differences, antennas, change, left_out & believed),
        notes=notes,
    )


def _mended(
    differences: DoubleDifferences, integers: Integers, R_nb: FloatArray, doubtful: BoolArray
) -> tuple[IntArray, FloatArray]:
    """Return integers, (n, b, m), those of doubtful epochs as they or their arcs vote; attitudes.

    A slip that nobody noticed parts an arc in two: there the epoch knows better than its arc.
    """
    ranges_m, fixed = fixed_ranges_m(differences, integers), integers.fixed
    R_nb = robust_attitudes(differences, ranges_m, R_nb, doubtful)
    off = _off_cycles(differences, integers, R_nb)
    whole = np.rint(off).astype(np.int64)
    near = _share(np.abs(off - whole) < _NEAR_CYCLES, fixed)
    trusted = (near >= _MOSTLY) & (_share(whole != 0, fixed) <= _MENDED_AT_MOST)
    right = fixed & (whole == 0)
    right &= (right.sum(axis=2) >= (1 - _MENDED_AT_MOST) * fixed.sum(axis=2))[:, :, None]
    trusted &= _placed(differences, ranges_m, R_nb, right)
    own = integers.cycles + np.where((doubtful & trusted)[:, None, None], whole, 0)
    knows = fixed & (trusted | ~doubtful)[:, None, None]
    voted = _voted(differences.arc, integers.cycles, own, knows)
    voted = np.where(fixed & doubtful[:, None, None], voted, integers.cycles)
    by_arc = replace(integers, cycles=voted)
    R_arc = robust_attitudes(differences, fixed_ranges_m(differences, by_arc), R_nb, doubtful)
    near_arc = _share(np.abs(_off_cycles(differences, by_arc, R_arc)) < _NEAR_CYCLES, fixed)
    alone = (doubtful & trusted & (near > near_arc))[:, None, None]
    return np.where(fixed & alone, own, voted), np.where(alone, R_nb, R_arc)


def _off_cycles(differences: DoubleDifferences, integers: Integers, R_nb: FloatArray) -> FloatArray:
    """Return fixed double differences less those of attitudes, in cycles, (n, b, m); else 0."""
    off_m = fixed_ranges_m(differences, integers) - differences.array_m(R_nb)
    return np.where(integers.fixed, off_m / differences.wavelength_m, 0.0)


def _placed(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray, links: BoolArray
) -> BoolArray:
    """Return the epochs, (n,), whose attitude some links tell well enough to round the others.

    Else an antenna would be free to turn about what the others tell, its integers along with it.
    """
    known_m = np.where(
        links | (differences.is_reference[:, None] & (ranges_m == 0)), ranges_m, np.nan
    )
    information = RotationQuadratic.of_ranges(differences, known_m).information_at(R_nb)
    covariance = np.linalg.inv(information + np.eye(3) / open_angle_variance_rad2())
    arms = skew(differences.baselines_b_m)
    place_m2 = np.einsum("bij,njk,bik->nb", arms, covariance, arms)
    shortest_m = differences.wavelength_m.min(initial=1.0)
    return np.asarray(place_m2.max(axis=1) < (_PLACED_CYCLES * shortest_m) ** 2)


def _share(of_links: BoolArray, links: BoolArray) -> FloatArray:
    """Return the share of an epoch's links, (n, b, m), that a property holds of, (n,)."""
    return np.asarray((of_links & links).sum(axis=(1, 2)) / np.maximum(links.sum(axis=(1, 2)), 1))


def _voted(arc: IntArray, cycles: IntArray, own: IntArray, knows: BoolArray) -> IntArray:
    """Return the integer that most epochs of each link's arc know; ``cycles`` where none does."""
    if not knows.any():
        return cycles
    links = np.arange(arc[0].size).reshape(arc[0].shape)
    label = links * (arc.max() + 1) + arc
    labels, integers, _ = majority_integers(label[knows], own[knows])
    place = np.searchsorted(labels, label).clip(max=len(labels) - 1)
    return np.asarray(np.where(labels[place] == label, integers[place], cycles))


def _rest(ranges_m: FloatArray, left_out: BoolArray) -> FloatArray:
    """Return ranges without the links left out, (n, a, m); the reference antenna takes all."""
    return np.where(left_out[:, 1:] | left_out[:, :1], np.nan, ranges_m)


def _left_out(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray, false_alarm: float
) -> tuple[BoolArray, FloatArray]:
    """Return the links, (n, a, m), without which the others of their epoch agree; attitudes.

    Nothing is left out where that would take too many.
    """
    n, b, m = ranges_m.shape
    left_out = np.zeros((n, b + 1, m), dtype=np.bool_)
    most = _LEFT_OUT_AT_MOST * np.isfinite(ranges_m).sum(axis=(1, 2))
    hopeless = np.zeros(n, dtype=np.bool_)
    for _ in range(_ROUNDS):
        rest_m = _rest(ranges_m, left_out)
        attitude = maximum_likelihood(RotationQuadratic.of_ranges(differences, rest_m), R_nb)
        R_nb, factor = attitude.R_nb, attitude.variance_factor()
        fails = attitude.solved & ~attitude.consistent(false_alarm, factor) & ~hopeless
        if not fails.any():
            break
        sigmas = _sigmas_off(differences, rest_m, R_nb, fails) / np.sqrt(factor)
        worst = sigmas.max(axis=(1, 2), keepdims=True)
        left_out[fails] |= sigmas >= np.minimum(worst, _LINK_SIGMAS)
        taken = np.isfinite(ranges_m) & np.isnan(_rest(ranges_m, left_out))
        hopeless |= taken.sum(axis=(1, 2)) > most
        left_out[hopeless] = False
    return left_out, R_nb


def _sigmas_off(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray, epochs: BoolArray
) -> FloatArray:
    """Return by how many sigmas each link of some epochs is off an attitude without the worst.

    Robust weights tell which are the worst; the rest with its full covariance is three times as
    accurate, and an attitude that is off makes links look off.
    """
    R_nb = robust_attitudes(differences, ranges_m, R_nb, epochs)
    sigmas = _link_sigmas(differences, ranges_m, R_nb, epochs)
    suspects = np.zeros((len(epochs), *sigmas.shape[1:]), dtype=np.bool_)
    suspects[epochs] = sigmas > sigmas.max(axis=(1, 2), keepdims=True) / 2
    rest = RotationQuadratic.of_ranges(differences, _rest(ranges_m, suspects))
    R_nb[epochs] = maximum_likelihood(rest[np.flatnonzero(epochs)], R_nb[epochs]).R_nb
    return _link_sigmas(differences, ranges_m, R_nb, epochs)


def _link_sigmas(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray, epochs: BoolArray
) -> FloatArray:
    """Return by how many sigmas each link of some epochs is off the others, (k, a, m).

    Medians over channels take the receiver terms off, medians over antennas the satellites'. So a
    bad link shows as itself, be it of the reference antenna or of the reference channel.
    """
    off_m = (ranges_m - differences.array_m(R_nb))[epochs]
    off_m = np.concatenate([np.zeros_like(off_m[:, :1]), off_m], axis=1)
    off_m[:, 0][np.isnan(off_m[:, 1:]).all(axis=1)] = np.nan
    for g in np.unique(differences.group):
        channels = differences.group == g
        off_m[:, :, channels] -= _median(off_m[:, :, channels], axis=2)
    off_m -= _median(off_m, axis=1)
    sigma_m = np.sqrt(differences.phase_variance_m2[epochs])
    return np.nan_to_num(np.abs(off_m) / sigma_m[:, None, :])


def _median(values: FloatArray, axis: int) -> FloatArray:
    """Return the median along an axis, kept; of a NaN slice 0."""
    known = np.isfinite(values)
    middle = np.sort(values, axis=axis)  # NaN last
    count = known.sum(axis=axis, keepdims=True)
    low, high = (count - 1).clip(0) // 2, count // 2
    high = np.minimum(high, (count - 1).clip(0))
    pair = [np.take_along_axis(middle, at, axis=axis) for at in (low, high)]
    return np.asarray(np.where(count > 0, (pair[0] + pair[1]) / 2, 0.0))


def _listed(
    differences: DoubleDifferences,
    antennas: tuple[str, ...],
    change: IntArray,
    left_out: BoolArray,
) -> tuple[Rejected, ...]:
    """Return each mended integer, (n, b, m), and each link left out, (n, a, m), with its span."""
    found = []
    for i, j, first, last, cycles in _runs(change):
        reason = f"integer off by {-cycles:+d}: mended by what the rest of the array says"
        found.append((i + 1, j, first, last, reason))
    for i, j, first, last, _ in _runs(left_out.astype(np.int64)):
        found.append((i, j, first, last, "contradicts the rest of the array: left out"))
    return tuple(
        Rejected(
            what="phase",
            link=f"{antennas[i]} {differences.satellites[j]} {differences.signals[j]}",
            from_s=float(differences.t_s[first]),
            until_s=float(differences.t_s[last]),
            reason=reason,
        )
        for i, j, first, last, reason in found
    )


def _runs(values: IntArray) -> list[tuple[int, int, int, int, int]]:
    """Return row, column, first and last epoch and value of every run of one value but 0."""
    edged = np.pad(values, ((1, 1), (0, 0), (0, 0)))
    changes = np.diff(edged, axis=0) != 0
    first = np.argwhere((changes[:-1] & (values != 0)).transpose(1, 2, 0))
    last = np.argwhere((changes[1:] & (values != 0)).transpose(1, 2, 0))
    return [
        (int(i), int(j), int(begin), int(end), int(values[begin, i, j]))
        for (i, j, begin), (_, _, end) in zip(first, last, strict=True)
    ]
