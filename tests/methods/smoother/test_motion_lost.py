"""Shares of motion lost by a smoother whose every part is known in the frequency domain."""

import numpy as np
import pytest

from fgnav.methods.smoother.motion_lost import PLACES, RATIO, Levels

N, STEP_S, INTENSITY, NOISE = 1200, 0.1, 1.0, 0.01  # (rad/s2)2/Hz, rad2 s
OMEGA = 2 * np.pi * np.fft.rfftfreq(N, STEP_S)


def levels(motion, rng):
    """Return what five smoothers make of a motion, (n, 3), that noise is added to."""
    noise = np.sqrt(NOISE / STEP_S) * rng.standard_normal((N, 3))
    seen = np.fft.rfft(motion + noise, axis=0)
    step, covariance = np.zeros((5, N, 15)), np.tile(np.eye(15), (5, N, 1, 1))
    for j, place in enumerate(PLACES):
        gain = 1 / (1 + NOISE * OMEGA**4 / (INTENSITY * RATIO**place))
        step[j, :, :3] = np.fft.irfft(gain[:, None] * seen, N, axis=0)
        both_sides = np.concatenate([gain, gain[-2:0:-1]])
        covariance[j, :, :3, :3] *= NOISE / STEP_S * both_sides.mean()
    return Levels(step=step, covariance=covariance)


def walk(rng, share):
    """Return a motion whose rate is a random walk of a share of the intensity, (n, 3)."""
    white = np.fft.rfft(np.sqrt(share * INTENSITY / STEP_S) * rng.standard_normal((N, 3)), axis=0)
    white[0] = 0.0
    return np.fft.irfft(-white / np.where(OMEGA > 0, OMEGA, 1.0)[:, None] ** 2, N, axis=0)


def test_slopes_are_those_of_the_covariances():
    power = 0.4
    P = np.exp(power * np.log(RATIO) * PLACES)[:, None, None, None] * np.eye(15)
    known = Levels(step=np.zeros((5, 1, 15)), covariance=P)
    np.testing.assert_allclose(np.diag(known.slope()[0]), power, rtol=1e-3)


@pytest.mark.parametrize("share", [0.5, 1.0, 2.0])
def test_a_random_walk_loses_as_much_as_its_own_intensity_says(share):
    found = [
        levels(walk(rng, share), rng).share()[0] for rng in map(np.random.default_rng, range(12))
    ]
    assert np.mean(found) == pytest.approx(share, abs=0.2)  # its standard deviation: 0.07 to 0.14


def test_a_swing_loses_what_it_does_and_not_what_a_walk_that_moves_as_far_would():
    row, size = 30, 1.5
    omega = OMEGA[row]
    swing = size * np.sin(omega * STEP_S * np.arange(N))[:, None] * np.ones(3)
    gain = 1 / (1 + NOISE * omega**4 / INTENSITY)
    lost = (size * (1 - gain)) ** 2 / 2
    found = []
    for rng in map(np.random.default_rng, range(12)):
        known = levels(swing, rng)
        found.append(known.share()[0] * known.slope()[0, 0, 0])
    assert np.mean(found) == pytest.approx(lost, rel=0.4)


def test_few_epochs_tell_little_and_the_share_stays_near_one():
    rng = np.random.default_rng(0)
    whole = levels(0 * walk(rng, 1.0), rng)
    few = Levels(step=whole.step[:, :40], covariance=whole.covariance[:, :40])
    (share, doubt), (of_few, doubt_of_few) = whole.share(), few.share()
    assert share < 0.2
    assert doubt_of_few > doubt
    assert share < of_few < 1


def test_a_third_of_the_intensity_is_better_where_next_to_nothing_moves():
    rng = np.random.default_rng(0)
    assert levels(np.zeros((N, 3)), rng).too_loose
    assert not levels(walk(rng, 1.0), rng).too_loose
