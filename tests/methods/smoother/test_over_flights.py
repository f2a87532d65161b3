"""The benchmark ``consistency``, few flights of it: is the stated covariance believable?"""

import numpy as np
import pytest

from fgnav.methods.smoother import Batch
from tests.benchmarks.consistency import (
    RIGHT,
    anees,
    cases,
    flown,
    judged,
    rows_of,
    with_message_errors,
)


def judgements(name, flights):
    scenario = cases()[name]
    method = Batch(resolver=RIGHT)
    return [judged(f, method(f)) for f in (flown(scenario, name, k) for k in range(flights))]


@pytest.mark.parametrize(("name", "flights"), [("drawn", 6), ("gyro", 2)])
def test_errors_are_as_large_as_stated_where_the_motion_is_the_model(name, flights):
    """A rate that is a random walk of unknown intensity; and a gyroscope's bias."""
    rows = {row["name"]: row["ours"] for row in rows_of(name, judgements(name, flights))}
    assert 2.0 < rows[f"anees_attitude_{name}"] < 4.5
    assert 0.8 < rows[f"rmse_over_sigma_{name}"] < 1.25


def test_a_smooth_motion_is_followed_within_the_stated_sigma():
    rows = {row["name"]: row["ours"] for row in rows_of("a20", judgements("a20", 1))}
    assert 1.3 < rows["anees_attitude_a20"] < 3.2
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


def test_messages_err_by_metres_all_flight_long_and_alike_on_all_antennas():
    scenario = cases()["drawn"]
    flight = flown(scenario, "drawn", 3)
    again = with_message_errors(flight, np.random.default_rng(0))
    change = again.observations.code_m - flight.observations.code_m
    seen = np.isfinite(change).all(axis=(0, 1))
    assert seen.sum() == 6
    assert (np.ptp(change[:, :, seen], axis=(0, 1)) < 1e-6).all()
    assert (np.abs(change[0, 0, seen]) > 0.1).all()
