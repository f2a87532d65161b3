"""Integers that arcs agree on."""

import dataclasses

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fgnav.frontend.array.consensus import arc_consensus, majority_integers
from fgnav.geometry import rotations
from tests.attitude.arrays import sky, synthetic

NAMES = ("a1", "a2", "a3")
ANTENNAS_B_M = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 0.5, 0]])


@pytest.fixture
def array():
    rng = np.random.default_rng(0)
    R_nb = rotations.exp(0.3 * rng.standard_normal((40, 3)))
    return synthetic(R_nb, sky(5, rng), rng, antennas_b_m=ANTENNAS_B_M)


def without(integers, epochs):
    fixed = integers.fixed.copy()
    fixed[epochs] = False
    return dataclasses.replace(integers, fixed=fixed, cycles=np.where(fixed, integers.cycles, 0))


def changed(integers, epochs, link, by):
    cycles = integers.cycles.copy()
    cycles[(epochs, *link)] += by
    return dataclasses.replace(integers, cycles=cycles)


def test_refused_epochs_take_the_integers_of_their_arcs(array):
    differences, true = array
    consensus = arc_consensus(differences, without(true, np.arange(3, 30)), NAMES)
    assert_array_equal(consensus.integers.cycles, true.cycles)
    assert_array_equal(consensus.integers.fixed, true.fixed)
    assert "27 epochs" in consensus.notes[0]
    assert not consensus.rejections


def test_everything_fixed_stays_as_it_is(array):
    differences, true = array
    assert arc_consensus(differences, true, NAMES).integers is true


def test_no_integer_holds_between_different_integers(array):
    """A slip that nobody noticed: until it, the arc's integer; then nobody knows from when."""
    differences, true = array
    integers = changed(true, np.arange(34, 40), (0, 1), 3)
    consensus = arc_consensus(differences, without(integers, np.arange(20, 25)), NAMES).integers
    assert consensus.fixed[20:25, 0, 1].all()
    consensus = arc_consensus(differences, without(integers, np.arange(32, 36)), NAMES).integers
    assert not consensus.fixed[32:36, 0, 1].any()
    assert consensus.fixed[32:36, 1, 1].all()
    assert_array_equal(consensus.cycles[36:, 0, 1], true.cycles[36:, 0, 1] + 3)


def test_an_integer_does_not_outlast_its_arc(array):
    differences, true = array
    arc = differences.arc.copy()
    arc[20:, 1, 2] = 1
    differences = dataclasses.replace(differences, arc=arc)
    consensus = arc_consensus(differences, without(true, np.arange(18, 40)), NAMES).integers
    assert consensus.fixed[18:20, 1, 2].all()
    assert not consensus.fixed[20:, 1, 2].any()


def test_a_single_epoch_is_outvoted_and_listed(array):
    differences, true = array
    consensus = arc_consensus(differences, changed(true, [7], (1, 3), -2), NAMES)
    assert_array_equal(consensus.integers.cycles, true.cycles)
    (rejected,) = consensus.rejections
    assert rejected.link == "a3 G04 1C"
    assert rejected.from_s == pytest.approx(0.7)
    assert "integer off by -2" in rejected.reason


def test_four_epochs_speak_for_no_arc(array):
    differences, true = array
    refused = without(true, np.arange(4, 40))
    assert not arc_consensus(differences, refused, NAMES).integers.fixed[4:].any()


def test_links_left_out_of_a_fixed_baseline_stay_out(array):
    differences, true = array
    fixed = true.fixed.copy()
    fixed[10:20, 0, 2] = False
    integers = dataclasses.replace(true, fixed=fixed, cycles=np.where(fixed, true.cycles, 0))
    assert not arc_consensus(differences, integers, NAMES).integers.fixed[10:20, 0, 2].any()


def test_the_integer_with_most_votes_wins_and_of_equal_ones_the_largest():
    label, cycles = np.array([5, 2, 5, 2, 5, 2, 9, 9]), np.array([1, -3, 1, 7, 4, -3, 2, 6])
    labels, integers, votes = majority_integers(label, cycles)
    assert labels.tolist() == [2, 5, 9]
    assert integers.tolist() == [-3, 1, 6]
    assert votes.tolist() == [2, 2, 1]


def test_no_votes_elect_nothing():
    none = np.zeros(0, dtype=np.int64)
    assert [len(part) for part in majority_integers(none, none)] == [0, 0, 0]
