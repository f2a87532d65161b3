"""What an epoch's phases say for its integers: how often wrong ones pass for right by chance."""

import numpy as np
import pytest

from fgnav.alignment.array.evidence import BELIEVED_LOG_ODDS, epoch_evidence, votes_of
from fgnav.attitude import RotationQuadratic
from fgnav.attitude.array import maximum_likelihood
from fgnav.geometry import rotations
from fgnav.types.integers import fixed_ranges_m
from tests.attitude.arrays import sky, synthetic
from tests.integers.arrays import L1_M, PAPER_ANTENNAS_B_M, link_covariance

N = 1000
ARRAYS = {"a pair, 5": ([0, 3], 5), "a pair, 9": ([0, 3], 9), "three, 5": ([0, 3, 5], 5)}


def drawn(seed, antennas, channels):
    rng = np.random.default_rng(seed)
    R_nb = rotations.from_euler(*rng.uniform(-1, 1, (3, N)))
    shape = PAPER_ANTENNAS_B_M[antennas]
    return *synthetic(R_nb, sky(channels, rng), rng, antennas_b_m=shape), rng


def evidence_of(differences, links, ranges_m, factor=1.0, R_nb=None):
    attitude = maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m), R_nb)
    factors = np.full(len(links), factor)
    return epoch_evidence(differences, links, attitude, factors), attitude


@pytest.mark.parametrize(("antennas", "channels"), ARRAYS.values(), ids=ARRAYS)
def test_wrong_integers_seldom_look_right(antennas, channels):
    """Of residuals anywhere, a share of 1 in x at most is x times as likely of right integers."""
    differences, true, rng = drawn(0, antennas, channels)
    anywhere_m = L1_M * rng.uniform(-0.5, 0.5, differences.phase_m.shape)
    ranges_m = np.where(true.fixed, anywhere_m, 0.0)
    evidence, _ = evidence_of(differences, true.fixed, ranges_m)
    for odds in (2.0, 5.0, 20.0):
        share = 1 / odds
        assert (evidence > np.log(odds)).mean() < share + 3 * np.sqrt(share / N)


def test_right_integers_are_likelier_the_more_links_there_are():
    medians = [
        np.median(evidence_of(d, true.fixed, fixed_ranges_m(d, true))[0])
        for d, true, _ in (drawn(1, *array) for array in ARRAYS.values())
    ]
    assert medians[0] < 2.0  # four links of a pair fit some direction by chance
    assert medians[1] > BELIEVED_LOG_ODDS
    assert medians[2] > medians[0] + 3.0


def test_evidence_has_the_density_of_correlated_double_differences():
    differences, true, _ = drawn(2, [0, 3, 5], 6)
    evidence, attitude = evidence_of(differences, true.fixed, fixed_ranges_m(differences, true))
    links, k = true.fixed[0], 17
    covariance = link_covariance(differences, k, links, differences.phase_variance_m2)
    density = -(attitude.chi_square[k] + np.linalg.slogdet(2 * np.pi * covariance)[1]) / 2
    turns = np.linalg.slogdet(2 * np.pi * attitude.covariance_rad2[k])[1] / 2 - np.log(8 * np.pi**2)
    uniform = links.sum() * np.log(L1_M)
    assert evidence[k] == pytest.approx(density + turns + uniform, abs=1e-9)


def test_louder_noise_is_that_of_larger_stated_variances():
    loud, true, _ = drawn(3, [0, 3, 5], 6)
    ranges_m = fixed_ranges_m(loud, true)
    known, attitude = evidence_of(loud, true.fixed, ranges_m, 4.0)
    variance = {"phase_variance_m2": 4.0 * loud.phase_variance_m2}
    fields = {name: getattr(loud, name) for name in loud.__slots__ if name != "__weakref__"}
    quiet = type(loud)(**{**fields, **variance})
    stated, _ = evidence_of(quiet, true.fixed, ranges_m, R_nb=attitude.R_nb)
    # a search ends within 1e-4 sigmas of its minimum
    np.testing.assert_allclose(known, stated, atol=1e-4)


def test_which_links_were_left_out_is_a_guess_among_all():
    differences, true, _ = drawn(4, [0, 3, 5], 6)
    links = true.fixed.copy()
    links[:, 0, 2] = False
    ranges_m = np.where(links | differences.is_reference[:, None], 0.0, np.nan)
    attitude = maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m))
    alone = epoch_evidence(differences, links, attitude, np.ones(N))
    chosen = epoch_evidence(differences, links, attitude, np.ones(N), chosen_of=true.fixed)
    np.testing.assert_allclose(alone - chosen, np.log(10), atol=1e-9)


def test_a_say_is_the_epochs_evidence_or_the_resolvers_statement_or_time_apart():
    t_s = np.array([0.0, 0.1, 10.1, 70.1])
    sound = np.array([True, True, True, False])
    none = np.full(4, -50.0)
    np.testing.assert_allclose(votes_of(t_s, none, sound, None), [0, 0.005, 0.5, 0])
    half = votes_of(t_s, np.full(4, BELIEVED_LOG_ODDS / 2), np.zeros(4, dtype=bool), None)
    np.testing.assert_allclose(half, 0.5)
    np.testing.assert_allclose(votes_of(t_s, none, sound, np.full(4, 1e-3)), [1, 1, 1, 0])
    np.testing.assert_allclose(votes_of(t_s, none, sound, np.ones(4)), [0, 0.005, 0.5, 0])
