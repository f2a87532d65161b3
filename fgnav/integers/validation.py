"""Detection, identification and adaptation of an array's phase [1]_.

A resolver proposes integers, epoch by epoch or arc by arc; users of the array's phases call this.

- Detection: an epoch whose residuals about its best attitude fail the chi-square test, and along
  arcs an integer other than that which the arc's epochs agree on: a slip, or a wrong one.
- Identification: the link, of one antenna to one satellite, of the largest w-test.
- Adaptation: a detected epoch has the integers of its arcs, as one that the resolver refused; the
  worst link is left out until the rest passes. An epoch that does not pass is refused whole.

Causal, all of that is by epochs up to each alone.

References
----------
.. [1] P. J. G. Teunissen, "Quality control in integrated navigation systems", IEEE Aerospace and
   Electronic Systems Magazine 5, 1990.
.. [2] D. J. C. MacKay, "Information Theory, Inference, and Learning Algorithms", Cambridge, 2003,
   chapter 28: evidence is likelihood times Occam factor.
"""

from dataclasses import dataclass, replace
from math import log, pi

import numpy as np

from fgnav.attitude.array import (
    AttitudeSolution,
    maximum_likelihood,
    noise_notes,
    searched_again,
)
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.clock_free import clock_free
from fgnav.integers.arcs.consensus import arc_consensus
from fgnav.integers.arcs.reported import APART_S
from fgnav.integers.identification import Residuals, exclude_links, w_tests
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected
from fgnav.types.integers import Integers, fixed_ranges_m

_ROUNDS = 10  # of leaving a link, or an antenna, out
_FULL_VOTE = log(0.999 / 0.001)  # log odds of right integers
_ROTATIONS = 8 * pi**2  # volume of all rotations, by the body tangent in rad


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ValidatedArray:
    """Phases of the array that agree, epoch by epoch."""

    differences: DoubleDifferences
    integers: Integers  # adapted, and without the links that are excluded
    # Of the links that take part, the noise raised to what their residuals ask for.
    form: RotationQuadratic
    attitude: AttitudeSolution  # of the form
    # Double differences without integers that the form is of; NaN where excluded.
    ranges_m: FloatArray  # (n, b, m)
    # Links, the reference antenna's first, that contradict the others of their epoch.
    excluded: BoolArray  # (n, b + 1, m)
    refused: BoolArray  # (n,): epochs that nothing brings to agree
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class _Phases:
    """Ranges of an array without integers, and the attitudes that they lead to."""

    differences: DoubleDifferences
    all_m: FloatArray  # (n, b, m)
    ranges_m: FloatArray  # those of them that take part
    form: RotationQuadratic
    attitude: AttitudeSolution
    variance_factor: FloatArray  # (n,), of the stated noise
    false_alarm: float

    def fails(self) -> BoolArray:
        return ~self.attitude.consistent(self.false_alarm, self.variance_factor)

    def log_odds(self) -> FloatArray:
        """Return the log odds of each epoch's integers against all others by phase alone, (n,).

        The density of residuals, the attitude drawn from all there are, against that of any
        integers, uniform within a wavelength [2]_: few links fit some attitude by chance.
        """
        finite, group = np.isfinite(self.ranges_m), self.differences.group
        links = np.concatenate([finite.any(axis=1, keepdims=True), finite], axis=1)
        clocks = clock_free(
            group, links, self.differences.phase_variance_m2, np.zeros((*links.shape, 1))
        )
        uniform, factor = np.zeros(len(finite)), np.log(self.variance_factor)
        for g in range(int(group.max(initial=-1)) + 1):
            of_group = finite[:, :, group == g]
            free = of_group.sum(axis=(1, 2)) - of_group.any(axis=2).sum(axis=1)
            uniform += free * log(self.differences.wavelength_m[group == g][0])
        normal = (self.form.count * (log(2 * pi) + factor) + clocks.log_determinant) / 2
        volume = np.linalg.slogdet(self.attitude.covariance_rad2)[1] + 3 * (log(2 * pi) + factor)
        occam = np.minimum(volume / 2 - log(_ROTATIONS), 0.0)
        fit = self.attitude.chi_square / self.variance_factor / 2
        return np.asarray(uniform - normal + occam - fit)

    def w_tests(self, rows: IntArray) -> FloatArray:
        differences, R_nb = self.differences.resampled(rows), self.attitude.R_nb[rows]
        off_m = self.ranges_m[rows] - differences.array_m(R_nb)
        variance_m2 = differences.phase_variance_m2 * self.variance_factor[rows, None]
        baselines_n_m = np.einsum("nij,bj->nbi", R_nb, differences.baselines_b_m)
        return w_tests(differences, [Residuals(off_m, variance_m2)], baselines_n_m)

    def without(self, rows: IntArray, links: BoolArray) -> "_Phases":
        ranges_m = self.ranges_m.copy()
        lost = links[:, 1:] | links[:, :1]  # the reference antenna takes all
        ranges_m[rows] = np.where(lost, np.nan, self.all_m[rows])
        of_rows = RotationQuadratic.of_ranges(self.differences.resampled(rows), ranges_m[rows])
        form = self.form.with_rows(rows, of_rows)
        attitude = searched_again(self.attitude, form, rows, self.attitude.R_nb[rows])
        return replace(self, ranges_m=ranges_m, form=form, attitude=attitude)


def validated(
    differences: DoubleDifferences,
    integers: Integers,
    antennas: tuple[str, ...],
    false_alarm: float,
    *,
    causal: bool = False,
) -> ValidatedArray:
    """Validate an array's phases; epochs and arcs that agree at once stay as they are.

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
    adapted, phases = _held_by_arcs(differences, integers, false_alarm, causal=causal)
    phases, excluded = exclude_links(phases, adapted.fixed, _ROUNDS)
    refused = phases.fails()
    factor = _variance_factor(phases.attitude, causal=causal)
    form, attitude = phases.form, phases.attitude
    if (factor != 1.0).any():
        form = form.with_variance_factor(factor)
        raised = np.flatnonzero(factor != 1.0)
        attitude = searched_again(attitude, form, raised, attitude.R_nb[raised])
    change = np.where(integers.fixed & adapted.fixed, adapted.cycles - integers.cycles, 0)
    fixed = adapted.fixed & np.isfinite(phases.ranges_m)
    if excluded.any():
        adapted = replace(adapted, fixed=fixed, cycles=np.where(fixed, adapted.cycles, 0))
    here = ~refused[:, None, None]
    return ValidatedArray(
        differences=differences,
        integers=adapted,
        form=form,
        attitude=attitude,
        ranges_m=phases.ranges_m,
        excluded=excluded,
        refused=refused,
        rejections=_listed(differences, antennas, change * (fixed & here), excluded),
        notes=(
            *noise_notes(float(factor[-1]) if len(factor) else 1.0),
            *_filled_note(differences, integers, adapted),
        ),
    )


def _held_by_arcs(
    differences: DoubleDifferences, integers: Integers, false_alarm: float, *, causal: bool
) -> tuple[Integers, _Phases]:
    """Return integers, those of detected and refused epochs as their arcs agree on; phases by them.

    A baseline with some links fixed at an epoch gets no more: who resolved it left the others out.
    """
    phases = _phases(differences, integers, false_alarm, causal=causal)
    fails = phases.fails()
    sound = phases.attitude.solved & ~fails & (phases.attitude.degrees_of_freedom > 0)
    votes = _votes(differences.t_s, sound, phases.log_odds(), integers.wrong_probability)
    weight = np.where(integers.fixed, votes[:, None, None], 0.0)
    arcs = arc_consensus(differences.arc, integers.cycles, weight, causal=causal)
    open_baseline = ~integers.fixed.any(axis=2, keepdims=True)
    wanted = integers.fixed | (differences.resolvable & open_baseline)
    held = wanted & arcs.agreed & ~(integers.fixed & (integers.cycles == arcs.cycles))
    rows = np.flatnonzero(held.any(axis=(1, 2)))
    if not len(rows):
        return integers, phases
    wrong = integers.wrong_probability
    if wrong is not None:  # as likely as those of the last epoch that voted for them
        last = np.maximum.accumulate(np.where(votes > 0.0, np.arange(len(votes)), -1))
        last = np.where(last < 0, int(np.argmax(votes > 0.0)), last)
        wrong = np.where(held.any(axis=(1, 2)), wrong[last], wrong)
    source = np.where(held, 1, 0)
    integers = replace(
        integers,
        cycles=np.where(held, arcs.cycles, integers.cycles),
        fixed=integers.fixed | held,
        wrong_probability=wrong,
        source=source,
    )
    ranges_m = fixed_ranges_m(differences, integers)
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    attitude = searched_again(phases.attitude, form, rows)
    factor = _variance_factor(attitude, causal=causal)
    return integers, _Phases(differences, ranges_m, ranges_m, form, attitude, factor, false_alarm)


def _phases(
    differences: DoubleDifferences, integers: Integers, false_alarm: float, *, causal: bool
) -> _Phases:
    ranges_m = fixed_ranges_m(differences, integers)
    form = RotationQuadratic.of_ranges(differences, ranges_m)
    attitude = maximum_likelihood(form)
    factor = _variance_factor(attitude, causal=causal)
    return _Phases(differences, ranges_m, ranges_m, form, attitude, factor, false_alarm)


def _variance_factor(attitude: AttitudeSolution, *, causal: bool) -> FloatArray:
    """Return by what the noise's variance is raised, (n,)."""
    if causal:
        return attitude.variance_factor_so_far()
    return np.full(len(attitude.solved), attitude.variance_factor())


def _votes(
    t_s: FloatArray, sound: BoolArray, log_odds: FloatArray, wrong: FloatArray | None
) -> FloatArray:
    """Return the weights of epochs in votes on integers of their arcs, (n,), from 0 to 1.

    As the log odds of right integers, those of the residuals or those that the resolver states, in
    full at a chance of 1e-3 that they are wrong. Epochs so far apart that they err independently
    agree on wrong integers by chance alone: one counts in full a correlation time after the one
    before.
    """
    if wrong is not None:
        chance = wrong.clip(1e-300, 1 - 1e-16)
        log_odds = np.maximum(log_odds, np.log1p(-chance) - np.log(chance))
    votes = np.maximum(np.diff(t_s, prepend=t_s[:1]) / APART_S, log_odds / _FULL_VOTE)
    return np.where(sound, votes.clip(0.0, 1.0), 0.0)


def _filled_note(
    differences: DoubleDifferences, resolved: Integers, adapted: Integers
) -> tuple[str, ...]:
    new = adapted.fixed & ~resolved.fixed
    if not new.any():
        return ()
    none = new.any(axis=(1, 2)) & ~resolved.fixed.any(axis=(1, 2))
    arcs = np.unique(np.c_[np.argwhere(new)[:, 1:], differences.arc[new]], axis=0)
    return (
        f"Integers of {len(arcs)} arcs hold where they were refused: {int(new.sum())} links, "
        f"{int(none.sum())} epochs that had none.",
    )


def _listed(
    differences: DoubleDifferences, antennas: tuple[str, ...], change: IntArray, excluded: BoolArray
) -> tuple[Rejected, ...]:
    """Return integers changed, (n, b, m), and links excluded, (n, b + 1, m), with their spans."""
    mended = [
        (i + 1, j, first, last, f"integer off by {-cycles:+d}: mended by its arc")
        for i, j, first, last, cycles in _runs(change)
    ]
    out = [
        (i, j, first, last, "contradicts the rest of the array: left out")
        for i, j, first, last, _ in _runs(excluded.astype(np.int64))
    ]
    return tuple(
        Rejected(
            what="phase",
            link=f"{antennas[i]} {differences.satellites[j]} {differences.signals[j]}",
            from_s=float(differences.t_s[first]),
            until_s=float(differences.t_s[last]),
            reason=reason,
        )
        for i, j, first, last, reason in (*mended, *out)
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
