import numpy as np
import pytest

from fgnav.geometry.rotations import exp, log
from fgnav.process.matern import integral, noise_factor, poles, stationary, transition
from fgnav.process.prediction import filtered, filtered_back, smoothed
from tests.process.attitudes import DEG

T_S = 0.1 * np.arange(120)
SIGMA = 0.1 * DEG


def covariances(valid, length_s=1.0, sigma=0.2, R_nb=None):
    n = len(T_S)
    R = np.tile(np.eye(3), (n, 1, 1)) if R_nb is None else R_nb
    P = np.tile(SIGMA**2 * np.eye(3), (n, 1, 1))
    prior = np.tile(poles(length_s), (n - 1, 3, 1)), np.full((n - 1, 3), sigma**2)
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


def test_what_comes_before_and_after_tells_more_than_either():
    """Of a rate drawn from the prior itself: errors fall, and are as large as they are stated."""
    rng = np.random.default_rng(20_051)
    T, own = 0.1, poles(1.0)
    noise, root = noise_factor(T, own), np.linalg.cholesky(stationary(own))
    x, R = 0.2 * root @ rng.normal(size=(3, 3)), [np.eye(3)]
    rates = [x[0].copy()]
    for _ in T_S[1:]:
        drawn = 0.2 * noise @ rng.normal(size=(4, 3))
        R.append(R[-1] @ exp((integral(T, own) @ x + drawn[0])[None])[0])
        x = transition(T, own) @ x + drawn[1:]
        rates.append(x[0].copy())
    sigma = 1.0 * DEG
    measured = np.array(R) @ exp(sigma * rng.normal(size=(120, 3)))
    prior = np.tile(own, (119, 3, 1)), np.full((119, 3), 0.2**2)
    P = np.tile(sigma**2 * np.eye(3), (120, 1, 1))
    of = (T_S, measured, P, np.ones(120, dtype=bool), prior)
    before, after = filtered(*of), filtered_back(*of)
    both = smoothed(before, after)

    def off(one):
        return np.linalg.norm(one.rate_b_radps - rates, axis=1)[10:110]

    assert np.sqrt((off(both) ** 2).mean()) < 0.7 * np.sqrt((off(before) ** 2).mean())
    turned = np.linalg.norm(log(np.swapaxes(both.R_nb, 1, 2) @ np.array(R)), axis=1)[10:110]
    assert np.sqrt((turned**2).mean()) < 0.6 * sigma * np.sqrt(3)
    stated = np.sqrt(np.trace(both.covariance[10:110, 3:, 3:], axis1=1, axis2=2))
    assert 0.5 < np.sqrt((off(both) ** 2 / stated**2).mean()) < 1.5


def test_before_the_first_attitude_nothing_is_known():
    valid = np.ones(120, dtype=bool)
    valid[:30] = False
    found = covariances(valid)
    assert np.isinf(found[:30]).all()
    assert np.sqrt(found[30, 0, 0]) == pytest.approx(SIGMA, rel=1e-6)
