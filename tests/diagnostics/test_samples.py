from dataclasses import replace

import numpy as np
import pytest

from fgnav.diagnostics.contents import instrument_findings, sample_findings
from fgnav.types.flight import Imu
from tests.imu import imu_of
from tests.robustness.drawn.flights import KINDS, right_flight

T_S = np.arange(0, 20, 0.01)


@pytest.fixture
def imu() -> Imu:
    rng = np.random.default_rng(20_000)
    turn = np.sin(T_S)[:, None] * [0.3, 0.1, 0.05]
    return imu_of(
        T_S,
        np.array([0.0, 0.0, -9.8]) + turn + 0.02 * rng.normal(size=(len(T_S), 3)),
        np.cos(T_S)[:, None] * [0.3, 0.1, 0.5] + 0.01 * rng.normal(size=(len(T_S), 3)),
    )


def test_samples_in_motion_and_coarse_ones_at_rest_raise_no_alarm(imu):
    assert sample_findings(imu) == []
    # Rounded to a tenth of what it varies by at rest for half the record: all axes repeat often.
    rng = np.random.default_rng(20_001)
    rest = np.arange(len(T_S))[:, None] < 1000
    rates = np.where(rest, 0.0, imu.w_b_radps) + 0.01 * np.round(rng.normal(0, 0.3, (len(T_S), 3)))
    assert sample_findings(replace(imu, w_b_radps=rates)) == []


@pytest.mark.parametrize("axis", range(3))
def test_an_axis_that_never_moves_is_certain(imu, axis):
    w_b_radps = imu.w_b_radps.copy()
    w_b_radps[:, axis] = 0.0
    (finding,) = sample_findings(replace(imu, w_b_radps=w_b_radps))
    assert finding.name == "gyroscope axis"
    assert f"w{'xyz'[axis]}_radps" in finding.where
    assert finding.certain


def test_an_axis_that_is_stuck_for_a_while_is_named_with_its_times(imu):
    f_b_mps2 = imu.f_b_mps2.copy()
    f_b_mps2[300:800, 1] = f_b_mps2[300, 1]
    (finding,) = sample_findings(replace(imu, f_b_mps2=f_b_mps2))
    assert "axis y repeats" in finding.text
    assert "from 3.000 to 7.990 s" in finding.text


def test_a_unit_that_repeats_itself_is_named(imu):
    f_b_mps2, w_b_radps = imu.f_b_mps2.copy(), imu.w_b_radps.copy()
    f_b_mps2[500:600], w_b_radps[500:600] = f_b_mps2[500], w_b_radps[500]
    (finding,) = sample_findings(replace(imu, f_b_mps2=f_b_mps2, w_b_radps=w_b_radps))
    assert finding.name == "imu stuck"
    assert "from 5.000 to 5.990 s" in finding.text


def stuck(flight):
    return [(one.name, one.text) for one in instrument_findings(flight)]


def test_right_and_coarse_instruments_raise_no_alarm():
    flights = {kind: right_flight(kind, 1) for kind in KINDS}
    assert [stuck(flight) for flight in flights.values()] == [[]] * len(KINDS)
    single = flights["instruments"]
    height_m = np.round(single.barometer.height_m / 2) * 2
    assert stuck(replace(single, barometer=replace(single.barometer, height_m=height_m))) == []


def test_a_repeated_sample_of_an_instrument_is_named_with_its_span():
    single = right_flight("instruments", 1)
    field = single.magnetometer.field_b_ut.copy()
    field[50:100] = field[50]
    wrong = replace(single, magnetometer=replace(single.magnetometer, field_b_ut=field))
    text = "one sample is repeated 50 times from 5.000 to 9.900 s"
    assert stuck(wrong) == [("magnetometer stuck", text)]


def test_a_detector_that_never_changes_is_stuck():
    flight = right_flight("photodetector", 1)
    currents = np.tile(flight.photodetector.currents[3], (len(flight.photodetector.t_s), 1))
    ((name, _),) = stuck(
        replace(flight, photodetector=replace(flight.photodetector, currents=currents))
    )
    assert name == "photodetector stuck"
