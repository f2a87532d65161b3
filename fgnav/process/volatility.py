"""A rate prior whose scale follows the motion: thrusts, throws and gusts between quiet flight.

About each axis the logarithm of the process noise's scale is a random walk over half seconds, a
stochastic volatility model [1]_. Scales and length have the greatest posterior density; its
gradient is exact (``score_kernel``), and Fisher scoring takes steps by the degrees of freedom that
attitudes tell of each scale. The scale varies only where that is likelier than a constant one.

References
----------
.. [1] Kim, Shephard and Chib, Stochastic volatility: likelihood inference and comparison with ARCH
   models, Review of Economic Studies 65, 1998.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.linalg import cholesky_banded, solveh_banded

from fgnav.checks import FloatArray, IntArray
from fgnav.process.attitude_series import AttitudeSeries, attitude_series, spread
from fgnav.process.evidence_kernel import Tape, tape
from fgnav.process.hyperparameters import (
    DEFAULT_LENGTH_S,
    LEAST_RADPS,
    LONGEST_S,
    MOST_RADPS,
    VERY_STRONG_EVIDENCE,
    RatePrior,
    climbed,
)
from fgnav.process.posterior import (
    DAMPING,
    LENGTH,
    RATIO,
    SIGMA,
    bounds,
    hyperparameters,
    log_posterior,
    log_prior,
    poles,
)
from fgnav.process.score_kernel import score

_BLOCK_S = 0.5
# 1-sigma of the walk's steps, any of these alike before attitudes are seen: by their evidence a
# glider in gusts has .25, a rocket .3, a coast and a tumble .6 (evidence lost by .5: 13, 7, 2, 4).
_WALK_SIGMAS = np.sqrt(0.5) ** np.arange(7)
_USUAL_WALK = 3  # of these, .35
# How long a swing may be remembered, of the record, 1 sigma. One of constant scale is driven as its
# amplitude tells; one whose scale has fallen is next to a function of time, and body rates of Euler
# angles' sines are none to the second order: of 5 degrees they have an attitude NEES of 2.9 with
# this, of 5 with half of the record, 13 with all of it, 32 with none.
_MEMORY = 0.2
# Searches start with scales too large: towards too small ones attitudes are lost, and no slope is.
_FROM_ABOVE = 1.5
_MOST_STEP = 1.0  # of logarithms at once
_LEVEL_GAIN, _LAST_GAIN = 1.0, 0.1  # less gained by a step ends a search, and the last
_STEPS, _HALVINGS, _ROUNDS = 20, 4, 10
_RIDGE = 1e-6  # of the precision, where attitudes tell nothing of an axis


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class VaryingRatePrior:
    """A prior of the rate whose noise has another scale in each interval."""

    poles_per_s: FloatArray  # (3, 3): about the body axes; see ``matern``
    # Of each interval between attitudes, about the body axes.
    variance_rad2ps2: FloatArray  # (n - 1, 3)
    evidence_gain: float  # log evidence beyond that of constant variances


def varying_rate_prior(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    constant: RatePrior,
    *,
    swings: bool = True,
) -> VaryingRatePrior | None:
    """Return the likeliest prior of varying scale, or None where constant variances will do.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        As in ``rate_prior``.
    constant : RatePrior
        What ``rate_prior`` has identified from them.
    swings : bool
        As in ``rate_prior``.
    """
    n = len(t_s)
    rows = spread(n)
    attitudes, some = (
        attitude_series(t_s, R_nb, covariance_rad2, of, past=n) for of in (np.arange(n), rows)
    )
    swings = swings and not attitudes.epochs.open_axis.any()
    search = _Search(attitudes, some, rows, bounds(swings=swings))
    x = hyperparameters(constant)
    scales = np.tile(x[SIGMA], (search.block[-1] + 1, 1))
    likelihood = attitudes.log_densities(constant.poles_per_s, constant.variance_rad2ps2).sum()
    still = float(likelihood) + log_prior(x, min(attitudes.record_s, LONGEST_S))[0]
    # A constant scale may take what is fast for wrong attitudes, and be small.
    above = _FROM_ABOVE + np.maximum(
        scales, np.log(attitudes.turn_deviations()[1].clip(LEAST_RADPS))
    )
    # From long memories and from short ones: each may lead to a lesser maximum.
    starts = (search.climbed(search.point(start, _bounded(above))) for start in _starts(x, swings))
    begun = search.with_shapes(max(starts, key=lambda point: point.value))
    best = search.with_walk(search.maximum_from(begun))
    gained = search.evidence(best) - still
    if gained < VERY_STRONG_EVIDENCE:
        return None
    return VaryingRatePrior(
        poles_per_s=poles(best.x),
        variance_rad2ps2=search.variances(best.scales),
        evidence_gain=gained,
    )


def _starts(x: FloatArray, swings: bool) -> list[FloatArray]:
    """Return where searches start: from long memories and from short ones, that swing or not."""
    usual = np.zeros(12)
    usual[LENGTH] = np.log(DEFAULT_LENGTH_S)
    if not swings:
        return [x, usual]
    swung = usual.copy()
    swung[RATIO], swung[DAMPING] = 1.0, 1.0
    return [x, usual, swung]


class _Point(NamedTuple):
    """Point of a search: hyperparameters (12,), log scales (blocks, 3), and its score.

    The standard deviations of the former are the scales' mean. Slope and freedom are the score of
    scales by the attitudes alone, and what these tell of them.
    """

    x: FloatArray
    scales: FloatArray
    walk_sigma: float
    without_walk: float  # log posterior density but for the walk's
    slope: FloatArray  # (blocks, 3)
    freedom: FloatArray  # (blocks, 3)

    @property
    def value(self) -> float:
        """Log posterior density."""
        walk = (np.diff(self.scales, axis=0) ** 2).sum() / (2 * self.walk_sigma**2)
        return self.without_walk - float(walk)


@dataclass(frozen=True, eq=False, slots=True)
class _Search:
    """Posterior density of scales and shapes, and steps uphill."""

    attitudes: AttitudeSeries
    some: AttitudeSeries  # of a longer flight, by which shapes and levels are found
    rows: IntArray  # which these are
    limits: tuple[FloatArray, FloatArray]  # of hyperparameters
    block: IntArray = field(init=False)  # (n - 1,), of each interval
    tape: Tape = field(init=False)
    some_tape: Tape = field(init=False)
    memory_s: float = field(init=False)

    def __post_init__(self) -> None:
        t_s = self.attitudes.epochs.t_s
        block = ((t_s[:-1] - t_s[0]) / _BLOCK_S + 1e-6).astype(np.int64)
        object.__setattr__(self, "block", block)
        object.__setattr__(self, "tape", tape(len(t_s)))
        object.__setattr__(self, "some_tape", tape(len(self.rows)))
        record_s = min(self.attitudes.record_s, LONGEST_S)
        object.__setattr__(self, "memory_s", _MEMORY * record_s)

    def variances(self, scales: FloatArray) -> FloatArray:
        """Return the variance of each interval, (n - 1, 3)."""
        return np.asarray(np.exp(2 * scales[self.block]))

    def point(
        self, x: FloatArray, scales: FloatArray, walk_sigma: float = _WALK_SIGMAS[_USUAL_WALK]
    ) -> _Point:
        """Return a point with its density and the score of its scales."""
        x = x.copy()
        x[SIGMA] = scales.mean(axis=0)
        variance = self.variances(scales)
        of_intervals = np.tile(poles(x), (len(variance), 1, 1))
        value = float(self.attitudes.log_densities(of_intervals, variance, self.tape).sum())
        slope, freedom, _ = score(
            self.attitudes.epochs.t_s, of_intervals, variance, self.tape, False
        )
        return _Point(
            x,
            scales,
            walk_sigma,
            value + log_prior(x, self.memory_s)[0],
            self._of_blocks(slope),
            self._of_blocks(freedom),
        )

    def _of_blocks(self, values: FloatArray) -> FloatArray:
        """Return sums, (blocks, 3), of what intervals have, (n - 1, 3)."""
        columns = [np.bincount(self.block, weights=column) for column in values.T]
        return np.stack(columns, axis=1)

    def maximum_from(self, here: _Point) -> _Point:
        """Return where scales, and shapes with levels, in turn lead to."""
        best = self.climbed(here)
        for _ in range(_ROUNDS):
            before, best = best.value, self.climbed(self.with_shapes(best))
            if best.value - before < _LEVEL_GAIN:
                break
        return best

    def climbed(self, here: _Point, least: float = _LEVEL_GAIN) -> _Point:
        """Return where steps of scales uphill end: where the next gains less evidence."""
        for _ in range(_STEPS):
            steps = self._steps(here)
            trials = (
                self.point(here.x, _bounded(here.scales + 0.5**i * steps), here.walk_sigma)
                for i in range(_HALVINGS)
            )
            best = next((point for point in trials if point.value > here.value), here)
            gained, here = best.value - here.value, best
            if gained < least:
                break
        return here

    def with_shapes(self, here: _Point) -> _Point:
        """Return the likeliest shapes and levels of scales that vary as they do."""
        deviation = (here.scales - here.x[SIGMA])[self.block[self.rows[:-1]]]
        x = climbed(
            lambda x: log_posterior(self.some, x, self.some_tape, self.memory_s, deviation),
            here.x,
            *self.limits,
        )
        best = self.point(x, _bounded(here.scales + (x[SIGMA] - here.x[SIGMA])), here.walk_sigma)
        return best if best.value > here.value else here

    def with_walk(self, here: _Point) -> _Point:
        """Return the likeliest end for any step of the walk, from that of the usual one."""
        best, evidence = here, self.evidence(here)
        for towards in (1, -1):
            i = _USUAL_WALK + towards
            while 0 <= i < len(_WALK_SIGMAS):
                other = self.climbed(best._replace(walk_sigma=_WALK_SIGMAS[i]))
                of_other = self.evidence(other)
                if of_other < evidence:
                    break
                best, evidence, i = other, of_other, i + towards
            if best is not here:
                break
        return self.climbed(self.with_shapes(best), _LAST_GAIN)

    def evidence(self, at: _Point) -> float:
        """Return the log evidence of shapes and levels, scales about these integrated (Laplace)."""
        total = at.value
        for freedom in at.freedom.T:
            precision = _precision(freedom, at.walk_sigma)
            roots = np.log(cholesky_banded(precision, lower=True)[0]).sum()
            level = np.log(2 * freedom.sum() + _RIDGE) / 2
            total += level - roots - (len(freedom) - 1) * np.log(at.walk_sigma)
        return float(total)

    def _steps(self, at: _Point) -> FloatArray:
        """Return Fisher's scoring steps of scales, (blocks, 3)."""
        slope = at.slope + log_prior(at.x, self.memory_s)[1][SIGMA] / len(at.slope)
        walk = np.diff(at.scales, axis=0) / at.walk_sigma**2
        slope[1:] -= walk
        slope[:-1] += walk
        steps = [
            solveh_banded(_precision(freedom, at.walk_sigma), of_axis, lower=True)
            for freedom, of_axis in zip(at.freedom.T, slope.T, strict=True)
        ]
        return np.asarray(np.clip(np.stack(steps, axis=1), -_MOST_STEP, _MOST_STEP))


def _bounded(scales: FloatArray) -> FloatArray:
    return np.asarray(np.clip(scales, np.log(LEAST_RADPS), np.log(MOST_RADPS)))


def _precision(freedom: FloatArray, walk_sigma: float) -> FloatArray:
    """Return the precision of one axis' scales, lower banded, (2, blocks)."""
    n = len(freedom)
    out = np.zeros((2, n))
    out[0] = 2 * freedom + _RIDGE
    out[0, 1:] += 1 / walk_sigma**2
    out[0, :-1] += 1 / walk_sigma**2
    out[1, :-1] = -1 / walk_sigma**2
    return out
