import numpy as np
import pytest

from fgnav.integers.acceptance import share_threshold
from fgnav.integers.array.kernel import PROVEN
from fgnav.integers.array.search import search_constrained

from .arrays import make, simulated

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
