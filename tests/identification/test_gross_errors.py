"""Fixes that are off for seconds: left out, in place of noise that all positions then have."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.evaluation.span import within
from fgnav.frontend.problem import build_problem
from fgnav.identification.apply import with_findings
from fgnav.identification.notes import exclusion_notes
from fgnav.identification.spans.gross_errors import GrossError
from fgnav.methods.smoother import Batch, Smoother
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.recordings import kitti
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import right_flight

FROM_S, UNTIL_S = 6.0, 9.0
OFF_M = np.array([0.0, 10.0, 8.0])  # of 1 m stated


def shifted(flight, by_m, from_s=FROM_S, until_s=UNTIL_S):
    fixes = flight.fixes
    inside = (fixes.t_s > from_s - 1e-6) & (fixes.t_s < until_s + 1e-6)
    return replace(
        flight, fixes=replace(fixes, p_n_m=np.where(inside[:, None], by_m, 0.0) + fixes.p_n_m)
    )


def position_nees(right, estimate):
    truth = right.truth
    row = np.searchsorted(truth.t_s, estimate.t_s - 1e-6)
    off = estimate.p_n_m - truth.p_n_m[row]
    return nees(off, estimate.position_covariance_m2)


# As noise of positions, 3.2 to 3.4 times the stated, NEES of positions were 64 and 77; of attitudes
# 35 and 5.5.
@pytest.mark.parametrize(("number", "method"), [(901, Batch()), (902, Smoother())])
def test_fixes_that_are_off_for_seconds_are_left_out(number, method):
    right = right_flight("fixes", number)
    flight = shifted(right, OFF_M)
    found = found_in(flight)
    (one,) = found.rejected
    assert (one.what, one.from_s, one.until_s) == ("position", FROM_S, UNTIL_S)
    assert "position" not in found.factors
    prepared = with_findings(flight, SETTINGS, found, build_problem)
    positions = next(m for m in prepared.problem.measurements if m.name == "position")
    t_s = prepared.problem.t_s[positions.row]
    assert not np.any((t_s > FROM_S - 0.1) & (t_s < UNTIL_S + 0.1))
    velocities = next(m for m in prepared.problem.measurements if m.name == "velocity")
    assert len(velocities.row) == len(flight.fixes.t_s)
    estimate = method.estimate_prepared(flight, prepared)
    assert one in estimate.rejections
    assert any("off what all else measures" in note for note in estimate.notes)
    assert position_nees(right, estimate) < 6.0
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


def test_each_of_several_is_left_out():
    right = right_flight("fixes", 903)
    flight = shifted(shifted(right, OFF_M), np.array([-8.0, 4.0, 0.0]), 2.0, 2.4)
    spans = [(one.from_s, one.until_s) for one in found_in(flight).rejected]
    assert spans == [(2.0, 2.4), (FROM_S, UNTIL_S)]


# Positions off by 3 m from a time on, or drifting off by .8 m/s: a clock and a delay of velocities
# .1 s each way took them to other places along the path, attitude NEES 31 and 29.
@pytest.mark.parametrize("seed", [951000260, 951000315])
def test_places_that_are_off_are_no_clock_and_no_late_velocities(seed):
    right = right_flight("fixes", seed // 12)
    flight, _ = dirty(right, seed)
    found = found_in(flight)
    assert {one.what for one in found.rejected} == {"position"}
    assert not found.moved.any()
    assert found.calibration == ()
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 10.0


def test_positions_that_are_noisier_throughout_are_only_that():
    right, rng = right_flight("fixes", 901), np.random.default_rng(4)
    fixes = right.fixes
    loud = fixes.p_n_m + rng.normal(scale=4.0, size=fixes.p_n_m.shape)
    found = found_in(replace(right, fixes=replace(fixes, p_n_m=loud)))
    assert found.rejected == ()
    assert found.factors["position"] == pytest.approx(4.0, rel=0.2)


def test_a_faulty_unit_is_no_error_of_fixes():
    right = right_flight("fixes", 744)
    imu = right.imu
    inside = (imu.t_s > 4.1) & (imu.t_s <= 7.3)
    w_b_radps = np.where(inside[:, None], imu.w_b_radps * [1.0, 1.0, 0.7], imu.w_b_radps)
    found = found_in(replace(right, imu=replace(imu, w_b_radps=w_b_radps)))
    assert found.rejected == ()
    assert any(one.is_likely for one in found.faults)


@pytest.mark.parametrize("number", [731, 905])
@pytest.mark.parametrize("unstated", [(), ("position", "velocity")])
def test_right_fixes_are_not_left_out(number, unstated):
    right = right_flight("fixes", number)
    found = found_in(replace(right, fixes=replace(right.fixes, unstated=unstated)))
    assert found is None or found.rejected == ()


def test_a_recorded_drive_has_some_in_its_turns():
    """Residuals of them were .1 to .4 m, of noise four times the stated; what is left is .01 m."""
    flight = within(kitti(240.0), 120.0, None)
    estimate = Batch()(flight)
    at_s = [one.from_s for one in estimate.rejections if one.what == "position"]
    assert at_s == pytest.approx([200.9, 203.9, 219.9, 236.9], abs=0.01)
    assert not any("contradict each other" in note for note in estimate.notes)
    fixes = flight.fixes
    row = np.searchsorted(estimate.t_s, fixes.t_s - 0.002)
    off_m = np.abs(estimate.p_n_m[row] - fixes.p_n_m).max(axis=1)
    is_right = np.abs(fixes.t_s[:, None] - [*at_s, 220.9]).min(axis=1) > 0.1
    assert np.sqrt((off_m[is_right] ** 2).mean()) < 0.02


def test_each_span_is_said_with_how_far_it_is_off():
    spans = [
        GrossError("position", "a1", at_s, at_s + 1.0, size) for at_s, size in ((2, 0.5), (7, 3))
    ]
    (note,) = exclusion_notes(tuple(one.rejected for one in spans))
    assert note.startswith(
        "Position from 2.0 to 3.0 s: 0.5 m off what all else measures: left out; "
    )
    assert "7.0 to 8.0 s: 3 m off" in note
