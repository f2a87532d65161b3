import numpy as np
import pytest
from scipy.stats import multivariate_normal

from fgnav.checks import BadInputError
from fgnav.geometry.rotations import exp, from_euler, log
from fgnav.process import filter_kernel
from fgnav.process.attitude_series import NO_TAPE, attitude_series
from fgnav.process.evidence import (
    DEFAULT_LENGTH_S,
    DEFAULT_SIGMA_RADPS,
    RatePrior,
    rate_prior,
)
from fgnav.process.evidence_kernel import UPDATE, Epochs, tape
from fgnav.process.evidence_kernel import log_densities as log_densities_of
from fgnav.process.matern import integral, poles, transition
from fgnav.process.posterior import log_posterior
from tests.process.attitudes import (
    ARRAY_SIGMA,
    DEG,
    drawn_attitudes,
    sigmas,
    sine,
    with_noise,
)

T_S = 0.1 * np.arange(600)


def log_densities(t_s, R_nb, V, length_s, sigma, mean_sigma=0.1):
    n = len(t_s)
    epochs = Epochs(t_s, R_nb, V, np.zeros((n, 3)), np.full(n, UPDATE))
    own, variance = np.tile(poles(length_s), (n - 1, 3, 1)), np.full((n - 1, 3), sigma**2)
    return log_densities_of(epochs, np.array([0, 0, 0, mean_sigma]), own, variance, NO_TAPE)


def dense_log_likelihood(t_s, angle, V, length_s, sigma, mean_sigma):
    """Of angles about one axis given the first, by the covariance of all: no filter, no state."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    T = np.diff(t_s)
    s = t_s[:-1, None] + T[:, None] * (nodes + 1) / 2
    lag = np.sqrt(5) / length_s * np.abs(s.ravel()[:, None] - s.ravel())
    rates = sigma**2 * (1 + lag + lag**2 / 3) * np.exp(-lag)
    G = np.kron(np.tril(np.ones((len(T), len(T)))), weights / 2) * np.repeat(T, 8)
    since = t_s[1:] - t_s[0]
    C = G @ rates @ G.T + mean_sigma**2 * np.outer(since, since) + V * (1 + np.eye(len(T)))
    return multivariate_normal(np.zeros(len(T)), C).logpdf(angle[1:] - angle[0])


@pytest.mark.parametrize(("length_s", "sigma"), [(1.0, 0.1), (0.2, 0.3), (60.0, 1e-4)])
def test_likelihood_is_that_of_the_dense_covariance(length_s, sigma):
    rng = np.random.default_rng(1)
    t_s = np.cumsum(rng.uniform(0.05, 0.2, 60))
    V = (0.1 * DEG) ** 2
    angle = 0.1 * DEG * rng.normal(size=60)
    R = exp(angle[:, None] * np.array([[0.0, 0.0, 1.0]]))
    found = log_densities(t_s, R, np.tile(V * np.eye(3), (60, 1, 1)), length_s, sigma).sum()
    expected = 59 * np.log(0.99)  # each is right with that probability
    for data in (angle, np.zeros(60), np.zeros(60)):
        expected += dense_log_likelihood(t_s, data, V, length_s, sigma, 0.1)
    assert found == pytest.approx(expected, abs=0.05)


def test_rotation_rows_are_the_derivatives_of_the_predicted_rotation():
    rng = np.random.default_rng(2)
    T_s, h = 0.2, 1e-6
    F, H = (
        np.array([of(T_s, poles(length_s)) for length_s in (0.7, 0.2, 3.0)])
        for of in (transition, integral)
    )
    x = rng.normal(size=(4, 3)) * np.array([[3.0], [0.5], [0.3], [2.0]])
    C, N = np.empty((3, 15)), np.empty((3, 6))
    middle = exp(filter_kernel.rotation_rows(x, F, H, T_s, C, N)[None])[0]
    for column in range(15):
        ends = []
        for sign in (1, -1):
            start, moved = np.zeros(3), x.copy()
            if column < 3:
                start[column] = sign * h
            else:
                moved.ravel()[column - 3] += sign * h
            phi = filter_kernel.rotation_rows(moved, F, H, T_s, np.empty((3, 15)), np.empty((3, 6)))
            ends.append(middle.T @ exp(start[None])[0] @ exp(phi[None])[0])
        slope = (log(ends[0][None]) - log(ends[1][None]))[0] / (2 * h)
        np.testing.assert_allclose(C[:, column], slope, atol=1e-8)
    # noise of the rate afterwards acts as the derivative by T0 a does through it alone
    rest = C[:, 6:9] - H[:, 1] * N[:, :3]
    np.testing.assert_allclose(rest, F[:, 0, 1] * N[:, 3:], atol=1e-12)


@pytest.mark.parametrize("length_s", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("epochs", [200, 600])
def test_hyperparameters_of_drawn_rates_are_recovered(length_s, epochs):
    rng = np.random.default_rng(20_000)
    sigma, t_s = np.array([0.3, 0.5, 0.2]), T_S[:epochs]
    R = drawn_attitudes(t_s, poles(length_s), sigma, np.array([0.1, -0.2, 3.0]), rng)
    prior = rate_prior(t_s, *with_noise(R, 0.3 * DEG, rng))
    effective = t_s[-1] / length_s  # independent values of each rate, roughly
    spread = 3 / np.sqrt(2 * effective) + 0.1
    assert np.abs(np.log(sigmas(prior) / sigma)).max() < spread
    assert np.abs(np.log(prior.length_s / length_s)).max() < 0.35


def test_axes_that_turn_unlike_have_lengths_of_their_own():
    rng = np.random.default_rng(20_014)
    lengths_s, sigma = np.array([0.25, 3.0, 1.0]), np.array([0.2, 0.5, 0.3])
    own = np.array([poles(length_s) for length_s in lengths_s])
    R = drawn_attitudes(T_S, own, sigma, np.array([0.1, -0.2, 0.5]), rng)
    prior = rate_prior(T_S, *with_noise(R, 0.1 * DEG, rng))
    assert np.abs(np.log(prior.length_s / lengths_s)).max() < 0.35
    # Variance of ln sigma: the integral of the squared correlation, 3.5 l / sqrt(5), over T.
    by_chance = np.sqrt(3.5 / np.sqrt(5.0) * lengths_s / np.ptp(T_S))
    assert (np.abs(np.log(sigmas(prior) / sigma)) < 3 * by_chance).all()


def frequencies_radps(prior):
    """Return where the spectrum of each axis' rate is highest, (3,)."""
    w = np.geomspace(0.05, 20, 3000)
    k, z, pair = prior.poles_per_s.T
    gain = (1j * w + k[:, None]) * ((1j * w + z[:, None]) ** 2 + pair[:, None] ** 2)
    return w[np.argmin(np.abs(gain), axis=1)]


def test_sine_swings_at_its_frequency_for_long():
    rng = np.random.default_rng(20_001)
    prior = rate_prior(T_S, *with_noise(sine(T_S), ARRAY_SIGMA, rng))
    np.testing.assert_allclose(frequencies_radps(prior), 1.0, rtol=0.1)
    assert (prior.damping_ratio < 0.2).all()
    assert (sigmas(prior) > 20 * DEG / 2).all()
    assert (sigmas(prior) < 1).all()


def test_swings_that_were_drawn_are_recovered():
    rng = np.random.default_rng(20_013)
    own = np.array([[2.0, 0.15, 2.5], [3.0, 0.3, 4.0], [8.0, 0.1, 1.5]])
    sigma = np.array([0.3, 0.5, 0.2])
    R = drawn_attitudes(T_S, own, sigma, np.array([0.1, -0.2, 0.5]), rng)
    prior = rate_prior(T_S, *with_noise(R, 0.3 * DEG, rng))
    np.testing.assert_allclose(prior.poles_per_s[:, 2], own[:, 2], rtol=0.1)
    assert (prior.damping_ratio < 0.25).all()
    assert np.abs(np.log(sigmas(prior) / sigma)).max() < 0.6


@pytest.mark.parametrize("seed", range(20_060, 20_063))
def test_rates_that_do_not_swing_are_not_said_to_for_long(seed):
    rng = np.random.default_rng(seed)
    length_s, sigma = np.exp(rng.uniform(np.log(0.3), np.log(4.0))), rng.uniform(0.1, 0.5, 3)
    R = drawn_attitudes(T_S[:300], poles(length_s), sigma, np.zeros(3), rng)
    prior = rate_prior(T_S[:300], *with_noise(R, 0.3 * DEG, rng))
    assert (prior.damping_ratio > 0.3).all()


def test_nothing_swings_where_it_may_not():
    rng = np.random.default_rng(20_001)
    prior = rate_prior(T_S[:200], *with_noise(sine(T_S[:200]), ARRAY_SIGMA, rng), swings=False)
    np.testing.assert_array_equal([prior.pole_ratio, prior.damping_ratio], 1.0)


def test_slope_of_the_posterior_is_that_of_its_differences():
    rng = np.random.default_rng(20_015)
    own = np.array([[4.0, 3.0, 2.0], [10.0, 1.0, 5.0], [0.5, 9.0, 0.1]])
    R = drawn_attitudes(T_S[:200], own, np.array([0.3, 0.5, 0.2]), np.array([0.1, -0.2, 0.3]), rng)
    attitudes = attitude_series(T_S[:200], *with_noise(R, 0.3 * DEG, rng), np.arange(200), 200)
    room, h = tape(200), 1e-4
    x = np.array([-0.5, -0.9, 0.0, 0.3, -0.5, 2.0, 0.4, 1.2, 0.2, -1.2, -0.7, -1.6])
    _, slope = log_posterior(attitudes, x, room, 4.0)
    ends = [
        [log_posterior(attitudes, x + sign * h * axis, room, 4.0)[0] for axis in np.eye(12)]
        for sign in (1, -1)
    ]
    by_differences = np.subtract(*ends) / (2 * h)
    # linearised about other estimates at other hyperparameters
    atol = 0.01 * np.abs(by_differences).max()
    np.testing.assert_allclose(slope, by_differences, atol=atol)


@pytest.mark.parametrize("seed", [20_002, 20_003])
@pytest.mark.parametrize("rate", [[0, 0, 0], [0, 0, 0.2], [4 * np.pi, 0, 0], [0, 8 * np.pi, 0]])
def test_constant_rate_has_next_to_no_motion_about_it(rate, seed):
    # only the variance is asked for: of no motion every length is as likely, within half a nat, and
    # which one is answered hangs on the last bits of the linear algebra
    rng = np.random.default_rng(seed)
    R = exp(T_S[:, None] * np.array([rate], dtype=float))
    prior = rate_prior(T_S, *with_noise(R, 0.3 * DEG, rng))
    # across a spin the rate turns with the body, and its slow changes are hard to tell: a nat of
    # evidence between .01 and .1 rad/s over 60 s
    spins = np.abs(rate) == np.abs(rate).max() if np.abs(rate).max() > 1 else np.ones(3, dtype=bool)
    assert (sigmas(prior)[spins] < 2e-3).all()
    assert (sigmas(prior) < 0.3).all()


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, None], ids=["2 %", "10 %", "30 %", "3 s"])
def test_wrong_attitudes_are_not_motion(share):
    """Wrong anywhere, or all alike for three seconds on end."""
    rng = np.random.default_rng(20_003)
    R, V = with_noise(sine(T_S), 0.3 * DEG, rng)
    clean = rate_prior(T_S, R, V)
    wrong = np.abs(T_S - 21.5) < 1.5 if share is None else rng.random(600) < share
    turn = [[0.2, -0.4, 0.3]] if share is None else rng.normal(size=(wrong.sum(), 3))
    R[wrong] = R[wrong] @ exp(np.array(turn))
    prior = rate_prior(T_S, R, V)
    np.testing.assert_allclose(frequencies_radps(prior), frequencies_radps(clean), rtol=0.1)
    assert np.abs(np.log(sigmas(prior) / sigmas(clean))).max() < 0.3


def test_motion_that_starts_late_is_motion():
    rng = np.random.default_rng(20_005)
    late = np.maximum(T_S - 50, 0)
    R = from_euler(0 * late, 0.5 * np.sin(3 * late), 0 * late)
    prior = rate_prior(T_S, *with_noise(R, 0.3 * DEG, rng))
    assert frequencies_radps(prior)[1] == pytest.approx(3.0, rel=0.1)
    assert sigmas(prior)[1] > 0.1
    assert (sigmas(prior)[[0, 2]] < 0.05).all()


def test_axis_that_no_attitude_tells_does_not_spoil_the_others():
    rng = np.random.default_rng(20_006)
    still = 0 * T_S
    truth = from_euler(still, 20 * DEG * np.sin(T_S), 20 * DEG * np.sin(T_S + 1))
    R, V = with_noise(truth, 0.3 * DEG, rng)
    V[:, 0, 0] = np.pi**2 / 3
    shuffled = R @ exp(rng.uniform(-np.pi, np.pi, (600, 1)) * np.array([[1.0, 0, 0]]))
    for attitudes in (R, shuffled):
        prior = rate_prior(T_S, attitudes, V)
        assert (prior.length_s[1:] > 1).all()  # 3 with one length for all axes
        np.testing.assert_array_equal(prior.damping_ratio, 1.0)
        # longer memories go with larger rates: white jerk stays; .25 rad/s is that of the sine
        alike = sigmas(prior)[1:] * (3 / prior.length_s[1:]) ** 2.5
        assert (alike > 0.1).all()
        assert (alike < 2).all()


def test_gap_and_uneven_epochs_change_little():
    rng = np.random.default_rng(20_007)
    t_s = np.sort(T_S + rng.uniform(-0.03, 0.03, 600))
    R, V = with_noise(sine(t_s), 0.3 * DEG, rng)
    even = rate_prior(t_s, R, V)
    kept = (t_s < 20) | (t_s > 35)
    prior = rate_prior(t_s[kept], R[kept], V[kept])
    assert np.abs(np.log(prior.length_s / even.length_s)).max() < 0.35
    assert np.abs(np.log(sigmas(prior) / sigmas(even))).max() < 0.3


def test_epochs_a_second_apart_tell_the_same_sine():
    rng = np.random.default_rng(20_008)
    t_s = np.arange(300.0)
    prior = rate_prior(t_s, *with_noise(sine(t_s), ARRAY_SIGMA, rng))
    np.testing.assert_allclose(frequencies_radps(prior), 1.0, rtol=0.1)
    assert (sigmas(prior) > 0.15).all()
    assert (sigmas(prior) < 0.6).all()


def test_long_flight_is_looked_at_in_blocks():
    rng = np.random.default_rng(20_009)
    t_s = 0.1 * np.arange(2000)
    R = drawn_attitudes(t_s, poles(0.6), np.array([0.3, 0.5, 0.2]), np.zeros(3), rng)
    prior = rate_prior(t_s, *with_noise(R, 0.3 * DEG, rng))
    np.testing.assert_allclose(prior.length_s, 0.6, rtol=0.2)
    np.testing.assert_allclose(sigmas(prior), [0.3, 0.5, 0.2], rtol=0.2)


@pytest.mark.parametrize("turns_per_second", [0.0, 2.0, 4.0])
def test_default_prior_follows_a_spin_from_its_first_second(turns_per_second):
    rng = np.random.default_rng(20_012)
    t_s = T_S[:20]
    R = exp(2 * np.pi * turns_per_second * t_s[:, None] * np.array([[1.0, 0, 0]]))
    densities = log_densities(
        t_s, *with_noise(R, 0.3 * DEG, rng), DEFAULT_LENGTH_S, DEFAULT_SIGMA_RADPS, 15.0
    )
    assert (densities[5:] > 0).all()  # a contradicted one has -9


def test_too_few_attitudes_are_refused():
    with pytest.raises(BadInputError, match="4 are too few to identify the motion"):
        rate_prior(T_S[:4], np.tile(np.eye(3), (4, 1, 1)), np.tile(np.eye(3), (4, 1, 1)))


def test_times_that_go_back_are_refused():
    with pytest.raises(BadInputError, match="time must increase, row 3"):
        rate_prior(np.array([0.0, 1, 2, 1, 4]), np.tile(np.eye(3), (5, 1, 1)), np.zeros((5, 3, 3)))


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        ({"length_s": 0.0}, "length_s: must be positive"),
        ({"damping_ratio": 1.5}, "damping_ratio: 1.5, must be 1 or less"),
        ({"pole_ratio": -1.0}, "pole_ratio: must be positive"),
    ],
)
def test_prior_that_is_none_is_refused(wrong, match):
    right = {"length_s": 1.0, "variance_rad2ps2": np.ones(3), "evidence": 0.0}
    with pytest.raises(BadInputError, match=match):
        RatePrior(**(right | wrong))
