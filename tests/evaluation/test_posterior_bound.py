"""The posterior bound against GTSAM's marginals at the truth, and against other priors."""

from dataclasses import replace

import gtsam
import msgspec
import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.posterior_bound import posterior_angles, posterior_bound, true_states
from fgnav.evaluation.scores import Angles
from fgnav.geometry.rotations import euler_jacobian
from fgnav.graph.build import Layout, flight_values
from fgnav.graph.factors.position import Position
from fgnav.integers.resolvers.truth import Truth, attitude_at
from fgnav.methods.smoother import Batch, Forward
from fgnav.process.hyperparameters import RatePrior
from fgnav_sim.simulate import simulate
from tests.benchmarks.consistency import cases
from tests.methods.simulated import flown
from tests.solve.flights import flight_graph

BATCH = Batch(resolver=Truth())
ARM_B_M = (0.3, -0.1, 0.2)
PRIOR = RatePrior(length_s=0.5, variance_rad2ps2=np.full(3, 0.5**2), evidence=float("nan"))


def with_prior(prepared, prior):
    """Return a flight without a gyroscope whose body rate has another prior."""
    problem, n = prepared.problem, len(prepared.problem.t_s) - 1
    motion = replace(
        problem.motion,
        poles_per_s=np.tile(prior.poles_per_s, (n, 1, 1)),
        variance_rad2ps2=np.tile(prior.variance_rad2ps2, (n, 1)),
    )
    return replace(prepared, problem=replace(problem, motion=motion))


@pytest.fixture(scope="module")
def swing():
    """Three seconds of the demo, the accelerometer off the origin, and its smoothing problem."""
    flight = flown("demo", 3.0, imu_position_b_m=ARM_B_M)
    return flight, BATCH.prepare(flight)


def test_the_bound_is_gtsams_marginal_at_the_truth(swing):
    flight, prepared = swing
    states, problem = true_states(flight, prepared), prepared.problem
    parameters = gtsam.ISAM2Params()
    parameters.setFactorization("QR")  # ambiguities beside metres are too much for Cholesky
    marginals = gtsam.ISAM2(parameters)
    marginals.update(flight_graph(problem, states), flight_values(problem, states))
    layout, bound = Layout.of(problem), posterior_bound(flight, prepared)
    for k in range(len(problem.t_s)):
        theirs = marginals.marginalCovariance(layout.keyframe(k)[0])[:3, :3]
        np.testing.assert_allclose(bound[k], theirs, rtol=0, atol=1e-4 * np.trace(theirs))


def test_measurements_at_true_states_differ_from_them_by_their_noise(swing):
    flight, prepared = swing
    states = true_states(flight, prepared)
    for measurement in prepared.problem.sensors:
        count = len(measurement.row)
        value = measurement.linearise(states.at(measurement.row), np.arange(count)).value
        if isinstance(measurement, Position):  # all of a flight are off together, by decimetres
            value = value - value.mean(axis=0)
        freedom = measurement.freedom.sum()
        assert (value**2).sum() < freedom * (1 + 5 * np.sqrt(2 / freedom))


def test_who_knows_less_of_the_motion_has_the_greater_bound(swing):
    flight, prepared = swing
    little = replace(PRIOR, variance_rad2ps2=4 * PRIOR.variance_rad2ps2)
    more, less = (posterior_bound(flight, with_prior(prepared, one)) for one in (PRIOR, little))
    assert (np.linalg.eigvalsh(less - more) > 0).all()


def test_errors_of_the_batch_are_stated_as_the_bound_of_its_own_prior(swing):
    flight, prepared = swing
    stated = BATCH.estimate_prepared(flight, prepared).attitude_covariance_rad2
    bound = posterior_bound(flight, prepared)
    # Linearised where errors are a third of a degree.
    np.testing.assert_allclose(
        np.trace(bound, axis1=1, axis2=2), np.trace(stated, axis1=1, axis2=2), rtol=0.02, atol=0
    )


def test_with_a_gyroscope_the_bound_is_less():
    with_gyroscope, without = (
        simulate(msgspec.structs.replace(cases()[name], duration_s=3.0), np.random.default_rng(1))
        for name in ("gyro", "a20")
    )
    prepared = BATCH.prepare(with_gyroscope)
    least = np.trace(posterior_bound(with_gyroscope, prepared), axis1=1, axis2=2)
    free = np.trace(posterior_bound(without, BATCH.prepare(without)), axis1=1, axis2=2)
    assert (least < 0.8 * free).all()


def test_a_flight_without_truth_has_no_bound(swing):
    flight, prepared = swing
    blind = replace(flight, truth=None)
    with pytest.raises(NoSolutionError, match="a posterior bound needs its truth"):
        posterior_bound(blind, prepared)


def test_a_comparison_states_the_bound_of_the_problem_that_knows_the_whole_flight(swing):
    flight, prepared = swing
    methods = [Forward(resolver=Truth(), noise="nominal"), replace(BATCH, noise="nominal")]
    expected = posterior_angles(flight, methods[1].prepare(flight))
    assert compare(flight, methods).posterior_bound == expected
    J = euler_jacobian(attitude_at(flight.truth, prepared.problem.t_s)[0])
    P = J @ posterior_bound(flight, methods[1].prepare(flight)) @ J.swapaxes(1, 2)
    rms_deg = np.degrees(np.sqrt(np.einsum("nii->ni", P).mean(axis=0)))
    np.testing.assert_allclose([expected.roll, expected.pitch, expected.yaw], rms_deg, rtol=1e-12)


def test_without_truth_throughout_there_is_no_bound_of_angles(swing):
    flight, prepared = swing
    assert posterior_angles(replace(flight, truth=None), prepared) == Angles()
    truth = flight.truth
    half = {k: getattr(truth, k)[truth.t_s > 1.5] for k in ("t_s", "p_n_m", "v_n_mps", "R_nb")}
    part = replace(flight, truth=replace(truth, integers=None, **half))
    assert posterior_angles(part, prepared) == Angles()
