"""Filter less smoother has the difference of their covariances, if both are what they say."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.evaluation.internal_consistency.filter_smoother import separations
from fgnav.types.estimate import Estimate

STEPS, Q, R = 60, 0.04, 1.0


def kalman_and_rts(measured):
    """Return means and variances of a random walk by a filter and by the smoother behind it."""
    mean, variance = np.empty_like(measured), np.empty(len(measured))
    m, p = np.zeros(measured.shape[1]), 100.0
    for k, z in enumerate(measured):
        p = p + Q * (k > 0)
        gain = p / (p + R)
        m, p = m + gain * (z - m), (1 - gain) * p
        mean[k], variance[k] = m, p
    smooth, smooth_variance = mean.copy(), variance.copy()
    for k in range(len(measured) - 2, -1, -1):
        gain = variance[k] / (variance[k] + Q)
        smooth[k] += gain * (smooth[k + 1] - mean[k])
        smooth_variance[k] += gain**2 * (smooth_variance[k + 1] - variance[k] - Q)
    return (mean, variance), (smooth, smooth_variance)


def estimate(name, mean, variance):
    n = len(mean)
    covariance = variance[:, None, None] * np.eye(3)
    return Estimate(
        method=name,
        t_s=np.arange(n) * 1.0,
        epochs=n,
        R_nb=np.tile(np.eye(3), (n, 1, 1)),
        attitude_covariance_rad2=covariance,
        p_n_m=mean,
        position_covariance_m2=covariance,
    )


@pytest.fixture(scope="module")
def both():
    rng, ratios, pair = np.random.default_rng(5), [], None
    for _ in range(300):
        walk = np.cumsum(np.sqrt(Q) * rng.standard_normal((STEPS, 3)), axis=0)
        passes = kalman_and_rts(walk + np.sqrt(R) * rng.standard_normal((STEPS, 3)))
        pair = [estimate(n, *one) for n, one in zip(("forward", "smoother"), passes, strict=True)]
        ratios.append(next(s.ratio for s in separations(*pair) if s.quantity == "position"))
    return pair, np.array(ratios)


def test_two_honest_passes_differ_by_the_difference_of_their_covariances(both):
    ratios = both[1][:, :-1]  # at the last epoch both are one
    # 900 independent squares at each epoch: mean 1, 1 sigma .047; the largest of 59.
    assert np.abs((ratios**2).mean(axis=(0, 2)) - 1).max() < 5 * np.sqrt(2 / 900)


def test_where_the_smoother_states_more_there_is_no_sigma(both):
    pair = both[0]
    assert np.isnan(separations(*pair)[1].sigma[-1]).all()
    assert np.isnan(separations(*pair[::-1])[1].sigma).all()


def test_states_without_a_covariance_or_left_open_are_not_compared(both):
    forward, smoother = both[0]
    names = [s.quantity for s in separations(forward, smoother)]
    assert names == ["attitude", "position"]
    open_ = replace(forward, unobservable=("yaw",))
    assert [s.quantity for s in separations(open_, smoother)] == ["position"]
    later = replace(smoother, t_s=smoother.t_s + 0.5)
    assert separations(forward, later) == []
