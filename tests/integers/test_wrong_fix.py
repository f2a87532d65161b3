"""What is declared to be wrong is what is: the benchmark of that, in small."""

import numpy as np
import pytest
from scipy.stats import binom

from tests.benchmarks.wrong_fix import CASES, WEAKEST, caught, holds, lower_bound, ruled, tally


@pytest.fixture(scope="module")
def nominal():
    return tally("wrong_fix_declared", 1000)


def test_no_more_is_wrong_than_declared_where_noise_is_as_stated(nominal):
    for case in CASES:
        assert holds(nominal[case]).all(), case
    weak = nominal[WEAKEST]
    spread = 4 * np.sqrt(weak.declared_of_all) + 3
    assert weak.declared_of_all == pytest.approx(weak.wrong_of_all, abs=spread)
    assert weak.wrong_of_all > 100
    assert nominal["paper, 6 sat."].wrong_of_all == 0


def test_more_is_wrong_than_declared_where_noise_is_louder_than_stated():
    louder = tally("wrong_fix_louder_noise", 4000)
    assert not holds(louder[WEAKEST]).all()
    assert louder["paper, 6 sat."].wrong == 0  # chi-square refuses most of these, and none is wrong
    for weak in louder.values():
        assert weak.far_caught <= weak.far_limit  # true integers cost more than wrong ones found


def test_the_whole_rule_keeps_wrong_fixes_out_where_noise_is_louder_than_stated():
    told = ruled("wrong_fix_louder_noise", CASES[WEAKEST], 300)
    assert told.ruled_far > 50
    assert told.ruled_accepted > 30
    assert told.ruled_wrong <= 0.01 * told.ruled_far


def test_chi_square_of_the_array_catches_wrong_fixes_that_turn_it():
    assert float(str(caught(200)["ours"])) >= 99.0


def test_lower_bound_of_a_share_is_that_of_clopper_and_pearson():
    assert lower_bound(0, 100) == 0.0
    # the share at which five or more of a hundred have a chance of 5 %
    assert binom.sf(4, 100, lower_bound(5, 100)) == pytest.approx(0.05, abs=1e-9)
