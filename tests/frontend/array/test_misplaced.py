"""Antennas that are not where they are said to be, from fixed phases of known places."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.frontend.array.misplaced import misplaced
from fgnav.types.integers import fixed_ranges_m
from tests.attitude.arrays import synthetic
from tests.frontend.flights import E_N, motion

OFF_B_M = np.array([0.01, -0.02, 0.012])


def drawn(seed):
    """Double differences of a minute at 1 Hz, and their ranges."""
    differences, integers = synthetic(
        motion(np.arange(60.0), 0.3)[0], E_N, np.random.default_rng(seed)
    )
    return differences, fixed_ranges_m(differences, integers)


def stated_off(differences, antenna):
    """The same with a wrong place of an antenna; of the reference all others are off against it."""
    baselines_b_m = differences.baselines_b_m.copy()
    if antenna == 0:
        baselines_b_m += OFF_B_M
    else:
        baselines_b_m[antenna - 1] -= OFF_B_M
    return replace(differences, baselines_b_m=baselines_b_m)


def accused(differences, ranges_m):
    attitude = maximum_likelihood(RotationQuadratic.of_ranges(differences, ranges_m))
    return misplaced(differences, ranges_m, attitude)


def test_antennas_at_their_places_are_not_accused():
    assert [accused(*drawn(seed)) for seed in range(30)] == [()] * 30


@pytest.mark.parametrize("antenna", range(4))
def test_an_antenna_off_its_place_is_named_and_placed(antenna):
    squares = []
    for seed in range(10):
        differences, ranges_m = drawn(seed)
        (found,) = accused(stated_off(differences, antenna), ranges_m)
        assert found.antenna == antenna
        squares.append(((found.off_b_m - OFF_B_M) / found.sigma_m) ** 2)
    assert 11.6 < np.sum(squares) < 59.7  # chi-square of thirty, 99.9 % from either side
    assert_allclose(found.off_b_m, OFF_B_M, rtol=0, atol=5 * found.sigma_m.max())


def test_phases_that_no_place_explains_accuse_nobody():
    differences, ranges_m = drawn(0)
    rng = np.random.default_rng(1)
    loud = ranges_m + 0.03 * rng.normal(size=ranges_m.shape)
    assert accused(stated_off(differences, 2), loud) == ()


def test_few_epochs_accuse_nobody():
    differences, ranges_m = drawn(0)
    few_m = np.where(np.arange(60)[:, None, None] < 20, ranges_m, np.nan)
    assert accused(stated_off(differences, 2), few_m) == ()
