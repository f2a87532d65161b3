"""Any time within a flight as a keyframe."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav.graph.between import with_times
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Batch, Forward, Smoother
from tests.methods.simulated import errors_rad, flown, nees

RIGHT = Truth()
BATCH = Batch(resolver=RIGHT, noise="nominal")


@pytest.fixture(scope="module")
def flight():
    return flown("demo", 20.0)


@pytest.fixture(scope="module")
def batch(flight):
    return BATCH(flight)


def test_between_keyframes_the_motion_model_is_as_good_as_at_them(flight, batch):
    t_s = np.arange(1.013, 18.9, 0.25)
    between = BATCH.at(flight, t_s)
    assert_allclose(between.t_s, t_s)
    assert between.converged
    error = errors_rad(flight, between)
    assert 0.8 < nees(error, between.attitude_covariance_rad2) < 4.5
    sigma, at_keyframes = (
        np.sqrt(np.einsum("nii->ni", e.attitude_covariance_rad2)).mean(axis=0)
        for e in (between, batch)
    )
    assert_allclose(sigma, at_keyframes, rtol=0.15)


def test_a_time_at_a_keyframe_is_that_keyframe(flight, batch):
    estimate = BATCH.at(flight, batch.t_s[[3, 50]])
    assert_allclose(estimate.p_n_m, batch.p_n_m[[3, 50]], atol=1e-9)
    assert_allclose(estimate.R_nb, batch.R_nb[[3, 50]], atol=1e-12)
    assert estimate.n_epochs == 2


def test_at_keyframes_the_search_starts_where_it_did(flight):
    """To the last bit, at the last one, too: a filter's covariance tells by 1e-6 of itself."""
    problem = Smoother(resolver=RIGHT, noise="nominal").prepare(flight).problem
    dense = with_times(problem, problem.t_s[:-1] + 0.05)
    row = np.searchsorted(dense.t_s, problem.t_s)
    for name in ("R_nb", "p_n_m", "v_n_mps", "aux"):
        assert_array_equal(getattr(dense.start, name)[row], getattr(problem.start, name))


@pytest.mark.parametrize("method", [Smoother, Forward])
def test_the_window_and_the_filter_tell_any_time_too(flight, method):
    one = method(resolver=RIGHT, noise="nominal")
    estimate = one.at(flight, np.array([5.03, 5.07, 12.345]))
    assert np.abs(errors_rad(flight, estimate)).max() < 0.1
    assert estimate.method == one.name


def test_more_times_leave_the_others_as_they_were(flight, batch):
    t_s = np.union1d(batch.t_s, [5.05, 5.051])
    dense = BATCH.at(flight, t_s)
    row = np.searchsorted(t_s, batch.t_s)
    sigma = np.sqrt(np.einsum("nii->ni", batch.position_covariance_m2))
    # Other sub-steps in two intervals, and no more.
    assert (np.abs(dense.p_n_m[row] - batch.p_n_m) < 0.02 * sigma).all()


@pytest.mark.parametrize(
    ("t_s", "text"),
    [
        ([], "must be one or more times"),
        ([3.0, 2.0], "must be one or more times"),
        ([-5.0, 2.0], "t_s: must lie within the keyframes"),
        ([2.0, 50.0], "t_s: must lie within the keyframes"),
    ],
)
def test_times_that_mean_nothing_are_refused(flight, t_s, text):
    with pytest.raises(BadInputError, match=text):
        BATCH.at(flight, np.array(t_s))
