from dataclasses import replace

import numpy as np
import pytest

from fgnav.attitude.flight_vectors import track_of
from fgnav.set_up import describe
from fgnav.set_up.field_angle import angle_findings
from fgnav.set_up.mean_force import mean_forces
from tests.robustness.drawn.flights import right_flight


def found(flight):
    forces = mean_forces(flight.imu, track_of(flight), flight.origin)
    return angle_findings(flight.imu, flight.magnetometer, forces)


def with_field(flight, field_b_ut):
    return replace(flight, magnetometer=replace(flight.magnetometer, field_b_ut=field_b_ut))


@pytest.mark.parametrize("number", range(60, 70))
def test_a_right_flight_raises_no_alarm(number):
    assert found(right_flight("instruments", number)) == []


@pytest.mark.parametrize("number", range(60, 63))
def test_reversed_forces_and_a_reversed_field_are_told_from_a_body_on_its_back(number):
    flight = right_flight("instruments", number)
    forces = replace(flight, imu=replace(flight.imu, f_b_mps2=-flight.imu.f_b_mps2))
    for wrong in (forces, with_field(flight, -flight.magnetometer.field_b_ut)):
        (finding,) = [one for one in describe(wrong, quick=True).findings if one.certain]
        assert finding.name == "magnetometer axes"
        assert "reverse fx, fy, fz (specific force at rest is up)" in finding.mend


def test_hard_iron_as_stated_explains_another_angle_and_a_reversed_axis_is_not_certain():
    flight = right_flight("instruments", 64)
    sensor = flight.magnetometer
    iron_ut = 2.0 * sensor.hard_iron_ut * np.ones(3)
    assert found(with_field(flight, sensor.field_b_ut + iron_ut)) == []
    (finding,) = found(with_field(flight, sensor.field_b_ut * [1.0, 1.0, 0.0]))
    assert not finding.certain
    assert "its axes, or hard_iron_ut, are not as stated" in finding.mend
