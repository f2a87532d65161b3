"""The inertial unit's noise beside the phases of arcs, which place an antenna to millimetres.

The chain on which noise is identified has no arcs. Whether the unit is louder than stated shows
best beside them: of the whole problem's minimum the score of each noise is

    dL/dtheta = r' C r - tr(C M)        exp(2 theta) = r' C r / tr(C M)  where that is zero [1]_

with r, M, C of the motion's rows as in ``likelihood.linear_chain``.

References
----------
.. [1] Foerstner, Ein Verfahren zur Schaetzung von Varianz- und Kovarianzkomponenten, 1979.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.graph.innovation.band import TOLERATED
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.linear_chain import motion_score
from fgnav.identification.noise.begin import ABOVE, WHITE
from fgnav.identification.tested_constants import SIGMAS
from fgnav.identification.track.windows import EXCLUDED, FALSE_ALARM
from fgnav.solve.chain import solve_batch

_ROUNDS = 20  # of noise at states, and states at noise
_MOST_STEP = 1.2  # of theta, as of ``search``
_SETTLED = 0.03  # of theta: 3 % of a standard deviation, as there
_NODES = 5  # of the integral of tr(C M), smooth and between none and all of the rows


class WhiteNoise(NamedTuple):
    """Factors on the unit's white noises, 1-sigma of the logarithm of each, and what they gain."""

    factors: dict[str, float]
    sigmas: dict[str, float]
    nats: float = 0.0


_AS_STATED = WhiteNoise({}, {})


def white_noise(
    problem: SmoothingProblem,
    changed: Callable[[dict[str, float]], SmoothingProblem],
    found: "Scored | None" = None,
) -> WhiteNoise:
    """Return factors on the unit's white noises that phases contradict, by the usual odds.

    Parameters
    ----------
    problem : SmoothingProblem
        With phases.
    changed : callable
        From factors to the problem with these.
    found : Scored, optional
        At its minimum, if that is known.
    """
    found = found or _scored(problem)
    if found is None:
        return _AS_STATED
    if not (found.is_beyond(found.theta).any() or is_misfit(problem, found.cost)):
        return _AS_STATED
    stated = found
    likeliest = _likeliest(stated, changed)
    if likeliest is None:
        return _AS_STATED
    theta, found = likeliest
    used = np.flatnonzero(found.is_beyond(theta))
    factors = {found.names[i]: float(np.exp(theta[i])) for i in used}
    # Of a few keyframes a likelihood may be flat below a minimum that is sharp: sigma is none.
    # What is left of all is of a free variance factor, as in ``profile_likelihood``.
    beyond = max(found.cost / measured_rows(problem), 1.0)
    nats = noise_gain(factors, changed, stated)
    if nats <= EXCLUDED * beyond:
        return _AS_STATED
    return WhiteNoise(factors, {found.names[i]: float(found.sigma[i]) for i in used}, nats)


def noise_in_motion(
    stated: "Scored", changed: Callable[[dict[str, float]], SmoothingProblem]
) -> WhiteNoise:
    """Return the likeliest factors on white noises in motion, without sigmas, and what they gain.

    Of a flight that rests: what is stated of its unit is so at rest, and vibration is no fault.
    Asked for no odds.

    Parameters
    ----------
    stated : Scored
        At the minimum with noises as stated.
    changed : callable
        From factors in motion to the problem with these, at rest as stated.
    """
    likeliest = _likeliest(stated, changed)
    if likeliest is None:
        return _AS_STATED
    factors = _factors(stated.names, likeliest[0])
    return WhiteNoise(factors, {}, noise_gain(factors, changed, stated))


def _likeliest(
    stated: "Scored", changed: Callable[[dict[str, float]], SmoothingProblem]
) -> tuple[FloatArray, "Scored"] | None:
    """Return the likeliest logarithms of factors, none below 0, and the minimum with nearly these.

    None where there is no minimum.
    """
    found, theta = stated, np.full(len(stated.names), np.log(ABOVE))  # who is faint takes nothing
    for _ in range(_ROUNDS):
        louder = _scored(changed(_factors(found.names, theta)), found.states)
        if louder is None:
            return None
        found = louder
        step = found.theta.clip(-_MOST_STEP, _MOST_STEP)
        step = np.maximum(step, -theta)  # none is less than stated
        theta = theta + step
        if np.abs(step).max() < _SETTLED:
            break
    return theta, found


def schwarz_nats(problem: SmoothingProblem) -> float:
    """Return what a constant costs that is known by convention alone: half of ln of the rows.

    References
    ----------
    Schwarz, Estimating the dimension of a model, Annals of Statistics 6, 1978.
    """
    return float(np.log(measured_rows(problem))) / 2


def profile_likelihood(problem: SmoothingProblem) -> float:
    """Return the log likelihood at the minimum of a whole problem; minus infinity without one.

    One factor on all variances, 1 or more, is free: whatever else is louder than stated does not
    make one of two problems surer. Determinants are left out: of problems that differ by the
    unit's tags alone they are the same.

    Parameters
    ----------
    problem : SmoothingProblem
        With phases.
    """
    try:
        cost = solve_batch(problem).cost
    except NoSolutionError:
        return -np.inf
    rows = measured_rows(problem)
    factor = max(cost / rows, 1.0)
    return -(cost / factor + rows * float(np.log(factor))) / 2


def noise_gain(
    factors: dict[str, float],
    louder: Callable[[dict[str, float]], SmoothingProblem],
    stated: "Scored | None" = None,
) -> float:
    """Return what white noises so many times as loud as stated gain of a whole problem.

    Of the score the cost at the minimum tells r' C r; tr(C M), which is smooth, is summed on the
    way, each minimum sought from the one before. Infinite where there is none.

    Against ``stated``, if that minimum is known, as causes are that compete: 600 standard
    deviations off it depends on which biases samples were summed up about.
    """
    if not factors:
        return 0.0
    theta = {name: float(np.log(factor)) for name, factor in factors.items()}
    places, weights = np.polynomial.legendre.leggauss(_NODES)
    try:
        at = stated or _minimum(louder({}), None)
        total = at.cost / 2
        for place, weight in zip((places + 1) / 2, weights / 2, strict=True):
            on_the_way = {name: float(np.exp(place * one)) for name, one in theta.items()}
            at = _minimum(louder(on_the_way), at.states)
            redundancy = dict(zip(at.names, at.redundancy.tolist(), strict=True))
            total -= weight * sum(redundancy[name] * one for name, one in theta.items())
        total -= _minimum(louder(factors), at.states).cost / 2
    except NoSolutionError:
        return np.inf
    return float(total)


def _factors(names: tuple[str, ...], theta: FloatArray) -> dict[str, float]:
    return dict(zip(names, np.exp(theta).tolist(), strict=True))


class Scored(NamedTuple):
    """White noises of the unit, by what their logarithms are off, and the sigmas of these."""

    names: tuple[str, ...]
    theta: FloatArray
    sigma: FloatArray
    squares: FloatArray  # r' C r
    redundancy: FloatArray  # tr(C M)
    states: States
    cost: float  # at the minimum

    @classmethod
    def of(cls, problem: SmoothingProblem, solution: Solution) -> "Scored":
        """Return them at a whole problem's minimum."""
        every, squares, redundancy, information = motion_score(problem, solution)
        of_unit = [i for i, name in enumerate(every) if name in WHITE]
        squares, redundancy = squares[of_unit], redundancy[of_unit]
        theta = np.log(squares.clip(1e-6) / redundancy.clip(1e-6)) / 2
        spread = (np.diag(4 * information)[of_unit] + 2 * redundancy) / 2
        sigma = 1 / np.sqrt(spread.clip(1e-6))
        names = tuple(every[i] for i in of_unit)
        return cls(names, theta, sigma, squares, redundancy, solution.states, solution.cost)

    def is_beyond(self, theta: FloatArray) -> BoolArray:
        """Return which of some logarithms are contradictions, (c,)."""
        return np.asarray((2 * theta > np.log(TOLERATED)) & (theta > SIGMAS * self.sigma))


def _scored(problem: SmoothingProblem, begin: States | None = None) -> Scored | None:
    """Return the fixed point's next step at a minimum, sought from states; None without one."""
    try:
        solution = solve_batch(problem, begin=begin)
    except NoSolutionError:
        return None
    return Scored.of(problem, solution) if solution.converged else None


def _minimum(problem: SmoothingProblem, begin: States | None) -> Scored:
    scored = _scored(problem, begin)
    if scored is None:
        raise NoSolutionError("noise: the problem has no minimum")
    return scored


def is_misfit(problem: SmoothingProblem, cost: float) -> bool:
    """Return whether what is left at the minimum of a whole problem is beyond chance."""
    return cost > chance_of(problem)


def chance_of(problem: SmoothingProblem) -> float:
    """Return what chance leaves at most at the minimum of a whole problem."""
    return float(chdtri(measured_rows(problem), FALSE_ALARM))


def measured_rows(problem: SmoothingProblem) -> int:
    """Return how many measurements there are beside as many as states, constants and arcs."""
    rows = sum(int(one.freedom.sum()) for one in problem.measurements)
    phase = problem.phase
    if phase is not None:
        rows += int(phase.freedom.sum())
        rows += sum(len(one.right) - one.size for one in phase.blocks)
    return rows
