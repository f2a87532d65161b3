from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.integer_counts import count_integers, integers_at, true_attitudes
from tests.evaluation.conftest import differences_of, true_state

ARRAY_B_M = np.array([[0, 0.1, 0], [1, 0, 0], [-0.8, 0.1, 0.1]])
EPOCHS, BASELINES, PAIRS = 10, len(ARRAY_B_M), 5


@pytest.fixture
def case():
    """Return differences of ten epochs and their true integers, known in the first eight."""
    rng = np.random.default_rng(5)
    t_s = np.arange(EPOCHS) * 0.1
    differences = differences_of(true_state(t_s).R_nb, ARRAY_B_M, rng)
    truth = true_state(t_s[:8])
    return differences, integers_at(differences, *true_attitudes(truth, t_s))


def test_a_changed_integer_is_wrong_and_an_open_one_is_not_fixed(case):
    differences, right = case
    cycles, fixed = right.cycles.copy(), right.fixed.copy()
    cycles[0, 0, 1] += 1
    fixed[1, 0, 1] = False
    counts = count_integers(differences, replace(right, cycles=cycles, fixed=fixed), right)
    assert counts.wrong == 1
    assert counts.right == 8 * BASELINES * PAIRS - 2
    assert counts.not_fixed == 2 * BASELINES * PAIRS + 1


def test_integers_where_truth_is_unknown_are_neither_right_nor_wrong(case):
    differences, right = case
    everywhere = replace(right, fixed=differences.resolvable)
    counts = count_integers(differences, everywhere, right)
    assert counts.fixed == EPOCHS * BASELINES * PAIRS
    assert counts.right + counts.wrong == 8 * BASELINES * PAIRS


def test_without_truth_nothing_is_said_of_right_and_wrong(case):
    differences, right = case
    counts = count_integers(differences, right, None)
    assert counts.right is None
    assert counts.wrong is None


def test_integers_in_another_layout_are_an_error(case):
    differences, right = case
    other = replace(right, cycles=right.cycles[:5], fixed=right.fixed[:5], ratio=right.ratio[:5])
    text = r"integers of truth: expected the shape of the flight's double differences \(10, 3, 6\)"
    with pytest.raises(BadInputError, match=text):
        count_integers(differences, other, right)
