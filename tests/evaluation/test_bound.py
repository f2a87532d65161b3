import numpy as np
import pytest

from fgnav.evaluation.bound import attitude_bound, euler_sigma_rad, flight_bound
from fgnav.evaluation.integer_counts import integers_at, true_attitudes
from fgnav.geometry import rotations
from tests.evaluation.conftest import Off, differences_of, true_state
from tests.integers.arrays import link_covariance

ARRAY_B_M = np.array([[0, 0.1, 0], [1, 0, 0], [-0.8, 0.1, 0.1]])


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def everywhere(differences, R_nb):
    return integers_at(differences, R_nb, np.ones(len(R_nb), dtype=bool))


def test_bound_is_that_of_weighted_least_squares_with_the_full_covariance(rng):
    R_nb = rotations.exp(rng.uniform(-1, 1, (1, 3)))
    differences = differences_of(R_nb, ARRAY_B_M, rng)
    step = 1e-6
    links = differences.resolvable[0]
    J = np.empty((links.sum(), 3))
    for i, axis in enumerate(np.eye(3)):
        up, down = (R_nb @ rotations.exp(s * step * axis[None]) for s in (1, -1))
        J[:, i] = (differences.array_m(up) - differences.array_m(down))[0][links] / (2 * step)
    C = link_covariance(differences, 0, links, differences.phase_variance_m2)
    E = rotations.euler_jacobian(R_nb)[0]
    want = np.sqrt(np.diag(E @ np.linalg.inv(J.T @ np.linalg.inv(C) @ J) @ E.T))
    bound = attitude_bound(differences, everywhere(differences, R_nb), R_nb)
    got = np.radians([bound.roll, bound.pitch, bound.yaw])
    np.testing.assert_allclose(got, want, rtol=1e-6)


def test_one_baseline_along_x_bounds_pitch_and_yaw_but_not_roll(rng):
    R_nb = rotations.from_euler(*np.array([[0.3], [0.1], [-1.0]]))
    differences = differences_of(R_nb, np.array([[1.5, 0, 0]]), rng)
    bound = attitude_bound(differences, everywhere(differences, R_nb), R_nb)
    assert bound.roll is None
    assert 0 < bound.pitch < 1
    assert 0 < bound.yaw < 1


def test_one_slanted_baseline_bounds_nothing(rng):
    R_nb = rotations.from_euler(*np.array([[0.3], [0.1], [-1.0]]))
    differences = differences_of(R_nb, np.array([[1.0, 0.5, 0.3]]), rng)
    bound = attitude_bound(differences, everywhere(differences, R_nb), R_nb)
    assert (bound.roll, bound.pitch, bound.yaw) == (None, None, None)


def test_epochs_without_information_do_not_count(rng):
    R_nb = np.tile(rotations.exp(rng.uniform(-1, 1, (1, 3))), (4, 1, 1))
    differences = differences_of(R_nb, ARRAY_B_M, rng)
    integers = everywhere(differences, R_nb)
    known = np.array([True, False, False, True])
    some = integers_at(differences, R_nb, known)
    assert attitude_bound(differences, some, R_nb) == attitude_bound(differences, integers, R_nb)


def test_a_sigma_beyond_that_of_an_unknown_angle_is_no_bound():
    information = np.diag([1.0 / 1.9**2, 1e4, 1e4])[None]
    sigma = euler_sigma_rad(information, np.eye(3)[None])[0]
    np.testing.assert_allclose(sigma, [np.inf, 0.01, 0.01])


def test_flight_bound_with_truth_is_the_bound_at_the_true_attitude(rng):
    truth = true_state(np.arange(0, 2, 0.1))
    R_nb, _ = true_attitudes(truth, np.arange(20) * 0.1)
    differences = differences_of(R_nb, ARRAY_B_M, rng)
    want = attitude_bound(differences, everywhere(differences, R_nb), R_nb)
    assert flight_bound(differences, truth, []) == want


def test_flight_bound_without_truth_is_taken_at_the_surest_estimate(rng, flight):
    t_s = np.arange(20) * 0.1
    R_nb = true_state(t_s).R_nb
    differences = differences_of(R_nb, ARRAY_B_M, rng)
    integers = everywhere(differences, R_nb)

    def claims(sigma_rad, tangent):
        covariance = np.tile(sigma_rad**2 * np.eye(3), (len(t_s), 1, 1))
        more = {"attitude_covariance_rad2": covariance, "integers": integers}
        return Off("any", tangent, t_s=t_s, more=more)(flight)

    estimates = [claims(0.1, (0.5, 0.5, 0)), claims(0.001, (0, 0, 0))]
    want = attitude_bound(differences, integers, R_nb)
    got = flight_bound(differences, None, estimates)
    assert got.roll == pytest.approx(want.roll, rel=1e-9)
    assert got.yaw == pytest.approx(want.yaw, rel=1e-9)


def test_flight_bound_without_truth_and_covariance_is_unknown(rng, flight):
    differences = differences_of(np.eye(3)[None], ARRAY_B_M, rng)
    bound = flight_bound(differences, None, [Off("any")(flight)])
    assert bound.roll is None
