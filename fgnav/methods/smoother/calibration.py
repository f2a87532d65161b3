"""How much of the stated covariance a flight's own motion deserves, without a gyroscope.

A covariance has two parts: noise let through, and motion smoothed away. The second holds for a rate
that is a random walk; a swing or a steady turn is smoother, and loses far less than that. How much
it does lose shows where the same flight is smoothed with other intensities of angular acceleration:
two solutions differ by noise, which is known, and by what the one smoothed away more.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.methods.smoother.ahead import array_attitudes
from fgnav.methods.smoother.chain import STATE, Chain
from fgnav.methods.smoother.gaps import BridgingPreintegrator
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.linear import Block, blocks_of, eliminated, stepped
from fgnav.methods.smoother.motion_lost import HERE, PLACES, RATIO, USUAL, Levels
from fgnav.methods.smoother.solution import Solution

_MOST, _BLOCK = 600, 300  # keyframes to look at; of a longer flight, blocks spread evenly
_STEPS = 5  # of Newton, at most, from where attitudes start
# RMS of a next step: differences of smoothers are then told as from the minimum, to a percent.
_NEAR_SIGMAS = 0.2
_EDGE = 15  # keyframes at a block's ends are known worse than within
_FEWEST = 25  # keyframes within that tell anything
_TURNING = np.array([0, 1, 2, 12, 13, 14])  # rotation and rate: what the intensity rules
_VELOCITY = slice(6, 9)  # which specific forces turned wrongly move
_ROUNDING = 1e-12  # of variances: less is not told from nothing


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Calibrated:
    """A solution, and what its covariances are to be multiplied by.

    Attributes
    ----------
    keyframes : Keyframes
        With the intensity of angular acceleration that was used.
    solution : Solution
    told : ndarray, shape (15, 15)
        What is to stand between the roots ``L`` and ``L'`` of a usual keyframe's covariance,
        velocity in body axes; the identity where nothing speaks against the model.
    usual : ndarray, shape (3,)
        Median variances of rotation as solved.
    """

    keyframes: Keyframes
    solution: Solution
    told: FloatArray
    usual: FloatArray

    @property
    def notes(self) -> tuple[str, ...]:
        """What was found, in a sentence."""
        if (self.told == np.eye(STATE)).all():
            return ()
        factors = ", ".join(f"{value:.2f}" for value in np.diag(self.told)[:3])
        return (
            f"Variances of rotation about the body axes: {factors} times those of a rate that is a "
            "random walk, as the flight itself says.",
        )

    def believed(self, solution: Solution) -> Solution:
        """Return a solution of the flight with covariances as they are to be believed."""
        turn = _to_body(solution.R_nb)
        covariance = turn @ solution.covariance @ turn.swapaxes(1, 2)
        variance = np.einsum("nii->ni", covariance)
        # What is known far worse than usual, as in a gap, keeps the rest of its variance.
        room = USUAL * self.usual / variance[:, :3].clip(np.finfo(float).tiny)
        share = room.min(axis=1).clip(None, 1.0)[:, None, None]
        between = np.eye(STATE) + share * (self.told - np.eye(STATE))
        try:
            root = np.linalg.cholesky(covariance + _ROUNDING * variance[:, None] * np.eye(STATE))
        except np.linalg.LinAlgError:  # of what is hardly known, rounding leaves no root
            return solution
        root = turn.swapaxes(1, 2) @ root
        return replace(solution, covariance=root @ between @ root.swapaxes(1, 2))


def calibrated(keyframes: Keyframes, solve: Callable[[Keyframes], Solution]) -> Calibrated:
    """Solve, and hold the covariance against the flight.

    With a gyroscope nothing is changed: its noise is stated.

    What a random walk would lose, ``P'``, is lost to some share k, see ``motion_lost``: the
    covariance is ``P - (1 - k) P'``. The flight tells its intensity to some standard deviation
    only: by so much of its logarithm the solution may be off along ``dx/dlnS``, the square of which
    is added [1]_. Both are means over the flight, relative to the root of each covariance: what the
    intensity does to velocities and biases goes with rotations, in their directions.

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
    .. [1] Kass, Steffey: Approximate Bayesian inference in conditionally independent hierarchical
       models, J. Am. Stat. Assoc. 84, 1989.
    """
    here, lower = _told(keyframes)
    if lower is not None:
        third = with_intensity(keyframes, RATIO**-HERE)
        found = solve(third)
        if found.converged:
            return Calibrated(keyframes=third, solution=found, told=lower.told, usual=lower.usual)
    found = solve(keyframes)
    if here is None or not found.converged:
        here = _Told(np.eye(STATE), np.ones(3))
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


class _Told(NamedTuple):
    """What blocks of a flight tell; see ``Calibrated``."""

    told: FloatArray
    usual: FloatArray

    @classmethod
    def by(cls, levels: Levels) -> "_Told":
        (share, doubt), row = levels.share(), levels.usual
        white = np.linalg.inv(np.linalg.cholesky(levels.covariance[HERE, row]))
        moved = np.einsum("kij,kj->ki", white, levels.step_slope()[row])
        told = np.eye(STATE)
        told -= (1 - share) * (white @ levels.slope()[row] @ white.swapaxes(1, 2)).mean(axis=0)
        # An intensity told by few epochs: without this a drawn walk's attitudes have NEES 3.17.
        told += doubt * moved.T @ moved / len(moved)
        return cls(told, np.median(np.einsum("kii->ki", levels.covariance[HERE])[:, :3], axis=0))


class _Level(NamedTuple):
    """The linear smoother of one intensity, (k, 15) and (k, 15, 15), velocities in body axes."""

    step: FloatArray
    covariance: FloatArray


def _told(keyframes: Keyframes) -> tuple[_Told | None, _Told | None]:
    """Return what is told at the flight's intensity, and at a third where that is better.

    None where there is nothing to be told.
    """
    known: dict[int, _Level] = {}

    def around(place: int) -> Levels:
        places = [place + int(at) for at in PLACES]
        for at in places:
            if at not in known:
                known[at] = _level(blocks, [eliminated(block, RATIO**at) for block in blocks])
        chosen = [known[at] for at in places]
        return Levels(
            step=np.array([one.step for one in chosen]),
            covariance=np.array([one.covariance for one in chosen]),
        )

    try:
        blocks, known[0] = _settled(keyframes)
        here = around(0)
        return _Told.by(here), _Told.by(around(-HERE)) if here.too_loose else None
    except (NoSolutionError, np.linalg.LinAlgError):
        # A block may leave open what the whole flight determines, or all but rounding.
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
    chains = [eliminated(block, 1.0) for block in blocks]
    for _ in range(_STEPS):
        blocks = [stepped(*pair) for pair in zip(blocks, chains, strict=True)]
        chains = [eliminated(block, 1.0) for block in blocks]
        here = _level(blocks, chains)
        variance = np.einsum("kii->ki", here.covariance)[:, _TURNING]
        if (here.step[:, _TURNING] ** 2 / variance).mean() < _NEAR_SIGMAS**2:
            return blocks, here
    raise NoSolutionError("intensity: rotations do not settle")


def _level(blocks: list[Block], chains: list[Chain]) -> _Level:
    pairs = zip(blocks, chains, strict=True)
    steps, covariances = zip(*(_solved(*pair) for pair in pairs), strict=True)
    return _Level(np.concatenate(steps), np.concatenate(covariances))


def _solved(block: Block, chain: Chain) -> tuple[FloatArray, FloatArray]:
    """Return steps and covariances of a block's inner keyframes."""
    last = len(block.rows) - 1
    inner = slice(_EDGE, last + 1 - _EDGE)
    step, turn = chain.step(0, last)[0][inner, :STATE], _to_body(block.states.R_nb[inner])
    covariance = chain.marginals(0, last).covariance[inner]
    return np.einsum("kij,kj->ki", turn, step), turn @ covariance @ turn.swapaxes(1, 2)


def _to_body(R_nb: FloatArray) -> FloatArray:
    """Return what turns velocities of states to body axes, (n, 15, 15).

    Specific forces turned wrongly about one body axis move velocity along the other two.
    """
    turn = np.tile(np.eye(STATE), (len(R_nb), 1, 1))
    turn[:, _VELOCITY, _VELOCITY] = R_nb.swapaxes(1, 2)
    return turn
