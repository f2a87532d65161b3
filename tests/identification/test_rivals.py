"""A clock that is off, or what is off for a span of the record: the likelier of both is said."""

from dataclasses import replace

import numpy as np

from fgnav.frontend.problem import build_problem
from fgnav.identification.findings import findings
from fgnav.methods.smoother import Smoother
from tests.robustness.drawn.flights import right_flight

SETTINGS = Smoother().preparation
FROM_S = 5.4


def found_in(flight):
    return findings(flight, SETTINGS, build_problem(flight, SETTINGS), build_problem)


def kinds(found):
    return set() if found is None else {one.kind for one in found.calibration}


def test_a_clock_is_no_span():
    flight = right_flight("fixes", 751)
    imu = flight.imu
    found = found_in(replace(flight, imu=replace(imu, t_s=imu.t_s + 0.06)))
    assert "clock" in kinds(found)


def test_a_lost_sample_is_no_clock_beside_phases():
    """Tags go on, so that all samples after it are tagged one interval early."""
    flight = right_flight("raw", 752)
    imu = flight.imu
    keep = np.arange(len(imu.t_s)) != np.searchsorted(imu.t_s, FROM_S)
    interval_s = float(np.median(np.diff(imu.t_s)))
    lost = replace(imu[keep], t_s=imu.t_s[:-1])
    found = found_in(replace(flight, imu=lost))
    assert not found.moved.any()
    fault = found.faults[0]
    assert (fault.sensor, fault.shape) == ("inertial unit", "late")
    assert abs(fault.value[0] + interval_s) < 0.25 * interval_s
    assert abs(fault.from_s - FROM_S) < 0.5
