"""Measurements in axes that are turned against those of the states."""

import numpy as np
import pytest

from fgnav.geometry.rotations import exp
from fgnav.graph.turned import ARRAY_TURN, UNIT_TURN, Turned, in_turned_axes
from fgnav.graph.types.constants import Constants, flight_constant
from tests.graph.factors import cases
from tests.graph.factors.test_array_phase import K, phases, with_lasting
from tests.graph.factors.test_directions_of_instruments import field, sight


def with_turn(turn: str) -> Constants:
    others = cases.constants(3, 9).parts
    return Constants((*others, flight_constant(turn, ("x_b", "y_b", "z_b"), "rad", 0.1)))


def turned(kind: str, rng, shared, at):
    inner = {
        "array": lambda: phases(rng, shared, stretch=True),
        "lasting": lambda: phases(rng, shared, stretch=True, lasting=6),
        "sight": lambda: sight(rng, shared, at, boresight=True),
        "field": lambda: field(rng, shared, at, iron=True),
    }[kind]()
    found = in_turned_axes(inner, shared)
    assert isinstance(found, Turned)
    return found


@pytest.mark.parametrize("gyroscope", [False, True])
@pytest.mark.parametrize("kind", ["array", "sight", "field"])
def test_jacobians_equal_differences(kind, gyroscope):
    rng, shared = np.random.default_rng(1), with_turn(UNIT_TURN)
    at = cases.random_states(K, shared, rng, gyroscope=gyroscope)
    cases.assert_jacobians(turned(kind, rng, shared, at), at)


@pytest.mark.parametrize("kind", ["array", "sight", "field"])
def test_gtsam_says_the_same(kind):
    rng, shared = np.random.default_rng(2), with_turn(UNIT_TURN)
    at = cases.random_states(K, shared, rng)
    cases.assert_gtsam_says_the_same(turned(kind, rng, shared, at), at, shared)


def test_phases_that_err_lastingly_keep_their_part_of_the_keyframes_vector():
    rng, shared = np.random.default_rng(5), with_turn(ARRAY_TURN)
    at = with_lasting(cases.random_states(K, shared, rng), rng, 6)
    measurement = turned("lasting", rng, shared, at)
    cases.assert_jacobians(measurement, at)
    cases.assert_gtsam_says_the_same(measurement, at, shared)


def test_residual_of_a_turned_array_vanishes_where_the_turn_leads_to_the_minimum():
    rng, shared = np.random.default_rng(3), with_turn(ARRAY_TURN)
    at = cases.random_states(K, shared, rng)
    form = phases(rng, shared)
    turn = exp(at.constants[None, shared.columns(ARRAY_TURN)])
    at = at._replace(R_nb=form.minimum @ turn.swapaxes(1, 2))
    there = in_turned_axes(form, shared).linearise(at, np.arange(K))
    assert np.abs(there.value).max() < 1e-12


def test_a_turn_of_the_array_leaves_other_sensors_where_they_are():
    rng, shared = np.random.default_rng(4), with_turn(ARRAY_TURN)
    one = sight(rng, shared, cases.random_states(K, shared, rng), boresight=False)
    assert in_turned_axes(one, shared) is one
