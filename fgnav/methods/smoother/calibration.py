"""How much of the stated covariance a flight's own motion deserves, without a gyroscope.

A covariance has two parts: noise let through, and motion smoothed away. The second holds for a rate
that is a random walk; a swing or a steady turn is smoother, and loses far less than that. How much
it does lose shows where the same flight is smoothed with three times the intensity of angular
acceleration: the two solutions differ by noise, which is known, and by what the first smoothed
away.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.methods.smoother.ahead import array_attitudes
from fgnav.methods.smoother.chain import STATE
from fgnav.methods.smoother.gaps import BridgingPreintegrator
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.linear import Block, blocks_of, eliminated, stepped
from fgnav.methods.smoother.solution import Solution

_RATIO = 3.0  # of intensities that are compared
_MOST, _BLOCK = 600, 300  # keyframes to look at; of a longer flight, blocks spread evenly
_STEPS = 5  # of Newton, at most, from where attitudes start
# RMS of a next step: differences of smoothers are then told as from the minimum, to a percent.
_NEAR_SIGMAS = 0.2
_EDGE = 15  # keyframes at a block's ends are known worse than within
_FEWEST = 25  # keyframes within that tell anything
_USUAL = 4.0  # times the median variance: beyond, a keyframe is in a gap
_PARTS = 8  # of the keyframes, for how well their mean is known
_DOUBT = 2.0  # 1-sigma of the walk's share before the flight says anything, about 1
_LARGEST = 4.0  # times as much as the model says
_TURNING = np.array([0, 1, 2, 12, 13, 14])  # rotation and rate: what the intensity rules
_VELOCITY = slice(6, 9)  # which specific forces turned wrongly move
_RULED = np.array([0, 1, 2, 6, 7, 8, 12, 13, 14])
_CLEARLY = 0.25  # of the noise that a lower intensity saves: less is lost by it


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Calibrated:
    """A solution, and what its variances are to be multiplied by.

    Attributes
    ----------
    keyframes : Keyframes
        With the intensity of angular acceleration that was used.
    solution : Solution
    told : ndarray, shape (15,)
        Of the variance of each part of a usual state, velocity in body axes; 1 where nothing speaks
        against the model.
    usual : ndarray, shape (15,)
        Median variances as solved, velocity in body axes.
    """

    keyframes: Keyframes
    solution: Solution
    told: FloatArray
    usual: FloatArray

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found, in a sentence."""
        if (self.told == 1).all():
            return ()
        factors = ", ".join(f"{value:.2f}" for value in self.told[:3])
        return (
            f"Variances of rotation about the body axes: {factors} times those of a rate that is a "
            "random walk, as the flight itself says.",
        )

    def believed(self, solution: Solution) -> Solution:
        """Return a solution of the flight with covariances as they are to be believed."""
        R_nb, covariance = solution.R_nb, solution.covariance
        variance = _variances(R_nb, covariance[:, :STATE, :STATE])
        # What is known far worse than usual, as in a gap, keeps the rest of its variance.
        usual = (_USUAL * self.usual / variance.clip(np.finfo(float).tiny)).clip(None, 1.0)
        root = np.sqrt(np.where(self.told < 1, 1 - (1 - self.told) * usual, self.told))
        of_velocity = (R_nb * root[:, None, _VELOCITY]) @ R_nb.swapaxes(1, 2)
        root[:, _VELOCITY] = 1.0
        covariance = covariance * root[:, :, None] * root[:, None, :]
        covariance[:, _VELOCITY] = of_velocity @ covariance[:, _VELOCITY]
        covariance[:, :, _VELOCITY] = covariance[:, :, _VELOCITY] @ of_velocity
        return replace(solution, covariance=covariance)


def calibrated(keyframes: Keyframes, solve: Callable[[Keyframes], Solution]) -> Calibrated:
    """Solve, and hold the covariance of rotations, rates and velocities against the flight.

    With a gyroscope nothing is changed: its noise is stated.

    For linear smoothers ``x(S)`` of intensity S and covariance ``P(S)``: with ``P' = dP/dlnS``, the
    noise in x(S) has the covariance ``P - P'``, the motion smoothed away ``P'`` if the rate is a
    random walk of intensity S. Noise in ``x(S)`` and ``x(cS)`` has the common covariance
    ``(c P(S) - P(cS)) / (c - 1)``, since the two informations differ by a multiple of one matrix.
    So the mean square of ``x(cS) - x(S)`` has a known part of noise, and a part of the motion,
    ``P(cS) - (1 - 1/c) P'(cS) - P(S)`` less that of noise, if it is a random walk. The share that
    is found instead, k, makes the variance ``P - (1 - k) P'``. It may be above 1. The flight tells
    k to some standard deviation only, and its intensity no better: by so much of its logarithm the
    solution may be off along ``dx/dlnS``, the square of which is added [2]_.

    Where the difference to a third of the intensity shows that next to nothing would be lost by it,
    the flight is solved with that: epochs a second apart tell the intensity badly. All this is told
    before the flight is solved, from blocks of it alone.

    Parameters
    ----------
    keyframes : Keyframes
    solve : callable
        From keyframes to their solution.

    References
    ----------
    .. [1] Bias and variance of a linear smoother whose motion is not the model's: Wahba, Bayesian
       "confidence intervals" for the cross-validated smoothing spline, JRSS B 45, 1983.
    .. [2] Kass, Steffey: Approximate Bayesian inference in conditionally independent hierarchical
       models, J. Am. Stat. Assoc. 84, 1989.
    """
    here, lower = _spreads(keyframes)
    if lower is not None:
        third = with_intensity(keyframes, 1 / _RATIO)
        found = solve(third)
        if found.converged:
            return Calibrated(keyframes=third, solution=found, told=lower.told, usual=lower.usual)
    found = solve(keyframes)
    if here is None or not found.converged:
        return Calibrated(
            keyframes=keyframes, solution=found, told=np.ones(STATE), usual=np.ones(STATE)
        )
    return Calibrated(keyframes=keyframes, solution=found, told=here.told, usual=here.usual)


def with_intensity(keyframes: Keyframes, factor: FloatArray | float) -> Keyframes:
    """Return keyframes with so many times the intensity; gaps keep what they were given."""
    pre = keyframes.preintegrate
    usual = pre.angular_acceleration_density
    made = replace(pre, angular_acceleration_density=factor * usual)
    if isinstance(pre, BridgingPreintegrator) and isinstance(made, BridgingPreintegrator):
        own = (pre.density != usual).any(axis=1, keepdims=True)
        made = replace(made, density=np.where(own, 1.0, factor) * pre.density)
    return replace(keyframes, preintegrate=made)


class _Level(NamedTuple):
    """The linear smoother of one intensity, (k, 15) each."""

    step: FloatArray
    variance: FloatArray


@dataclass(frozen=True, eq=False, slots=True)
class _Spread:
    """Linear smoothers of three intensities: a third of one, that, and three times it."""

    low: _Level
    here: _Level
    high: _Level

    @property
    def slopes(self) -> tuple[FloatArray, ...]:
        """``P'`` of each, by the parabola through logarithms of intensity and variance."""
        a, b, c = (np.log(level.variance) for level in (self.low, self.here, self.high))
        twice = (4 * b - 3 * a - c, c - a, 3 * c - 4 * b + a)
        levels = zip(twice, (self.low, self.here, self.high), strict=True)
        apart = 2 * np.log(_RATIO)
        return tuple(slope.clip(0) / apart * level.variance for slope, level in levels)

    @property
    def too_loose(self) -> bool:
        """Whether a third of the intensity would clearly lose less than the noise it saves."""
        slope, slope_here, _ = self.slopes
        P, P_here = self.low.variance, self.here.variance
        noise = _noise_apart(P, slope, P_here, slope_here)
        lost = ((self.here.step - self.low.step) ** 2 - noise) / P_here
        saved = ((P_here - slope_here) - (P - slope)) / P_here
        # A smooth motion loses by the square of one over the intensity: that at a third, less that
        # here, is twice the square of the difference.
        return bool(2 * lost[:, :3].mean() < _CLEARLY * saved[:, :3].mean())

    @property
    def usual(self) -> FloatArray:
        """Median variance of each state, (15,)."""
        return np.asarray(np.median(self.here.variance, axis=0))

    @property
    def told(self) -> FloatArray:
        """Return what the variances of a usual keyframe are to be multiplied by, (15,)."""
        _, slope, slope_high = self.slopes
        P, P_high = self.here.variance, self.high.variance
        noise = _noise_apart(P, slope, P_high, slope_high)
        walk = P_high - (1 - 1 / _RATIO) * slope_high - P - noise
        apart = (self.high.step - self.here.step) ** 2
        moved = apart - noise
        told = np.ones(STATE)
        for i in _RULED:
            usual = P[:, i] < _USUAL * self.usual[i]
            share, doubt = _share(*(part[usual, i] / P[usual, i] for part in (moved, walk)))
            told[i] = 1 - (slope[usual, i] / P[usual, i]).mean() * (1 - share)
            # An intensity told by few epochs: without this a drawn walk's attitudes have NEES 3.17.
            told[i] += (doubt / np.log(_RATIO)) ** 2 * (apart[usual, i] / P[usual, i]).mean()
        return told


def _noise_apart(
    P: FloatArray, slope: FloatArray, P_high: FloatArray, slope_high: FloatArray
) -> FloatArray:
    """Return the variance of noise in the difference of two smoothers, intensities 1 to 3."""
    common = (_RATIO * P - P_high) / (_RATIO - 1)
    return (P - slope) + (P_high - slope_high) - 2 * common


def _share(moved: FloatArray, walk: FloatArray) -> tuple[float, float]:
    """Return how much of what a random walk would lose was lost, and how well that is told.

    Of (k,) each; near 1 if unsure.
    """
    if not walk.mean() > 0:
        return 1.0, 0.0
    share = moved.mean() / walk.mean()
    parts = [part.mean() for part in np.array_split(moved, _PARTS)]
    doubt = np.std(parts, ddof=1) / np.sqrt(_PARTS) / walk.mean()
    trust = _DOUBT**2 / (_DOUBT**2 + doubt**2)
    return float(np.clip(1 + trust * (share - 1), 0.0, _LARGEST)), float(np.sqrt(trust) * doubt)


def _spreads(keyframes: Keyframes) -> tuple[_Spread | None, _Spread | None]:
    """Return linear smoothers about the flight's intensity, and about a third where that is better.

    None where there is nothing to be told.
    """
    try:
        blocks, level = _settled(keyframes)
        low, high = (_level(blocks, factor) for factor in (1 / _RATIO, _RATIO))
        here = _Spread(low, level, high)
        if not here.too_loose:
            return here, None
        return here, _Spread(_level(blocks, _RATIO**-2), low, level)
    except NoSolutionError:  # a block may leave open what the whole flight determines
        return None, None


def _settled(keyframes: Keyframes) -> tuple[list[Block], _Level]:
    """Return blocks linearised next to their minimum, and their level of the flight's intensity.

    Raises
    ------
    NoSolutionError
        Where they tell nothing.
    """
    n = len(keyframes.t_s)
    stated = keyframes.preintegrate.imu.w_b_radps is not None
    if stated or n < _FEWEST + 2 * _EDGE or array_attitudes(keyframes) is None:
        raise NoSolutionError("intensity: nothing to be told")
    firsts, length = [0], n
    if n > _MOST:
        firsts = [int(first) for first in np.linspace(0, n - _BLOCK, _MOST // _BLOCK)]
        length = _BLOCK
    blocks = list(blocks_of(keyframes, firsts, length))
    for _ in range(_STEPS):
        blocks = [stepped(block) for block in blocks]
        here = _level(blocks, 1.0)
        left = here.step[:, _TURNING] ** 2 / here.variance[:, _TURNING]
        if left.mean() < _NEAR_SIGMAS**2:
            return blocks, here
    raise NoSolutionError("intensity: rotations do not settle")


def _level(blocks: list[Block], factor: float) -> _Level:
    steps, variances = zip(*(_solved(block, factor) for block in blocks), strict=True)
    return _Level(np.concatenate(steps), np.concatenate(variances))


def _solved(block: Block, factor: float) -> tuple[FloatArray, FloatArray]:
    """Return steps and variances of a block's inner keyframes, (k, 15) each."""
    chain, last = eliminated(block, factor), len(block.rows) - 1
    step, _ = chain.step(0, last)
    covariance = chain.marginals(0, last).covariance[:, :STATE, :STATE]
    inner = slice(_EDGE, last + 1 - _EDGE)
    R_nb, step = block.states.R_nb[inner], step[inner, :STATE]
    step[:, _VELOCITY] = np.einsum("nji,nj->ni", R_nb, step[:, _VELOCITY])
    return step, _variances(R_nb, covariance[inner])


def _variances(R_nb: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return variances of states, (n, 15), those of velocity along the body axes.

    Specific forces turned wrongly about one body axis move velocity along the other two.
    """
    variance: FloatArray = np.einsum("nii->ni", covariance).copy()
    own = covariance[:, _VELOCITY, _VELOCITY]
    variance[:, _VELOCITY] = np.einsum("nji,nji->ni", R_nb, own @ R_nb)
    return variance
