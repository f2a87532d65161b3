import numpy as np
import pytest

from fgnav.geometry.rotations import exp, from_euler
from fgnav.process.attitude_series import attitude_series
from fgnav.process.evidence import rate_prior
from fgnav.process.evidence_kernel import PREDICT, RESTART, tape
from fgnav.process.matern import poles
from fgnav.process.score_kernel import score
from fgnav.process.volatility import varying_rate_prior
from tests.process.attitudes import DEG, drawn_attitudes, sine, with_noise

T_S = 0.1 * np.arange(300)
SIGMA = 0.3 * DEG


def thrown(t_s, rng):
    """Turning slowly, but in the middle by 30 degrees within half a second."""
    calm, throw = 0.02 * np.sin(0.5 * t_s), 30 * DEG * (1 + np.tanh((t_s - 15) / 0.2)) / 2
    truth = from_euler(calm + throw, calm, calm)
    return with_noise(truth, SIGMA, rng)


@pytest.mark.parametrize("with_gap", [False, True])
def test_score_is_the_derivative_of_the_likelihood(with_gap):
    rng = np.random.default_rng(20_040)
    t_s, sigma = T_S[:60], np.array([0.3, 0.5, 0.2])
    R = drawn_attitudes(t_s, poles(0.6), sigma, np.array([0.1, -0.2, 0.3]), rng)
    attitudes = attitude_series(t_s, *with_noise(R, SIGMA, rng), np.arange(60), past=60)
    if with_gap:
        attitudes.epochs.use[20:24], attitudes.epochs.use[40] = PREDICT, RESTART
    variance = sigma**2 * rng.uniform(0.5, 2, (59, 3))
    room = tape(60)
    own = np.array([2.0, 0.5, 3.0])
    attitudes.log_densities(own, variance, room)
    slope, freedom, _ = score(t_s, np.tile(own, (59, 3, 1)), variance, room, False)
    assert (freedom > -1e-12).all()
    assert (freedom < 4).all()
    for k, axis in ((3, 0), (21, 1), (30, 1), (39, 2), (58, 0)):
        ends = []
        for step in (1e-4, -1e-4):
            moved = variance.copy()
            moved[k, axis] *= np.exp(2 * step)
            ends.append(attitudes.log_densities(own, moved).sum())
        # linearised about other estimates at every other variance, and of a mixture: .1
        assert slope[k, axis] == pytest.approx((ends[0] - ends[1]) / 2e-4, abs=0.1, rel=0.1)


def test_a_throw_has_a_scale_of_its_own():
    R, V = thrown(T_S, np.random.default_rng(20_041))
    varying = varying_rate_prior(T_S, R, V, rate_prior(T_S, R, V))
    assert varying.evidence_gain > 20
    sigma = np.sqrt(varying.variance_rad2ps2)
    during = np.abs(T_S[:-1] - 15) < 0.5
    assert sigma[during, 0].max() > 20 * np.median(sigma[:, 0])
    assert sigma[during, 1].max() < 4 * np.median(sigma[:, 1])


@pytest.mark.parametrize("motion", ["sine", "still", "spin", "drawn"])
def test_an_even_motion_keeps_its_constant_scale(motion):
    rng = np.random.default_rng(20_042)
    along = np.array([[1.0, 0.0, 0.0]])
    truth = {
        "sine": lambda: sine(T_S),
        "still": lambda: np.tile(np.eye(3), (len(T_S), 1, 1)),
        "spin": lambda: exp(4 * np.pi * T_S[:, None] * along),
        "drawn": lambda: drawn_attitudes(T_S, poles(0.6), np.full(3, 0.4), np.zeros(3), rng),
    }[motion]()
    R, V = with_noise(truth, SIGMA, rng)
    assert varying_rate_prior(T_S, R, V, rate_prior(T_S, R, V)) is None


def test_wrong_attitudes_are_no_throw():
    rng = np.random.default_rng(20_043)
    R, V = with_noise(sine(T_S), SIGMA, rng)
    wrong = rng.random(300) < 0.05
    R[wrong] = R[wrong] @ exp(rng.normal(size=(wrong.sum(), 3)))
    assert varying_rate_prior(T_S, R, V, rate_prior(T_S, R, V)) is None
