"""Motion with a gyroscope: GTSAM's Galilean preintegration against motions in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.graph.inertial.increments import at_latest
from fgnav.graph.inertial.preintegrated import TURNED_RAD, Inertial
from fgnav.graph.types.parameters import Parameters, flight_constant
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


def inertial(imu, t_s, *, sub_steps=2):
    n = len(t_s)
    accelerometer = imu.accelerometer_noise_mps2_per_sqrt_hz
    return Inertial(
        t_s=t_s,
        imu=imu,
        sub_steps=sub_steps,
        gravity_n_mps2=np.tile(GRAVITY_N_MPS2, (n, 1)),
        earth_rate_n_radps=EARTH_N_RADPS,
        accelerometer_noise=np.full(n - 1, accelerometer**2),
        gyroscope_noise=np.full(n - 1, imu.gyroscope_noise_radps_per_sqrt_hz**2),
    )


def of_motion(motion, T, n=20, constants=0, **options):
    t_s = np.arange(n + 1) * T
    states = motion.states(t_s, gyroscope=True, constants=np.zeros(constants))
    return inertial(motion.imu(n * T, 100.0, gyroscope=True), t_s, **options), states


@pytest.mark.parametrize(("motion", "T"), [(sine(45.0), 0.1), (spin(2.0), 0.1), (sine(45.0), 0.5)])
def test_true_motion_leaves_residuals_below_the_stated_noise(motion, T):
    factors, states = of_motion(motion, T)
    value = factors.linearise(*ends(states), every(factors)).value
    assert np.sqrt((value**2).mean(axis=0)).max() < 0.5


def test_noisy_samples_with_walking_biases_have_residuals_of_variance_one():
    rng, hz, n, T = np.random.default_rng(3), 100.0, 300, 0.1
    t_s, motion = np.arange(n + 1) * T, sine(45.0)
    imu = motion.imu(n * T, hz, gyroscope=True)
    noise, walk = np.repeat([1e-2, 1e-3], 3), np.repeat([1e-3, 1e-4], 3)  # densities
    k = len(imu.t_s)
    bias = np.cumsum(walk / np.sqrt(hz) * rng.standard_normal((k, 6)), axis=0) + 0.01
    white = noise * np.sqrt(hz) * rng.standard_normal((k, 6))
    noisy = replace(
        imu,
        f_b_mps2=imu.f_b_mps2 + (bias + white)[:, :3],
        w_b_radps=imu.w_b_radps + (bias + white)[:, 3:],
        accelerometer_noise_mps2_per_sqrt_hz=1e-2,
        accelerometer_bias_walk_mps2_per_sqrt_s=1e-3,
        gyroscope_noise_radps_per_sqrt_hz=1e-3,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-4,
    )
    states = motion.states(t_s, gyroscope=True, constants=np.zeros(0))
    states = states._replace(aux=bias[::10])
    factors = inertial(noisy, t_s)
    by_row = (factors.linearise(*ends(states), every(factors)).value ** 2).mean(axis=0)
    assert by_row[3:6].max() < 1  # the integration's own noise of the position, 0.1 mm, is more
    others = np.delete(by_row, [3, 4, 5])
    assert abs(others.mean() - 1) < 3 * np.sqrt(2 / (12 * n))
    assert np.abs(others - 1).max() < 4 * np.sqrt(2 / n)


@pytest.mark.parametrize("motion", [sine(45.0), spin(2.0)])
def test_derivatives_are_differences_and_those_of_all_intervals_at_once(motion):
    constants = Parameters((flight_constant("landmark", ("x", "y"), "m", 1.0),))
    factors, states = of_motion(motion, 0.1, 5, constants=2)
    factors.linearise(*ends(states), every(factors))  # about these biases from now on
    moved = moved_at_random(states, np.random.default_rng(2), 1e-3)
    moved.aux[:, 3:] *= 0.5 * TURNED_RAD / (0.1 * np.abs(moved.aux[:, 3:]).max())
    assert_derivatives(factors, moved, constants)


def test_predicted_states_have_no_residual():
    factors, states = of_motion(spin(2.0), 0.1, 10)
    before, _ = ends(moved_at_random(states, np.random.default_rng(3), 0.01))
    after = factors.predict(before, every(factors))
    assert np.abs(factors.linearise(before, after, every(factors)).value).max() < 1e-6


@pytest.mark.parametrize("change", [0.9 * TURNED_RAD, 5 * TURNED_RAD])
def test_another_gyroscope_bias_is_as_good_as_integrated_about_it(change):
    factors, states = of_motion(spin(2.0), 0.1, 5)
    before, after = ends(states)
    factors.linearise(before, after, every(factors))
    before = before._replace(aux=np.tile([0.3, 0.3, 0.3, *np.full(3, change / 0.1)], (5, 1)))
    anew = replace(factors)
    after = anew.predict(before, every(factors))
    assert np.abs(factors.linearise(before, after, every(factors)).value).max() < 0.1


def test_what_is_released_is_made_again_to_the_last_bit_about_the_first_biases():
    (kept, states), (released, _), (fresh, _) = (of_motion(sine(45.0), 0.1) for _ in range(3))
    before, after = ends(states)
    for one in (kept, released):
        one.linearise(before, after, every(one))
    released.release(10)
    before.aux[:, 3:] += 0.9 * TURNED_RAD / 0.1  # near enough: still about the first
    value, again, other = (
        one.linearise(before, after, every(one)).value for one in (kept, released, fresh)
    )
    np.testing.assert_array_equal(again, value)
    assert (other != value).any()


def test_rates_are_the_gyroscopes_less_its_bias():
    factors, states = of_motion(sine(45.0), 0.1, 10)
    aux = np.tile([0.1, 0.1, 0.1, 0.01, 0.02, 0.03], (11, 1))
    expected = at_latest(factors.imu.t_s, factors.imu.w_b_radps, factors.t_s) - aux[:, 3:]
    np.testing.assert_allclose(factors.rates_b_radps(factors.t_s, aux), expected, atol=1e-12)
    truth = sine(45.0).inertial_rates(factors.t_s)
    assert np.abs(factors.rates_b_radps(factors.t_s, 0 * states.aux) - truth).max() < 1e-6


def test_prior_is_the_stated_size_of_both_biases():
    factors, _ = of_motion(sine(45.0), 0.1, 2)
    mean, rows = factors.prior(4)
    assert not mean.any()
    expected = np.diag(1 / np.repeat([0.02, 1e-3], 3))
    np.testing.assert_allclose(rows, np.hstack([expected, np.zeros((6, 4))]), rtol=1e-12)


def test_more_keyframes_inherit_the_noise_of_their_interval():
    factors, _ = of_motion(sine(45.0), 0.2, 5)
    raised = replace(
        factors, accelerometer_noise=np.arange(1.0, 6.0), gyroscope_noise=np.arange(2.0, 7.0)
    )
    finer = raised.at_times(np.sort(np.r_[factors.t_s, factors.t_s[:-1] + 0.15]))
    np.testing.assert_array_equal(finer.accelerometer_noise, np.repeat(np.arange(1.0, 6.0), 2))
    np.testing.assert_array_equal(finer.gyroscope_noise, np.repeat(np.arange(2.0, 7.0), 2))


def test_an_interval_of_raised_noise_weighs_less_and_others_the_same():
    factors, states = of_motion(sine(45.0), 0.1, 4)
    before, after = ends(moved_at_random(states, np.random.default_rng(6), 1e-3))
    raise_one = np.array([1.0, 1.0, 1e4, 1.0])
    raised = replace(
        factors,
        accelerometer_noise=factors.accelerometer_noise * raise_one,
        gyroscope_noise=factors.gyroscope_noise * raise_one,
    )
    kept, weak = (m.linearise(before, after, every(m)).value[:, :9] for m in (factors, raised))
    np.testing.assert_array_equal(weak[[0, 1, 3]], kept[[0, 1, 3]])
    assert np.abs(weak[2, :3]).max() < 0.02 * np.abs(kept[2, :3]).max()


def test_wrong_arrays_and_a_missing_gyroscope_are_refused_by_name():
    factors, _ = of_motion(sine(45.0), 0.1, 4)
    with pytest.raises(BadInputError, match=r"inertial gyroscope_noise: expected shape \(4,\)"):
        replace(factors, gyroscope_noise=np.ones(3))
    with pytest.raises(BadInputError, match=r"inertial accelerometer_noise: expected shape \(4,\)"):
        factors.with_added_noise(np.ones((2, 4)), np.ones(4))
    with pytest.raises(BadInputError, match="the imu has no gyroscope"):
        replace(factors, imu=sine(45.0).imu(1.0, 100.0, gyroscope=False))
