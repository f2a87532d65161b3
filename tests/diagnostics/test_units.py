from dataclasses import replace

import numpy as np
import pytest

from fgnav.diagnostics import describe
from fgnav.diagnostics.units import G_MPS2, magnetometer_finding, mean_forces, unit_finding
from tests.imu import imu_of
from tests.recordings import uav
from tests.robustness.drawn.flights import right_flight

T_S = np.arange(0, 60, 0.01)


def imu(f_b_mps2, w_b_radps=None):
    return imu_of(T_S, f_b_mps2, w_b_radps)


def resting(size_mps2=9.81):
    return np.tile([0, 0, -size_mps2], (len(T_S), 1))


def rolling():
    """Roll that swings by 30 degrees, in still air: gravity turns against the body."""
    roll = np.radians(30) * np.sin(T_S)
    f_b_mps2 = -9.81 * np.stack([0 * roll, np.sin(roll), np.cos(roll)], axis=1)
    w_b_radps = np.stack([np.radians(30) * np.cos(T_S), 0 * roll, 0 * roll], axis=1)
    return f_b_mps2, w_b_radps


def at_rest(imu):
    return unit_finding(imu, None)


@pytest.mark.parametrize(
    ("size_mps2", "name", "text"),
    [
        (1.0, "imu unit", "specific force is in g; multiply by 9.80665"),
        (0.0981, "imu unit", "specific force is velocity increments; multiply by 100"),
        (0.01, "imu gravity", "gravity is removed"),
        (96.2, "imu unit", "specific force is multiplied by 9.81 twice; divide by 9.80665"),
    ],
)
def test_a_wrong_size_of_specific_force_is_named(size_mps2, name, text):
    finding = at_rest(imu(resting(size_mps2)))
    assert finding.name == name
    assert text in str(finding)


def test_right_samples_at_rest_and_in_motion_raise_no_alarm():
    assert at_rest(imu(resting())) is None
    assert at_rest(imu(*rolling())) is None


def test_a_real_gyroscope_is_right_and_its_degrees_are_found(shared):
    flight = uav(shared)
    assert of_unit(flight) == []
    degrees = replace(flight.imu, w_b_radps=np.degrees(flight.imu.w_b_radps))
    (finding,) = of_unit(replace(flight, imu=degrees))
    assert finding.certain
    assert "degrees per second" in finding.text


def test_a_body_that_yaws_faster_than_its_course_has_a_gyroscope_in_radians():
    """A weave's course follows yaw at a twentieth: it was refused as one in degrees."""
    assert of_unit(right_flight("instruments", 52032)) == []


def of_unit(flight):
    """Return what a quick check finds of the inertial unit's axes and units."""
    names = ("imu", "gyroscope")
    findings = describe(flight, quick=True).findings
    return [one for one in findings if one.name.split()[0] in names]


@pytest.mark.parametrize("kind", ["fixes", "raw", "array"])
def test_accelerations_without_gravity_are_named_and_right_forces_are_not(kind):
    flight = right_flight(kind, 7)
    assert not [one for one in describe(flight, quick=True).findings if "imu" in one.name]
    t_s, truth = flight.imu.t_s, flight.truth
    down_b = truth.R_nb[np.searchsorted(truth.t_s, t_s).clip(max=len(truth.t_s) - 1), 2]
    removed = replace(flight.imu, f_b_mps2=flight.imu.f_b_mps2 + 9.80665 * down_b)
    (finding,) = [
        one
        for one in describe(replace(flight, imu=removed), quick=True).findings
        if "imu" in one.name
    ]
    assert finding.certain
    assert "gravity is removed" in finding.text


def test_vibration_is_no_unit():
    flight = right_flight("fixes", 7)
    shaken = np.random.default_rng(0).normal(0.0, 8.0, flight.imu.f_b_mps2.shape)
    forces = mean_forces(flight.fixes[0], flight.origin)
    imu = replace(flight.imu, f_b_mps2=flight.imu.f_b_mps2 + shaken)
    assert unit_finding(imu, forces) is None


@pytest.mark.parametrize("kind", ["fixes", "raw", "array"])
@pytest.mark.parametrize(("factor", "unit"), [(1 / G_MPS2, "in g"), (G_MPS2, "9.81 twice")])
def test_force_in_g_and_g_twice_are_named_before_any_axis(kind, factor, unit):
    flight = right_flight(kind, 7)
    wrong = replace(flight, imu=replace(flight.imu, f_b_mps2=factor * flight.imu.f_b_mps2))
    for quick in (True, False):
        diagnosis = describe(wrong, quick=quick)
        (finding,) = [one for one in diagnosis.findings if "imu" in one.name]
        assert finding.certain
        assert finding.name == "imu unit"
        assert unit in finding.text
        assert "not before" in diagnosis.unchecked[-1].text


def magnetic(flight):
    forces = mean_forces(flight.fixes[0], flight.origin)
    return magnetometer_finding(flight.magnetometer, flight.imu, forces)


def with_field(flight, field_b_ut):
    return replace(flight, magnetometer=replace(flight.magnetometer, field_b_ut=field_b_ut))


@pytest.mark.parametrize("number", range(60, 66))
def test_a_right_magnetometer_raises_no_alarm(number):
    assert magnetic(right_flight("instruments", number)) is None


@pytest.mark.parametrize("number", range(60, 63))
def test_reversed_forces_and_a_reversed_field_are_told_from_a_body_on_its_back(number):
    flight = right_flight("instruments", number)
    forces = replace(flight, imu=replace(flight.imu, f_b_mps2=-flight.imu.f_b_mps2))
    for wrong in (forces, with_field(flight, -flight.magnetometer.field_b_ut)):
        (finding,) = [one for one in describe(wrong, quick=True).findings if one.certain]
        assert finding.name == "magnetometer axes"
        assert "reverse fx, fy, fz (specific force at rest is up)" in finding.mend


def test_hard_iron_explains_another_angle_and_a_missing_axis_is_not_certain():
    flight = right_flight("instruments", 64)
    sensor = flight.magnetometer
    iron_ut = 2.0 * sensor.hard_iron_ut * np.ones(3)
    assert magnetic(with_field(flight, sensor.field_b_ut + iron_ut)) is None
    finding = magnetic(with_field(flight, sensor.field_b_ut * [1.0, 1.0, 0.0]))
    assert not finding.certain
    assert "its axes, or hard_iron_ut, are wrong" in finding.mend
