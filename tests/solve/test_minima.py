"""Several minima of one cost, against mixtures of Gaussians drawn by hand."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.geometry.rotations import exp
from fgnav.solve.batch import solve_batch
from fgnav.solve.gauss_newton import Minimum, gauss_newton
from fgnav.solve.minima import distinct, mixture
from tests.solve.flights import flight
from tests.solve.test_outages import with_outage


@pytest.fixture(scope="module")
def solved():
    problem, _ = flight(1.0)
    return gauss_newton(problem).solution


def turned(solution, by_rad):
    """The same minimum, its last attitude turned about x."""
    R_nb = solution.states.R_nb.copy()
    R_nb[-1] = R_nb[-1] @ exp(np.array([[by_rad, 0.0, 0.0]]))[0]
    return replace(solution, states=solution.states._replace(R_nb=R_nb))


def test_two_minima_as_likely_leave_half_of_their_distance_squared(solved):
    both = mixture([Minimum(solved, -10.0), Minimum(turned(solved, 1.0), -10.0)])
    np.testing.assert_array_equal(both.states.R_nb, solved.states.R_nb)
    added = both.covariance - solved.covariance
    assert added[-1, 0, 0] == pytest.approx(0.5)
    added[-1, 0, 0] = 0.0
    np.testing.assert_allclose(added, 0.0, atol=1e-12)


def test_a_minimum_a_hundred_nats_behind_leaves_no_doubt(solved):
    both = mixture([Minimum(solved, 0.0), Minimum(turned(solved, 1.0), -100.0)])
    np.testing.assert_allclose(both.covariance, solved.covariance, atol=1e-12)


def test_minima_are_distinct_converged_and_the_likeliest_comes_first(solved):
    far = turned(solved, 1.0)
    lost = replace(turned(solved, 2.0), converged=False)
    ends = [Minimum(solved, 1.0), Minimum(far, 2.0), Minimum(solved, 1.0), Minimum(lost, 9.0)]
    kept = distinct(ends)
    assert [end.log_evidence for end in kept] == [2.0, 1.0]
    assert distinct([Minimum(lost, 9.0)])[0].solution is lost


def test_a_body_that_rolled_over_while_nobody_looked_is_another_minimum():
    problem = with_outage(flight(18.0)[0], 4.0, 14.0)
    share = np.clip((problem.t_s - 4.0) / 10.0, 0.0, 1.0)
    over = problem.start._replace(
        R_nb=problem.start.R_nb @ exp(2 * np.pi * share[:, None] * [1.0, 0.0, 0.0])
    )
    ends = distinct([gauss_newton(problem, begin=begin) for begin in (problem.start, over)])
    assert len(ends) == 2
    best = solve_batch(problem)
    assert best.cost == pytest.approx(ends[0].solution.cost, abs=0.1)
