"""Outages, slow motions and gyroscopes: windows converge, covariances are GTSAM's own."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.graph.build import Layout
from fgnav.graph.types.parameters import flight_constant
from fgnav.graph.types.problem import Problem
from fgnav.process import matern
from fgnav.solve import fixed_lag
from fgnav.solve.batch import solve_batch
from tests.graph.factors.motions import sine
from tests.solve.flights import flight, measured_at, sigma_ratio, sigmas_apart

AGREE_SIGMAS, AGREE_RATIO = 0.1, 0.03


def with_outage(problem: Problem, from_s: float, until_s: float) -> Problem:
    """Nothing is measured within a span, and no attitude known."""
    gone = (problem.t_s > from_s) & (problem.t_s < until_s)
    known = problem.attitude_known & ~gone
    return replace(problem, sensors=measured_at(problem, ~gone), attitude_known=known)


def test_a_window_over_a_slow_motion_is_the_batch() -> None:
    problem, _ = flight(5.0, motion=sine(5.0, rate_radps=0.1))
    motion = replace(
        problem.motion,
        poles_per_s=np.tile(matern.poles(45.0), (50, 3, 1)),
        variance_rad2ps2=np.full((50, 3), 1e-3),
    )
    problem = replace(problem, motion=motion)
    window, batch = fixed_lag.solve_fixed_lag(problem, 10.0), solve_batch(problem)
    assert window.converged
    assert sigmas_apart(batch, window) < AGREE_SIGMAS
    assert sigma_ratio(batch, window) < AGREE_RATIO


@pytest.mark.parametrize("gyroscope", [False, True])
def test_windows_wait_through_an_outage_and_converge_after_it(gyroscope: bool) -> None:
    problem = with_outage(flight(18.0, gyroscope=gyroscope)[0], 4.0, 14.0)
    window = fixed_lag.solve_fixed_lag(problem, 2.0)
    assert window.converged
    assert fixed_lag.solve_forward(problem, 2.0).converged
    assert np.isfinite(window.covariance).all()


@pytest.mark.parametrize("gyroscope", [False, True])
def test_covariances_are_those_of_isam2(gyroscope: bool) -> None:
    """Of what has marginalised, at the same linearisation: within rounding."""
    lever = flight_constant("lever arm", ("x", "y"), "m", 0.5)
    problem, _ = flight(4.0, gyroscope=gyroscope, extra=(lever,))
    window, layout = fixed_lag.FixedLag(1.0), Layout.of(problem)
    for row in range(len(problem.t_s)):
        window.update(problem, row)
    oldest, solution = window.oldest, window.flush()
    for i, covariance in enumerate(solution.covariance):
        variables = [*layout.keyframe(oldest + i), *layout.constant_keys]
        P = window.isam2.jointMarginalCovariance(variables).fullMatrix()
        D, sigma = problem.width, np.sqrt(np.diag(P))
        own, of_constants = (covariance, P[:D, :D]), (solution.constant_cross[i], P[:D, D:])
        for (one, other), beside in zip((own, of_constants), (sigma[:D], sigma[D:]), strict=True):
            np.testing.assert_allclose(
                one / np.outer(sigma[:D], beside),
                other / np.outer(sigma[:D], beside),
                rtol=0,
                atol=1e-6,
            )
