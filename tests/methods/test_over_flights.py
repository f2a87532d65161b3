"""The benchmark ``consistency``, few flights of it: is the stated covariance believable?"""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.geometry import rotations
from fgnav_sim.simulate import simulate
from tests.benchmarks.consistency import (
    anees,
    flown,
    one,
    rows_of,
    scenario_of,
    true_bias,
    with_message_errors,
)


def figures(name, flights):
    rows = rows_of(name, [one(name, seed) for seed in range(flights)])
    return {row["name"]: row["ours"] for row in rows}


@pytest.mark.parametrize(("name", "flights"), [("drawn", 6), ("gyro", 2)])
def test_errors_are_as_large_as_stated_where_the_motion_is_the_model(name, flights):
    """A rate that is a random walk of unknown intensity; and a gyroscope's bias."""
    rows = figures(name, flights)
    assert 2.0 < rows[f"anees_attitude_{name}"] < 4.5
    assert 0.8 < rows[f"rmse_over_sigma_{name}"] < 1.25


def test_a_smooth_motion_is_followed_within_the_stated_sigma():
    rows = figures("a20", 1)
    assert 1.7 < rows["anees_attitude_a20"] < 3.6
    assert rows["rmse_a20_roll"] < 0.19
    assert rows["rmse_a20_pitch"] < 0.10
    assert rows["rmse_a20_yaw"] < 0.055


def test_mean_squares_of_gaussian_errors_lie_in_their_band():
    rng = np.random.default_rng(1)
    covariance = np.diag([1.0, 4.0, 9.0])
    errors = rng.standard_normal((10, 2000, 3)) * [1, 2, 3]
    mean, inside = anees(errors, np.tile(covariance, (10, 2000, 1, 1)))
    assert abs(mean.mean() - 3) < 0.1
    assert abs(inside - 0.95) < 0.02


def test_messages_err_by_metres_that_move_by_centimetres_and_alike_on_all_antennas():
    flight = flown("drawn", 3)
    again = with_message_errors(flight, np.random.default_rng(0))
    change = again.observations.code_m - flight.observations.code_m
    seen = np.isfinite(change).all(axis=(0, 1))
    assert seen.sum() == 6
    assert (np.ptp(change[:, :, seen], axis=1) < 1e-4).all()  # by their places: millimetres off
    moved_m = np.ptp(change[:, 0, seen], axis=0)
    assert ((moved_m > 1e-3) & (moved_m < 0.1)).all()
    assert (np.abs(change[0, 0, seen]) > 0.1).all()


def test_the_true_bias_is_what_flights_of_one_seed_have_in_common():
    t_s, bias = true_bias("gyro", 4)
    rng = np.random.default_rng(4)
    flight = simulate(scenario_of("gyro", rng), rng)
    rate = flight.truth.R_nb  # turns by the mean rate between its samples
    turned = rotations.log(rotations.transpose(rate[:-1]) @ rate[1:])
    assert_allclose(bias[0], bias[-1], atol=5e-5)  # it walks by 1e-5
    measured = np.add.reduceat(flight.imu.w_b_radps, np.arange(0, len(t_s), 10))[: len(turned)] / 10
    off = measured - turned / np.diff(flight.truth.t_s)[:, None]
    earth = np.einsum("nji,j->ni", rate[:-1], flight.origin.earth_rate_n_radps)
    assert_allclose((off - earth).mean(axis=0), bias.mean(axis=0), atol=5e-4)
