"""The benchmark ``consistency``, few flights of it: is the stated covariance believable?"""

import pytest

from tests.benchmarks.consistency import (
    one,
    rows_of,
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
