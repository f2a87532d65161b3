"""A throw within a steady flight: its intensity is its own, and the rest's is that of the rest."""

import numpy as np
import pytest

from fgnav import rotations
from fgnav.methods.smoother.bursts import Intensity, intensity

from .test_density import noisy, stated, walking

LOUD, QUIET = 1.0, 2e-4


def thrown(rng, n=600, dt=0.1):
    """Attitudes that turn briskly about x for a second and a half from 20 s on, quietly else."""
    fine = 10
    density = np.full((fine * n, 3), QUIET)
    density[fine * 200 : fine * 215, 0] = LOUD
    rate = np.cumsum(np.sqrt(density * dt / fine) * rng.standard_normal((fine * n, 3)), axis=0)
    R = [np.eye(3)]
    for step in rotations.exp(rate * (dt / fine)):
        R.append(R[-1] @ step)
    return dt * np.arange(n), noisy(rng, np.array(R[:-1:fine]))


@pytest.mark.parametrize("seed", range(4))
def test_a_throw_has_an_intensity_of_its_own(seed):
    t, R = thrown(np.random.default_rng(seed))
    found = intensity(t, R, stated(len(t)))
    assert len(found.bursts) == 1
    from_s, until_s = found.bursts_s[0]
    assert 18.5 < from_s <= 20.0
    assert 21.3 < until_s < 24.0
    assert found.bursts[0, 0] > 0.1 * LOUD
    assert (found.usual < 5 * QUIET).all()
    density = found.at(t)
    np.testing.assert_array_equal(density[205], found.bursts[0])
    np.testing.assert_array_equal(density[[100, 300]], [found.usual, found.usual])


def test_steady_flights_have_no_burst():
    bursts = 0
    for seed in range(40):
        t, R = walking(np.random.default_rng(seed), np.full(3, 0.01), n=300)
        bursts += len(intensity(t, R, stated(len(t))).bursts)
    assert bursts <= 2  # one in a hundred flights is asked for


def test_a_steady_intensity_is_the_same_between_all_times():
    np.testing.assert_array_equal(Intensity.steady(np.ones(3)).at(np.arange(4.0)), np.ones((3, 3)))
