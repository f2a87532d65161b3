import numpy as np
import pytest

from fgnav.geometry.rotations import exp, from_euler
from fgnav.process import matern
from fgnav.process.attitude_series import attitude_series
from fgnav.process.evidence import (
    DEFAULT_LENGTH_S,
    DEFAULT_SIGMA_RADPS,
    causal_rate_priors,
    rate_prior,
)
from tests.process.attitudes import ARRAY_SIGMA, DEG, sigmas, sine, with_noise

T_S = 0.1 * np.arange(600)


def noise(poles, variance):
    """Return the mean variance of the turn over each interval that nothing before tells, rad^2."""
    of_unit = np.array(
        [[matern.noise_factor(0.1, own)[0, 0] ** 2 for own in axes] for axes in poles]
    )
    return (of_unit * variance).mean(axis=1)


def swings_from(start_s, t_s, rng):
    """Return attitudes that stand still and then swing by 20 degrees, from a start at full rate."""
    since = np.maximum(t_s - start_s, 0)
    truth = from_euler(0 * since, 20 * DEG * np.sin(since), 20 * DEG * np.sin(1.3 * since))
    return with_noise(truth, ARRAY_SIGMA, rng)


def test_causal_prior_is_the_default_first_and_then_that_of_the_past():
    rng = np.random.default_rng(20_011)
    R, V = with_noise(sine(T_S), 0.3 * DEG, rng)
    poles, variance = causal_rate_priors(T_S[:12], R[:12], V[:12])
    assert poles.shape == (11, 3, 3)
    assert variance.shape == (11, 3)
    np.testing.assert_array_equal(poles[:9], np.tile(matern.poles(DEFAULT_LENGTH_S), (9, 3, 1)))
    np.testing.assert_array_equal(variance[:9], DEFAULT_SIGMA_RADPS**2)
    identified = rate_prior(T_S[:10], R[:10], V[:10])
    np.testing.assert_array_equal(poles[9:], np.tile(identified.poles_per_s, (2, 1, 1)))
    np.testing.assert_array_equal(variance[9:], np.tile(identified.variance_rad2ps2, (2, 1)))


def test_motion_that_starts_late_widens_the_causal_prior_within_a_second():
    R, V = swings_from(30.0, T_S, np.random.default_rng(20_030))
    poles, variance = causal_rate_priors(T_S, R, V)
    assert (np.sqrt(variance[290:300]).max(axis=1) < 0.35).all()
    assert (noise(poles, variance)[290:300] < 1e-7).all()
    assert (np.sqrt(variance[310:400]) > 0.3).all()
    assert (noise(poles, variance)[310:400] > 1e-6).all()


def test_lasting_change_of_motion_is_identified_anew():
    R, V = swings_from(30.0, T_S, np.random.default_rng(20_031))
    poles, variance = causal_rate_priors(T_S, R, V)
    whole = rate_prior(T_S[320:], R[320:], V[320:])
    for of in (poles[430], whole.poles_per_s):
        np.testing.assert_allclose(of[1:, 2], [1.0, 1.3], rtol=0.15)  # it does not roll
    later = attitude_series(T_S[430:], R[430:], V[430:], np.arange(170), past=170)
    now, before, best = (
        later.log_densities(own, of).sum()
        for own, of in (
            (poles[430], variance[430]),
            (poles[299], variance[299]),
            (whole.poles_per_s, whole.variance_rad2ps2),
        )
    )
    # What comes later has taken part in that one, and a longer record allows a longer memory.
    assert best - now < 0.02 * (best - before)
    assert before < best - 1000


@pytest.mark.parametrize("share", [0.0, 0.1])
def test_steady_motion_keeps_its_identified_prior(share):
    rng = np.random.default_rng(20_032)
    R, V = with_noise(sine(T_S), 0.3 * DEG, rng)
    wrong = rng.random(600) < share
    R[wrong] = R[wrong] @ exp(rng.normal(size=(wrong.sum(), 3)))
    poles, variance = causal_rate_priors(T_S, R, V)
    changes = np.flatnonzero(np.diff(poles[:, 0, 0])) + 1
    # as identified, and none other; of a tenth wrong the default may be as good up to 160
    assert {159, 319} <= set(changes[changes >= 40]) <= {79, 159, 319}
    assert (np.abs(np.log(np.sqrt(variance[320:]) / sigmas(rate_prior(T_S, R, V)))) < 0.3).all()


def test_wrong_attitudes_for_three_seconds_do_not_widen_the_causal_prior():
    rng = np.random.default_rng(20_033)
    R, V = with_noise(np.tile(np.eye(3), (400, 1, 1)), 0.3 * DEG, rng)
    R[200:230] = R[200:230] @ exp(np.array([[0.2, -0.4, 0.3]]))
    _, variance = causal_rate_priors(T_S[:400], R, V)
    assert (np.sqrt(variance[160:]).max(axis=1) < 0.2).all()


def test_cutting_a_flight_whose_motion_changes_alters_no_causal_prior_before_the_cut():
    R, V = swings_from(30.0, T_S, np.random.default_rng(20_034))
    poles, variance = causal_rate_priors(T_S, R, V)
    for cut in (301, 306, 320, 321, 421, 560):
        early, early_variance = causal_rate_priors(T_S[:cut], R[:cut], V[:cut])
        np.testing.assert_array_equal(early, poles[: cut - 1])
        np.testing.assert_array_equal(early_variance, variance[: cut - 1])


def test_gap_after_the_cut_changes_no_causal_prior_before_it():
    rng = np.random.default_rng(20_035)
    t_s = np.append(T_S[:100], 100 + np.arange(200.0))  # its usual spacing is another
    R, V = with_noise(sine(t_s), 0.3 * DEG, rng)
    poles, variance = causal_rate_priors(t_s, R, V)
    early, early_variance = causal_rate_priors(t_s[:100], R[:100], V[:100])
    np.testing.assert_array_equal(early, poles[:99])
    np.testing.assert_array_equal(early_variance, variance[:99])
