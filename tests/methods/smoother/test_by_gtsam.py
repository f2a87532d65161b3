import numpy as np
from numpy.testing import assert_allclose

from fgnav.integers.truth import Truth
from fgnav.methods import method_named
from fgnav.methods.smoother import Batch, GtsamBatch
from tests.methods.simulated import flown

RIGHT = Truth()


def test_gtsam_and_the_chain_end_at_the_same_minimum_with_the_same_covariance():
    flight = flown("demo", 10.0)
    ours, theirs = Batch(resolver=RIGHT)(flight), GtsamBatch(resolver=RIGHT)(flight)
    assert ours.converged
    assert theirs.converged
    sigma = np.sqrt(np.einsum("nii->ni", ours.attitude_covariance_rad2))
    turn = np.einsum("nji,njk->nik", ours.R_nb, theirs.R_nb)
    off = np.stack([turn[:, 2, 1], turn[:, 0, 2], turn[:, 1, 0]], axis=1)
    # The Earth's turn enters GTSAM's preintegration to second order only.
    assert np.abs(off / sigma).max() < 0.1
    theirs_sigma = np.sqrt(np.einsum("nii->ni", theirs.attitude_covariance_rad2))
    assert_allclose(theirs_sigma, sigma, rtol=0.02)
    assert_allclose(theirs.v_n_mps, ours.v_n_mps, atol=2e-3)


def test_it_is_a_method_of_its_own_with_the_landmark():
    method = method_named("gtsam", RIGHT)
    assert method.name == "gtsam"
    estimate = method(flown("terminal", 50.0))
    assert estimate.converged
