"""Scores of noise: their gradient is that of the marginal likelihood, at any noise."""

from functools import partial

import numpy as np
import pytest

from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.problem import build_problem
from fgnav.methods.smoother import Smoother
from fgnav.noise.components import AT_REST, NoiseComponents, Standstill
from fgnav.noise.decimation import decimated
from fgnav.noise.nominal import scalable
from fgnav.solve.gauss_newton import gauss_newton
from tests.robustness.drawn.flights import right_flight

STEP = 0.02  # of theta


def components_of(kind, seed, standstill=None):
    flight = right_flight(kind, seed)
    build = partial(build_problem, last=LastObservations())
    problem, _ = decimated(build(flight, Smoother().preparation))
    resting = None
    if standstill is not None:
        n = len(problem.t_s)
        resting = Standstill(np.arange(n) < standstill, (np.arange(n - 1) < standstill) * 1.0)
    return NoiseComponents.of(problem, scalable(flight), resting)


def evidence(components, theta):
    problem = components.problem_at(theta)
    return gauss_newton(problem).log_evidence


@pytest.mark.parametrize(
    ("kind", "standstill"), [("fixes", None), ("instruments", None), ("array", None), ("fixes", 20)]
)
def test_the_gradient_is_that_of_the_marginal_likelihood(kind, standstill):
    components = components_of(kind, 94_000, standstill)
    theta = np.linspace(-0.4, 0.5, len(components.names))
    problem = components.problem_at(theta)
    score = components.score(theta, problem, gauss_newton(problem).solution)
    for i, axis in enumerate(np.eye(len(theta))):
        ends = [evidence(components, theta + sign * STEP * axis) for sign in (1, -1)]
        slope = (ends[0] - ends[1]) / (2 * STEP)
        # Laplace's determinant bends with the states: a hundredth of the rows' information.
        assert abs(score.gradient[i] - slope) < 0.02 * score.information[i, i] + 0.5


def test_a_factor_of_one_changes_nothing():
    components = components_of("fixes", 94_001)
    theta = np.zeros(len(components.names))
    solved = [
        gauss_newton(one).solution for one in (components.problem, components.problem_at(theta))
    ]
    np.testing.assert_allclose(solved[0].states.R_nb, solved[1].states.R_nb, atol=1e-9)
    np.testing.assert_allclose(solved[0].cost, solved[1].cost, rtol=1e-9)


def test_standstill_has_components_of_its_own():
    names = components_of("fixes", 94_002, 20).names
    assert {"gyroscope" + AT_REST, "accelerometer" + AT_REST, "position" + AT_REST} <= set(names)
    assert "gyroscope bias" + AT_REST not in names


def test_nominal_noise_has_no_slope_beyond_chance():
    slopes = []
    for seed in range(94_010, 94_014):
        components = components_of("fixes", seed)
        theta = np.zeros(len(components.names))
        problem = components.problem_at(theta)
        score = components.score(theta, problem, gauss_newton(problem).solution)
        slopes.append(score.gradient / np.sqrt(np.diag(score.information)))
    assert np.abs(slopes).max() < 4.5
    assert np.mean(np.square(slopes)) < 2.0
