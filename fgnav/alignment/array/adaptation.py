"""Phases of an array that contradict it: detected, identified and adapted in one place [1]_.

A resolver proposes integers, epoch by epoch or arc by arc; users of the array's phases call this.

- Detection: the phases of an epoch contradict each other where their residuals fail the chi-square
  test, and an epoch contradicts its arcs where it has other integers than their epochs agree on.
- Identification: residuals about the attitude that most links of the epoch share (a robust cost)
  are whole cycles where integers are wrong, or an unseen slip was; other ones are bad links. An
  epoch then votes on its arcs by its evidence: few links fit some attitude by chance.
- Adaptation: an integer becomes that of its arc, or, where the evidence is greater, of the epoch
  itself. Bad links are excluded. An epoch that fails the test again is refused whole, as is one
  that failed it once and neither its arcs nor its own evidence vouches for.

An epoch that a resolver refuses has the integers that its arcs agree on, and is tested like any
other. Causal, all of that is by epochs up to each alone.

References
----------
.. [1] P. J. G. Teunissen, "Quality control in integrated navigation systems", IEEE Aerospace and
   Electronic Systems Magazine 5, 1990.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.array.evidence import BELIEVED_LOG_ODDS, epoch_evidence, votes_of
from fgnav.alignment.array.exclusion import excluding, variance_factor
from fgnav.alignment.array.links import listed, without
from fgnav.alignment.filling import zero_order_hold
from fgnav.attitude.array import (
    AttitudeSolution,
    maximum_likelihood,
    noise_notes,
    searched_again,
)
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.robust import robust_attitudes
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.rotations import skew
from fgnav.integers.arcs.consensus import Consensus, arc_consensus
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected, open_angle_variance_rad2
from fgnav.types.integers import SOURCES, Integers, fixed_ranges_m

_NEAR_CYCLES = 0.15  # a residual this near to a whole number identifies it
_MENDED_AT_MOST = 0.4  # of an epoch's links: the majority knows the attitude, not a minority
_PLACED_CYCLES = 0.1  # 1-sigma of where an antenna is, before its integers are rounded


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AdaptedArray:
    """Phases of the array that agree, epoch by epoch."""

    integers: Integers  # adapted, and without the links that are excluded
    # Of the links that take part, the noise raised to what their residuals ask for.
    form: RotationQuadratic
    attitude: AttitudeSolution  # of the form
    # Double differences without integers that the form is of; NaN where excluded.
    ranges_m: FloatArray  # (n, b, m)
    # Links, the reference antenna's first, that contradict the others of their epoch.
    excluded: BoolArray  # (n, b + 1, m)
    refused: BoolArray  # (n,): epochs that nothing brings to agree
    evidence: FloatArray  # (n,): for the integers of each epoch, log odds; 0 of those refused
    source: IntArray  # (n, b, m): whose integers they are, of ``types.integers.SOURCES``
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]


def adapted(
    differences: DoubleDifferences,
    integers: Integers,
    antennas: tuple[str, ...],
    false_alarm: float,
    *,
    causal: bool = False,
) -> AdaptedArray:
    """Return what agrees of an array's phases; of epochs and arcs that agree at once, everything.

    Parameters
    ----------
    differences : DoubleDifferences
    integers : Integers
        Of the same differences.
    antennas : tuple of str, length b + 1
        Names, the reference first.
    false_alarm : float
        Share of right epochs that the chi-square test may turn away.
    causal : bool
        Each epoch by epochs up to it alone; so must be the integers.
    """
    filled, attitude = _filled(differences, integers, false_alarm, causal=causal)
    chosen = _chosen(differences, filled, attitude, false_alarm, causal=causal)
    ranges_m = fixed_ranges_m(differences, chosen.integers)
    if len(chosen.rows):
        form = RotationQuadratic.of_ranges(differences, ranges_m)
        attitude = searched_again(attitude, form, chosen.rows, chosen.R_nb)
    excluded, form, attitude = excluding(differences, ranges_m, attitude, false_alarm, causal)
    factor = variance_factor(attitude, causal=causal)
    links = chosen.integers.fixed & np.isfinite(without(ranges_m, excluded))
    evidence = epoch_evidence(differences, links, attitude, factor, chosen_of=chosen.integers.fixed)
    if (factor != 1.0).any():
        form = form.with_variance_factor(factor)
        raised = np.flatnonzero(factor != 1.0)
        attitude = searched_again(attitude, form, raised, attitude.R_nb[raised])
    refused = attitude.solved & (chosen.unsure | ~attitude.consistent(false_alarm))
    believed, here = chosen.integers, ~refused[:, None, None]
    if excluded.any():
        fixed = believed.fixed & np.isfinite(without(ranges_m, excluded))
        believed = replace(believed, fixed=fixed, cycles=np.where(fixed, believed.cycles, 0))
    both = integers.fixed & believed.fixed & here
    change = np.where(both, believed.cycles - integers.cycles, 0)
    return AdaptedArray(
        integers=believed,
        form=form,
        attitude=attitude,
        ranges_m=without(ranges_m, excluded),
        excluded=excluded,
        refused=refused,
        evidence=np.where(refused, 0.0, evidence),
        source=_source(integers, believed, chosen.by_arc),
        rejections=listed(differences, antennas, change, chosen.by_arc, excluded & here),
        notes=(
            *noise_notes(float(factor[-1]) if len(factor) else 1.0),
            *_filled_note(differences, integers, believed),
        ),
    )


def _source(resolved: Integers, believed: Integers, by_arc: BoolArray) -> IntArray:
    """Return the source of each integer, (n, b, m): filled ones are of their arcs."""
    same = resolved.fixed & (resolved.cycles == believed.cycles)
    of_arc = by_arc | ~resolved.fixed
    named = np.where(of_arc, SOURCES.index("arc"), SOURCES.index("array"))
    return np.where(same | ~believed.fixed, SOURCES.index("resolver"), named).astype(np.int64)


def _filled_note(
    differences: DoubleDifferences, resolved: Integers, believed: Integers
) -> tuple[str, ...]:
    new = believed.fixed & ~resolved.fixed
    if not new.any():
        return ()
    none = new.any(axis=(1, 2)) & ~resolved.fixed.any(axis=(1, 2))
    arcs = np.unique(np.c_[np.argwhere(new)[:, 1:], differences.arc[new]], axis=0)
    return (
        f"Integers of {len(arcs)} arcs hold where they were refused: {int(new.sum())} links, "
        f"{int(none.sum())} epochs that had none.",
    )


def _filled(
    differences: DoubleDifferences, integers: Integers, false_alarm: float, *, causal: bool
) -> tuple[Integers, AttitudeSolution]:
    """Return integers, those that arcs agree on also of baselines that are refused; attitudes.

    A baseline with some links fixed at an epoch gets no more: who resolved it left the others out.
    """
    form = RotationQuadratic.of_ranges(differences, fixed_ranges_m(differences, integers))
    attitude = maximum_likelihood(form)
    new = differences.resolvable & ~integers.fixed.any(axis=2, keepdims=True)
    if not (new.any() and integers.fixed.any()):
        return integers, attitude
    sound = attitude.solved & attitude.consistent(false_alarm)
    factor = variance_factor(attitude, causal=causal)
    evidence = epoch_evidence(differences, integers.fixed, attitude, factor)
    arcs, votes = _agreed(differences, integers, evidence, sound, sound, causal=causal)
    new &= arcs.agreed
    rows = np.flatnonzero(new.any(axis=(1, 2)))
    if not len(rows):
        return integers, attitude
    wrong = integers.wrong_probability
    if wrong is not None:  # as likely as those of the last epoch that voted for them
        last_wrong = zero_order_hold(differences.t_s, wrong, votes > 0.0)
        wrong = np.where(new.any(axis=(1, 2)), last_wrong, wrong)
    integers = replace(
        integers,
        cycles=np.where(new, arcs.cycles, integers.cycles),
        fixed=integers.fixed | new,
        wrong_probability=wrong,
    )
    form = RotationQuadratic.of_ranges(differences, fixed_ranges_m(differences, integers))
    return integers, searched_again(attitude, form, rows)


class _Chosen(NamedTuple):
    """Integers, and what is known of epochs that were in doubt."""

    integers: Integers
    by_arc: BoolArray  # (n, b, m): the arc's, not the epoch's own
    rows: IntArray  # (k,), those in doubt
    R_nb: FloatArray  # (k, 3, 3), what most of their links agree on
    unsure: BoolArray  # (n,): evidence of neither the epoch nor its arcs suffices


def _chosen(
    differences: DoubleDifferences,
    integers: Integers,
    attitude: AttitudeSolution,
    false_alarm: float,
    *,
    causal: bool,
) -> _Chosen:
    """Return integers, those of doubtful epochs their arcs' or their own.

    A slip that nobody noticed parts an arc in two: there the epoch knows better than its arc.
    """
    fixed, cycles = integers.fixed, integers.cycles
    sound = attitude.solved & attitude.consistent(false_alarm)
    factor = variance_factor(attitude, causal=causal)
    evidence = epoch_evidence(differences, fixed, attitude, factor)
    arcs, _ = _agreed(differences, integers, evidence, sound, sound, causal=causal)
    differs = (fixed & arcs.agreed & (cycles != arcs.cycles)).any(axis=(1, 2))
    doubtful = fixed.any(axis=(1, 2)) & (~sound | differs)
    rows = np.flatnonzero(doubtful)
    if not len(rows):
        return _Chosen(integers, np.zeros_like(fixed), rows, attitude.R_nb[rows], doubtful)
    ranges_m = fixed_ranges_m(differences, integers)
    R_nb = zero_order_hold(differences.t_s, attitude.R_nb, attitude.solved)
    since = np.logical_or.accumulate(attitude.solved)  # the first holds from there on only
    R_nb = np.where(since[:, None, None], R_nb, attitude.R_nb)
    R_links = robust_attitudes(differences, ranges_m, R_nb, doubtful, causal=causal)
    off = _off_cycles(differences, integers, R_links)
    cycles_off = np.rint(off).astype(np.int64)
    right = fixed & (cycles_off == 0)
    right &= (right.sum(axis=2) >= (1 - _MENDED_AT_MOST) * fixed.sum(axis=2))[:, :, None]
    trusted = _share(cycles_off != 0, fixed) <= _MENDED_AT_MOST
    trusted &= _placed(differences, ranges_m, R_links, right)
    rounded = replace(
        integers, cycles=cycles + np.where((doubtful & trusted)[:, None, None], cycles_off, 0)
    )
    near, mended = _about(differences, rounded, R_links, rows, attitude)
    factor = variance_factor(mended, causal=causal)
    by_epoch = epoch_evidence(differences, near, mended, factor, chosen_of=fixed)
    arcs, _ = _agreed(differences, rounded, by_epoch, sound, sound | trusted, causal=causal)
    by_arc = replace(
        integers, cycles=np.where(fixed & (arcs.margin > 0), arcs.cycles, rounded.cycles)
    )
    R_arc = robust_attitudes(
        differences, fixed_ranges_m(differences, by_arc), R_links, doubtful, causal=causal
    )
    near, by_arc_solution = _about(differences, by_arc, R_arc, rows, mended)
    of_arc = epoch_evidence(differences, near, by_arc_solution, factor, chosen_of=fixed)
    differs = (rounded.cycles != by_arc.cycles).any(axis=(1, 2))
    alone = ~doubtful | ((trusted | sound) & differs & (by_epoch > of_arc))
    believed = np.where(alone[:, None, None], rounded.cycles, by_arc.cycles)
    borne = _share((believed == arcs.cycles) & (arcs.margin >= 1.0), fixed)
    odds = np.where(alone, by_epoch, of_arc)
    unsure = doubtful & (odds < BELIEVED_LOG_ODDS) & (borne < 1 - _MENDED_AT_MOST)
    return _Chosen(
        replace(integers, cycles=np.where(fixed, believed, 0)),
        (arcs.margin > 0) & ~alone[:, None, None],
        rows,
        np.where(alone[:, None, None], R_links, R_arc)[rows],
        unsure,
    )


def _agreed(
    differences: DoubleDifferences,
    integers: Integers,
    evidence: FloatArray,
    sound: BoolArray,
    voting: BoolArray,
    *,
    causal: bool,
) -> tuple[Consensus, FloatArray]:
    """Return what arcs agree on, and the votes of epochs, (n,), by their evidence."""
    weight = votes_of(differences.t_s, evidence, sound, integers.wrong_probability)
    weight = np.where(voting, weight, 0.0)
    votes = np.where(integers.fixed, weight[:, None, None], 0.0)
    return arc_consensus(differences.arc, integers.cycles, votes, causal=causal), weight


def _about(
    differences: DoubleDifferences,
    integers: Integers,
    R_nb: FloatArray,
    rows: IntArray,
    attitude: AttitudeSolution,
) -> tuple[BoolArray, AttitudeSolution]:
    """Return the fixed links, (n, b, m), of some epochs those near attitudes, and theirs."""
    near = np.abs(_off_cycles(differences, integers, R_nb)) < _NEAR_CYCLES
    links = integers.fixed.copy()
    links[rows] &= near[rows]
    ranges_m = fixed_ranges_m(differences, integers)
    used_m = np.where(links | ~integers.fixed, ranges_m, np.nan)
    form = RotationQuadratic.of_ranges(differences, used_m)
    return links, searched_again(attitude, form, rows, R_nb[rows])


def _off_cycles(differences: DoubleDifferences, integers: Integers, R_nb: FloatArray) -> FloatArray:
    """Return fixed double differences less those of attitudes, in cycles, (n, b, m); else 0."""
    off_m = fixed_ranges_m(differences, integers) - differences.array_m(R_nb)
    return np.where(integers.fixed, off_m / differences.wavelength_m, 0.0)


def _placed(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray, links: BoolArray
) -> BoolArray:
    """Return the epochs, (n,), whose attitude by some links suffices to round the others.

    Else an antenna could turn about the others' solution, its integers along with it.
    """
    used_m = np.where(
        links | (differences.is_reference[:, None] & (ranges_m == 0)), ranges_m, np.nan
    )
    information = RotationQuadratic.of_ranges(differences, used_m).information_at(R_nb)
    covariance = np.linalg.inv(information + np.eye(3) / open_angle_variance_rad2())
    arms = skew(differences.baselines_b_m)
    place_m2 = np.einsum("bij,njk,bik->nb", arms, covariance, arms)
    shortest_m = differences.wavelength_m.min(initial=1.0)
    return np.asarray(place_m2.max(axis=1) < (_PLACED_CYCLES * shortest_m) ** 2)


def _share(of_links: BoolArray, links: BoolArray) -> FloatArray:
    """Return the share of an epoch's links, (n, b, m), that a property holds of, (n,)."""
    return np.asarray((of_links & links).sum(axis=(1, 2)) / np.maximum(links.sum(axis=(1, 2)), 1))
