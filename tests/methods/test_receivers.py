"""A drone with receivers' fixes of two antennas and the baseline between them."""

from dataclasses import replace
from functools import cache

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.ablation import without
from fgnav.evaluation.scores import errors_against
from fgnav.methods.closed_form import ClosedForm
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav_sim.motion import Straight
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate

DRONE = load_scenario("drone")
GAPS_S = DRONE.baseline.gaps_s
ONE = msgspec.structs.replace(DRONE.fixes, antennas=("a1",))
HOVER = msgspec.structs.replace(DRONE.motion, path=Straight(speed_mps=0.01))


@cache
def flown(seed, gyroscope=True, **changes):
    measures = changes.pop("measures", None)
    made = msgspec.structs.replace(DRONE, **changes)
    if measures is not None:
        baseline = msgspec.structs.replace(made.baseline, measures=measures)
        made = msgspec.structs.replace(made, baseline=baseline)
    flight = simulate(made, np.random.default_rng(seed))
    return flight if gyroscope else without(flight, ["gyroscope"])


def yaw_over_sigma(flight, estimate):
    error = np.degrees(errors_against(flight.truth, estimate).euler_rad[:, 2])
    return error / estimate.sigma_deg[: len(error), 2]


@pytest.mark.parametrize("gyroscope", [True, False])
@pytest.mark.parametrize("method", [Smoother(), Batch(noise="nominal")], ids=lambda one: one.name)
def test_errors_are_within_what_is_stated_gaps_of_the_baseline_included(method, gyroscope):
    nees, in_gaps = [], []
    for seed in range(51_001, 51_005):
        flight = flown(seed, gyroscope)
        estimate = method(flight)
        assert estimate.consistent
        errors = errors_against(flight.truth, estimate)
        nees.append([np.mean(x) for x in (errors.nees, errors.position_nees, errors.velocity_nees)])
        of = yaw_over_sigma(flight, estimate)
        inside = [(errors.t_s > a) & (errors.t_s < b) for a, b in GAPS_S]
        in_gaps.append([np.mean(of[rows] ** 2) for rows in inside])
    assert (np.mean(nees, axis=0) > 2.0).all()
    assert (np.mean(nees, axis=0) < 4.0).all()
    assert (np.mean(in_gaps, axis=0) < 4.0).all()  # of 2, 5, 10 and 20 s; one is expected


@pytest.mark.parametrize("measures", ["vector", "direction", "heading"])
def test_one_receiver_and_a_baseline_have_a_heading_from_the_first_keyframe_on(measures):
    flight = flown(51_010, fixes=ONE, motion=HOVER, measures=measures)
    for method in (Smoother(noise="nominal"), Forward(noise="nominal")):
        estimate = method(flight)
        assert estimate.sigma_deg[:, 2].max() < 5.0
        assert np.abs(yaw_over_sigma(flight, estimate)).max() < 5.0


@pytest.mark.parametrize("gyroscope", [True, False])
def test_fixes_of_two_antennas_tell_the_heading_of_a_body_that_hovers(gyroscope):
    flight = flown(51_011, gyroscope, motion=HOVER, baseline=None)
    estimate = Smoother(noise="nominal")(flight)
    assert np.median(estimate.sigma_deg[:, 2]) < 0.5
    assert np.mean(yaw_over_sigma(flight, estimate) ** 2) < 3.0


def test_a_baseline_is_a_vector_of_the_closed_form():
    flight = flown(51_012, gyroscope=False, fixes=ONE)
    estimate = ClosedForm()(flight)
    errors_deg = np.degrees(errors_against(flight.truth, estimate).euler_rad)
    assert "receiver baseline a1 a2" in estimate.notes[0]
    assert np.isin(estimate.t_s, flight.baselines[0].t_s).all()  # of others none is guessed
    assert np.sqrt((errors_deg[:, 2] ** 2).mean()) < 0.8  # .57 deg of .01 m across 1 m


def test_baselines_between_keyframes_have_keyframes_of_their_own():
    flight = flown(51_013)
    (one,) = flight.baselines
    moved = replace(one, t_s=one.t_s + 0.037)
    estimate = Smoother(noise="nominal")(replace(flight, baselines=(moved,)))
    assert not [loss for loss in estimate.unused if loss.what.startswith("baseline")]
    assert np.isin(np.round(moved.t_s, 6), np.round(estimate.t_s, 6)).mean() > 0.99


def test_a_baseline_of_exchanged_antennas_is_left_out_and_said():
    flight = flown(51_014)
    (one,) = flight.baselines
    wrong = replace(flight, baselines=(replace(one, antennas=one.antennas[::-1]),))
    estimate = Smoother()(wrong)
    assert [one.what for one in estimate.rejections] == ["baseline"]
    assert {one.sensor for one in estimate.verdicts} == {"baseline"}
    assert np.mean(yaw_over_sigma(flight, estimate) ** 2) < 3.0


def test_a_baseline_of_antennas_at_one_place_is_refused_by_name():
    flight = flown(51_014)
    together = tuple(replace(one, position_b_m=np.zeros(3)) for one in flight.antennas)
    with pytest.raises(BadInputError, match=r"baseline a1 to a2: both antennas have position_b_m"):
        Smoother()(replace(flight, antennas=together))
