"""Fixes and inertial unit against each other: right flights raise no alarm, mistakes are named."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgnav.diagnostics import describe
from fgnav.geometry.earth import Origin
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import from_euler, log
from fgnav.types.flight import Antenna, Fixes, Flight
from fgnav.types.vehicle import WheeledVehicle
from tests.imu import imu_of
from tests.recordings import drive, quadrotor

ORIGIN = Origin(latitude_rad=0.7, longitude_rad=0.2, height_m=100.0)
ARM_B_M = np.array([0.4, -0.3, 0.2])


@cache
def flown(seed=20_100, span_s=60.0):
    """A body nose first along unlike sines, at 100 Hz; fixes at 10 Hz, 2 cm and 5 cm/s off."""
    rng = np.random.default_rng(seed)
    t_s, step_s = np.linspace(0, span_s, round(100 * span_s) + 1, retstep=True)
    waves = rng.uniform(0.3, 2.0, (2, 3, 4)), rng.uniform(0, 2 * np.pi, (2, 3, 4))
    sway = np.sin(t_s[:, None, None, None] * waves[0] + waves[1]).mean(axis=3)
    v_n_mps = np.array([12.0, 0.0, 0.0]) + sway[:, 0] * [6.0, 9.0, 2.0]
    course = np.arctan2(v_n_mps[:, 1], v_n_mps[:, 0])
    R_nb = from_euler(0.5 * sway[:, 1, 0], 0.3 * sway[:, 1, 1], course + 0.1 * sway[:, 1, 2])
    swing = log(R_nb[:-1].swapaxes(1, 2) @ R_nb[1:]) / step_s
    w_b = interpolate(t_s, t_s[1:] - step_s / 2, swing)
    a_n = np.gradient(v_n_mps, t_s, axis=0) - [0.0, 0.0, 9.802]
    f_b = np.einsum("nji,nj->ni", R_nb, a_n) + 0.02 * rng.normal(size=w_b.shape)
    p = (np.cumsum(v_n_mps, axis=0) - v_n_mps / 2) * step_s + R_nb @ ARM_B_M
    v = v_n_mps + np.einsum("nij,nj->ni", R_nb, np.cross(w_b, ARM_B_M))
    p, v = p[::10] + 0.02 * rng.normal(size=p[::10].shape), v[::10]
    return Flight(
        name="synthetic",
        start_gps_s=1e9,
        origin=ORIGIN,
        antennas=(Antenna(name="a1", position_b_m=ARM_B_M),),
        imu=imu_of(
            t_s,
            f_b + rng.normal(0, 0.05, 3),
            w_b + 0.002 * rng.normal(size=w_b.shape) + rng.normal(0, 0.002, 3),
            accelerometer=(2e-3, 5e-2, 1e-4),
            gyroscope=(2e-4, 2e-3, 1e-6),
        ),
        fixes=(
            Fixes(
                t_s=t_s[::10],
                antenna="a1",
                p_n_m=p,
                v_n_mps=v + 0.05 * rng.normal(size=v.shape),
                position_sigma_m=np.full(p.shape, 0.02),
                velocity_sigma_mps=np.full(v.shape, 0.05),
            ),
        ),
    )


def with_imu(**change):
    return replace(flown(), imu=replace(flown().imu, **change))


def with_fixes(**change):
    return replace(flown(), fixes=(replace(flown().fixes[0], **change),))


def stated(finding, unit="s", word="off"):
    """Return a figure of a finding and its sigma, with what rounding of each may add."""
    figures = rf"([+-]?[\d.]+) {unit} {word}[^±]*\(± ([\d.]+) {unit}\)"
    shown, sigma = re.search(figures, finding.text).groups()
    last = 10.0 ** -len(shown.partition(".")[2])
    return float(shown), float(sigma) + last


def within_stated(finding, off, **which):
    """Whether a figure of a finding is the given one, by three of its stated sigma."""
    shown, sigma = stated(finding, **which)
    return abs(shown - off) <= 3 * sigma


def findings(flight, *, quick=False):
    return {one.name: one for one in describe(flight, quick=quick).findings}


def test_a_right_flight_raises_no_alarm():
    assert findings(flown()) == {}
    assert findings(flown(), quick=True) == {}


@pytest.mark.parametrize("late_s", [1.0, -18.0, 18.0, 7.3])
def test_a_clock_is_found_within_twenty_seconds_and_leap_seconds_by_name(late_s):
    flight = with_imu(t_s=flown().imu.t_s + late_s)
    finding = findings(flight)["imu clock"]
    assert within_stated(finding, late_s)
    assert ("leap seconds" in finding.text) == (abs(late_s) == 18)
    assert finding.certain


def test_a_clock_off_by_less_than_a_second_is_no_reason_to_refuse():
    finding = findings(with_imu(t_s=flown().imu.t_s + 0.08))["imu clock"]
    assert within_stated(finding, 0.08)
    assert not finding.certain


@pytest.mark.parametrize("seed", range(3))
def test_exchanged_axes_are_put_right(seed):
    rng = np.random.default_rng(seed)
    order, signs = rng.permutation(3), rng.choice([-1.0, 1.0], 3)
    finding = findings(with_imu(f_b_mps2=(signs * flown().imu.f_b_mps2)[:, order]))["imu axes"]
    back = np.argsort(order)
    names = ", ".join(f"{'-' if signs[i] < 0 else ''}f{'xyz'[back[i]]}" for i in range(3))
    assert f"fx, fy, fz should read {names}" in finding.mend


def test_one_reversed_axis_of_the_gyroscope_is_put_right():
    w_b_radps = flown().imu.w_b_radps * [1.0, -1.0, 1.0]
    assert "wx, -wy, wz" in findings(with_imu(w_b_radps=w_b_radps))["imu axes"].mend


def begun(flight, span_s):
    """Return its fixes so far."""
    fixes = flight.fixes[0]
    rows = fixes.t_s < fixes.t_s[0] + span_s
    names = ("t_s", "p_n_m", "v_n_mps", "position_sigma_m", "velocity_sigma_mps")
    return replace(flight, fixes=(replace(fixes, **{n: getattr(fixes, n)[rows] for n in names}),))


def test_axes_are_put_right_in_half_a_minute_before_an_estimate_too():
    """Seven windows: their squares tell what the mean of their gains does not."""
    assert findings(begun(flown(), 30.0), quick=True) == {}
    exchanged = with_imu(f_b_mps2=flown().imu.f_b_mps2[:, [1, 0, 2]])
    finding = findings(begun(exchanged, 30.0), quick=True)["imu axes"]
    assert finding.certain
    assert "fx, fy, fz should read fy, fx, fz" in finding.mend


def test_east_for_north_is_named_in_twelve_seconds():
    assert findings(begun(flown(), 12.0), quick=True) == {}
    exchanged = with_fixes(v_n_mps=flown().fixes[0].v_n_mps[:, [1, 0, 2]])
    finding = findings(begun(exchanged, 12.0), quick=True)["fixes velocity"]
    assert "should read ve_mps, vn_mps, vd_mps" in finding.mend


def test_rates_in_degrees_are_named():
    finding = findings(with_imu(w_b_radps=np.degrees(flown().imu.w_b_radps)))["imu unit"]
    assert "rates are in degrees per second" in finding.text


def test_velocities_in_knots_and_east_for_north_are_named():
    v = flown().fixes[0].v_n_mps[:, [1, 0, 2]] * 3600 / 1852
    finding = findings(with_fixes(v_n_mps=v))["fixes velocity"]
    assert "multiply by 0.514444" in finding.mend
    assert "should read ve_mps, vn_mps, vd_mps" in finding.mend
    assert findings(with_fixes(v_n_mps=v), quick=True)["fixes velocity"] == finding


def test_old_velocities_are_named_and_do_not_move_the_clock():
    fixes = flown().fixes[0]
    v = interpolate(fixes.t_s - 0.2, fixes.t_s, fixes.v_n_mps)
    names = findings(with_fixes(v_n_mps=v))
    assert set(names) == {"velocity delay"}
    assert within_stated(names["velocity delay"], 0.2, word="old")


def test_positions_alone_tell_the_clock():
    late = replace(flown().imu, t_s=flown().imu.t_s - 1.0)
    fixes = replace(flown().fixes[0], v_n_mps=None, velocity_sigma_mps=None)
    finding = findings(replace(flown(), imu=late, fixes=(fixes,)))["imu clock"]
    assert within_stated(finding, -1.0)


def test_the_car_has_old_velocities_and_a_late_clock(shared):
    names = findings(drive(shared))
    assert set(names) == {"velocity delay", "imu clock"}
    assert within_stated(names["imu clock"], 0.125)  # that its authors take off
    # As a parameter of GTSAM's smoother beside fixes and unit: 0.127 s.
    assert within_stated(names["velocity delay"], 0.127, word="old")


@pytest.fixture(scope="module")
def as_it_lies(shared):
    """Return the car in the axes of its unit."""
    return drive(shared, mounted=False)


def test_the_unit_of_the_car_as_it_lies_is_put_right(as_it_lies):
    finding = findings(as_it_lies)["imu mounting"]
    assert "should read -x, y, -z" in finding.mend
    assert '[imu] axes = ["-x", "y", "-z"]' in finding.mend


def test_the_car_with_its_axes_named_leans_as_its_authors_say(as_it_lies):
    """By 6.79 and 5.35 deg, beside the quarter turns."""
    flight = as_it_lies
    named = np.array([-1.0, 1.0, -1.0])
    imu = replace(
        flight.imu, f_b_mps2=flight.imu.f_b_mps2 * named, w_b_radps=flight.imu.w_b_radps * named
    )
    car = replace(flight, imu=imu, vehicle=WheeledVehicle())
    finding = findings(car)["imu mounting"]
    figures = [re.findall(r"-?\d+\.\d", part) for part in finding.text.split("[")[1].split("(±")]
    off, sigma = np.array(figures, dtype=float)
    assert (np.abs(off - [0.0, -6.79, 5.35]) < 3 * sigma).all()
    assert (sigma < 1.0).all()
    assert f"mounting_deg = [{', '.join(figures[0])}]" in finding.mend


def test_only_wheels_tell_a_unit_that_leans_from_a_body_that_does():
    M = from_euler(*np.radians([[1.0], [-7.0], [6.0]]))[0]
    imu = flown().imu
    leaning = with_imu(f_b_mps2=imu.f_b_mps2 @ M, w_b_radps=imu.w_b_radps @ M)
    open_to_all = describe(leaning)
    assert "imu mounting" not in {one.name for one in open_to_all.findings}
    assert any('[vehicle] kind = "wheeled"' in one.mend for one in open_to_all.unchecked)
    wheels = WheeledVehicle()
    assert "imu mounting" in findings(replace(leaning, vehicle=wheels))
    assert findings(replace(flown(), vehicle=wheels)) == {}


def test_both_paths_of_the_quadrotor_have_one_clock_by_positions_alone(shared):
    """One unit, one receiver: off alike, and later than its autopilot's attitudes, -0.42 s."""
    offs = []
    for path in ("path_10", "path_15"):
        (finding,) = describe(quadrotor(shared, path)).findings
        assert not finding.certain
        offs.append(stated(finding))
    (a_s, a_sigma_s), (b_s, b_sigma_s) = offs
    assert abs(a_s - b_s) < 3 * np.hypot(a_sigma_s, b_sigma_s)
    assert a_s > 0.42
