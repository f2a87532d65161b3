"""What is declared to be wrong is what is: the benchmark of that, in small."""

import numpy as np
import pytest
from scipy.stats import binom

from tests.benchmarks.wrong_fix import CASES, caught, holds, lower_bound, tally


@pytest.fixture(scope="module")
def nominal():
    return tally("wrong_fix_declared", 4000)


def test_no_more_is_wrong_than_declared_where_noise_is_as_stated(nominal):
    for case in CASES:
        assert holds(nominal[case]).all(), case
    weak = nominal["2 ant., 7 sat."]
    spread = 4 * np.sqrt(weak.declared_of_all) + 3
    assert weak.declared_of_all == pytest.approx(weak.wrong_of_all, abs=spread)
    assert weak.wrong_of_all > 100
    assert nominal["paper, 6 sat."].wrong_of_all == 0


def test_more_is_wrong_than_declared_where_noise_is_louder_than_stated():
    louder = tally("wrong_fix_louder_noise", 4000)
    assert not holds(louder["2 ant., 7 sat."]).all()
    assert louder["paper, 6 sat."].wrong == 0  # chi-square refuses most of these, and none is wrong


def test_chi_square_of_the_array_catches_wrong_fixes_that_turn_it():
    assert float(str(caught(200)["ours"])) >= 99.0


def test_lower_bound_of_a_share_is_that_of_clopper_and_pearson():
    assert lower_bound(0, 100) == 0.0
    # the share at which five or more of a hundred have a chance of 5 %
    assert binom.sf(4, 100, lower_bound(5, 100)) == pytest.approx(0.05, abs=1e-9)
