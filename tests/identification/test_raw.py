"""What raw observations tell of the inertial unit: phases of arcs, and places of an array."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.identification import tested_constants, time_tags
from fgnav.identification.lasting.clock import ClockOff
from fgnav.identification.tested_constants import Times
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods.smoother import Smoother
from tests.gnss.based import flown
from tests.identification.identified import SETTINGS, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight


def test_an_accelerometer_too_loud_for_phases_is_found_beside_them():
    """Doppler alone does not tell: attitudes erred by nine sigmas without a word."""
    flight = right_flight("raw", 75_843)
    assert not found_in(flight).factors
    imu = flight.imu
    noise = 0.2 * np.random.default_rng(3).normal(size=imu.f_b_mps2.shape)
    loud = found_in(replace(flight, imu=replace(imu, f_b_mps2=imu.f_b_mps2 + noise)))
    stated = imu.accelerometer_noise_mps2_per_sqrt_hz
    real = np.hypot(0.2 * np.sqrt(np.median(np.diff(imu.t_s))), stated)
    assert set(loud.factors) == {"accelerometer"}
    assert abs(np.log(loud.factors["accelerometer"] * stated / real)) < 4 * 0.14  # its sigmas


def test_a_clock_that_is_off_is_corrected_to_the_end():
    """Phases of arcs take tags as exact: a clock estimated beside them erred by eight sigmas."""
    flight = right_flight("array", 75_835)
    late = replace(flight, imu=replace(flight.imu, t_s=flight.imu.t_s + 0.352))
    found = found_in(late)
    assert isinstance(found.cause, ClockOff)
    assert abs(found.cause.moved[0] + 0.352) < 4 * 0.0013  # its sigma
    assert all(one.kind != "clock" for one in found.calibration)
    assert any("corrected." in note for note in found.notes)


def test_tags_are_moved_by_steps_until_one_is_within_its_sigma(monkeypatch):
    """A step that goes half the way, as steps do, is not the last one."""
    flight = right_flight("fixes", 75_836)
    late_s = 0.4

    def half_the_way(at, *_, **__):
        rest_s = late_s - (flight.imu.t_s - at.imu.t_s).mean()
        times = Times(value=np.array([-rest_s / 2, 0.0, 0.0]), sigma=np.full(3, 0.02))
        return SimpleNamespace(times=times, factors={}, has_no_minimum=False)

    monkeypatch.setattr(time_tags, "identify", half_the_way)
    monkeypatch.setattr(time_tags.ThinnedFlight, "of", lambda flight, *_: flight)
    search = time_tags.TagSearch(flight, SETTINGS, lambda *_: None)
    at_tags = search._stepped(time_tags.AtTags(half_the_way(flight), np.zeros(2)), ())
    assert abs(at_tags.moved[0] + late_s) < 0.04
    assert at_tags.moved[1] == 0.0


def test_steps_to_and_fro_end_at_once(monkeypatch):
    """Of other faults: each would identify all noise again."""
    flight, offsets_s = right_flight("fixes", 75_836), iter([0.3, -0.2, 0.25, -0.25])

    def to_and_fro(*_, **__):
        times = Times(value=np.array([next(offsets_s), 0.0, 0.0]), sigma=np.full(3, 0.02))
        return SimpleNamespace(times=times, factors={}, has_no_minimum=False)

    monkeypatch.setattr(time_tags, "identify", to_and_fro)
    monkeypatch.setattr(time_tags.ThinnedFlight, "of", lambda flight, *_: flight)
    search = time_tags.TagSearch(flight, SETTINGS, lambda *_: None)
    with pytest.raises(NoSolutionError, match="clock: its steps do not end"):
        search._stepped(time_tags.AtTags(to_and_fro(), np.zeros(2)), ())
    assert next(offsets_s) == -0.25


def test_a_clock_that_runs_fast_is_moved_where_phases_say_so():
    """The chain, which has no phases, finds such tags 6.5 nats likelier, and eight are asked."""
    right = right_flight("array", 7_335)
    t_s = right.imu.t_s
    fast = replace(right, imu=replace(right.imu, t_s=t_s[0] + (1 + 2.3e-3) * (t_s - t_s[0])))
    estimate = Smoother()(fast)
    assert any("clock disagrees with GNSS" in note for note in estimate.notes)
    # Of 3; measured 3.3.
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 5.0


def test_a_right_flight_that_is_asked_for_its_clock_keeps_its_tags(monkeypatch):
    asked = []
    likelihood = time_tags.profile_likelihood

    def seen(problem):
        asked.append(likelihood(problem))
        return asked[-1]

    monkeypatch.setattr(time_tags, "profile_likelihood", seen)
    monkeypatch.setattr(tested_constants, "_ASKED_SIGMAS", 0.0)
    found = found_in(right_flight("array", 7_335))
    assert len(asked) == 2  # at both tags
    assert not found.moved.any()


def test_a_body_that_turns_alike_tells_no_clock():
    """One step of the chain would move the tags of this flight by .47 s."""
    flight = flown(name="tumble", base=None, span_s=30.0, seed=94_012, message_errors=True)
    prepared = Smoother(resolver=Truth()).prepare(flight)
    assert not any("clock" in note for note in prepared.notes)


def test_the_reference_may_be_the_antenna_that_is_off():
    flight = right_flight("array", 75_835)
    off_b_m = np.array([0.02, -0.01, 0.02])
    first, *others = flight.antennas
    moved = replace(first, position_b_m=first.position_b_m + off_b_m)
    found = found_in(replace(flight, antennas=(moved, *others)))
    assert found.reference != 0
    assert [one.antenna for one in found.calibration] == [first.name]
    assert any(f"Antenna {first.name} is off its place" in note for note in found.notes)
