"""Errors of the unit over a span of time: a bias that steps, other scales, turned axes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import ortho_group

from fgnav.checks import NoSolutionError
from fgnav.frontend.problem import build_problem
from fgnav.geometry.rotations import exp
from fgnav.graph.types.constants import flight_constant
from fgnav.identification.findings import findings
from fgnav.identification.likelihood import span_offsets
from fgnav.identification.likelihood.changed_samples import ChangedBy, solved_with_changes
from fgnav.identification.likelihood.span_offsets import _Columns, _of_window, of_biases
from fgnav.identification.likelihood.thinned import thinned
from fgnav.identification.spans.errors import ANY_MIX, MIX, further, without
from fgnav.identification.spans.span_ends import at_samples
from fgnav.identification.spans.span_fault import SpanFault
from fgnav.identification.track.windows import EXCLUDED
from fgnav.methods.smoother import Smoother
from fgnav.solve.chain import solve_batch
from tests.identification.identified import SETTINGS, estimate_by, found_in
from tests.methods.simulated import errors_rad, nees
from tests.robustness.drawn.dirty import dirty
from tests.robustness.drawn.flights import KINDS, right_flight
from tests.robustness.drawn.series import of_triad

FROM_S, UNTIL_S = 4.1, 7.3
KEYFRAMES_S = 0.2
TURNING, PUSHING = np.array([0.0, 0.02, -0.02]), np.array([0.3, 0.0, 0.2])
TURNED = exp(np.radians([[2.0, -2.0, 1.0]]))[0]
TURNED_FAR = exp(np.radians([[6.0, -6.0, 4.0]]))[0]


def changed(flight, field, by, from_s=FROM_S, until_s=UNTIL_S):
    imu = flight.imu
    x = getattr(imu, field)
    inside = (imu.t_s > from_s) & (imu.t_s <= until_s)
    return replace(flight, imu=replace(imu, **{field: np.where(inside[:, None], by(x), x)}))


def faults_of(flight):
    found = findings(flight, SETTINGS, build_problem(flight, SETTINGS), build_problem)
    return () if found is None else [one for one in found.faults if one.is_likely]


def test_a_gain_is_that_of_the_chain_with_such_a_constant():
    """Of a linear problem half of what the cost falls by; G, scores and N are of this module."""
    flight = changed(right_flight("fixes", 741), "w_b_radps", lambda x: x + TURNING)
    small = thinned(build_problem(flight, SETTINGS).problem)
    stated = solve_batch(small)
    stated = solve_batch(small, begin=stated.states)
    offset = next(one for one in of_biases(small, stated) if one.shape == "offset")
    from_s, until_s = small.t_s[[offset.begin, offset.end]]
    field = {"accelerometer": "f_b_mps2", "gyroscope": "w_b_radps"}[offset.sensor]

    def less(by):
        return lambda imu: (
            changed(replace(flight, imu=imu), field, lambda x: x - by, from_s, until_s).imu
        )

    steps = np.full(3, 1e-3)
    part = flight_constant("offset", ("x", "y", "z"), "", 10.0, reported=False)
    free = solved_with_changes(small, ChangedBy((part,), tuple(map(less, np.diag(steps))), steps))
    assert (stated.cost - free.cost) / 2 == pytest.approx(offset.gain, rel=0.02)
    off = free.states.constants[-3:] - offset.value
    assert off @ np.linalg.solve(offset.covariance, off) < 0.02 * 2 * offset.gain


def test_what_leaves_a_flight_less_likely_is_no_fault():
    """Scales promised 13 nats of a unit with noise of 1.7 m/s2, and left 72 less: NEES 39."""
    right = right_flight("raw", 941000081 // 12)
    flight, _ = dirty(right, 941000081)
    found = found_in(flight)
    assert not found.faults
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 5.0  # 2.2


@pytest.mark.parametrize("kind", ["fixes", "instruments", "raw"])
def test_a_right_unit_is_not_accused(kind):
    assert not faults_of(right_flight(kind, 731))


@pytest.mark.parametrize("kind", ["fixes", "raw"])
def test_axes_that_turn_early_are_named_though_most_samples_have_them(kind):
    """They were noise of the gyroscope: NEES 84 and 35 (930000400, 951001221)."""
    right = right_flight(kind, 743)
    flight = changed(right, "f_b_mps2", lambda f: f @ TURNED, 3.0, np.inf)
    found = found_in(flight)
    (fault,) = found.faults
    assert (fault.sensor, fault.shape, fault.is_likely) == ("accelerometer", "turn", True)
    assert abs(fault.from_s - 3.0) <= 2 * KEYFRAMES_S
    assert not found.factors
    estimate = estimate_by(found, flight)
    squares = nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2)
    assert squares < 4.0  # 1.5 and 6.9 without what is left of the turn


def greatest_gain(flight):
    small = thinned(build_problem(flight, SETTINGS).problem)
    solution = solve_batch(small)
    solution = solve_batch(small, begin=solution.states)
    return max(one.gain for one in of_biases(small, solution))


def test_an_error_that_wanders_all_along_is_no_fault_of_a_span(monkeypatch):
    """As of a car's unit that vibrates: three spans of seconds gained 46, 39 and 27 nats."""
    monkeypatch.setattr(span_offsets, "_WINDOW", 10)
    right, rng = right_flight("fixes", 741), np.random.default_rng(1)
    t_s = right.imu.t_s
    wander = np.stack(
        [np.interp(t_s, np.arange(20), rng.normal(size=20)) for _ in range(3)], axis=1
    )
    wandering = changed(right, "w_b_radps", lambda x: x + 0.01 * wander, t_s[0] - 1, t_s[-1])
    limit = EXCLUDED + np.log(np.ptp(t_s))
    assert greatest_gain(wandering) < limit
    monkeypatch.setattr(span_offsets, "_FEWEST", 1000)
    assert greatest_gain(wandering) > limit


# As noise of the unit they had an attitude NEES of 2.1, 9.8 and 15.3.
@pytest.mark.parametrize(
    ("kind", "number", "sensor", "shape", "field", "by", "most"),
    [
        ("fixes", 744, "gyroscope", "scale", "w_b_radps", lambda x: x * [1.0, 1.0, 0.7], 8.0),
        ("fixes", 744, "accelerometer", "turn", "f_b_mps2", lambda x: x @ TURNED, 4.0),
        ("raw", 743, "accelerometer", "offset", "f_b_mps2", lambda x: x + PUSHING, 5.0),
    ],
)
def test_an_error_that_lasts_for_seconds_is_named_and_taken_out(
    kind, number, sensor, shape, field, by, most
):
    right = right_flight(kind, number)
    flight = changed(right, field, by)
    fault, *_ = faults_of(flight)
    assert (fault.sensor, fault.shape) == (sensor, shape)
    for at_s, (first_s, last_s) in ((FROM_S, fault.begins_s), (UNTIL_S, fault.ends_s)):
        assert first_s - KEYFRAMES_S <= at_s <= last_s + KEYFRAMES_S
    estimate = Smoother()(flight)
    assert any(f"The {sensor}'s" in note for note in estimate.notes)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < most


@pytest.mark.parametrize("number", [745, 746])
def test_a_step_that_no_noise_shows_is_found(number):
    """Attitude NEES was 16 and 13, unnoticed; nothing tells which sensor it is."""
    right = right_flight("fixes", number)
    flight = changed(right, "w_b_radps", lambda x: x + TURNING / 2, 2.5)
    assert {one.sensor for one in faults_of(flight)} == {"gyroscope", "accelerometer"}
    estimate = Smoother()(flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


@pytest.mark.parametrize("number", [762, 770])
def test_a_span_by_which_a_unit_is_louder_than_any_noise_is_taken_out(number):
    """Refused before, as an error of all the record."""
    right = right_flight("fixes", number)
    flight = changed(right, "f_b_mps2", lambda x: x @ TURNED_FAR, FROM_S, 6.3)
    fault, *_ = faults_of(flight)
    assert (fault.sensor, fault.shape) == ("accelerometer", "turn")
    estimate = Smoother()(flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


@pytest.mark.parametrize("seed", range(3))
def test_what_unmixes_axes_twice_is_one_matrix(seed):
    rng, imu = np.random.default_rng(seed), right_flight("fixes", 741).imu
    first, then = rng.normal(size=(2, 9))
    twice = without(without(imu, "gyroscope", MIX, first), "gyroscope", MIX, then)
    at_once = without(imu, "gyroscope", MIX, further(MIX, first, then))
    np.testing.assert_allclose(at_once.w_b_radps, twice.w_b_radps, rtol=0, atol=1e-12)


def test_no_more_is_known_of_a_mix_than_that_axes_stay_orthogonal():
    of_mix = np.eye(3) - ortho_group.rvs(3, size=2000, random_state=1)
    assert np.sqrt((of_mix**2).mean()) == pytest.approx(ANY_MIX, rel=0.02)


@pytest.mark.parametrize(
    ("seed", "from_s", "until_s"), [(967000058, 4.1, 5.7), (965000082, 7.7, np.inf)]
)
def test_axes_that_are_exchanged_or_turned_far_for_a_while_are_put_right(seed, from_s, until_s):
    """Three numbers left attitudes with NEES of 19 and 76."""
    right = right_flight("raw", seed // 12)
    flight, _ = dirty(right, seed)
    found = found_in(flight)
    (fault,) = found.faults
    assert (fault.sensor, fault.shape, fault.is_likely) == ("gyroscope", MIX, True)
    assert fault.from_s == pytest.approx(from_s, abs=0.1)
    assert fault.until_s == pytest.approx(until_s, abs=0.1)
    assert "exchanged, reversed or turned far" in fault.sentence
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 6.0


def test_most_of_a_record_that_is_louder_than_any_noise_is_refused():
    """Of the majority nothing says that it is not the rest that is wrong."""
    flight = changed(right_flight("fixes", 763), "f_b_mps2", lambda x: x * [1.0, 0.5, 1.0], -1.0)
    with pytest.raises(NoSolutionError, match="contradict each other: gyroscope"):
        Smoother()(flight)


@pytest.mark.parametrize("seed", range(4))
def test_an_offset_that_states_follow_gains_nothing_by_rounding(seed):
    """Across a gap of GNSS a thousandth of G' G is rounding: some of it positive, some negative."""
    rng, w = np.random.default_rng(seed), 12
    noise = 1e-3 * rng.normal(size=(w, w))
    shared = (np.eye(w) + (noise + noise.T) / 2)[:, None, :, None]
    score = 0.03 * rng.normal(size=(w, 1))
    columns = _Columns("accelerometer", "offset", np.zeros((w, 0, 1)), np.ones((w, 1, 1)), score)
    found = _of_window(np.arange(w + 1.0), columns, shared, slice(0, w), (1.0, w, 0.0))
    assert found.gain < 3.0


@pytest.mark.parametrize(
    ("seed", "most"),
    [
        (945000456, 3.0),  # a gyroscope turned by 3 degrees beside phases: silent, 27; now .7
        (970000033, 9.0),  # a gyroscope x .5 that begins and ends between keyframes: 12, now 6.6
    ],
)
def test_attitudes_hold_what_a_span_may_be_instead(seed, most):
    right = right_flight(KINDS[seed // 12 % 5], seed // 12)
    flight, _ = dirty(right, seed)
    estimate = Smoother()(flight)
    assert any("taken out" in note for note in estimate.notes)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < most


def test_an_error_of_a_span_is_no_clock():
    """Forces off by .7 m/s2 from 6.1 to 11.4 s were a clock, noise and a drift: NEES 15, now .5."""
    right, rng = right_flight("raw", 62_004), np.random.default_rng([62_004, 5])
    flight, _ = of_triad("imu", "f_b_mps2")[5](right, rng)
    found = found_in(flight)
    assert not found.moved.any()
    assert found.faults[0][:2] == ("accelerometer", "offset")
    estimate = estimate_by(found, flight)
    assert nees(errors_rad(right, estimate), estimate.attitude_covariance_rad2) < 3.0


def test_an_end_by_which_keyframes_are_others_is_not_tried():
    """Damage 2003139, a record with a column of one value, ended in a traceback."""
    flight = right_flight("instruments", 7002)
    whole, fewer = (
        thinned(build_problem(one, SETTINGS).problem)
        for one in (flight, replace(flight, imu=late_begin(flight.imu)))
    )
    assert len(fewer.t_s) < len(whole.t_s)
    three = np.full(3, 0.01)
    fault = SpanFault(
        sensor="gyroscope",
        shape="offset",
        from_s=4.0,
        until_s=np.inf,
        begins_s=(3.9, 4.1),
        ends_s=(np.inf, np.inf),
        value=three,
        sigma=three,
        variance=three,
        size=0.01,
        share=1.0,
    )

    def without(one):
        return whole if one.from_s >= fault.from_s else fewer

    assert at_samples(fault, flight.imu.t_s, without).from_s >= fault.from_s


def late_begin(imu):
    """Return a unit whose record begins a second later."""
    of_rest = imu.t_s >= imu.t_s[0] + 1.0
    series = {name: getattr(imu, name)[of_rest] for name in ("t_s", "f_b_mps2", "w_b_radps")}
    return replace(imu, **series)
