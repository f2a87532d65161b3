"""Noise of a filter: what came before says that what is stated is wrong, and nothing later does."""

from dataclasses import replace
from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from fgnav.frontend.causal.truncation import truncated
from fgnav.frontend.problem import build_problem
from fgnav.identification.apply import with_findings
from fgnav.identification.findings import Findings
from fgnav.identification.from_past import Look, _with_late_velocities, look, looks_s
from fgnav.identification.spans.span_fault import SpanFault
from fgnav.methods.smoother import Forward
from fgnav_sim.scenario import FixesTable
from fgnav_sim.simulate import simulate
from tests.frontend.standing import standing
from tests.methods.driven import driven
from tests.methods.simulated import errors_rad, nees
from tests.methods.test_truncation import scenario
from tests.robustness.drawn.flights import right_flight

CUT_S = 74.43  # noise is identified at 30 and at 60 s, when it has driven long enough


@pytest.fixture(scope="module")
def loud():
    """A car whose gyroscope is thirty times as loud as is stated; it drives from 15 s on."""
    flight = standing(20_007, span_s=90.0)
    sheet = flight.imu.gyroscope_noise_radps_per_sqrt_hz / 30
    return replace(flight, imu=replace(flight.imu, gyroscope_noise_radps_per_sqrt_hz=sheet))


@pytest.fixture(scope="module")
def prepared(loud):
    return Forward().prepare(loud)


@pytest.fixture(scope="module")
def filtered(loud, prepared):
    return Forward().estimate_prepared(loud, prepared)


def test_stretches_that_believe_the_same_are_one(prepared):
    assert [one.from_s for one in prepared.stretches] == [-np.inf, 60.0]


def test_a_filter_is_as_sure_as_the_noise_that_its_past_shows(loud, filtered):
    stated, found = Forward(noise="stated")(loud), filtered
    late = stated.t_s > 60.0
    figures = [
        nees(errors_rad(loud, e)[late], e.attitude_covariance_rad2[late]) for e in (stated, found)
    ]
    assert figures[0] > 60.0
    assert figures[1] < 7.0
    np.testing.assert_array_equal(found.t_s, stated.t_s)
    early = found.t_s < 60.0
    np.testing.assert_allclose(found.R_nb[early], stated.R_nb[early], atol=1e-9)
    assert any("identified anew from the past" in note for note in found.notes)


@pytest.fixture(scope="module")
def cut(loud):
    """The same car up to a time, and its problem, which nothing later has part in either."""
    flight = truncated(loud, CUT_S)
    return flight, Forward().prepare(flight)


@pytest.mark.parametrize("rate_hz", [None, 1.25])  # of fixes, and times most of which lie between
def test_nothing_that_comes_later_takes_part(loud, prepared, filtered, cut, rate_hz, monkeypatch):
    if rate_hz is None:
        whole, part = filtered, Forward().estimate_prepared(*cut)
    else:
        problems = {loud: prepared, cut[0]: cut[1]}
        monkeypatch.setattr(Forward, "prepare", lambda _, flight: problems[flight])
        whole, part = (Forward().at(one, rate_hz=rate_hz) for one in (loud, cut[0]))
    n = int((part.t_s <= part.t_s[-1]).sum())
    assert part.t_s[-1] > CUT_S - 1.2
    for name in ("t_s", "R_nb", "p_n_m", "v_n_mps", "attitude_covariance_rad2"):
        np.testing.assert_allclose(getattr(whole, name)[:n], getattr(part, name), atol=1e-9)


def test_a_flight_that_states_its_noise_rightly_is_estimated_once():
    prepared = Forward().prepare(standing(20_009, span_s=45.0))
    assert prepared.stretches == ()


def every_second(seed, **noise):
    """A body that swings, by fixes once a second, and the random numbers that follow."""
    rng = np.random.default_rng(seed)
    six = scenario("six", 30.0, fixes=True, gyroscope=True)
    made = msgspec.structs.replace(six, fixes=FixesTable(rate_hz=1.0, **noise))
    return simulate(made, rng), rng


# A clock that nothing tells yet is a flat, bent valley: as stated a few steps end nowhere in it.
@pytest.mark.parametrize(("seed", "until_s"), [(851_002, 13.0), (851_002, 20.0)])
def test_a_right_flight_s_first_fixes_leave_its_noise_and_its_heading(seed, until_s):
    flight, _ = every_second(seed)
    assert look(flight, Forward().preparation, until_s, build_problem) == Look(None)


@pytest.mark.parametrize("seed", [20_011, 20_012])
def test_a_dozen_good_fixes_tell_a_loud_accelerometer(seed):
    """Of thirty times the stated noise: they know it to a quarter, and it is in no doubt."""
    flight, rng = every_second(seed, position_noise_m=0.02, velocity_noise_mps=0.02)
    imu, step_s = flight.imu, np.diff(flight.imu.t_s).mean()
    noise = 30 * imu.accelerometer_noise_mps2_per_sqrt_hz / np.sqrt(step_s)
    f_b_mps2 = imu.f_b_mps2 + rng.normal(0.0, noise, imu.f_b_mps2.shape)
    loud = replace(flight, imu=replace(imu, f_b_mps2=f_b_mps2))
    told = look(loud, Forward().preparation, 13.0, build_problem)
    assert told.found.factors == {"accelerometer": pytest.approx(30.0, rel=0.5)}


def test_where_the_clock_is_off_velocities_may_be_late_as_well_until_the_record_tells():
    flight, settings = driven(97_022, late_s=0.1, span_s=90.0), Forward().preparation
    by_then = look(flight, settings, 30.0, build_problem)
    assert [one.kind for one in by_then.found.calibration] == ["clock", "velocity-delay"]
    without = replace(flight, fixes=replace(flight.fixes, v_n_mps=None, velocity_sigma_mps=None))
    changes = Findings({}, np.zeros(2), by_then.found.calibration[:1], ())
    assert _with_late_velocities(changes, without, settings) is changes
    asked = replace(settings, calibration=changes.calibration)
    assert _with_late_velocities(changes, flight, asked) is changes


def test_noise_is_looked_at_when_motion_tells_the_heading_and_as_that_motion_doubles():
    problem, opening = SimpleNamespace(t_s=np.arange(200.0)), SimpleNamespace(until_s=38.0)
    opening.keyframes = 39
    known = SimpleNamespace(problem=problem, opening=opening)
    early = [5.0, 10.0, 20.0]  # with its clock off nothing tells the heading
    assert looks_s(known, 199.0) == [*early, 30.0, 38.0, 43.0, 48.0, 58.0, 60.0, 120.0]
    assert looks_s(SimpleNamespace(problem=problem, opening=None), 199.0) == [30.0, 60.0, 120.0]


def test_a_drift_is_put_right_about_the_middle_of_the_record_that_told_it():
    """Of a record that goes on the same: its tags up to then stay where they are."""
    told = Findings({}, np.array([0.02, 300.0]), (), (), middle_s=10.0)
    flight, settings = standing(20_010, stands_s=2.0, span_s=30.0), Forward().preparation
    whole, part = (
        with_findings(one, settings, told, build_problem).imu.t_s
        for one in (flight, truncated(flight, 20.0))
    )
    np.testing.assert_array_equal(part, whole[: len(part)])
    moved_s = part - flight.imu.t_s[: len(part)]
    np.testing.assert_allclose(moved_s, 0.02 + 3e-4 * (flight.imu.t_s[: len(part)] - 10.0))


def test_a_fault_that_a_record_ends_in_may_end_with_it():
    """A gyroscope that is right again at 10.4 s: NEES 3.8 after it as if the fault went on."""
    right = right_flight("fixes", 782)
    imu = right.imu
    wrong = imu.w_b_radps + np.array([0.0, 0.05, -0.05])
    inside = (imu.t_s > 6.5) & (imu.t_s <= 10.4)
    flight = replace(
        right, imu=replace(imu, w_b_radps=np.where(inside[:, None], wrong, imu.w_b_radps))
    )
    settings = Forward().preparation
    (fault,) = look(flight, settings, 10.0, build_problem).found.faults
    assert (fault.sensor, fault.until_s) == ("gyroscope", 10.0)
    steps = fault.stepping(build_problem(right, settings).problem).motion
    after = np.searchsorted(steps.t_s, 10.0 + 1e-3) - 1
    interval_s = steps.t_s[after + 1] - steps.t_s[after]
    np.testing.assert_allclose(steps.bias_steps[after, 3:] * interval_s, fault.variance)
    estimate = Forward()(flight)
    late = estimate.t_s > 10.4
    error = errors_rad(right, estimate)[late]
    assert nees(error, estimate.attitude_covariance_rad2[late]) < 3.0


def test_a_fault_of_all_of_a_record_goes_on():
    fault = SpanFault(
        sensor="gyroscope",
        shape="offset",
        from_s=-np.inf,
        until_s=np.inf,
        begins_s=(0.0, 0.0),
        ends_s=(9.0, 10.0),
        value=np.ones(3),
        sigma=np.ones(3),
        variance=np.ones(3),
        size=1.0,
        share=1.0,
    )
    assert fault.up_to(10.0) is fault
    assert fault._replace(from_s=3.0).up_to(10.0).until_s == 10.0
