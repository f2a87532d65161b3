"""What an estimate corrects by closed-form tests; clean flights stay the same object."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.diagnostics.corrections import corrected_set_up
from tests.diagnostics.test_array import flown as array_flown
from tests.diagnostics.test_track import flown
from tests.robustness.drawn.flights import KINDS, right_flight


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(3))
def test_a_clean_flight_is_returned_as_it_is(kind, seed):
    flight = right_flight(kind, seed)
    corrected, notes = corrected_set_up(flight)
    assert corrected is flight
    assert notes == ()


def exchanged(flight, pair, rows):
    seen = flight.observations
    order = np.arange(len(flight.antennas))
    order[list(pair)] = pair[::-1]
    changed = {}
    for name in ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags"):
        x = getattr(seen, name).copy()
        x[rows] = x[rows][:, order]
        changed[name] = x
    return replace(flight, observations=replace(seen, **changed))


@pytest.mark.parametrize("rows", [slice(None), slice(80, 160)])
def test_exchanged_antennas_get_their_observations_back(rows):
    flight = array_flown("demo")
    wrong = exchanged(flight, (1, 4), rows)
    corrected, (note,) = corrected_set_up(wrong)
    names = [flight.antennas[i].name for i in (1, 4)]
    assert note.startswith(f"Antennas {names[0]} and {names[1]} are exchanged from ")
    assert "log-likelihood ratio" in note
    seen, right = corrected.observations, flight.observations
    np.testing.assert_array_equal(seen.phase_cycles, right.phase_cycles)


def with_gap(flight, length_s, step_s):
    """Cut samples out at half of the record, or let the clock step there."""
    imu = flight.imu
    middle_s = imu.t_s.mean()
    if step_s:
        return replace(flight, imu=replace(imu, t_s=imu.t_s + step_s * (imu.t_s > middle_s)))
    return replace(flight, imu=imu[(imu.t_s < middle_s) | (imu.t_s > middle_s + length_s)])


@pytest.mark.parametrize("step_s", [0.1, 1.0, 3.0])
def test_a_step_of_timestamps_is_corrected_and_a_gap_is_not(step_s):
    flight = flown()
    stepped, (note,) = corrected_set_up(with_gap(flight, 0, step_s))
    assert f"step by {step_s:+.3f} s" in note
    np.testing.assert_allclose(stepped.imu.t_s, flight.imu.t_s, rtol=0, atol=1e-6)
    gapped = with_gap(flight, step_s, 0)
    assert corrected_set_up(gapped).flight is gapped


def test_a_clock_that_is_off_by_a_delay_is_left_to_the_estimate():
    late = replace(flown(), imu=replace(flown().imu, t_s=flown().imu.t_s + 0.3))
    assert corrected_set_up(late).flight is late


def test_a_clock_beside_an_array_without_a_gyroscope_is_corrected():
    flight = array_flown("demo")
    imu = replace(flight.imu, w_b_radps=None, gyroscope_noise_radps_per_sqrt_hz=None,
                  gyroscope_bias_radps=None, gyroscope_bias_walk_radps_per_sqrt_s=None)  # fmt: skip
    late = replace(flight, imu=replace(imu, t_s=imu.t_s + 3.0))
    corrected, (note,) = corrected_set_up(late)
    assert "IMU clock offset of +3.0" in note
    np.testing.assert_allclose(corrected.imu.t_s, imu.t_s, rtol=0, atol=0.1)
