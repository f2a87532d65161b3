"""Motion without a gyroscope: its 21 rows against motions in closed form, and against GTSAM."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.rotation_kernel import accumulated
from fgnav.geometry.rotations import exp
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.types.parameters import Parameters, flight_constant
from fgnav.graph.types.states import DERIVATIVE_SCALE_S, States
from fgnav.process import matern
from tests.graph.factors.motions import (
    EARTH_N_RADPS,
    GRAVITY_N_MPS2,
    assert_derivatives,
    ends,
    every,
    moved_at_random,
    sine,
    spin,
)
from tests.imu import imu_of

CONSTANTS = Parameters(
    (
        flight_constant("boresight", ("x", "y"), "rad", 0.1),
        flight_constant("mean rate", ("x", "y", "z"), "rad/s", 15.0),
    )
)
RATE = slice(2, 5)
DENSITY = 1e-3**2  # of the accelerometer's noise
LENGTHS_S = (0.8, 0.5, 1.0)  # of the rate about the body axes


def gyro_free(imu, t_s, *, length_s=LENGTHS_S, variance=0.3, sub_steps=5):
    n = len(t_s)
    return GyroFree(
        t_s=t_s,
        imu=imu,
        sub_steps=sub_steps,
        gravity_n_mps2=np.tile(GRAVITY_N_MPS2, (n, 1)),
        earth_rate_n_radps=EARTH_N_RADPS,
        poles_per_s=np.tile(matern.poles(np.broadcast_to(length_s, 3)), (n - 1, 1, 1)),
        variance_rad2ps2=np.full((n - 1, 3), variance),
        accelerometer_noise=np.full(n - 1, DENSITY),
        constants=CONSTANTS,
    )


def lasting(t_s, size, rng, *, constant_s=3.0):
    """A lasting error of an array, whose links change at every keyframe."""
    turned, _ = np.linalg.qr(rng.normal(size=(len(t_s) - 1, size, size)))
    return Multipath(
        t_s=t_s,
        basis=np.eye(9)[:, :size],
        share=np.full(len(t_s), 0.5),
        decay_per_s=np.full(len(t_s) - 1, 1 / constant_s),
        kept=rng.uniform(0.5, 1.0, (len(t_s) - 1, 1, 1)) * turned,
    )


def with_lasting(factors, states, rng, size=6):
    """A motion beside which an array errs lastingly, and states at random errors."""
    aux = np.hstack([states.aux, rng.normal(size=(len(states.aux), size))])
    return replace(factors, multipath=lasting(factors.t_s, size, rng)), states._replace(aux=aux)


def of_motion(motion, T, n=20, **options):
    """A motion's factors and its true states; the constant rate is their mean."""
    t_s = np.arange(n + 1) * T
    states = motion.states(t_s, gyroscope=False, constants=np.zeros(CONSTANTS.width))
    states.constants[RATE] = states.aux[:, 3:6].mean(axis=0)
    return gyro_free(motion.imu(n * T, 100.0, gyroscope=False), t_s, **options), states


@pytest.mark.parametrize(
    ("motion", "T", "options"),
    [
        (sine(20.0), 0.1, {"variance": 0.1}),
        (sine(45.0), 0.1, {"variance": 0.5}),
        (spin(2.0), 0.05, {"length_s": 0.15, "variance": 0.05**2}),
    ],
)
def test_true_motion_leaves_residuals_below_the_stated_noise(motion, T, options):
    factors, states = of_motion(motion, T, 40, **options)
    value = factors.linearise(*ends(states), every(factors)).value
    assert np.sqrt((value**2).mean(axis=0)).max() < 1.0
    assert np.abs(value[:, 3:12]).max() < 0.02  # samples without noise: quadrature alone


def test_half_a_second_of_a_wide_sine_is_crossed_within_the_accelerometers_noise():
    factors, states = of_motion(sine(45.0), 0.5, variance=0.5)
    value = factors.linearise(*ends(states), every(factors)).value
    assert np.sqrt((value[:, 3:9] ** 2).mean()) < 0.5


def test_motion_by_the_process_itself_has_residuals_of_variance_one():
    rng = np.random.default_rng(5)
    t_s, imu, states = _simulated(rng, until_s=60.0, lengths_s=LENGTHS_S, variance=0.3)
    factors = gyro_free(imu, t_s, variance=0.3)
    value = factors.linearise(*ends(states), every(factors)).value
    by_row = (value**2).mean(axis=0)
    assert by_row[3:6].max() < 1  # the integration's own noise of the position, 0.1 mm, is more
    others = np.delete(by_row, [3, 4, 5])
    assert abs(others.mean() - 1) < 3 * np.sqrt(2 / (18 * len(value))) + 0.01
    assert np.abs(others - 1).max() < 4 * np.sqrt(2 / len(value)) + 0.05


def _simulated(rng, *, until_s, lengths_s, variance):
    """Keyframes every 0.1 s, a noisy accelerometer and true states of a body that turns so."""
    h, every_sample, every_keyframe = 1e-3, 10, 100
    n = round(until_s / h)
    own = matern.poles(np.array(lengths_s))
    F, H, L = (
        np.array([of(h, axis) for axis in own])
        for of in (matern.transition, matern.integral, matern.noise_factor)
    )
    root = np.linalg.cholesky(np.array([matern.stationary(axis) for axis in own]) * variance)
    x = np.empty((n + 1, 3, 3))  # time, derivative, axis
    x[0] = np.einsum("ipq,qi->pi", root, rng.standard_normal((3, 3)))
    white, mean = np.sqrt(variance) * rng.standard_normal((n, 4, 3)), np.array([1.0, 0, 0])
    noise = np.einsum("ipq,nqi->npi", L, white)
    for k in range(n):
        x[k + 1] = np.einsum("ipq,qi->pi", F, x[k]) + noise[k, 1:]
    turned = np.einsum("iq,nqi->ni", H, x[:-1]) + noise[:, 0] + mean * h
    x[:, 0] += mean
    R_nb = exp(np.outer(-np.arange(n + 1) * h, EARTH_N_RADPS)) @ accumulated(turned, np.eye(3))
    time_s = np.arange(n + 1) * h
    v = np.array([50.0, 20.0, 1.0])
    f_n = -GRAVITY_N_MPS2 + 2 * np.cross(EARTH_N_RADPS, v)  # a straight line at constant speed
    samples, rows = slice(None, None, every_sample), slice(None, None, every_keyframe)
    f_b = np.einsum("nji,j->ni", R_nb[samples], f_n)
    density = 100.0 * DENSITY
    bias = np.cumsum(1e-4 * np.sqrt(0.01) * rng.standard_normal(f_b.shape), axis=0)
    imu = imu_of(
        time_s[samples],
        f_b + bias + np.sqrt(density) * rng.standard_normal(f_b.shape),
        accelerometer=(np.sqrt(DENSITY), 0.02, 1e-4),
    )
    m = len(time_s[rows])
    states = States(
        R_nb=R_nb[rows],
        p_n_m=np.outer(time_s[rows], v),
        v_n_mps=np.tile(v, (m, 1)),
        aux=np.hstack([bias[::10], x[rows].reshape(m, 9)]),
        constants=np.zeros(CONSTANTS.width),
    )
    states.constants[RATE] = mean
    return time_s[rows], imu, states


@pytest.mark.parametrize(
    ("motion", "T", "lasts"),
    [
        (sine(45.0), 0.1, False),
        (spin(2.0), 0.05, False),
        (sine(20.0), 0.5, False),
        (sine(45.0), 0.1, True),
    ],
)
def test_derivatives_are_differences_and_gtsams_factor_is_the_kernel(motion, T, lasts):
    factors, states = of_motion(motion, T, 5)
    rng = np.random.default_rng(12)
    if lasts:
        factors, states = with_lasting(factors, states, rng)
    moved = moved_at_random(states, rng, 0.02)
    assert_derivatives(factors, moved, CONSTANTS)


def test_a_lasting_error_keeps_its_covariance():
    rng = np.random.default_rng(13)
    error = lasting(np.arange(9) / 10, 6, rng)
    F, white = error.transition()
    noise = np.linalg.inv(white.swapaxes(1, 2) @ white)
    np.testing.assert_allclose(
        F @ F.swapaxes(1, 2) + noise, np.tile(np.eye(6), (8, 1, 1)), atol=1e-12
    )


def test_keyframes_between_leave_a_lasting_error_as_it_is():
    rng = np.random.default_rng(14)
    error = lasting(np.arange(6) / 10, 6, rng)
    finer = error.at_times(np.sort(np.r_[error.t_s, error.t_s[:-1] + 0.03]))
    F, _ = error.transition()
    parts, _ = finer.transition()
    np.testing.assert_allclose(parts[1::2] @ parts[::2], F, rtol=0, atol=1e-12)
    np.testing.assert_array_equal(finer.at_times(finer.t_s[2:7]).transition()[0], parts[2:6])


@pytest.mark.parametrize("lasts", [False, True])
def test_predicted_states_have_no_residual(lasts):
    factors, states = of_motion(sine(45.0), 0.1, 10)
    if lasts:
        factors, states = with_lasting(factors, states, np.random.default_rng(15))
    before, _ = ends(moved_at_random(states, np.random.default_rng(3), 0.05))
    after = factors.predict(before, every(factors))
    assert np.abs(factors.linearise(before, after, every(factors)).value).max() < 1e-6


def test_a_slow_sine_is_predicted_over_a_tenth_of_a_second():
    factors, states = of_motion(sine(20.0), 0.1, 10)
    before, after = ends(states)
    led = factors.predict(before, every(factors))
    assert np.abs(led.p_n_m - after.p_n_m).max() < 0.1e-3
    assert np.abs(led.v_n_mps - after.v_n_mps).max() < 1e-3
    assert np.abs(led.R_nb - after.R_nb).max() < 1e-4


def test_prior_is_the_stationary_process_about_the_mean_rate():
    factors, _ = of_motion(sine(20.0), 0.1, 5, length_s=0.7, variance=0.2)
    mean, rows = factors.prior(CONSTANTS.width)
    rng = np.random.default_rng(4)
    k = np.sqrt(5) / 0.7 * DERIVATIVE_SCALE_S
    P = 0.2 * np.array([[1, 0, -(k**2) / 3], [0, k**2 / 3, 0], [-(k**2) / 3, 0, k**4]])
    constants = rng.standard_normal(CONSTANTS.width)
    x = np.linalg.cholesky(P) @ rng.standard_normal((3, 3))  # derivative, axis
    aux = np.concatenate([[0.02, 0, 0], x[0] + constants[RATE], x[1], x[2]])
    white = rows @ np.concatenate([aux - mean, constants])
    assert white[0] == pytest.approx(1.0)
    expected = np.einsum("pi,pq,qi->", x, np.linalg.inv(P), x)
    assert (white[3:] ** 2).sum() == pytest.approx(expected, rel=1e-9)


def test_more_keyframes_leave_motion_and_noise_as_they_are():
    factors, states = of_motion(sine(20.0), 0.2, 5)
    noise = np.arange(1.0, 6.0)
    raised = replace(factors, accelerometer_noise=noise)
    finer = raised.at_times(np.sort(np.r_[factors.t_s, factors.t_s[:-1] + 0.15]))
    np.testing.assert_array_equal(finer.accelerometer_noise, np.repeat(noise, 2))
    same = factors.at_times(factors.t_s).linearise(*ends(states), every(factors))
    kept = factors.linearise(*ends(states), every(factors))
    np.testing.assert_array_equal(same.value, kept.value)


def test_raised_noise_weakens_position_and_velocity_alone():
    factors, states = of_motion(sine(20.0), 0.1, 5)
    before, after = ends(moved_at_random(states, np.random.default_rng(6), 0.01))
    raised = replace(factors, accelerometer_noise=factors.accelerometer_noise * 1e4)
    kept, weak = (m.linearise(before, after, every(m)).value for m in (factors, raised))
    np.testing.assert_allclose(weak[:, 6:9], kept[:, 6:9] / 100, rtol=1e-12)
    others = [0, 1, 2, *range(9, 21)]
    np.testing.assert_array_equal(weak[:, others], kept[:, others])


def test_arrays_of_wrong_shape_are_refused_by_name():
    factors, _ = of_motion(sine(20.0), 0.1, 5)
    with pytest.raises(BadInputError, match=r"gyro-free poles_per_s: expected shape \(5, 3, 3\)"):
        replace(factors, poles_per_s=np.ones((4, 3)))
    with pytest.raises(BadInputError, match="gyro-free constants: mean rate is not among them"):
        replace(factors, constants=Parameters())
