"""From a flight to a smoothing problem: what it holds, where it starts, what is noted and lost."""

import dataclasses
import gc
import weakref

import msgspec
import numpy as np
import pytest

from fgnav.assembly.calibration_request import calibration_requests
from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.problem import build_problem
from fgnav.assembly.settings import ProblemSettings
from fgnav.geometry import rotations
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.factors.array_shape import ArrayShape
from fgnav.graph.factors.gravity import TILT
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.inertial.gyro_free import MEAN_RATE, GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.states import States
from fgnav.gravity import LowDynamics
from fgnav.integers.resolvers.truth import Truth, attitude_at
from fgnav.noise.nominal import with_factors
from fgnav.process.hyperparameters import IntervalPriors, RatePrior
from fgnav_sim.gnss.tables import MultipathTable, OutageTable
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.alignment.test_gaps import with_hole
from tests.assembly.flights import GYROSCOPE
from tests.methods.simulated import SCENARIOS, flown
from tests.methods.test_maximum_likelihood import Off

PRIOR = RatePrior(length_s=1.0, variance_rad2ps2=np.full(3, 0.1), evidence=0.0)
PER_EPOCH = ("t_s", "tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")


def build(flight, resolver=None, **settings):
    settings = {"rate_prior": PRIOR, **settings}
    return build_problem(flight, ProblemSettings(resolver=resolver or Truth(), **settings))


def with_outages(*outages, gyro=False, span_s=20.0):
    scenario = load_scenario(SCENARIOS / "demo.toml")
    gnss = msgspec.structs.replace(scenario.gnss, outages=outages)
    imu = msgspec.structs.replace(scenario.imu, **(GYROSCOPE if gyro else {}))
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss, imu=imu)
    return simulate(scenario, np.random.default_rng(1))


def with_echoes(span_s=20.0, *, gyro=False):
    """The demo's motion; of the phases' variance the half stays with antenna and satellite."""
    scenario = load_scenario(SCENARIOS / "demo.toml")
    echoes = MultipathTable(code_m=0.3, phase_m=0.003, time_constant_s=5.0)
    gnss = msgspec.structs.replace(scenario.gnss, multipath=echoes)
    imu = msgspec.structs.replace(scenario.imu, **(GYROSCOPE if gyro else {}))
    scenario = msgspec.structs.replace(scenario, duration_s=span_s, gnss=gnss, imu=imu)
    return simulate(scenario, np.random.default_rng(20_011))


def measurement(prepared, name):
    return next(part for part in prepared.problem.sensors if part.name == name)


def true_states(flight, problem):
    """Where keyframes truly are; rates as they start."""
    truth, t_s = flight.truth, problem.t_s
    R_nb, _ = attitude_at(truth, t_s)
    p, v = (interpolate(t_s, truth.t_s, values) for values in (truth.p_n_m, truth.v_n_mps))
    return States(R_nb, p, v, problem.start.aux, problem.start.constants)


@pytest.fixture(scope="module")
def demo():
    flight = flown("demo", 20.0)
    return flight, build(flight)


@pytest.mark.parametrize("name", ["array phases", "velocity"])
def test_residuals_at_the_truth_are_white_and_of_unit_variance(demo, name):
    flight, prepared = demo
    part = measurement(prepared, name)
    at = true_states(flight, prepared.problem).at(part.row)
    value = part.linearise(at, np.arange(len(part.row))).value
    degrees = part.freedom.sum()
    assert abs((value**2).sum() / degrees - 1) < 5 * np.sqrt(2 / degrees)


def test_the_search_starts_close_to_the_truth(demo):
    flight, prepared = demo
    problem = prepared.problem
    true, start = true_states(flight, problem), problem.start
    turn = rotations.log(rotations.transpose(start.R_nb) @ true.R_nb)
    assert np.degrees(np.linalg.norm(turn, axis=1)).max() < 3.0
    assert np.linalg.norm(start.p_n_m - true.p_n_m, axis=1).max() < 3.0  # by code of 0.3 m
    assert np.linalg.norm(start.v_n_mps - true.v_n_mps, axis=1).max() < 0.5
    assert problem.attitude_known.all()
    np.testing.assert_array_equal(start.constants, problem.constants.start)


def test_without_a_gyroscope_rates_are_states_about_a_constant_of_the_flight(demo):
    problem = demo[1].problem
    assert isinstance(problem.motion, GyroFree)
    assert problem.width == 21
    assert problem.motion.mean_rate == problem.constants.columns(MEAN_RATE)
    assert problem.start.aux[:, 3:6].any(axis=1).all()
    np.testing.assert_array_equal(
        problem.motion.poles_per_s, np.tile(PRIOR.poles_per_s, (len(problem.t_s) - 1, 1, 1))
    )
    assert any(note.code == "D207" and "Matern 5/2" in note for note in demo[1].notes)


def test_with_a_gyroscope_its_biases_are():
    flight = with_outages(gyro=True, span_s=5.0)
    prepared = build(flight)
    problem = prepared.problem
    assert isinstance(problem.motion, Inertial)
    assert problem.width == 15
    assert problem.constants.column(MEAN_RATE) == -1
    assert not any(note.code[1:3] == "20" and note.code[0] == "D" for note in prepared.notes)


def test_the_rate_prior_is_identified_where_none_is_stated():
    """Sines of 20 degrees and 6.3 s about all axes: rates of 0.25 rad/s RMS, smooth for seconds."""
    motion = build(flown("demo", 20.0), rate_prior=None).problem.motion
    assert (np.ptp(motion.poles_per_s, axis=0) == 0).all()
    assert motion.poles_per_s[0, 0, 2] == pytest.approx(1.0, rel=0.1)
    assert motion.poles_per_s[0, 0, 1] < 0.3
    sigma = np.sqrt(motion.variance_rad2ps2)
    assert (sigma > 0.2).all()
    assert (sigma < 1.0).all()


def test_a_rate_prior_of_intervals_serves_a_unit_with_other_timestamps(monkeypatch):
    flight = flown("demo", 20.0)
    before = build(flight, rate_prior=None).problem.motion
    moved = dataclasses.replace(
        flight, imu=dataclasses.replace(flight.imu, t_s=flight.imu.t_s + 0.15)
    )
    anew = build_problem(moved, ProblemSettings(resolver=Truth())).problem.motion
    priors = IntervalPriors(before.t_s, before.poles_per_s, before.variance_rad2ps2)
    settings = ProblemSettings(resolver=Truth(), interval_priors=priors)
    monkeypatch.setattr("fgnav.assembly.motion.rate_prior", None)  # nothing is identified
    motion = build_problem(moved, settings).problem.motion
    assert motion.t_s[0] > before.t_s[0]
    later = np.searchsorted(before.t_s, motion.t_s[:-1])
    np.testing.assert_array_equal(motion.variance_rad2ps2, before.variance_rad2ps2[later])
    np.testing.assert_array_equal(motion.poles_per_s, before.poles_per_s[later])
    apart = np.log(motion.variance_rad2ps2.mean() / anew.variance_rad2ps2.mean())
    assert abs(apart) < 0.1


def test_keyframes_are_the_epochs_within_the_inertial_record_and_others_are_counted():
    flight = flown("demo", 20.0)
    late = flight.imu.t_s >= 2.0
    imu = dataclasses.replace(
        flight.imu, t_s=flight.imu.t_s[late], f_b_mps2=flight.imu.f_b_mps2[late]
    )
    prepared = build(dataclasses.replace(flight, imu=imu))
    assert len(prepared.problem.t_s) == prepared.epochs - 20
    unused = {loss.reason: loss.count for loss in prepared.unused}
    assert unused["not covered by the accelerometer's record"] == 20


def test_epochs_that_are_not_in_the_file_are_keyframes_without_measurements():
    flight = flown("demo", 20.0)
    seen = flight.observations
    keep = (seen.t_s < 8.0) | (seen.t_s > 10.05)
    rest = dataclasses.replace(seen, **{name: getattr(seen, name)[keep] for name in PER_EPOCH})
    prepared = build(dataclasses.replace(flight, observations=rest))
    problem = prepared.problem
    np.testing.assert_allclose(problem.t_s, seen.t_s, atol=0.02)
    inside = (problem.t_s > 8.0) & (problem.t_s < 10.05)
    assert not problem.attitude_known[inside].any()
    for part in problem.sensors:
        assert not np.isin(np.flatnonzero(inside), part.row).any(), part.name


def test_links_with_wrong_integers_are_corrected_by_their_arcs_and_listed():
    prepared = build(flown("demo", 20.0), Off(epochs=(50, 51, 52)))
    assert prepared.problem.attitude_known.all()
    corrected = [one for one in prepared.rejections if "mended by its arc" in one.reason]
    assert corrected
    assert {(one.what, one.from_s, one.until_s) for one in corrected} == {("phase", 5.0, 5.2)}
    assert not any("chi-square" in loss.reason for loss in prepared.unused)


def test_an_outage_is_noted_and_leaves_the_forces_direction_unknown_in_its_middle():
    prepared = build(with_outages(OutageTable(from_s=7.0, until_s=13.0)))
    problem = prepared.problem
    for what in ("position", "velocity", "attitude of single epochs"):
        assert f"No {what} from 6.90 to 13.00 s." in prepared.notes
    noise = problem.motion.accelerometer_noise
    inflated_s = problem.t_s[:-1][noise > noise.min()]
    # Half a radian from the last attitude and, back, from the next: as far from either, and at
    # PRIOR's .3 rad/s not sooner than after 1.6 s.
    assert 8.5 < inflated_s.min() < 9.9
    assert inflated_s.min() - 6.9 == pytest.approx(12.9 - inflated_s.max(), abs=0.25)


def test_a_gyroscope_carries_the_attitude_through_an_outage():
    prepared = build(with_outages(OutageTable(from_s=7.0, until_s=13.0), gyro=True))
    assert np.ptp(prepared.problem.motion.accelerometer_noise) == 0


def test_a_hole_in_the_inertial_record_is_bridged_noted_and_loud():
    flight = flown("demo", 20.0)
    prepared = build(dataclasses.replace(flight, imu=with_hole(flight.imu, 6.0, 11.0)))
    problem = prepared.problem
    assert "No inertial samples from 6.00 to 11.00 s." in prepared.notes
    assert not any(loss.reason == "off its neighbours" for loss in prepared.unused)
    noise = problem.motion.accelerometer_noise
    inflated_s = problem.t_s[:-1][noise > noise.min()]
    assert (inflated_s.min(), inflated_s.max()) == pytest.approx((6.0, 10.9), abs=0.11)


def test_one_antenna_that_is_gone_is_noted():
    prepared = build(with_outages(OutageTable(from_s=5.0, until_s=15.0, antennas=("a3",))))
    assert "No phase of antenna a3 from 4.90 to 15.00 s." in prepared.notes
    assert prepared.problem.attitude_known.all()


@pytest.mark.parametrize("antennas", [("a1",), ("a1", "a2")])
def test_attitude_and_position_outlive_the_reference_antenna(antennas):
    flight = with_outages(OutageTable(from_s=5.0, until_s=15.0, antennas=antennas))
    prepared = build(flight)
    problem = prepared.problem
    begins = "No observations of the reference antenna a1 from 4.90 to 15.00 s: "
    assert any(note.startswith(begins) for note in prepared.notes)
    assert problem.attitude_known.all()
    assert len(problem.phase.row) == len(problem.t_s)
    true = true_states(flight, problem)
    turn = rotations.log(rotations.transpose(problem.start.R_nb) @ true.R_nb)
    assert np.degrees(np.linalg.norm(turn, axis=1)).max() < 5.0
    for name in ("array phases", "velocity"):
        squares, freedom = 0.0, 0
        for part in problem.sensors:
            during = (problem.t_s[part.row] > 5.0) & (problem.t_s[part.row] < 15.0)
            if part.name == name and during.any():
                value = part.linearise(true.at(part.row), np.arange(len(part.row))).value
                squares += (value[during] ** 2).sum()
                freedom += part.freedom[during].sum()
        assert squares / freedom < 1.3, name


def test_an_antenna_alone_still_measures_position():
    names = tuple(f"a{k}" for k in (1, 3, 4, 5, 6, 7, 8))
    prepared = build(with_outages(OutageTable(from_s=8.0, until_s=10.0, antennas=names)))
    assert not any(note.startswith("No position") for note in prepared.notes)
    assert len(prepared.problem.phase.row) == len(prepared.problem.t_s)


def test_losses_of_another_reference_count_each_link_once():
    flight = with_outages(OutageTable(from_s=5.0, until_s=9.0, antennas=("a1",)), span_s=10.0)
    below = {
        loss.what: loss.count
        for loss in build(flight).unused
        if loss.reason == "below the elevation mask" and loss.what.endswith("link")
    }
    assert below["a2 link"] == below["a8 link"] == len(flight.observations.t_s)
    assert not any("reference antenna" in loss.reason for loss in build(flight).unused)


def test_one_baseline_starts_from_other_vectors_about_its_own_axis():
    """What phase leaves open, roll, velocity and specific force tell to start with."""
    flight = flown("demo", 20.0)
    keep = [0, 3]
    seen = flight.observations
    change = {name: getattr(seen, name)[:, keep] for name in PER_EPOCH if name != "t_s"}
    two = dataclasses.replace(
        flight,
        observations=dataclasses.replace(seen, **change),
        antennas=tuple(flight.antennas[k] for k in keep),
    )
    prepared = build(two)
    problem = prepared.problem
    assert problem.attitude_known.mean() > 0.9
    turn = rotations.log(
        rotations.transpose(problem.start.R_nb) @ true_states(flight, problem).R_nb
    )
    assert np.degrees(np.sqrt((turn**2).sum(axis=1).mean())) < 20.0
    # Its phases do not know the third angle: of nine elements they tell three.
    assert (measurement(prepared, "array phases").freedom == 3).all()


def test_every_instrument_becomes_a_measurement_with_its_constants():
    prepared = build(flown("surroundings", 10.0))
    names = [part.name for part in prepared.problem.sensors]
    assert len(set(names)) == len(names)
    assert "velocity" in names
    assert prepared.problem.phase is not None
    reported = [one.name for one in prepared.problem.constants.parts if one.reported]
    assert reported == ["barometer", "hard iron"]


def test_gravity_directions_take_part():
    prepared = build(flown("ramp", 10.0), gravity=LowDynamics())
    part = measurement(prepared, "gravity")
    assert part.constants.column(TILT) == -1
    np.testing.assert_allclose(np.linalg.norm(part.known_n, axis=1), 1.0, rtol=1e-12)


def test_antennas_that_are_asked_for_are_columns_of_the_arrays_measurement():
    requests = calibration_requests(("antenna:a4", "lever-arm"))
    prepared = build(flown("demo", 10.0), calibration=requests)
    constants = prepared.problem.constants
    (shape,) = (m for m in prepared.problem.sensors if isinstance(m, ArrayShape))
    named = [name for name in shape.parameters if shape.constants.column(name) >= 0]
    assert named == ["antenna a4"]
    assert len(shape.row) == len(prepared.problem.t_s)
    assert constants.column(LEVER_ARM) >= 0
    assert prepared.problem.phase.constants is constants
    assert measurement(prepared, "velocity").constants is constants


def test_a_flight_is_not_kept_once_its_problem_is_built():
    flight = dataclasses.replace(flown("demo", 5.0))
    known = weakref.ref(flight)
    prepared = build(flight)
    del flight
    gc.collect()
    assert known() is None
    assert len(prepared.problem.t_s) == 50


class Counting:
    """Integers of truth, and how often they were asked for."""

    def __init__(self):
        self.asked = 0

    def __call__(self, differences, flight):
        self.asked += 1
        return Truth()(differences, flight)


def test_problems_of_the_same_observations_share_their_integers_and_no_others():
    flight, resolver, last = flown("demo", 5.0), Counting(), LastObservations()
    settings = ProblemSettings(resolver=resolver, rate_prior=PRIOR)
    louder = with_factors(flight, {"accelerometer": 3.0})
    for one in (flight, louder):
        shared, alone = build_problem(one, settings, last=last), build_problem(one, settings)
        np.testing.assert_array_equal(shared.problem.start.p_n_m, alone.problem.start.p_n_m)
        assert shared.unused == alone.unused
        assert shared.imu is one.imu
    assert resolver.asked == 2  # the second: of the other flight, alone
    noise = dataclasses.replace(flight.gnss_noise, phase_m=2 * flight.gnss_noise.phase_m)
    first, *others = flight.antennas
    moved = dataclasses.replace(first, position_b_m=first.position_b_m + 0.01)
    for change in ({"gnss_noise": noise}, {"antennas": (moved, *others)}):
        build_problem(dataclasses.replace(flight, **change), settings, last=last)
    assert resolver.asked == 4


def test_problems_that_estimate_antennas_share_their_integers():
    flight, resolver, last = flown("demo", 5.0), Counting(), LastObservations()
    asked = calibration_requests(["antenna:a2"])
    settings = ProblemSettings(resolver=resolver, rate_prior=PRIOR, calibration=asked)
    for one in (flight, with_factors(flight, {"accelerometer": 3.0})):
        build_problem(one, settings, last=last)
    assert resolver.asked == 2  # of the array as it is stated, and as its phases place it


def test_phase_errors_that_stay_are_a_state_of_keyframes():
    flight = with_echoes()
    prepared = build(flight)
    problem, error = prepared.problem, prepared.problem.motion.multipath
    assert error.share[0] == pytest.approx(0.5, abs=0.1)
    # Eight other seeds: 4.4 ± .3, since clocks and satellites are taken off by what lasts, too.
    assert 1 / error.decay_per_s[0] == pytest.approx(5.0, rel=0.3)
    assert problem.width == 21 + error.size
    array = measurement(prepared, "array phases")
    np.testing.assert_array_equal(array.share, error.share)
    assert any(note.code == "I203" for note in prepared.notes)
    asked = build(flight, calibration=calibration_requests(["antenna:a2"]))
    assert asked.problem.motion.multipath is None  # an antenna off its place lasts as well
    assert build(flight, causal=True).problem.motion.multipath is None


def test_beside_a_gyroscope_phases_that_err_alike_count_as_often_as_they_differ():
    flight = with_echoes(gyro=True)
    prepared = build(flight)
    array, form = measurement(prepared, "array phases"), build(flight, causal=True)
    white = measurement(form, "array phases")
    assert prepared.problem.width == 15
    # Half for 5 s at 10 Hz: 1 + 2 x .5 x 49.5.
    ratio = (white.root**2).sum(axis=(1, 2)) / (array.root**2).sum(axis=(1, 2))
    assert np.median(ratio) == pytest.approx(50.5, rel=0.3)


def test_white_phase_errors_are_no_state():
    prepared = build(with_outages())
    assert prepared.problem.motion.multipath is None
    assert prepared.problem.width == 21
