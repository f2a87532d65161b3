"""Bad links are named, left out, and the rest is right."""

import dataclasses

import numpy as np
import pytest

from fgnav.integers.resolvers.constrained import Constrained
from fgnav.integers.snooping import LEFT_OUT, touched

from .arrays import PAPER_ANTENNAS_B_M, make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
STATED = Constrained(estimate_noise=False)
PHASE_M = 0.045  # a quarter of a cycle: no integer takes it in


def spoilt(made, errors, epochs=slice(None)):
    """The same with phase errors, m, of undifferenced links {(antenna, channel): error}."""
    d = made.differences
    links = np.zeros((len(d.t_s), len(d.baselines_b_m) + 1, len(d.satellites)))
    for (antenna, channel), error_m in errors.items():
        links[epochs, antenna, channel] = error_m
    single = links[:, 1:] - links[:, :1]
    of_reference = d.reference[:, d.group][:, None, :]
    double = single - np.take_along_axis(single, of_reference, axis=2)
    return dataclasses.replace(d, phase_m=d.phase_m + double)


def named(found):
    return {loss.what: loss.count for loss in found.losses if loss.reason == LEFT_OUT}


def test_bad_link_is_named_and_the_rest_of_its_epochs_is_right():
    made = make(np.random.default_rng(1), epochs=60)
    d = spoilt(made, {(3, 4): PHASE_M}, slice(0, 40))
    found = STATED(d, made.flight)
    assert named(found) == {"a4 G05 1C link": 40}
    assert not found.fixed[:40, 2, 4].any()
    assert found.fixed.sum() == 60 * 35 - 40
    assert (found.cycles == made.cycles)[found.fixed].all()
    assert set(found.reasons[:40]) == {f"a link {LEFT_OUT}"}
    assert set(found.reasons[40:]) == {""}
    assert set(found.outcome) == {"fixed"}


def test_bad_link_of_the_reference_antenna_costs_its_channel():
    made = make(np.random.default_rng(2), epochs=20)
    found = STATED(spoilt(made, {(0, 2): PHASE_M}), made.flight)
    assert named(found) == {"a1 G03 1C link": 20 * 7}
    assert not found.fixed[:, :, 2].any()
    assert found.fixed.sum() == 20 * 28
    assert (found.cycles == made.cycles)[found.fixed].all()


def test_bad_link_of_the_reference_channel_costs_its_antenna():
    made = make(np.random.default_rng(3), epochs=20)
    found = STATED(spoilt(made, {(5, 0): PHASE_M}), made.flight)
    assert named(found) == {"a6 G01 1C link": 20 * 5}
    assert not found.fixed[:, 4].any()
    assert (found.cycles == made.cycles)[found.fixed].all()


@pytest.mark.parametrize("code_m", [4.0, -8.0])
def test_bad_code_is_found_too(code_m):
    made = make(np.random.default_rng(4), epochs=20)
    measured_m = made.differences.code_m.copy()
    measured_m[:, 4, 3] += code_m
    d = dataclasses.replace(made.differences, code_m=measured_m)
    found = STATED(d, made.flight)
    assert named(found) == {"a6 G04 1C link": 20}
    assert (found.cycles == made.cycles)[found.fixed].all()


def test_three_bad_links_are_found_one_after_the_other_and_four_are_refused():
    made = make(np.random.default_rng(5), epochs=20, satellites=(8,))
    errors = {(3, 4): PHASE_M, (6, 2): -PHASE_M, (1, 7): 0.06}
    found = STATED(spoilt(made, errors), made.flight)
    fixed = found.fixed.any(axis=(1, 2))
    assert fixed.mean() >= 0.9
    assert (found.cycles == made.cycles)[found.fixed].all()
    assert {"a4 G05 1C link", "a7 G03 1C link", "a2 G08 1C link"} <= set(named(found))
    errors[(4, 1)] = -0.06
    found = STATED(spoilt(made, errors), made.flight)
    assert not found.fixed.any()
    assert named(found) == {}
    assert [loss.count for loss in found.losses] == [20 * 49]


def test_which_of_two_antennas_is_bad_is_not_claimed():
    made = make(np.random.default_rng(6), epochs=60, satellites=(10,), antennas_b_m=PAIR_B_M)
    found = STATED(spoilt(made, {(1, 4): PHASE_M}), made.flight)
    accepted = found.fixed.any(axis=(1, 2))
    assert accepted.mean() > 0.8
    assert (found.cycles == made.cycles)[found.fixed].all()
    # a neighbour is taken for it now and then: two antennas have little to check a link by
    assert named(found)["a1 or a2 G05 1C link"] >= 0.9 * accepted.sum()


def test_epochs_that_other_links_explain_as_well_with_other_integers_stay_refused():
    made = make(np.random.default_rng(7), epochs=200, satellites=(5,), antennas_b_m=PAIR_B_M)
    every = Constrained(wrong_max=None, estimate_noise=False)
    found = every(spoilt(made, {(1, 3): PHASE_M}), made.flight)
    accepted = np.array([reason == f"a link {LEFT_OUT}" for reason in found.reasons])
    spoilt_ones = np.array(["chi-square" in reason for reason in found.reasons])
    assert accepted.sum() < spoilt_ones.sum()


def test_link_left_out_counts_once_where_two_share_a_difference():
    made = make(np.random.default_rng(8), epochs=20)
    errors = {(0, 2): PHASE_M, (3, 4): -PHASE_M}
    found = STATED(spoilt(made, errors), made.flight)
    assert found.fixed.sum() + sum(loss.count for loss in found.losses) == 20 * 35
    # left out one by one, so now and then a link more than need be
    assert 0.95 * 20 * 27 <= found.fixed.sum() <= 20 * 27


def test_differences_that_a_link_takes_part_in():
    made = make(np.random.default_rng(9), antennas_b_m=PAPER_ANTENNAS_B_M[:3], satellites=(3, 2))
    for (antenna, channel), expected in {
        (1, 1): [[0, 1, 0, 0, 0], [0, 0, 0, 0, 0]],
        (2, 0): [[0, 0, 0, 0, 0], [1, 1, 1, 0, 0]],
        (0, 4): [[0, 0, 0, 0, 1], [0, 0, 0, 0, 1]],
        (0, 3): [[0, 0, 0, 1, 1], [0, 0, 0, 1, 1]],
    }.items():
        links = np.zeros((1, 3, 5), bool)
        links[0, antenna, channel] = True
        found = touched(made.differences, np.array([0]), links)
        np.testing.assert_array_equal(found[0], np.array(expected, bool))
