from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fgnav.checks import BadInputError
from fgnav.geometry import rotations
from fgnav.gnss.difference import double_differences
from fgnav.integers.arcs.carried import Answers, carry, chance_of_epochs
from fgnav.integers.arcs.resolver import Arcs, lambda_arcs, link_arcs
from fgnav.integers.arcs.smoothing import effective, smoothed
from fgnav.integers.resolvers.lambda_ import Lambda
from fgnav.integers.resolvers.rounding import Rounding
from fgnav.types.differences import DoubleDifferences
from tests.gnss.flights import Made as MadeFlight
from tests.integers.arrays import PAPER_ANTENNAS_B_M, make, sky

TWO_B_M = PAPER_ANTENNAS_B_M[[0, 3]]
N, M = 60, 8


def still(rng, *, code_m=1.0, tau=0.0, changes=(), antennas_b_m=TWO_B_M, epochs=N):
    """One sky for all epochs, turning attitude, code noise of correlation ``tau`` in epochs.

    ``changes`` are (epoch, channel) from which on another channel is the reference. Returns the
    differences, and undifferenced integers relative to channel 0, (b, m).
    """
    made = make(rng, epochs=epochs, antennas_b_m=antennas_b_m, satellites=(M,), phase_m=0.003)
    d = made.differences
    e_n = np.repeat(sky(rng, 1, M)[0], epochs, axis=0)
    R_nb = rotations.exp(np.linspace(0, 1, epochs)[:, None] * np.array([0.5, 1.0, -0.7]))
    a = len(antennas_b_m)
    noise = rng.normal(size=(epochs, a, M))
    rho = np.exp(-1.0 / tau) if tau else 0.0
    for k in range(1, epochs):
        noise[k] = rho * noise[k - 1] + np.sqrt(1 - rho**2) * noise[k]
    range_m = -np.einsum("nij,aj,nmi->nam", R_nb, antennas_b_m, e_n)
    whole = rng.integers(-(10**6), 10**6, (a, M))
    link = d.wavelength_m * whole + range_m + 0.003 * rng.normal(size=(epochs, a, M))
    reference = np.zeros((epochs, 1), dtype=np.int64)
    for k, channel in changes:
        reference[k:] = channel
    take = np.repeat(reference[:, :, None], a - 1, axis=1)

    def differenced(values):
        single = values[:, 1:] - values[:, :1]
        return single - np.take_along_axis(single, take, axis=2)

    arc = np.cumsum(np.diff(reference[:, 0], prepend=0) != 0)
    d = replace(
        d,
        e_n=e_n,
        reference=reference,
        code_m=differenced(range_m + code_m * noise),
        phase_m=differenced(link),
        code_variance_m2=np.full((epochs, M), code_m**2),
        arc=np.tile(arc[:, None, None], (1, a - 1, M)),
    )
    return replace_made(made, d), whole[1:] - whole[:1]


def replace_made(made, differences):
    return type(made)(
        differences=differences, R_nb=made.R_nb, cycles=made.cycles, flight=made.flight
    )


def true_cycles(d: DoubleDifferences, single):
    """Integers by each epoch's references, (n, b, m)."""
    return single[None] - single[:, d.reference[:, 0]].T[:, :, None]


def constant_arc(d):
    return np.zeros(d.phase_m.shape, dtype=np.int64)


def test_smoothed_code_of_white_noise_is_as_good_as_the_mean_of_its_epochs():
    made, single = still(np.random.default_rng(1), epochs=400)
    d = made.differences
    found = smoothed(d, constant_arc(d))
    error_m = found.differences.code_m - (d.phase_m - d.wavelength_m * true_cycles(d, single))
    stated = np.sqrt(2 * (found.differences.code_variance_m2[0, 1:] * 2))
    assert np.abs(error_m[0, 0, 1:]).max() < 4 * stated.max()
    assert 20 < d.code_variance_m2[0, 0] / found.differences.code_variance_m2[0, 0] < 400
    assert found.variance_factor == pytest.approx(1.0, abs=0.15)


def test_correlated_noise_is_averaged_no_further_than_it_goes():
    # 400 epochs of a correlation over 40: about 5 independent ones
    worth = []
    for seed in range(8):
        made, _ = still(np.random.default_rng(seed), tau=40.0, epochs=400)
        correlation = smoothed(made.differences, constant_arc(made.differences)).correlation
        worth.append(effective(correlation)[-1])
    assert 1.0 < np.median(worth) < 8.0
    assert max(worth) < 16.0


def test_stated_correlation_gives_the_variance_of_a_mean_of_that_process():
    tau, n = 10.0, 50
    rho = np.exp(-np.arange(n) / tau)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    assert effective(rho)[-1] == pytest.approx(n**2 / rho[lag].sum(), rel=1e-12)
    made, _ = still(np.random.default_rng(3), epochs=n)
    found = smoothed(made.differences, constant_arc(made.differences), correlation_s=tau)
    assert found.correlation == pytest.approx(rho)


def test_normalised_errors_of_smoothed_code_have_the_variance_they_state():
    squares = []
    for seed in range(40):
        made, single = still(np.random.default_rng(seed), tau=8.0, epochs=120)
        d = made.differences
        smooth = smoothed(d, constant_arc(d), correlation_s=8.0).differences
        error_m = (smooth.code_m - (d.phase_m - d.wavelength_m * true_cycles(d, single)))[0, 0, 1:]
        variance = smooth.code_variance_m2[0, 1:]
        C = 2 * (np.diag(variance) + smooth.code_variance_m2[0, 0])
        squares.append(error_m @ np.linalg.solve(C, error_m) / (M - 1))
    # phase's own noise does not enter these errors, and is stated with them: a little below 1
    assert 0.7 < np.mean(squares) < 1.15


def test_change_of_reference_leaves_smoothed_code_as_good():
    rng = np.random.default_rng(4)
    made, single = still(rng, epochs=200, changes=((70, 3), (140, 5)))
    d = made.differences
    found = smoothed(d, constant_arc(d)).differences
    error_m = found.code_m - (d.phase_m - d.wavelength_m * true_cycles(d, single))
    # one error of a link for all epochs, seen from three references
    of_link = error_m - error_m.mean(axis=2, keepdims=True)
    assert np.ptp(of_link, axis=0).max() < 1e-3
    assert np.abs(of_link).max() < 0.5


def two_antennas():
    return MadeFlight(
        t_s=np.arange(0.0, 20.0, 1.0), arms_b_m=TWO_B_M, code_sigma_m=0.3, phase_sigma_m=0.002
    ).flight()


def test_code_that_jumps_with_the_receivers_clock_is_smoothed_all_the_same():
    flight = two_antennas()
    code_m, tag_s = flight.observations.code_m.copy(), flight.observations.tag_s.copy()
    code_m[10:, 1] += 299_792.458
    tag_s[10:, 1] += 1e-3
    jumped = replace(flight, observations=replace(flight.observations, code_m=code_m, tag_s=tag_s))
    before, after = (double_differences(f) for f in (flight, jumped))
    code = smoothed(before, link_arcs(before, flight)).differences.code_m
    again = smoothed(after, link_arcs(after, jumped)).differences.code_m
    assert np.isfinite(again[:, :, 1:]).any()
    assert np.nanmax(np.abs(code - again)) < 1e-3


def test_link_without_code_is_filled_in_from_its_arc():
    made, _ = still(np.random.default_rng(6))
    d = made.differences
    code_m = d.code_m.copy()
    code_m[10:20, 0, 4] = np.nan
    found = smoothed(replace(d, code_m=code_m), constant_arc(d)).differences
    assert np.isfinite(found.code_m).all()
    gone = smoothed(replace(d, code_m=np.where(np.arange(M) == 4, np.nan, code_m)), constant_arc(d))
    assert np.isnan(gone.differences.code_m[:, :, 4]).all()


@pytest.mark.parametrize("changes", [(), ((20, 3), (40, 6))])
def test_arcs_fix_what_single_epochs_cannot(changes):
    right, alone = [], []
    for seed in range(5):
        made, single = still(np.random.default_rng(seed), code_m=0.7, changes=changes)
        d = made.differences
        true = true_cycles(d, single)
        single_epochs = Lambda(success_min=0.95)(d, made.flight)
        alone.append(single_epochs.fixed[d.resolvable].mean())
        found = Arcs(inner=Lambda(), wrong_max=0.05, correlation_s=0.1)(d, made.flight)
        assert_array_equal(found.cycles[found.fixed], true[found.fixed])
        right.append(found.fixed[d.resolvable].mean())
    assert np.mean(alone) < 0.2
    assert np.mean(right) > 0.7


def test_satellite_that_joins_is_fixed_at_once_and_breaks_nothing():
    made, single = still(np.random.default_rng(7), code_m=0.3, antennas_b_m=PAPER_ANTENNAS_B_M)
    d = made.differences
    late = np.zeros(d.phase_m.shape, dtype=bool)
    late[:30, :, 7] = True
    d = replace(
        d,
        code_m=np.where(late, np.nan, d.code_m),
        phase_m=np.where(late, np.nan, d.phase_m),
        arc=np.where(late, -1, d.arc),
    )
    found = Arcs(inner=Lambda())(d, made.flight)
    assert_array_equal(found.cycles[found.fixed], true_cycles(d, single)[found.fixed])
    assert found.fixed[30:, :, 7].all()
    assert found.fixed[d.resolvable].all()


def test_links_are_fixed_or_counted():
    made, _ = still(np.random.default_rng(8), tau=30.0)
    d = made.differences
    code_m = np.where(np.arange(M) == 5, np.nan, d.code_m)
    d = replace(d, code_m=code_m)
    found = lambda_arcs()(d, made.flight)
    links = np.isfinite(d.phase_m) & ~d.is_reference[:, None]
    assert found.fixed.sum() + sum(loss.count for loss in found.unused) == links.sum()
    reasons = {loss.reason for loss in found.unused}
    assert "phase without code" in reasons
    assert (found.wrong_probability <= 1.0).all()


def answers(cycles, wrong, arc=None, reference=None):
    """Answers of one baseline and two channels, the first the reference unless said otherwise."""
    n = len(cycles)
    c = np.zeros((n, 1, 2), dtype=np.int64)
    of_reference = np.zeros((n, 2), dtype=np.int64)
    if reference is not None:
        of_reference[:] = np.array(reference)[:, None]
    c[np.arange(n), 0, 1 - of_reference[:, 0]] = cycles
    arcs = np.zeros((n, 1, 2), dtype=np.int64)
    if arc is not None:
        arcs[:, 0, 1] = arc
    return Answers(c, np.ones((n, 1, 2), dtype=bool), np.array(wrong, float), arcs, of_reference)


def test_the_surest_epoch_speaks_for_its_arc():
    found = carry(answers([5, 5, 5, 9, 9], [0.5, 1e-6, 0.1, 0.2, 1e-4], arc=[0, 0, 0, 1, 1]))
    assert_array_equal(found.cycles[:, 0, 1], [5, 5, 5, 9, 9])
    assert_array_equal(found.source[:, 0, 1], [1, 1, 1, 4, 4])
    assert found.chance[0, 0, 1] == pytest.approx(2 * 3e-6)


def test_a_second_opinion_as_sure_as_the_first_makes_it_one_in_two():
    found = carry(answers([5, 7], [1e-6, 1e-6]))
    assert (found.chance[:, 0, 1] >= 0.5).all()
    slightly = carry(answers([5, 7], [1e-6, 0.4]))
    assert (slightly.chance[:, 0, 1] < 1e-5).all()


def test_integers_are_re_expressed_by_another_reference():
    # channel 1 against 0 is 5: channel 0 against 1 is -5
    found = carry(answers([5, 5, -5, -5], [1e-9, 0.1, 0.1, 0.1], reference=[0, 0, 1, 1]))
    assert_array_equal(found.cycles[:2, 0, 1], [5, 5])
    assert_array_equal(found.cycles[2:, 0, 0], [-5, -5])
    assert_array_equal(found.source[2:, 0, 0], [0, 0])


def test_chance_of_an_epoch_adds_up_over_the_epochs_it_rests_on():
    found = carry(answers([5, 5], [1e-3, 1e-4]))
    there = np.zeros((2, 1, 2), dtype=bool)
    there[:, 0, 1] = True
    chance, sources = chance_of_epochs(found, there)
    assert_array_equal(sources, [1, 1])
    assert chance == pytest.approx(found.chance[:, 0, 1])


def test_what_is_accepted_is_wrong_no_more_often_than_stated():
    wrong = epochs = 0
    for seed in range(60):
        made, single = still(np.random.default_rng(100 + seed), tau=15.0, code_m=0.2)
        d = made.differences
        found = Arcs(inner=Lambda(), wrong_max=0.05)(d, made.flight)
        bad = found.fixed & (found.cycles != true_cycles(d, single))
        wrong += int(bad.any())
        epochs += int(found.fixed.any())
    assert epochs >= 10
    # of 60 arcs, each wrong with a chance of 0.05, more than 8 are with a chance below 1 %
    assert wrong <= 8


def test_arcs_of_links_outlive_a_change_of_reference():
    flight = two_antennas()
    d = double_differences(flight)
    arc = link_arcs(d, flight)
    assert set(np.unique(arc[np.isfinite(d.phase_m)])) == {0}


def test_made_up_differences_fall_back_to_their_own_arcs():
    made, _ = still(np.random.default_rng(9), changes=((30, 2),))
    assert_array_equal(link_arcs(made.differences, made.flight), made.differences.arc)


def test_inner_resolver_must_say_how_likely_it_is_wrong():
    made, _ = still(np.random.default_rng(10))
    with pytest.raises(BadInputError, match="'rounding-arcs': 'rounding' does not say how likely"):
        Arcs(inner=Rounding())(made.differences, made.flight)


@pytest.mark.parametrize("wrong_max", [0.0, 1.0, np.nan])
def test_threshold_that_is_no_probability_is_refused(wrong_max):
    with pytest.raises(BadInputError, match="wrong_max: must be between 0 and 1"):
        Arcs(inner=Lambda(), wrong_max=wrong_max)


@pytest.mark.parametrize("correlation_s", [0.0, -1.0, np.nan])
def test_correlation_time_must_be_positive(correlation_s):
    with pytest.raises(BadInputError, match="correlation_s: must be positive, or None"):
        Arcs(inner=Lambda(), correlation_s=correlation_s)
