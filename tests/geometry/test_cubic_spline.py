import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from fgnav.geometry.cubic_spline import cubic_spline


@pytest.mark.parametrize("n", [2, 3, 4, 5, 300])
@pytest.mark.parametrize("shape", [(), (3,)])
def test_it_is_scipy_s_spline_also_beyond_the_samples(n, shape):
    rng = np.random.default_rng(n)
    t = np.cumsum(rng.uniform(0.01, 1.0, n))
    values = rng.normal(size=(n, *shape))
    at = np.concatenate([t, rng.uniform(t[0] - 0.1, t[-1] + 0.1, 100)])
    found = cubic_spline(t, values, at)
    assert found.shape == (len(at), *shape)
    theirs = CubicSpline(t, values)(at)
    assert_allclose(found, theirs, rtol=0, atol=1e-12 * max(np.abs(theirs).max(), 1))


def test_a_cubic_is_kept_exactly():
    t, at = np.array([0.0, 0.1, 0.7, 1.0, 1.6]), np.linspace(-0.5, 2, 50)
    assert_allclose(cubic_spline(t, t**3 - t, at), at**3 - at, rtol=0, atol=1e-13)
