"""What is off for a whole flight: a landmark, axes of a detector or the unit, tags."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgnav.frontend.calibration_request import calibration_requests
from fgnav.frontend.causal.truncation import truncated
from fgnav.frontend.problem import build_problem
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import exp
from fgnav.identification import subject
from fgnav.identification.lasting.arm import LEVER_ARM
from fgnav.identification.lasting.choice import Lasting, _gained
from fgnav.identification.lasting.clock import ClockOff
from fgnav.identification.lasting.error import least_of_use
from fgnav.identification.lasting.lost_samples import LOST, LostSamples
from fgnav.identification.lasting.sight import BORESIGHT, LANDMARK, sight_errors
from fgnav.identification.likelihood.beside_phases import chance_of
from fgnav.identification.likelihood.satellite_errors import satellite_error_factors
from fgnav.identification.subject import with_satellite_errors
from fgnav.identification.track.windows import EXCLUDED
from fgnav.methods.smoother import Smoother
from fgnav.solve.chain import solve_batch
from fgnav.types.vehicle import WheeledVehicle
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.recordings import drive
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import KINDS, right_flight
from tests.robustness.drawn.series import samples_lost

SIGMAS = 4.0
TURN_RAD = np.radians([-1.8, 1.4, 2.0])  # 3 degrees


def displaced(flight, by_m):
    place = flight.seeker.landmark_n_m + by_m
    return replace(flight, seeker=replace(flight.seeker, landmark_n_m=place))


def turned(flight, field):
    """Return a flight with samples of a sensor in axes that are turned in the body."""
    x = getattr(flight.imu, field) @ exp(TURN_RAD[None])[0]
    return replace(flight, imu=replace(flight.imu, **{field: x}))


def within(error, truth):
    return (error.off - truth) @ np.linalg.solve(error.covariance, error.off - truth) < SIGMAS**2


def attitude_nees(right, estimate):
    return nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2)


@pytest.mark.parametrize(
    ("kind", "number", "off_m"),
    [
        # A clock 744 ppm slow: NEES 52; the arm gains 52 nats, the clock 12.
        ("array", 77500010, [0.07, 0.06, -0.12]),
        # The accelerometer's noise, 105 times, and an arm of .39 -1.63 .98 m: NEES 33.
        ("raw", 77500028, [2.3, -3.5, 2.6]),
    ],
)
def test_an_antenna_off_beside_the_unit_is_told_by_phases(kind, number, off_m):
    right = right_flight(kind, number)
    moved = tuple(
        replace(one, position_b_m=one.position_b_m - np.array(off_m)) for one in right.antennas
    )
    flight = replace(right, antennas=moved)
    found = found_in(flight)
    assert found.cause.error.kind == LEVER_ARM
    assert within(found.cause.error, off_m)
    assert not found.moved.any()
    assert "accelerometer" not in found.factors
    assert sum("antenna is off" in note for note in found.notes) == 1
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0


def test_a_landmark_that_is_off_is_not_the_accelerometers_noise():
    """As which it was said: attitude NEES 93."""
    right = right_flight("seeker", 8325009)
    flight = displaced(right, np.array([0.0, 15.0, 20.0]))
    found = found_in(flight)
    assert found.cause.error.kind == LANDMARK
    assert within(found.cause.error, [0.0, -15.0, -20.0])
    assert not found.factors
    assert "The landmark is off" in found.notes[0]
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0  # 2.1


def test_a_landmark_far_off_is_begun_where_it_is():
    """A window that had to learn it left all lines of sight out."""
    right = right_flight("seeker", 5008)
    estimate = Smoother()(displaced(right, np.array([-117.5, -65.7, 181.0])))
    assert not any(one.what == "line of sight" for one in estimate.rejections)
    assert attitude_nees(right, estimate) < 6.0  # 3.9


def test_a_landmark_off_by_little_is_doubted_and_not_said():
    """By nine metres, of which sights tell 5 by one sigma: NEES 14."""
    right = right_flight("seeker", 5009)
    flight = displaced(right, np.array([-4.5, -2.6, -7.9]))
    found = found_in(flight)
    assert not found.cause.is_likely
    assert not any("landmark" in note for note in found.notes)
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0  # 1.8


def test_a_cause_is_to_leave_no_more_than_chance_and_a_step_its_share_of_that():
    problem = build_problem(right_flight("raw", 7001), SETTINGS).problem
    chance = chance_of(problem) + 2 * EXCLUDED
    assert least_of_use(problem, 10 * chance) == pytest.approx(chance)
    assert least_of_use(problem, 10 * chance, 3) == pytest.approx(7 * chance)
    assert least_of_use(problem, chance / 2, 3) == pytest.approx(chance)


def test_a_turned_detector_is_told_from_a_landmark():
    prepared = build_problem(right_flight("seeker", 8325009), SETTINGS)
    errors = satellite_error_factors(prepared.problem.phase)
    problem = with_satellite_errors(prepared, errors).problem
    turn_rad = np.array([0.0, 0.02, -0.01])
    seen = tuple(
        replace(one, across_b=one.across_b @ exp(turn_rad[None])[0])
        if one.name == "line of sight"
        else one
        for one in problem.measurements
    )
    problem = replace(problem, measurements=seen)
    errors = {one.kind: one for one in sight_errors(problem, solve_batch(problem), None)}
    assert LANDMARK not in errors  # it leaves more than chance
    assert within(errors[BORESIGHT], turn_rad[1:])


@pytest.mark.parametrize("kind", ["raw", "fixes"])
def test_sensors_turned_against_each_other_hold_both_axes(kind):
    """Else the gyroscope's axes were another, or noise, or a lever arm: NEES 4,501 and 414."""
    right = right_flight(kind, 7001)
    flight = turned(right, "f_b_mps2")
    found = found_in(flight)
    assert found.cause.error.kind == "accelerometer"
    assert found.cause.share == 0.5
    assert within(found.cause.error, TURN_RAD)
    assert not found.factors
    for estimate in (estimate_by(found, flight), Smoother()(turned(right, "w_b_radps"))):
        assert attitude_nees(right, estimate) < 7.0  # of both: 6 at most


def test_a_turn_of_ten_degrees_is_found():
    """From zero no step leads there: it was a turn of the gyroscope, attitude NEES 39,733."""
    right = right_flight("raw", 910000059 // 12)
    R = exp(3.3 * TURN_RAD[None])[0]
    f_b_mps2 = right.imu.f_b_mps2 @ R
    found = found_in(replace(right, imu=replace(right.imu, f_b_mps2=f_b_mps2)))
    assert found.cause.error.kind == "accelerometer"
    assert within(found.cause.error, 3.3 * TURN_RAD)


@pytest.mark.parametrize(
    ("sensor", "field"), [("accelerometer", "f_b_mps2"), ("gyroscope", "w_b_radps")]
)
def test_a_magnetometer_tells_which_is_turned(sensor, field):
    right = right_flight("instruments", 7002)
    flight = turned(right, field)
    found = found_in(flight)
    assert found.cause.error.kind == sensor
    assert found.cause.share > 0.99
    assert within(found.cause.error, TURN_RAD)
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0


@pytest.mark.parametrize("kind", ["seeker", "raw", "fixes", "instruments"])
def test_right_flights_have_none(kind):
    """What is possible, here a landmark's place, a declination, is next to nothing of variances."""
    flight = right_flight(kind, 9101)
    found = found_in(flight)
    if found is None or found.cause is None:
        return
    assert not found.cause.is_likely
    assert found.cause.sentences == ()
    of_all = estimate_by(found, flight).attitude_covariance_rad2
    of_cause = found.cause.doubt.covariance_rad2
    assert np.trace(of_cause.mean(axis=0)) < 0.05 * np.trace(of_all.mean(axis=0))  # .02 and .005


def test_a_loud_accelerometer_is_no_landmark():
    right, rng = right_flight("seeker", 9102), np.random.default_rng(1)
    f_b_mps2 = right.imu.f_b_mps2 + 0.1 * rng.normal(size=right.imu.f_b_mps2.shape)
    found = found_in(replace(right, imu=replace(right.imu, f_b_mps2=f_b_mps2)))
    assert found.cause is None
    assert "accelerometer" in found.factors


@cache
def with_samples_lost(kind, number=7107):
    """Return a right flight, the same without some samples, and what is found in it."""
    right = right_flight(kind, number)
    flight, _ = samples_lost(right, np.random.default_rng([17, number]))
    return right, flight, found_in(flight)


@pytest.mark.parametrize(("kind", "allowed"), [("array", 6.0), ("raw", 5.0), ("fixes", 5.0)])
def test_lost_samples_whose_tags_go_on_are_put_back(kind, allowed):
    """Lost after 3.64, 5.20 and 10.70 s: NEES 1.7, 3.5 and 2.0; they were a clock."""
    right, flight, found = with_samples_lost(kind)
    assert isinstance(found.cause, LostSamples)
    assert not found.moved.any()
    steps = found.cause.steps
    assert sum(one.late_s for one in steps) == pytest.approx(-0.06, abs=0.021)
    assert abs(steps[0].after_s - 3.64) < 0.6
    assert attitude_nees(right, estimate_by(found, flight)) < allowed


@pytest.mark.parametrize(("kind", "number"), [("fixes", 8604), ("seeker", 8605)])
def test_many_lost_samples_are_no_clock(kind, number):
    """Five and thirteen were taken for clocks 3,700 and 16,000 ppm fast: NEES 32 and 19."""
    right, flight, found = with_samples_lost(kind, number)
    assert isinstance(found.cause, LostSamples)
    assert not found.moved.any()
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0  # 1.0, 3.3


def test_tags_put_back_are_those_stated_before_they_were():
    t_s = np.linspace(0.0, 3.0, 151)
    lost = LostSamples(np.array([0.0, 0.4, 2.0]), 0.02, np.array([1.0, 1.5, 2.0]), np.zeros((2, 2)))
    np.testing.assert_allclose(lost.tags_as_stated(lost.tags_put_back(t_s)), t_s, atol=1e-12)
    assert lost.tags_put_back(t_s)[-1] == pytest.approx(3.04)


def test_rates_at_an_antenna_are_those_of_tags_put_back():
    """Doppler of an arm that turns, at tags .4 s early, made noise of 23: NEES 29, now 1.7."""
    right = right_flight("raw", 9320)
    flight, _ = samples_lost(right, np.random.default_rng([9320, 5]))
    found = found_in(flight)
    assert isinstance(found.cause, LostSamples)
    # The record lasts as much longer as it has lost, and loses more in that time.
    estimate = estimate_by(found, flight)
    assert estimate.t_s[-1] > flight.imu.t_s[-1] + 0.2
    assert found.cause.t_s[-1] > flight.imu.t_s[-1] + 0.2
    assert attitude_nees(right, estimate) < 5.0
    truth, P_v = right.truth, estimate.velocity_covariance_m2ps2
    off = estimate.v_n_mps - interpolate(estimate.t_s, truth.t_s, truth.v_n_mps)
    assert nees(off, P_v) < 5.0  # 1.5


def test_a_clock_that_is_fast_is_no_lost_samples():
    flight = right_flight("array", 7201)
    t_s = flight.imu.t_s
    fast = replace(flight.imu, t_s=t_s[0] + 1.0047 * (t_s - t_s[0]))
    found = found_in(replace(flight, imu=fast))
    assert isinstance(found.cause, ClockOff)
    assert abs(found.cause.moved[1] + 4700) < 900  # 4 sigma
    assert not found.moved.any()
    assert found.calibration == ()  # phases take tags as exact


def test_where_a_loss_is_in_doubt_the_unit_is_louder():
    _, flight, found = with_samples_lost("fixes")
    lost = found.cause
    problem = build_problem(lost.undone(flight), SETTINGS).problem
    louder = lost.in_doubt(problem).motion
    near = np.abs(problem.t_s[1:] - lost.steps[0].after_s) < 0.5
    assert (louder.gyroscope_noise[near] > problem.motion.gyroscope_noise[near]).any()
    assert (louder.gyroscope_noise == problem.motion.gyroscope_noise).any()


@pytest.mark.parametrize(("kind", "off_ppm"), [("fixes", 4700.0), ("instruments", 2100.0)])
def test_a_fast_clock_beside_fixes_is_not_silent(kind, off_ppm):
    """Its rate shows little, and its offset hid in late velocities: silent, NEES 61 and 21."""
    right = right_flight(kind, 7201 if kind == "fixes" else 7202)
    t_s = right.imu.t_s
    fast = replace(right.imu, t_s=t_s[0] + (1 + 1e-6 * off_ppm) * (t_s - t_s[0]))
    flight = replace(right, imu=fast)
    found = found_in(flight)
    assert isinstance(found.cause, ClockOff)
    (clock,) = (one for one in found.calibration if one.kind == "clock")
    assert abs(clock.moved[1] + off_ppm) < SIGMAS * found.cause.sigma[1]
    assert sum("clock disagrees" in note for note in found.notes) == 1
    assert attitude_nees(right, estimate_by(found, flight)) < 6.0  # 4.6, 4.1


def test_axes_that_are_turned_for_a_while_are_no_clock():
    """Of 5.6 ms, NEES 31; the turn gains 59 nats, the clock 17."""
    number = 966_000_046
    right = right_flight("raw", number // 12)
    w_b_radps, t_s = right.imu.w_b_radps.copy(), right.imu.t_s
    inside = (t_s > 7.2) & (t_s < 10.3)
    w_b_radps[inside] = w_b_radps[inside] @ exp(np.radians([[1.7, -1.8, 1.7]]))[0].T
    flight = replace(right, imu=replace(right.imu, w_b_radps=w_b_radps))
    found = found_in(flight)
    assert found.cause is None
    assert not found.moved.any()
    (fault,) = found.faults
    assert (fault.sensor, fault.shape) == ("gyroscope", "turn")
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0


@pytest.mark.parametrize(("number", "cause"), [(968_000_055, "clock"), (968_000_089, LOST)])
def test_what_is_possible_doubts_attitudes(number, cause):
    """Tags 11 ms late beside fixes, a sample lost: silent, NEES 21 and 13; now 6.4 and 4.4."""
    right = right_flight(KINDS[number // 12 % 5], number // 12)
    flight, _ = dirty(right, number)
    found = found_in(flight)
    assert cause in found.cause.kinds
    assert found.is_as_stated
    assert not any(word in note for note in found.notes for word in ("clock", "lost"))
    assert attitude_nees(right, estimate_by(found, flight)) < 8.0


def test_a_clock_beside_phases_that_is_possible_doubts_attitudes():
    """Of 880 ppm: NEES 27, silent; now 2.4. A bias of 4 cm/s2 for seven seconds is as likely."""
    right = right_flight("raw", 9881)
    t_s = right.imu.t_s
    slow = replace(right.imu, t_s=t_s[0] + (1 - 8.8e-4) * (t_s - t_s[0]))
    flight = replace(right, imu=slow)
    found = found_in(flight)
    assert found.cause.kinds == ("clock",)
    assert attitude_nees(right, estimate_by(found, flight)) < 5.0


def test_axes_that_are_turned_far_are_found_where_the_first_step_leads_too_far():
    """A step of 15 degrees has no minimum behind it: NEES 2,800 as axes of the gyroscope."""
    right = right_flight("fixes", 762)
    R = exp(np.radians([[6.0, -6.0, 4.0]]))[0]
    flight = replace(right, imu=replace(right.imu, f_b_mps2=right.imu.f_b_mps2 @ R))
    found = found_in(flight)
    cause = found.cause
    assert isinstance(cause, Lasting)
    assert cause.is_of_unit
    assert attitude_nees(right, estimate_by(found, flight)) < 6.0


@pytest.mark.parametrize(
    ("kind", "number", "field", "scales"),
    [
        ("array", 91301, "f_b_mps2", [1.0, 0.86, 1.0]),
        ("fixes", 91001, "f_b_mps2", [1.13, 1.0, 1.0]),
        ("instruments", 91100, "w_b_radps", [0.93, 1.0, 0.9]),
    ],
)
def test_scale_factors_that_are_off_are_taken_back(kind, number, field, scales):
    """A span of 24 of 30 s, as if a bias were another there, had NEES 9 to 15."""
    right = right_flight(kind, number)
    flight = replace(right, imu=replace(right.imu, **{field: scales * getattr(right.imu, field)}))
    found = found_in(flight)
    assert isinstance(found.cause, Lasting)
    assert found.cause.is_of_unit
    assert within(found.cause.error, 1.0 / np.array(scales) - 1.0)
    assert "scale factors are off" in found.notes[0]
    assert attitude_nees(right, estimate_by(found, flight)) < 6.0


def test_no_samples_are_lost_where_a_louder_unit_explains_as_much(monkeypatch):
    """A plane's unit, 40 times as loud as its data sheet, had lost samples at nine times."""
    right = right_flight("fixes", 7401)
    rng, interval_s = np.random.default_rng(5), np.median(np.diff(right.imu.t_s))
    loud = right.imu.f_b_mps2 + 0.1 / np.sqrt(interval_s) * rng.normal(size=(len(right.imu.t_s), 3))
    flight = replace(right, imu=replace(right.imu, f_b_mps2=loud))
    edges = np.array([2.0, 2.1, 4.0, 4.1, 6.0, 6.1, right.imu.t_s[-1] + 1.0])
    count = np.array([0.0, 1.0, 1.0, 2.0, 2.0, 3.0, 3.0])
    lost = LostSamples(count, 0.02, edges, np.zeros((6, 2)), nats=100.0, odds=12.0)
    monkeypatch.setattr(subject, "_likely_causes", lambda *_: (lost,))
    found = found_in(flight)
    assert found.cause is None
    assert found.factors["accelerometer"] > 50.0


def test_a_clock_that_whole_samples_explain_as_well_is_held_against_them():
    """Lost samples gained 1.6 nats more, were then no likelier than noise, and nothing was said."""
    right = right_flight("fixes", 9852)
    late_s = -0.0039 * (right.imu.t_s - right.imu.t_s[0])
    flight = replace(right, imu=replace(right.imu, t_s=right.imu.t_s + late_s))
    estimate = Smoother()(flight)
    assert any(
        "lock disagrees with GNSS" in one or "samples are lost" in one for one in estimate.notes
    )
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 5.0  # 97, now 2.4


@pytest.mark.parametrize("off_s", [-0.05, 0.05])
def test_late_velocities_gain_what_a_delay_explains_and_early_ones_nothing(off_s):
    right = right_flight("fixes", 744)
    turned = interpolate(right.fixes.t_s + off_s, right.truth.t_s, right.truth.v_n_mps)
    flight = replace(right, fixes=replace(right.fixes, v_n_mps=turned))
    delay = replace(SETTINGS, calibration=calibration_requests(["velocity-delay"]))
    stated, free = (build_problem(flight, one).problem for one in (SETTINGS, delay))
    gained = _gained(solve_batch(stated).cost, free)
    assert gained > 100.0 if off_s < 0.0 else gained == 0.0


def test_a_car_that_has_just_begun_to_move_is_loud_and_no_sensor_of_it_late(shared):
    """A gyroscope .036 s late gained 17 nats by a data sheet's noise, which holds at rest alone.

    Noise in motion and velocities .13 s old, which it has, gain 20.
    """
    car = replace(drive(shared, stretched=True), vehicle=WheeledVehicle())
    found = found_in(truncated(car, 39.8))
    assert found.cause is None or not found.cause.is_likely
