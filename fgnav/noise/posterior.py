"""The most probable noise of a problem: Fisher scoring on its marginal likelihood and a prior.

The states are integrated out at their minimum (Laplace), which is first anew after each step. The
prior of theta, the logarithm of a factor on a standard deviation, is about the nominal.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.graph.correlation import correlated
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.noise.components import INSTRUMENTS, WHITE, NoiseComponents, Score
from fgnav.solve.gauss_newton import Minimum, gauss_newton

# Scale of theta's prior. What is stated holds to a factor of 1.5. White noise of small inertial
# units in motion is 1 to 200 times the figure of their data sheets, so the prior has the tails of
# Cauchy's distribution: near the nominal it is a normal one of that sigma, and what is far off is
# hardly drawn back (Gelman, Prior distributions for variance parameters, 2006).
STATED, _WHITE, _WALK = np.log(1.5), np.log(5.0), np.log(10.0)
_NEARLY = 0.5  # a step of theta that is small enough where patience is at its end
_SAME_COST = 0.5  # what is left of it then is a quarter of a unit of log-likelihood
_ITERATIONS, _PATIENCE = 30, 20
_DESCENT = 10  # steps towards the minimum between two of theta
_LARGEST_STEP = 1.2  # of theta: a factor of 3.3
_SUFFICIENT = 6.0  # redundancy that outweighs the prior of what is stated
_FAR = 4.0  # of squares over redundancy: beyond, theta moves by half its logarithm
_SETTLED, _SETTLED_SIGMAS = 0.03, 0.3  # a step below either of them is the last
_RAISED = np.log(10.0)  # at the beginning, until the data fit
_RAISES = 4
_MISFIT = 4.0  # of the cost to the number of measurements


class Prior(NamedTuple):
    """Prior of theta: scale about zero, and lower bounds, (c,) each."""

    sigma: FloatArray
    least: FloatArray

    def weight(self, theta: FloatArray) -> FloatArray:
        """Return the factor w of the prior's slope, ``-w theta``: of Cauchy's density."""
        return np.asarray(2.0 / (2.0 * self.sigma**2 + theta**2))

    def log_density(self, theta: FloatArray) -> float:
        """Return the logarithm of Cauchy's density, but for a constant."""
        return -float(np.log1p(theta**2 / (2.0 * self.sigma**2)).sum())

    @classmethod
    def of(cls, names: tuple[str, ...], stated: BoolArray) -> "Prior":
        """Return the prior of components; ``stated``, (c,), is True where the flight states them.

        What is systematic repeats in all residuals and shows in none: a sensor other than the
        inertial unit is not taken for better than stated.
        """
        walk = np.array([name.endswith("bias") for name in names])
        of_imu = np.array([name.startswith(WHITE) for name in names])
        sigma = np.where(stated, STATED, np.where(walk, _WALK, _WHITE))
        return cls(sigma, np.where(stated & ~of_imu, 0.0, -np.inf))


class NoisePosterior(NamedTuple):
    """The most probable noise, and the minimum of the problem that has it."""

    components: NoiseComponents
    # Logarithms of factors, and their 1-sigma.
    theta: FloatArray  # (c,)
    sigma: FloatArray  # (c,)
    problem: Problem
    minimum: Minimum

    @property
    def solution(self) -> Solution:
        """The states there, and how well they are known."""
        return self.minimum.solution

    def log_density(self, prior: Prior) -> float:
        """Return the logarithm of the posterior density of theta, but for a constant."""
        return self.minimum.log_evidence + prior.log_density(self.theta)


def noise_posterior(
    components: NoiseComponents, prior: Prior, begin: FloatArray, *, several: bool = True
) -> NoisePosterior:
    """Return the most probable noise.

    Parameters
    ----------
    components : NoiseComponents
    prior : Prior
    begin : ndarray, shape (c,)
        Theta at which the search begins.
    several : bool
        Whether another maximum may be higher than the one next to where the search begins.

    Raises
    ------
    NoSolutionError
        If the problem has no minimum at which to identify its noise.
    """
    first = _climbed(components, prior, np.maximum(begin, prior.least))
    names = np.array(components.names)
    walks = np.char.endswith(names, "bias")
    if not several or not (first.theta[walks] > STATED).any():
        return first
    # A random walk of a bias that explains residuals may stand for white noise: a maximum beside.
    other = np.where(walks, prior.least.clip(0.0), first.theta)
    other[np.isin(names, WHITE)] += _RAISED
    try:
        other_maximum = _climbed(components, prior, other)
    except NoSolutionError:
        return first
    return max(first, other_maximum, key=lambda one: one.log_density(prior))


def _climbed(components: NoiseComponents, prior: Prior, begin: FloatArray) -> NoisePosterior:
    """Return the maximum to which Fisher scoring leads."""
    cost = np.inf
    theta, states = _begin(components, begin)
    damping: FloatArray = np.ones(len(theta))
    last: FloatArray = np.zeros(len(theta))
    components = components.about(states)
    for iteration in range(_ITERATIONS):
        problem = components.problem_at(theta)
        minimum = gauss_newton(problem, begin=states, most=_DESCENT)
        solution = minimum.solution
        states = solution.states
        score = components.score(theta, problem, solution)
        sigma = 1 / np.sqrt(np.diag(score.information) + prior.weight(theta))
        step = _step(score, theta, prior)
        tolerance = np.maximum(_SETTLED, _SETTLED_SIGMAS * sigma)
        is_minimum = solution.converged or abs(solution.cost - cost) < _SAME_COST
        if (
            is_minimum
            and (np.abs(step) < np.where(iteration < _PATIENCE, tolerance, _NEARLY)).all()
        ):
            return NoisePosterior(components, theta, sigma, problem, minimum)
        # Noise and states may undo each other's changes: a component that turns goes half as far.
        damping = np.where(step * last < 0.0, damping / 2, np.minimum(2 * damping, 1.0))
        last, cost = step, solution.cost
        theta = np.maximum(theta + damping * step, prior.least)
    raise NoSolutionError("noise: the problem has no minimum at which to identify it")


def _begin(components: NoiseComponents, theta: FloatArray) -> tuple[FloatArray, States]:
    """Return theta with white noise and instruments' noise so large that the data fit, and states.

    From far below, states bend to the residuals, and a random walk of a bias may explain them.
    """
    names, problem = components.names, components.problem
    raised = [i for i, name in enumerate(names) if name in (*WHITE, *INSTRUMENTS)]
    rows = sum(int(one.freedom.sum()) for one in problem.sensors)
    if problem.phase is not None:
        rows += int(problem.phase.freedom.sum())
    states = problem.start
    for _ in range(_RAISES):
        solution = gauss_newton(components.problem_at(theta), most=_DESCENT).solution
        states = solution.states
        if solution.cost < _MISFIT * rows:
            break
        theta = theta.copy()
        theta[raised] += _RAISED
    return theta, states


def _step(score: Score, theta: FloatArray, prior: Prior) -> FloatArray:
    """Return a step of Fisher scoring, no component below its bound.

    Far from the maximum ``exp(2 theta) *= squares / redundancy`` instead (Foerstner 1979).
    """
    weight = prior.weight(theta)
    uphill = score.gradient - weight * theta
    free = np.flatnonzero((theta > prior.least) | (uphill > 0))
    H = score.information[np.ix_(free, free)] + np.diag(weight[free])
    step: FloatArray = np.zeros(len(theta))
    step[free] = np.linalg.solve(H, uphill[free])
    ratio = (score.squares / score.redundancy.clip(1e-3)).clip(1e-6)
    far = ((ratio > _FAR) | (ratio < 1 / _FAR)) & (score.redundancy > _SUFFICIENT)
    step[free] = np.where(far, np.log(ratio) / 2, step)[free]
    return np.asarray(np.maximum(step.clip(-_LARGEST_STEP, _LARGEST_STEP), prior.least - theta))


def correlated_noise(posterior: NoisePosterior) -> FloatArray:
    """Return theta, (c,), of instruments with the variance of their correlated errors.

    White noise that is as large at low frequencies has ``1 + 2 sum(rho)`` times the variance.
    """
    theta = posterior.theta.copy()
    for i, name in enumerate(posterior.components.names):
        if name in INSTRUMENTS:
            r = posterior.components.residuals(name, posterior.problem, posterior.solution)
            theta[i] += np.log(correlated(r)) / 2
    return theta
