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
from fgnav.process import matern
from fgnav.process.attitude_series import AttitudeSeries, attitude_series, spread
from fgnav.process.evidence_kernel import Tape, tape
from fgnav.process.hyperparameters import (
    DEFAULT_LENGTH_S,
    DEFAULT_SIGMA_RADPS,
    LEAST_RADPS,
    MOST_RADPS,
    VERY_STRONG_NATS,
    RatePrior,
    bounds,
    likeliest,
    log_prior,
)
from fgnav.process.score_kernel import score

_BLOCK_S = 0.5
# 1-sigma of the walk's steps. Evidence of a coast, a tumble, a glider, a rocket and a ramp, three
# flights each: nats gained 499, 494, 456 and 362 with .35, .5, .7 and 1.
_WALK_SIGMA = 0.5
# Searches start with scales too large: towards too small ones attitudes are lost, and no slope is.
_FROM_ABOVE = 1.5
_MOST_STEP = 1.0  # of logarithms at once
_LEVEL_NATS, _LAST_NATS = 1.0, 0.1  # less gained by a step ends a search, and the last
_STEPS, _HALVINGS, _ROUNDS = 20, 4, 10
_RIDGE = 1e-6  # of the precision, where attitudes tell nothing of an axis


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class VaryingRatePrior:
    """A Matern-5/2 prior of the rate whose noise has another scale in each interval.

    Attributes
    ----------
    length_s : ndarray, shape (3,)
        About the body axes.
    variance_rad2ps2 : ndarray, shape (n - 1, 3)
        Of each interval between attitudes, about the body axes.
    gained_nats : float
        Log evidence beyond that of constant variances.
    """

    length_s: FloatArray
    variance_rad2ps2: FloatArray
    gained_nats: float


def varying_rate_prior(
    t_s: FloatArray,
    R_nb: FloatArray,
    covariance_rad2: FloatArray,
    constant: RatePrior,
    swinging: RatePrior | None = None,
) -> VaryingRatePrior | None:
    """Return the likeliest prior of varying scale, or None where constant variances will do.

    Where a swing explains more than a scale that varies, it will do, too.

    Parameters
    ----------
    t_s, R_nb, covariance_rad2 : ndarray, shape (n,), (n, 3, 3), (n, 3, 3)
        As in ``rate_prior``.
    constant : RatePrior
        What ``matern_prior`` has identified from them.
    swinging : RatePrior, optional
        What ``swinging_prior`` has.
    """
    n = len(t_s)
    rows = spread(n)
    attitudes, some = (
        attitude_series(t_s, R_nb, covariance_rad2, of, past=n) for of in (np.arange(n), rows)
    )
    search = _Search(attitudes, some, rows)
    log_sigma = np.log(constant.variance_rad2ps2) / 2
    scales = np.tile(log_sigma, (search.block[-1] + 1, 1))
    still = search.point(np.log(constant.length_s), scales)
    # A constant scale may take what is fast for wrong attitudes, and be small.
    above = _FROM_ABOVE + np.maximum(
        scales, np.log(attitudes.turn_deviations()[1].clip(LEAST_RADPS))
    )
    # From long memories and from short ones: each may lead to a lesser maximum.
    lengths = (still.log_length, np.full(3, np.log(DEFAULT_LENGTH_S)))
    ends = [search.maximum_from(search.point(one, _bounded(above))) for one in lengths]
    best = search.climbed(max(ends, key=lambda one: one.value), _LAST_NATS)
    gained = best.value - still.value + search.log_volume(best)
    if gained < max(VERY_STRONG_NATS, _gained(attitudes, constant, swinging)):
        return None
    return VaryingRatePrior(
        length_s=np.exp(best.log_length),
        variance_rad2ps2=search.variances(best.scales),
        gained_nats=gained,
    )


def _gained(attitudes: AttitudeSeries, constant: RatePrior, other: RatePrior | None) -> float:
    """Return the nats by which attitudes are likelier under another constant prior, if any."""
    if other is None:
        return 0.0
    own, usual = (
        float(attitudes.log_densities(prior.poles_per_s, prior.variance_rad2ps2).sum())
        for prior in (other, constant)
    )
    return own - usual


class _Point(NamedTuple):
    """Where a search stands: log lengths (3,), log scales (blocks, 3), log posterior density."""

    log_length: FloatArray
    scales: FloatArray
    value: float


@dataclass(frozen=True, eq=False, slots=True)
class _Search:
    """Posterior density of scales and lengths, and steps uphill."""

    attitudes: AttitudeSeries
    some: AttitudeSeries  # of a longer flight, by which lengths and levels are found
    rows: IntArray  # which these are
    block: IntArray = field(init=False)  # (n - 1,), of each interval
    tape: Tape = field(init=False)

    def __post_init__(self) -> None:
        t_s = self.attitudes.epochs.t_s
        block = ((t_s[:-1] - t_s[0]) / _BLOCK_S + 1e-6).astype(np.int64)
        object.__setattr__(self, "block", block)
        object.__setattr__(self, "tape", tape(len(t_s)))

    def variances(self, scales: FloatArray) -> FloatArray:
        """Return the variance of each interval, (n - 1, 3)."""
        return np.asarray(np.exp(2 * scales[self.block]))

    def point(self, log_length: FloatArray, scales: FloatArray) -> _Point:
        """Return a point with its density; the tape is that of the last one."""
        value = self.attitudes.log_densities(
            matern.poles(np.exp(log_length)), self.variances(scales), self.tape
        ).sum()
        level = log_prior(log_length, scales.mean(axis=0))
        walk = (np.diff(scales, axis=0) ** 2).sum() / (2 * _WALK_SIGMA**2)
        return _Point(log_length, scales, float(value) + level - float(walk))

    def maximum_from(self, here: _Point) -> _Point:
        """Return where scales, and lengths with levels, in turn lead to."""
        best = self.climbed(here)
        for _ in range(_ROUNDS):
            before, best = best.value, self.climbed(self.with_lengths(best))
            if best.value - before < _LEVEL_NATS:
                break
        return best

    def climbed(self, here: _Point, least: float = _LEVEL_NATS) -> _Point:
        """Return where steps of scales uphill end: where the next gains less than some nats."""
        for _ in range(_STEPS):
            steps = self._steps(here)
            trials = (
                self.point(here.log_length, _bounded(here.scales + 0.5**i * steps))
                for i in range(_HALVINGS)
            )
            best = next((point for point in trials if point.value > here.value), here)
            gained, here = best.value - here.value, best
            if gained < least:
                break
        return here

    def with_lengths(self, here: _Point) -> _Point:
        """Return the likeliest lengths and levels of scales that vary as they do."""
        level, block = here.scales.mean(axis=0), self.block[self.rows[:-1]]

        def moved(x: FloatArray) -> FloatArray:
            return _bounded(here.scales + (x[3:] - level))

        def value(x: FloatArray) -> float:
            variance = np.exp(2 * moved(x)[block])
            of_some = self.some.log_densities(matern.poles(np.exp(x[:3])), variance)
            return float(of_some.sum()) + log_prior(x[:3], x[3:])

        x = likeliest(value, np.concatenate([here.log_length, level]), *bounds())
        best = self.point(x[:3], moved(x))
        return best if best.value > here.value else here

    def log_volume(self, at: _Point) -> float:
        """Return the log of posterior over prior volume of scales about their level (Laplace)."""
        _, freedom = self._score(at)
        total = 0.0
        for axis in range(3):
            precision = _precision(freedom[:, axis])
            roots = np.log(cholesky_banded(precision, lower=True)[0]).sum()
            level = np.log(2 * freedom[:, axis].sum() + _RIDGE) / 2
            total += level - roots - (len(freedom) - 1) * np.log(_WALK_SIGMA)
        return float(total)

    def _score(self, at: _Point) -> tuple[FloatArray, FloatArray]:
        """Return the score of scales, and the freedom that attitudes tell of them, (blocks, 3)."""
        variance = self.variances(at.scales)
        poles = np.tile(matern.poles(np.exp(at.log_length)), (len(variance), 1, 1))
        self.attitudes.log_densities(poles, variance, self.tape)
        parts = score(self.attitudes.epochs.t_s, poles, variance, self.tape)
        out = [np.zeros_like(at.scales) for _ in parts]
        for into, part in zip(out, parts, strict=True):
            np.add.at(into, self.block, part)
        return out[0], out[1]

    def _steps(self, at: _Point) -> FloatArray:
        """Return Fisher's scoring steps of scales, (blocks, 3)."""
        slope, freedom = self._score(at)
        sigma_radps = np.exp(at.scales.mean(axis=0))
        slope += (1 - sigma_radps / DEFAULT_SIGMA_RADPS) / len(slope)  # of log_prior
        walk = np.diff(at.scales, axis=0) / _WALK_SIGMA**2
        slope[1:] -= walk
        slope[:-1] += walk
        steps = [
            solveh_banded(_precision(freedom[:, axis]), slope[:, axis], lower=True)
            for axis in range(3)
        ]
        return np.asarray(np.clip(np.stack(steps, axis=1), -_MOST_STEP, _MOST_STEP))


def _bounded(scales: FloatArray) -> FloatArray:
    return np.asarray(np.clip(scales, np.log(LEAST_RADPS), np.log(MOST_RADPS)))


def _precision(freedom: FloatArray) -> FloatArray:
    """Return the precision of one axis' scales, lower banded, (2, blocks)."""
    n = len(freedom)
    out = np.zeros((2, n))
    out[0] = 2 * freedom + _RIDGE
    out[0, 1:] += 1 / _WALK_SIGMA**2
    out[0, :-1] += 1 / _WALK_SIGMA**2
    out[1, :-1] = -1 / _WALK_SIGMA**2
    return out
