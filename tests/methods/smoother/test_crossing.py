import numpy as np
import pytest

from fgnav import rotations
from fgnav.methods.smoother import crossing
from fgnav.methods.smoother.crossing import Around


def around(rate, dt=0.1, first=550, last=600):
    """Return what a body does that starts level and turns at rates, (n, 3)."""
    n = len(rate)
    known = np.ones(n, dtype=bool)
    known[first : last + 1] = False
    return Around(
        t_s=dt * np.arange(n),
        w_b_radps=rate,
        R_nb=crossing._turned(np.eye(3), rate, dt),
        known=known,
        first=first,
        last=last,
        edge=4,
    )


def across(one):
    """Return the way across the gap of one, and its errors."""
    _, R_nb = one.way(one.first, one.last, one.known)
    return rotations.log(rotations.transpose(R_nb) @ one.R_nb[one.first : one.last + 1])


def test_a_spinning_body_that_nods_is_followed_turn_by_turn():
    """Ten turns across the gap; the shortest way between its ends would have none."""
    t = 0.1 * np.arange(1200)
    rate = np.stack([4 * np.pi + 0 * t, 0.3 * np.sin(t), 0.3 * np.cos(t)], axis=1)
    error = across(around(rate))
    assert np.degrees(np.abs(error).max()) < 3
    np.testing.assert_allclose(error[[0, -1]], 0, atol=1e-6)


def test_little_around_a_gap_tells_no_intensity():
    rate = np.random.default_rng(0).standard_normal((200, 3))
    assert around(rate, first=80, last=120).density() is None


@pytest.mark.parametrize("seed", [0, 1])
def test_a_random_walk_is_told_to_be_as_brisk_as_it_is(seed):
    """Nothing foretells it; the largest error in a gap is more than that half-way."""
    rng = np.random.default_rng(seed)
    n, dt, density = 1200, 0.1, 1e-3
    rate = np.cumsum(np.sqrt(density * dt) * rng.standard_normal((n, 3)), axis=0)
    told = around(rate).density()
    assert (told > density).all()
    assert (told < 10 * density).all()
