import numpy as np
import pytest

from fgnav.geometry.rotations import exp
from fgnav.process.matern import integral, noise_factor, poles, stationary
from fgnav.process.prediction import filtered
from tests.process.chain import DEG

T_S = 0.1 * np.arange(120)
SIGMA = 0.1 * DEG


def covariances(valid, length_s=1.0, sigma=0.2, R_nb=None):
    n = len(T_S)
    R = np.tile(np.eye(3), (n, 1, 1)) if R_nb is None else R_nb
    P = np.tile(SIGMA**2 * np.eye(3), (n, 1, 1))
    prior = np.tile(poles(length_s), (n - 1, 1)), np.full((n - 1, 3), sigma**2)
    return filtered(T_S, R, P, valid, prior).covariance[:, :3, :3]


def test_a_gap_grows_as_the_process_predicts():
    """Between what it does from a rate that is known, and from a rate and a mean that are not."""
    valid = np.ones(120, dtype=bool)
    valid[61:] = False
    own = poles(1.0)
    sigma = np.sqrt(covariances(valid)[:, 0, 0])
    assert (sigma[2:61] < 1.5 * SIGMA).all()  # the second may be wrong for all that is known
    for k in (65, 75, 100):
        T = T_S[k] - T_S[60]
        noise = 0.2 * np.linalg.norm(noise_factor(T, own)[0])
        H = integral(T, own)
        unknown = np.linalg.norm([noise, 0.2 * np.sqrt(H @ stationary(own) @ H), 0.2 * T])
        assert noise < sigma[k] < unknown
    assert (np.diff(sigma[61:]) > 0).all()


def test_what_comes_after_a_time_changes_nothing_before_it():
    rng = np.random.default_rng(20_050)
    valid = np.ones(120, dtype=bool)
    valid[50:70] = False
    one = covariances(valid)
    turned = np.tile(np.eye(3), (120, 1, 1))
    turned[80:] = exp(rng.normal(size=(40, 3)))
    np.testing.assert_allclose(covariances(valid, R_nb=turned)[:80], one[:80], rtol=1e-12)


def test_before_the_first_attitude_nothing_is_known():
    valid = np.ones(120, dtype=bool)
    valid[:30] = False
    found = covariances(valid)
    assert np.isinf(found[:30]).all()
    assert np.sqrt(found[30, 0, 0]) == pytest.approx(SIGMA, rel=1e-6)
