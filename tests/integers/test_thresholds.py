import numpy as np
import pytest

from fgnav.integers.array.search import PROVEN, search_constrained
from fgnav.integers.thresholds import simulated, statistic, thresholds
from fgnav.integers.validation import share_threshold

from .arrays import make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
NODES = 10**6


def test_share_is_kept_by_the_lowest_statistic_that_keeps_it():
    value = np.array([9.0, 7.0, 5.0, 3.0, 1.0])
    wrong = np.array([0.0, 0.01, 0.05, 0.30, 0.9])
    # shares from the top: 0, 0.005, 0.02, 0.09, 0.252
    assert share_threshold(value, wrong, 0.001) == 9.0
    assert share_threshold(value, wrong, 0.02) == 5.0
    assert share_threshold(value, wrong, 0.10) == 3.0
    assert share_threshold(value, wrong, 0.99) == 3.0  # the last is more likely wrong than right
    assert share_threshold(value[::-1], wrong[::-1], 0.02) == 5.0


def test_nothing_passes_where_not_even_the_best_may():
    limit = share_threshold(np.array([2.0, 1.0]), np.array([0.1, 0.2]), 0.01)
    assert not (np.array([2.0, np.inf]) >= limit).any()
    assert np.isnan(share_threshold(np.zeros(0), np.zeros(0), 0.01))


def test_equal_statistics_are_accepted_together_or_not_at_all():
    value, wrong = np.array([4.0, 2.0, 2.0]), np.array([0.0, 0.0, 0.3])
    assert share_threshold(value, wrong, 0.05) == 4.0
    assert share_threshold(value, wrong, 0.11) == 2.0


@pytest.mark.parametrize("test", ["ratio", "difference"])
def test_share_that_passes_and_is_wrong_is_the_one_asked_for(test):
    made = make(np.random.default_rng(1), epochs=2000, code_m=0.5, antennas_b_m=PAIR_B_M)
    least = thresholds(
        made.differences,
        test,
        wrong_max=0.03,
        sets=2000,
        nodes=NODES,
        rng=np.random.default_rng(2),
    )
    assert len(set(least)) == 1  # one pattern of links
    found = search_constrained(made.differences, NODES)
    passes = statistic(found, test) >= least
    wrong = ~(found.cycles == made.cycles).all(axis=(1, 2)) & passes
    assert passes.sum() > 200
    assert wrong.sum() == pytest.approx(0.03 * passes.sum(), abs=4 * np.sqrt(0.03 * passes.sum()))


def test_patterns_of_links_have_thresholds_of_their_own():
    missing = np.zeros((40, 2, 8), bool)
    missing[20:, 1, 5:] = True
    rng = np.random.default_rng(3)
    made = make(rng, epochs=40, antennas_b_m=PAIR_B_M, satellites=(8,), missing=missing)
    least = thresholds(
        made.differences, "difference", wrong_max=0.01, sets=200, nodes=NODES, rng=rng
    )
    assert len(set(least[:20])) == 1
    assert least[0] < 0.5 * least[30] or np.isnan(least[30])


def test_simulated_sets_have_the_stated_noise_and_no_integers():
    rng = np.random.default_rng(4)
    d = make(rng, epochs=3, satellites=(5, 4), sine=True).differences
    sets = simulated(d, np.repeat([0, 2], 500), rng)
    found = search_constrained(sets, NODES)
    assert (found.status == PROVEN).all()
    assert (found.cycles == 0).mean() > 0.999
    # 2 * 49 links less three angles; four sigma of the mean of 1000
    mean = found.costs[:, 0].mean()
    assert mean == pytest.approx(95.0, abs=4 * np.sqrt(2 * 95 / 1000))


def test_same_seed_simulates_the_same():
    d = make(np.random.default_rng(5), epochs=2).differences
    one, other = (simulated(d, np.array([0, 1]), np.random.default_rng(6)) for _ in range(2))
    np.testing.assert_array_equal(one.code_m, other.code_m)
    np.testing.assert_array_equal(one.phase_m, other.phase_m)


def test_statistic_without_a_second_is_infinite_and_without_a_best_never_passes():
    made = make(np.random.default_rng(7), epochs=1)
    found = search_constrained(made.differences, NODES)
    assert np.isinf(found.costs[0, 1])
    assert statistic(found, "difference")[0] == np.inf
    given_up = search_constrained(made.differences, 5)
    assert statistic(given_up, "ratio")[0] == -np.inf
