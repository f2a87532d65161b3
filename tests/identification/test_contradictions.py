"""What is left out of a flight whose measurements contradict each other, and what is left of it."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.identification.contradictions import (
    contradictory,
    is_hopeless,
    without_contradictions,
)
from fgnav.identification.exclusion import exclusions
from fgnav.types.estimate import Consistency, Contradiction, Estimate
from tests.robustness.faults import right_flights


def consistency(what, *spans, nis=50.0, throughout=False):
    contradictions = tuple(
        Contradiction(from_s=a, until_s=b, freedom=100, nis=nis, throughout=throughout)
        for a, b in spans
    )
    own = nis if spans else 1.0
    return Consistency(
        what=what, count=100, freedom=300, nis=own, beyond_99=0.01, contradictions=contradictions
    )


def estimate(*consistencies):
    return Estimate(
        method="any",
        t_s=np.arange(3.0),
        epochs=3,
        R_nb=np.tile(np.eye(3), (3, 1, 1)),
        consistency=consistencies,
    )


@pytest.fixture(scope="module")
def flight():
    return right_flights()["single"]


def test_what_is_consistent_stays_as_it_is(flight):
    right = estimate(consistency("velocity"))
    assert without_contradictions(flight, right, pytest.fail) is right


@pytest.mark.parametrize(("nis", "is_said"), [(2.1, True), (1.7, False), (1.4, False)])
def test_what_is_out_of_its_band_by_little_is_said_and_kept(flight, nis, is_said):
    """The band of few samples leaves 1.8; by that of many, 1.3, a variance of 1.4 is below 2.25."""
    limit = 1.3 if nis == 1.4 else 1.8
    one = replace(consistency("array phases"), nis=nis, limit=limit)
    found = without_contradictions(flight, estimate(one), pytest.fail)
    assert [note for note in found.notes if "array phases" in note] == list(found.notes)
    assert bool(found.notes) == is_said
    assert found.rejections == ()


def test_gnss_contradicts_an_instrument_that_agrees_with_the_solution(flight):
    one = consistency("place by code", (0.0, 20.0), throughout=True)
    tried = list(exclusions(flight, (one,)))
    assert [each.rejected[0].what for each in tried] == ["barometric height", "magnetic field"]
    assert tried[0].flight.barometer is None
    assert tried[1].flight.magnetometer is None
    assert tried[0].rejected[0].reason == "place by code contradicts it: left out"


@pytest.mark.parametrize("what", ["specific force", "velocity"])
@pytest.mark.parametrize("nis", [3.9, 4.1])
def test_forces_end_a_flight_by_seconds_other_sensors_throughout(what, nis):
    """Where forces are tested no heading is known, and no noise of the unit is identified."""
    for_seconds = estimate(consistency(what, (8.0, 9.0), nis=nis))
    all_along = estimate(consistency(what, (0.0, 20.0), nis=nis, throughout=True))
    assert is_hopeless(for_seconds) == (nis > 4.0 and what == "specific force")
    assert is_hopeless(all_along) == (nis > 4.0)


def test_the_worst_comes_first():
    found = estimate(consistency("velocity", (1, 2), nis=3.0), consistency("position", (1, 2)))
    assert [one.what for one in contradictory(found)] == ["position", "velocity"]


def test_samples_of_the_spans_alone_are_left_out(flight):
    (field, *_) = (
        one.flight
        for one in exclusions(
            flight,
            (consistency("magnetic field", (5.0, 6.0)), consistency("velocity", (5.0, 6.0))),
        )
    )
    t_s = field.magnetometer.t_s
    assert not ((t_s >= 4.0) & (t_s <= 7.0)).any()
    assert (
        len(t_s) == (~((flight.magnetometer.t_s >= 4.0) & (flight.magnetometer.t_s <= 7.0))).sum()
    )
    assert len(field.magnetometer.field_b_ut) == len(t_s)
    assert field.fixes is flight.fixes
    assert field.imu is flight.imu


def test_an_instrument_that_contradicts_throughout_is_left_out_whole(flight):
    one = consistency("barometric height", (0.0, 20.0), throughout=True)
    first = next(iter(exclusions(flight, (one,))))
    assert first.flight.barometer is None
    (rejected,) = first.rejected
    assert rejected.reason == "residuals 7.1 x what noise explains: left out"


def test_the_unit_that_all_others_contradict_is_tried_first(flight):
    both = (consistency("position", (8.0, 9.0)), consistency("velocity", (9.5, 11.0)))
    first = next(iter(exclusions(flight, both)))
    t_s = first.flight.imu.t_s
    assert not ((t_s > 7.0) & (t_s < 12.0)).any()
    (rejected,) = first.rejected
    assert (rejected.what, rejected.from_s, rejected.until_s) == ("inertial samples", 7.0, 12.0)


def test_forces_that_no_attitude_makes_agree_are_the_units(flight):
    """Whatever else contradicts a solution that such forces draw away does so all along."""
    all_along = consistency("magnetic field", (0.0, 20.0), throughout=True)
    both = (consistency("specific force", (8.0, 9.0)), all_along)
    first, second, *_ = exclusions(flight, both)
    (rejected,) = first.rejected
    assert (rejected.what, rejected.from_s, rejected.until_s) == ("inertial samples", 7.0, 10.0)
    assert rejected.reason == "specific force contradicts it: left out and bridged"
    assert first.flight.magnetometer is flight.magnetometer
    assert second.rejected[0].what == "magnetic field"


def test_the_exclusion_that_leaves_nothing_is_kept_and_said(flight):
    def again(changed):
        if changed.magnetometer is not flight.magnetometer:
            return estimate(consistency("velocity"))
        return estimate(consistency("velocity", (5.0, 6.0), nis=40.0))

    first = estimate(consistency("velocity", (5.0, 6.0)), consistency("magnetic field", (5.0, 6.0)))
    found = without_contradictions(flight, first, again)
    assert [one.what for one in found.rejections] == ["magnetic field"]
    (note,) = found.notes
    assert note == (
        "Magnetic field from 5.0 to 6.0 s: residuals 7.1 x what noise explains: left out."
    )


def test_where_nothing_consistent_is_left_there_is_no_solution(flight):
    wrong = estimate(consistency("velocity", (0.0, 20.0), throughout=True))
    with pytest.raises(
        NoSolutionError, match=r"contradict each other: velocity \(throughout: resid"
    ):
        without_contradictions(flight, wrong, lambda _: wrong)


def test_what_cannot_be_left_out_is_said(flight):
    wrong = estimate(consistency("velocity", (5.0, 6.0)))

    def fails(_):
        raise NoSolutionError("nothing")

    for again in (fails, None):
        found = without_contradictions(flight, wrong, again)
        assert found.rejections == ()
        assert "covariances are too small" in found.notes[0]
        assert "velocity (5.0 to 6.0 s: residuals 7.1 x" in found.notes[0]


def test_noise_that_is_believed_is_never_a_reason_to_refuse(flight):
    wrong = estimate(consistency("velocity", (0.0, 20.0), throughout=True))
    found = without_contradictions(flight, wrong, None)
    assert "contradict each other" in found.notes[0]


def test_phases_and_doppler_of_spans_are_left_out():
    array = right_flights()["array"]
    for what, field in (("array phases", "phase_cycles"), ("velocity", "doppler_hz")):
        trials = exclusions(array, (consistency(what, (5.0, 6.0)),))
        values = getattr(next(iter(trials)).flight.observations, field)
        t_s = array.observations.t_s
        inside = (t_s >= 4.0) & (t_s <= 7.0)
        assert np.isnan(values[inside]).all()
        np.testing.assert_array_equal(values[~inside], getattr(array.observations, field)[~inside])


def test_phases_of_one_antenna_that_contradict_each_other_are_left_out_whole():
    array = right_flights()["array"]
    whole = consistency("phase", (0.0, 20.0), throughout=True)
    first = next(iter(exclusions(replace(array, imu=None), (whole,))))
    assert np.isnan(first.flight.observations.phase_cycles).all()
    doppler_hz = first.flight.observations.doppler_hz
    np.testing.assert_array_equal(doppler_hz, array.observations.doppler_hz)


def test_a_flight_without_a_unit_has_none_to_leave_out():
    array = right_flights()["array"]
    bare = replace(array, imu=None)
    whole = consistency("array phases", (0.0, 20.0), throughout=True)
    assert list(exclusions(bare, (whole,))) == []


def test_what_contradicts_for_seconds_and_agrees_in_all_is_said_alone(flight):
    agrees = replace(consistency("velocity", (5.0, 6.0)), nis=1.1)
    found = without_contradictions(flight, estimate(agrees), pytest.fail)
    assert found.rejections == ()
    assert "velocity (5.0 to 6.0 s" in found.notes[0]


def test_no_more_than_six_flights_are_tried(flight):
    asked = []

    def again(changed):
        asked.append(changed)
        return estimate(*wrong)

    wrong = [
        consistency(what, (5.0, 6.0))
        for what in ("velocity", "position", "magnetic field", "barometric height")
    ]
    for trial in range(20):
        wrong[0] = consistency("velocity", (5.0, 6.0), nis=50.0 / 3**trial)
        without_contradictions(flight, estimate(*wrong), again)
        assert len(asked) <= 6
        asked.clear()
