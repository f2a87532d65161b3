"""Findings on baselines of receivers: what places of antennas contradict."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgnav.diagnostics import describe
from fgnav.evaluation.ablation import without
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate


@cache
def flown(gyroscope=True, fixes=2):
    flight = simulate(load_scenario("drone"), np.random.default_rng(7))
    flight = replace(flight, fixes=flight.fixes[:fixes])
    return flight if gyroscope else without(flight, ["gyroscope"])


def placed(flight, first_b_m, second_b_m):
    places = zip(flight.antennas, (first_b_m, second_b_m), strict=True)
    antennas = (replace(one, position_b_m=np.array(place, float)) for one, place in places)
    return replace(flight, antennas=tuple(antennas))


def findings(flight):
    return [
        str(one) for one in describe(flight).findings if re.fullmatch(r"baseline a\d a\d", one.name)
    ]


CASES = [(True, 2), (True, 1), (False, 2), (False, 1)]
FIRST, SECOND = (-0.5, 0.0, -0.1), (0.5, 0.0, -0.1)


@pytest.mark.parametrize(("gyroscope", "fixes"), CASES)
def test_right_places_are_not_named(gyroscope, fixes):
    assert not findings(flown(gyroscope, fixes))


@pytest.mark.parametrize(("gyroscope", "fixes"), CASES)
def test_exchanged_places_are_named(gyroscope, fixes):
    found = findings(placed(flown(gyroscope, fixes), SECOND, FIRST))
    assert found
    assert all("a1 and a2 are exchanged" in text for text in found)


@pytest.mark.parametrize(("gyroscope", "fixes"), CASES)
def test_names_exchanged_in_the_baseline_alone_are_named(gyroscope, fixes):
    flight = flown(gyroscope, fixes)
    (one,) = flight.baselines
    flight = replace(flight, baselines=(replace(one, antennas=one.antennas[::-1]),))
    (text,) = findings(flight)
    assert "a2 and a1 are exchanged" in text
    assert "[[baseline]]" in text


@pytest.mark.parametrize("measured", ["vector", "heading"])
def test_antennas_at_one_place_are_named(measured):
    flight = placed(flown(fixes=1), (0, 0, 0), (0, 0, 0))
    (one,) = flight.baselines
    if measured == "heading":
        level = one.vector_n_m * [1, 1, 0]
        level /= np.linalg.norm(level, axis=1, keepdims=True)
        one = replace(one, vector_n_m=level, measured="heading")
    (text,) = findings(replace(flight, baselines=(one,)))
    assert "state position_b_m of each" in text
    assert ("1.000 m (± 0.001), places are 0.000 m" in text) == (measured == "vector")


def test_a_wrong_length_is_named():
    (text,) = findings(placed(flown(fixes=1), FIRST, (0.55, 0.0, -0.1)))
    assert "has 1.000 m (± 0.001), places are 1.050 m apart" in text


def test_places_that_are_turned_are_named_with_those_that_would_fit():
    second = np.add(FIRST, [np.cos(np.radians(20)), np.sin(np.radians(20)), 0.0])
    (text,) = findings(placed(flown(fixes=1), FIRST, second))
    found = np.array(text.split("position_b_m = [")[1].split("]")[0].split(","), float)
    np.testing.assert_allclose(found, SECOND, atol=0.04)


def test_a_heading_against_the_course_is_named_where_nothing_else_tells_it():
    flight = flown(gyroscope=False, fixes=1)
    (one,), fixes = flight.baselines, flight.fixes[0]
    ahead = np.stack([np.interp(one.t_s, fixes.t_s, v) for v in fixes.v_n_mps.T], axis=1)
    ahead[:, 2] = 0.0
    backwards = -ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
    one = replace(one, vector_n_m=backwards, measured="heading")
    (text,) = findings(replace(flight, baselines=(one,)))
    assert "a1 and a2 are exchanged: beside the course" in text
