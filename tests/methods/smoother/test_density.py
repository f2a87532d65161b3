import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav import rotations
from fgnav.checks import BadInputError
from fgnav.methods.smoother.cross_validation_kernel import (
    deletion_residuals,
    innovation_residuals,
)
from fgnav.methods.smoother.density import (
    angular_acceleration_density,
    density_of_rough_attitudes,
)

SIGMA_RAD = 0.005


def walking(rng, density, *, n=600, dt=0.1, spin_radps=0.0):
    """Attitudes of a body whose rate about each axis is a random walk, measured with noise."""
    fine = 10
    white = np.sqrt(np.multiply(density, dt / fine)) * rng.standard_normal((fine * n, 3))
    rate = np.cumsum(white, axis=0)
    rate[:, 0] += spin_radps
    R = [np.eye(3)]
    for step in rotations.exp(rate * (dt / fine)):
        R.append(R[-1] @ step)
    return dt * np.arange(n), noisy(rng, np.array(R[:-1:fine]))


def noisy(rng, R_nb, sigma_rad=SIGMA_RAD):
    return R_nb @ rotations.exp(sigma_rad * rng.standard_normal((len(R_nb), 3)))


def stated(n, sigma_rad=SIGMA_RAD):
    return np.tile(sigma_rad**2 * np.eye(3), (n, 1, 1))


def sine(rng, amplitude_deg=20.0, n=600, dt=0.1):
    t = dt * np.arange(n)
    angle = np.radians(amplitude_deg) * np.sin(t)
    return t, noisy(rng, rotations.from_euler(angle, angle, angle))


def test_what_all_others_foretell_is_what_a_dense_covariance_says():
    """About one axis everything is linear: an integrated random walk, seen with white noise."""
    rng = np.random.default_rng(0)
    n, dt, density = 12, 0.1, 0.05
    t = dt * np.arange(n)
    angle = np.cumsum(np.cumsum(np.sqrt(density * dt) * rng.standard_normal(n))) * dt
    angle += SIGMA_RAD * rng.standard_normal(n)
    square, log_determinant = deletion_residuals(
        t, rotations.exp(np.outer(angle, [1.0, 0, 0])), stated(n), np.full(3, density)
    )
    early, late = np.minimum(t, t[:, None]), np.maximum(t, t[:, None])
    start = 1e6 * (1 + t * t[:, None])  # first angle and rate unknown
    dense = density * (early**2 * late / 2 - early**3 / 6) + start + SIGMA_RAD**2 * np.eye(n)
    inverse = np.linalg.inv(dense)
    variance = 1 / np.diag(inverse)
    residual = inverse @ angle * variance
    assert_allclose(square[2:], (residual**2 / variance)[2:], rtol=1e-3)
    assert_allclose(log_determinant[2:], 3 * np.log(variance[2:]), atol=1e-3)
    assert np.isnan(square[:2]).all()


def test_residuals_of_a_right_model_have_their_expected_square():
    rng = np.random.default_rng(1)
    density = np.array([0.01, 0.02, 0.04])
    t, R = walking(rng, density, n=2000, spin_radps=6.0)
    square, _ = deletion_residuals(t, R, stated(len(t)), density)
    assert abs(np.nanmean(square) - 3) < 0.2  # neighbours share what they leave: 0.1 is one sigma


@pytest.mark.parametrize("spin_radps", [0.0, 12.6])
def test_intensity_of_a_random_walk_is_found_about_each_axis(spin_radps):
    """Within 35 %; a spin of two turns a second mixes the noise of the other two axes."""
    density = np.array([0.001, 0.01, 0.1])
    found = [
        angular_acceleration_density(t, R, stated(len(t)))
        for t, R in (
            walking(np.random.default_rng(seed), density, spin_radps=spin_radps)
            for seed in range(8)
        )
    ]
    assert_allclose(np.exp(np.log(found).mean(axis=0)), density, rtol=0.35)


def test_a_sine_asks_for_less_than_a_tenth_of_its_squared_acceleration():
    """A smoother follows it with that; the filter's likelihood would ask for half of it."""
    t, R = sine(np.random.default_rng(2))
    acceleration = np.radians(20.0) ** 2 / 2
    found = angular_acceleration_density(t, R, stated(len(t)))
    assert (found < 0.1 * acceleration).all()
    assert (found > 0.002 * acceleration).all()


def test_wrong_attitudes_count_little():
    rng = np.random.default_rng(3)
    t, R = sine(rng)
    clean = angular_acceleration_density(t, R, stated(len(t)))
    wrong = rng.random(len(t)) < 0.05
    R[wrong] = noisy(rng, R[wrong], 0.2)
    assert_allclose(angular_acceleration_density(t, R, stated(len(t))), clean, rtol=0.3)


def test_a_gap_and_a_slow_rate_are_borne():
    t, R = sine(np.random.default_rng(4))
    clean = angular_acceleration_density(t, R, stated(len(t)))
    there = (t < 10) | (t > 25)
    gap = angular_acceleration_density(t[there], R[there], stated(there.sum()))
    assert_allclose(gap, clean, rtol=0.5)
    slow = angular_acceleration_density(t[::10], R[::10], stated(60))
    assert (slow < 0.1).all()
    assert (slow > clean).all()


def test_a_body_at_rest_has_the_least_intensity():
    R = noisy(np.random.default_rng(5), np.tile(np.eye(3), (600, 1, 1)))
    assert_allclose(angular_acceleration_density(0.1 * np.arange(600), R, stated(600)), 1e-6)


def test_all_that_rough_attitudes_change_by_counts_as_motion():
    rng = np.random.default_rng(6)
    t, R = walking(rng, np.full(3, 0.01))
    quiet = density_of_rough_attitudes(t, R)
    assert_allclose(quiet, 0.01, rtol=0.5)
    assert (density_of_rough_attitudes(t, noisy(rng, R, 0.02)) > 2 * quiet).all()


def test_what_means_over_two_seconds_blur_still_counts():
    """Attitudes once a second, means over a second before and after: 0.575 of it is left."""
    rng, found = np.random.default_rng(7), []
    for _ in range(10):
        t, R = walking(rng, np.full(3, 0.01))
        rows = np.arange(10, len(t) - 10, 10)
        near = R[rows[:, None] + np.arange(-10, 11)]
        apart = rotations.log((rotations.transpose(R[rows])[:, None] @ near).reshape(-1, 3, 3))
        blurred = R[rows] @ rotations.exp(apart.reshape(len(rows), 21, 3).mean(axis=1))
        found.append(density_of_rough_attitudes(t[rows], blurred))
    assert_allclose(np.mean(found, axis=0), 0.01, rtol=0.2)


def test_blocks_of_a_long_flight_speak_for_it():
    density = np.full(3, 0.01)
    t, R = walking(np.random.default_rng(7), density, n=3000)
    assert_allclose(angular_acceleration_density(t, R, stated(len(t))), density, rtol=0.6)


def test_too_few_attitudes_ask_for_the_intensity():
    one = np.tile(np.eye(3), (4, 1, 1))
    text = r"4 are too few .* state angular_acceleration_density"
    with pytest.raises(BadInputError, match=text):
        angular_acceleration_density(np.arange(4.0), one, one)
    with pytest.raises(BadInputError, match=text):
        density_of_rough_attitudes(np.arange(4.0), one)


def test_the_filters_intensity_of_a_random_walk_is_that_walks_own():
    t, R = walking(np.random.default_rng(3), [1e-2, 1e-3, 1e-2])
    told = angular_acceleration_density(t, R, stated(len(t)), ahead=True)
    assert_allclose(told, [1e-2, 1e-3, 1e-2], rtol=0.6)


def test_a_filter_needs_more_than_a_smoother_to_follow_a_sine():
    t, R = sine(np.random.default_rng(4))
    ahead, both = (
        angular_acceleration_density(t, R, stated(len(t)), ahead=a) for a in (True, False)
    )
    assert (ahead > 2 * both).all()


def test_innovations_with_the_right_intensity_have_the_size_they_state():
    t, R = walking(np.random.default_rng(5), [1e-2] * 3, n=2000)
    square, log_determinant = innovation_residuals(t, R, stated(len(t)), np.full(3, 1e-2))
    told = square[np.isfinite(square)]
    assert len(told) == len(t) - 2
    assert abs(told.mean() - 3) < 0.2
    deleted = deletion_residuals(t, R, stated(len(t)), np.full(3, 1e-2))[1]
    assert np.nanmean(deleted) < np.nanmean(log_determinant)  # both sides tell more than one
