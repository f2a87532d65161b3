"""What the benchmark of the published table holds its rates against."""

import numpy as np
import pytest

from fgnav.integers.array.candidates import candidates
from tests.benchmarks.teunissen import PUBLISHED, below, cost_of_truth, fits, made
from tests.integers.arrays import sky


@pytest.mark.parametrize(("phase_mm", "code_cm"), [(3, 5), (1, 30), (30, 5)])
def test_true_integers_cost_what_the_search_says_and_never_less_than_its_answer(phase_mm, code_cm):
    rng = np.random.default_rng(1)
    cell = {"sigma_phase_mm": phase_mm, "sigma_code_cm": code_cm}
    sets = made(sky(rng, 1, 6)[0][0], cell, 0.7, rng)
    found = candidates(sets, most=1, reach=1e-9, nodes=10**6)
    truth = cost_of_truth(sets)[found.epoch]
    right = (found.cycles == 0).all(axis=(1, 2))
    assert right.sum() > 100
    np.testing.assert_allclose(found.cost[right], truth[right], rtol=0, atol=1e-6)
    assert (found.cost < truth + 1e-6).all()


def test_a_rate_is_below_another_only_beyond_chance():
    sigma = 100.0 * np.sqrt(2 * 0.25 / PUBLISHED)  # of the difference of two rates near 50 %
    assert not below(50.0, PUBLISHED, 50.0 + 1.9 * sigma)
    assert below(50.0, PUBLISHED, 50.0 + 2.1 * sigma)
    assert not below(100.0, 1000, 100.0)
    assert not below(99.95, 2000, 100.0)


def test_a_sky_fits_only_whole_and_of_the_published_dilution():
    rng = np.random.default_rng(2)
    skies = sky(rng, 3000, 6)[0]
    found = fits(skies)
    assert 0 < found.sum() < 300
    skies[:, 0] = np.nan
    assert not fits(skies).any()
