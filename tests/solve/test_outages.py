"""Outages, slow motions and gyroscopes: windows converge, covariances are GTSAM's own."""

from dataclasses import replace

import gtsam
import numpy as np
import pytest

from fgnav.graph import keys
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.process import matern
from fgnav.solve import fixed_lag
from fgnav.solve.batch import solve_batch
from fgnav.solve.sliding.relinearisation import MOVED_RAD
from tests.graph.factors.motions import sine
from tests.solve.flights import flight, sigma_ratio, sigmas_apart

AGREE_SIGMAS, AGREE_RATIO = 0.1, 0.03


def with_outage(problem: SmoothingProblem, from_s: float, until_s: float) -> SmoothingProblem:
    """Nothing is measured within a span, and no attitude known."""
    gone = (problem.t_s > from_s) & (problem.t_s < until_s)
    measurements = []
    for one in problem.measurements:
        kept = ~gone[one.row]
        names = ("row", "root", "minimum", "element_column", "value_n_m", "value_n_mps", "white",
                 "measured_b_radps")  # fmt: skip
        arrays = {n: getattr(one, n)[kept] for n in names if getattr(one, n, None) is not None}
        measurements.append(replace(one, **arrays))
    known = problem.attitude_known & ~gone
    return replace(problem, measurements=tuple(measurements), attitude_known=known)


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


def test_a_landmark_of_another_size_changes_no_estimate() -> None:
    place = flight_constant("landmark", ("north", "east", "down", "scale"), "m", 1.0)
    (problem, _), (plain, _) = flight(4.0, extra=(place,)), flight(4.0)
    for method in (fixed_lag.solve_fixed_lag, fixed_lag.solve_forward):
        assert sigmas_apart(method(plain, 1.0), method(problem, 1.0)) < 0.01


@pytest.mark.parametrize("gyroscope", [False, True])
def test_windows_wait_through_an_outage_and_converge_after_it(gyroscope: bool) -> None:
    problem = with_outage(flight(18.0, gyroscope=gyroscope)[0], 4.0, 14.0)
    window = fixed_lag.solve_fixed_lag(problem, 2.0)
    assert window.converged
    assert fixed_lag.solve_forward(problem, 2.0).converged
    assert np.isfinite(window.covariance).all()


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("method", ["solve_fixed_lag", "solve_forward"])
def test_covariances_are_those_of_isam2(method: str, gyroscope: bool) -> None:
    """Of the chain's elimination, against ``jointMarginalCovariance`` of what has marginalised.

    A factor that joins other keyframes than neighbours, and tells nothing, has ISAM2 asked.
    """
    lever = flight_constant("lever arm", ("x", "y"), "m", 0.5)
    problem, truth = flight(4.0, gyroscope=gyroscope, extra=(lever,))
    R, p = truth.R_nb[3].T @ truth.R_nb[8], truth.R_nb[3].T @ (truth.p_n_m[8] - truth.p_n_m[3])
    weak = gtsam.noiseModel.Isotropic.Sigma(6, 1e4)
    step = gtsam.Pose3(gtsam.Rot3(R), p)
    own = [gtsam.BetweenFactorPose3(keys.pose(3), keys.pose(8), step, weak)]
    solve = getattr(fixed_lag, method)
    plain, beside = solve(problem, 1.0), solve(problem, 1.0, own=own)
    assert sigma_ratio(plain, beside) < 1e-3
    for name in ("covariance", "cross", "constant_covariance", "constant_cross"):
        one, other = getattr(plain, name), getattr(beside, name)
        if name == "cross" and method == "solve_forward":
            assert one is None
            continue
        # Axes of keyframes next to what has left may be linearised that far apart.
        np.testing.assert_allclose(one, other, rtol=1e-3, atol=MOVED_RAD * np.abs(other).max())
