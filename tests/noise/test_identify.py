"""Noise, clock, latency and lever arm of flights whose own are known."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.problem import build_problem
from fgnav.methods.smoother import Batch, Smoother
from fgnav.noise.identify import identified
from fgnav.noise.nominal import with_factors
from fgnav.noise.report import implausible, noise_notes
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.flights import right_flight

SETTINGS = Smoother().preparation


def found_in(flight):
    return identified(flight, SETTINGS, partial(build_problem, last=LastObservations()))[0]


def with_timestamps(flight, late_s):
    return replace(flight, imu=replace(flight.imu, t_s=flight.imu.t_s + late_s))


def calibrated(found, kind):
    return next(one for one in found.calibrated if one.kind == kind)


@pytest.mark.parametrize("kind", ["array", "fixes", "instruments", "raw", "photodetector"])
def test_a_flight_as_stated_stays_nearly_so(kind):
    found = found_in(right_flight(kind, 95_000))
    sigmas = found.sigmas
    assert all(abs(np.log(f)) < 4 * sigmas[name] for name, f in found.factors.items())
    assert not found.clock
    assert not found.significant


@pytest.mark.parametrize(("name", "factor"), [("gyroscope", 100.0), ("accelerometer", 300.0)])
def test_noise_above_the_nominal_is_found(name, factor):
    flight = right_flight("fixes", 95_010)
    field, density = {
        "gyroscope": ("w_b_radps", flight.imu.gyroscope_noise_radps_per_sqrt_hz),
        "accelerometer": ("f_b_mps2", flight.imu.accelerometer_noise_mps2_per_sqrt_hz),
    }[name]
    samples = getattr(flight.imu, field)
    sigma = factor * density / np.sqrt(np.median(np.diff(flight.imu.t_s)))
    noise = np.random.default_rng(95_010).normal(0.0, sigma, samples.shape)
    found = found_in(replace(flight, imu=replace(flight.imu, **{field: samples + noise})))
    assert abs(np.log(found.factors[name] / factor)) < 4 * found.sigmas[name] + 0.1


def test_noise_of_fixes_above_the_nominal_is_found():
    stated = {"position": 0.2, "velocity": 0.25}
    found = found_in(with_factors(right_flight("fixes", 95_011), stated))
    for name, factor in stated.items():
        assert abs(np.log(found.factors[name] * factor)) < 4 * found.sigmas[name] + 0.1


def test_fixes_better_than_stated_are_not_believed_to_be():
    found = found_in(with_factors(right_flight("fixes", 95_012), {"position": 5.0}))
    assert found.factors.get("position", 1.0) == 1.0


@pytest.mark.parametrize("late_s", [-0.2, 0.08])
def test_a_late_clock_is_found(late_s):
    flight = with_timestamps(right_flight("fixes", 95_020), late_s)
    found = found_in(flight)
    clock = calibrated(found, "clock")
    assert abs(clock.value[0] + late_s) < 4 * clock.sigma[0]
    assert clock.sigma[0] < 0.05


@pytest.mark.parametrize("kind", ["raw", "instruments"])
def test_attitudes_of_a_late_unit_are_honest(kind):
    flight = with_timestamps(right_flight(kind, 95_021), 0.1)
    estimate = Batch()(flight)
    assert nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 10


def test_late_velocities_and_a_wrong_lever_arm_are_found():
    flight = right_flight("fixes", 95_030)
    fixes, late_s = flight.fixes[0], 0.1
    moved = [np.interp(fixes.t_s - late_s, fixes.t_s, v) for v in fixes.v_n_mps.T]
    late = replace(flight, fixes=(replace(fixes, v_n_mps=np.stack(moved, axis=1)),))
    latency = calibrated(found_in(late), "velocity-delay")
    assert abs(latency.value[0] - late_s) < 4 * latency.sigma[0] + 0.01
    off_b_m = np.array([0.4, 0.0, -0.3])
    antenna = flight.antennas[0]
    wrong = replace(antenna, position_b_m=antenna.position_b_m + off_b_m)
    arm = calibrated(found_in(replace(flight, antennas=(wrong,))), "lever-arm")
    assert arm.is_significant
    assert (np.abs(arm.value + off_b_m) < 4 * arm.sigma).all()


def test_notes_name_the_figure_and_the_runner_up():
    flight = with_timestamps(right_flight("fixes", 95_022), 0.2)
    (note,) = (one for one in noise_notes(flight, found_in(flight)) if "clock" in one.split(":")[0])
    assert "offset -0.19" in note
    assert "runner-up" in note


def test_what_no_sensor_can_have_is_implausible():
    flight = right_flight("fixes", 95_040)
    found = found_in(flight)
    assert implausible(flight, found) == {}
    louder = replace(found, factors={"gyroscope": 1e4, "accelerometer bias": 1e4})
    assert set(implausible(flight, louder)) == {"gyroscope", "accelerometer bias"}


def test_estimates_do_not_depend_on_how_a_flight_was_told_its_noise():
    flight = right_flight("fixes", 95_050)
    told = Batch(noise="nominal")(flight)
    found = Batch()(with_factors(flight, {"gyroscope": 0.1}))
    off = np.degrees(np.abs(errors_rad(flight, found)).max())
    assert off < 3 * np.degrees(np.abs(errors_rad(flight, told)).max()) + 0.1
