import numpy as np
import pytest

from fgnav.methods.smoother.autoregression import interpolated

# What counts as noise damps a sine: across a period, by a tenth.
DAMPED = 0.15


def test_sines_go_on_through_a_gap_longer_than_their_period():
    t = np.arange(400)
    samples = np.stack([np.sin(t / 7), np.cos(t / 11) + 3.0], axis=1)
    known = (t < 190) | (t >= 240)
    spoiled = np.where(known[:, None], samples, 99.0)
    found = interpolated(spoiled, known, 180, 250, 8)
    np.testing.assert_allclose(found, samples[180:251], rtol=0, atol=DAMPED)
    assert (found[:10] == samples[180:190]).all()


def test_a_random_walk_goes_straight_across():
    """That is its best interpolation, but for how well the autoregression is fitted."""
    rng = np.random.default_rng(0)
    walk = np.cumsum(rng.standard_normal(4000))[:, None]
    known = np.ones(4000, dtype=bool)
    known[2000:2040] = False
    found = interpolated(walk, known, 1999, 2040, 5)
    straight = np.interp(np.arange(42), [0, 41], walk[[1999, 2040], 0])
    np.testing.assert_allclose(found[:, 0], straight, rtol=0, atol=1.0)
    assert np.abs(walk[1999:2041, 0] - straight).max() > 3


def test_another_gap_is_passed_over():
    t = np.arange(500)
    samples = np.sin(t / 7)[:, None]
    known = ((t < 190) | (t >= 240)) & ((t < 280) | (t >= 300))
    found = interpolated(np.where(known[:, None], samples, 99.0), known, 180, 250, 8)
    np.testing.assert_allclose(found, samples[180:251], rtol=0, atol=DAMPED)


@pytest.mark.parametrize(
    "known",
    [np.arange(60) < 40, np.arange(60) % 5 > 0, np.zeros(60, dtype=bool)],
    ids=["nothing after it", "never enough in a row", "nothing"],
)
def test_what_too_few_samples_tell_is_left_open(known):
    assert interpolated(np.zeros((60, 1)), known, 40, 50, 8) is None
