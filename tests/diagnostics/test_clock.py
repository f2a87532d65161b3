"""Clock offsets of seconds: on a calm drive, by course; and where the motion cannot tell."""

import re
from dataclasses import replace

import numpy as np
import pytest

from fgnav.cli.new import new
from fgnav.diagnostics import corrected_set_up, describe
from fgnav.diagnostics.clock import clock_searches, coarse_offset
from fgnav.diagnostics.track import Motion
from fgnav.io.flight.folder import load_flight
from tests.diagnostics.test_track import flown, with_imu

DRIVES = ("", "calm_noisy_", "turns_noisy_")


@pytest.fixture(scope="module", params=DRIVES, ids=lambda name: name or "calm")
def drive(request, shared, tmp_path_factory):
    """Return a drive of four minutes as `fgnav new` reads it: turns of degrees per second."""
    case = shared / "cases" / "20-imu-clock-calm-drive"
    folder = tmp_path_factory.mktemp("drive") / "flight"
    new(case / f"{request.param}imu.csv", case / f"{request.param}fixes.csv", out=folder)
    return load_flight(folder)


def late(flight, offset_s):
    return replace(flight, imu=replace(flight.imu, t_s=flight.imu.t_s + offset_s))


def clocks(flight):
    return [one for one in describe(flight).findings if one.name == "imu clock"]


def test_a_right_clock_of_a_drive_is_no_finding(drive):
    assert clocks(drive) == []
    corrected, notes = corrected_set_up(drive)
    assert corrected is drive
    assert notes == ()


@pytest.mark.parametrize("offset_s", [2.0, 10.0, 18.0, -2.0, -18.0])
def test_seconds_of_a_drive_are_named_and_corrected_to_a_tenth(drive, offset_s):
    (finding,) = clocks(late(drive, offset_s))
    shown = float(re.search(r"are ([+-][\d.]+) s off", finding.text).group(1))
    assert shown == pytest.approx(offset_s, abs=0.1)
    assert ("leap seconds" in finding.text) == (abs(offset_s) == 18)
    corrected, (note,) = corrected_set_up(late(drive, offset_s))
    np.testing.assert_allclose(corrected.imu.t_s, drive.imu.t_s, rtol=0, atol=0.1)
    assert "runner-up" in note


def test_a_straight_drive_at_constant_speed_says_that_it_cannot_tell(drive):
    t_s, fixes = drive.fixes[0].t_s, drive.fixes[0]
    noise = np.random.default_rng(1).normal(0, 0.05, (len(t_s), 3))
    straight = replace(
        fixes, p_n_m=np.outer(t_s, [10.0, 0, 0]), v_n_mps=noise + np.array([10.0, 0.0, 0.0])
    )
    samples = np.random.default_rng(2).normal(0, 1e-3, (len(drive.imu.t_s), 3))
    imu = replace(drive.imu, f_b_mps2=20 * samples + [0, 0, -9.8], w_b_radps=samples)
    diagnosis = describe(replace(drive, fixes=(straight,), imu=imu))
    assert diagnosis.findings == ()
    assert "imu clock" in {one.name for one in diagnosis.unchecked}


def periodic(span_s=120.0):
    """Return a motion that repeats itself every six seconds."""
    flight = flown(20_101, span_s)
    t_s = flight.imu.t_s
    speed = 10.0 + 2 * np.sin(2 * np.pi * t_s / 6)
    course = 0.4 * np.sin(2 * np.pi * t_s / 6 + 1)
    v_n_mps = np.stack([speed * np.cos(course), speed * np.sin(course), 0 * speed], axis=1)
    a_n_mps2 = np.gradient(v_n_mps, t_s, axis=0) - [0, 0, 9.802]
    c, s = np.cos(course), np.sin(course)
    f_b = np.stack(
        [c * a_n_mps2[:, 0] + s * a_n_mps2[:, 1], c * a_n_mps2[:, 1] - s * a_n_mps2[:, 0],
         a_n_mps2[:, 2]], axis=1,
    )  # fmt: skip
    w_b = np.stack([0 * c, 0 * c, np.gradient(course, t_s)], axis=1)
    rng = np.random.default_rng(5)
    p_n_m = np.cumsum(v_n_mps, axis=0) * 0.01
    imu = replace(
        flight.imu,
        f_b_mps2=f_b + 0.02 * rng.normal(size=f_b.shape),
        w_b_radps=w_b + 0.002 * rng.normal(size=f_b.shape),
    )
    fixes = replace(
        flight.fixes[0],
        p_n_m=p_n_m[::10] + 0.02 * rng.normal(size=p_n_m[::10].shape),
        v_n_mps=v_n_mps[::10] + 0.05 * rng.normal(size=p_n_m[::10].shape),
    )
    antennas = (replace(flight.antennas[0], position_b_m=np.zeros(3)),)
    return replace(flight, imu=imu, fixes=(fixes,), antennas=antennas)


@pytest.mark.parametrize("offset_s", [0.0, 6.0, 8.0])
def test_offsets_of_whole_periods_are_not_told_apart(offset_s):
    flight = late(periodic(), offset_s)
    assert not [one for one in clocks(flight) if one.certain]
    assert "imu clock" in {one.name for one in describe(flight).unchecked}
    assert corrected_set_up(flight).flight is flight


def test_searches_state_their_evidence():
    flight = with_imu(t_s=flown().imu.t_s + 7.3)
    motion = Motion.from_flight(flight, flight.imu, flight.fixes[0], None)
    searches = clock_searches(motion, motion.integrals_at())
    coarse = coarse_offset(searches)
    assert coarse.by == "course"
    assert coarse.offset_s == pytest.approx(-7.3, abs=5 * coarse.sigma_s)
    assert coarse.ratio > 10
    assert coarse.runner_up_ratio > 10
    # Two searches that contradict each other decide nothing.
    other = coarse._replace(offset_s=3.0)
    assert coarse_offset([coarse, other]) is None
