"""Noise, delays and clocks identified from flights whose own are known."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.checks import NoSolutionError
from fgnav.frontend.problem import build_problem
from fgnav.frontend.settings import ProblemSettings
from fgnav.geometry.interpolation import interpolate
from fgnav.identification.apply import with_identified_noise
from fgnav.identification.likelihood.linear_chain import LinearChain
from fgnav.identification.likelihood.thinned import FIELDS, thinned
from fgnav.identification.noise import noise_search
from fgnav.identification.noise.identify import identify
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.integers.resolvers.truth import Truth
from fgnav.io.flight import usual_noise
from fgnav.methods.smoother import Batch
from fgnav.solve.chain import solve_batch
from fgnav_sim.motion import Arc, Motion, Sine
from fgnav_sim.scenario import FixesTable, load_scenario
from fgnav_sim.simulate import simulate
from tests.frontend.standing import standing
from tests.methods.simulated import SCENARIOS, errors_rad, nees

SETTINGS = ProblemSettings(resolver=Truth(), noise="identified")
GYROSCOPE_RADPS_PER_SQRT_HZ = 2e-4


def with_fixes(seed=20_001, span_s=200.0):
    """A gyroscope, and fixes once a second of one antenna: no array, no phases."""
    scenario = load_scenario(SCENARIOS / "demo.toml")
    scenario = msgspec.structs.replace(
        scenario,
        duration_s=span_s,
        fixes=FixesTable(rate_hz=1.0, position_noise_m=0.5, velocity_noise_mps=0.05),
        imu=msgspec.structs.replace(
            scenario.imu,
            gyroscope_noise_radps_per_sqrt_hz=GYROSCOPE_RADPS_PER_SQRT_HZ,
            gyroscope_bias_radps=0.01,
            gyroscope_bias_walk_radps_per_sqrt_s=1e-5,
        ),
    )
    flight = simulate(scenario, np.random.default_rng(seed))
    return replace(
        flight, observations=None, broadcast=None, precise=None, antennas=flight.antennas[:1]
    )


def circling():
    """One antenna's observations, and a gyroscope, in a steady turn."""
    demo, other = (load_scenario(SCENARIOS / f"{n}.toml") for n in ("demo", "surroundings"))
    rng, change = np.random.default_rng([92, 5083]), msgspec.structs.replace
    size_deg, speed_mps = rng.uniform(8.0, 25.0), rng.uniform(30.0, 100.0)
    path = Arc(speed_mps=speed_mps, radius_m=rng.uniform(4.0, 10.0) * speed_mps)
    swings = {
        "pitch": Sine(amplitude_deg=size_deg, phase_deg=rng.uniform(0.0, 180.0)),
        "yaw": Sine(amplitude_deg=size_deg, phase_deg=rng.uniform(0.0, 180.0)),
    }
    scenario = change(
        demo,
        duration_s=20.0,
        motion=Motion(path=path, roll=Sine(amplitude_deg=size_deg), **swings),
        antennas_b_m=((0.3, 0.0, -0.2),),
        gnss=change(demo.gnss, rate_hz=5.0),
        imu=other.imu,
    )
    return simulate(scenario, rng)


@pytest.fixture(scope="module")
def flight():
    return with_fixes()


def prepared(flight):
    return with_identified_noise(flight, SETTINGS, build_problem(flight, SETTINGS), build_problem)


def found_in(flight):
    return identify(ThinnedFlight.of(flight, build_problem(flight, SETTINGS), ()))


def test_the_score_is_the_slope_of_the_likelihood(flight):
    small = thinned(build_problem(flight, SETTINGS).problem)
    states = solve_batch(small).states
    chain = LinearChain.of(small, states, small.motion.noise_parts(), ("position", "velocity"))
    theta = np.array([0.3, -0.2, 0.4, 0.1, -0.3, 0.2])
    gradient = chain.score(theta).gradient
    for c in range(len(theta)):
        step = 1e-4 * np.eye(len(theta))[c]
        up, down = (chain.score(theta + s, whole=False).log_likelihood for s in (step, -step))
        assert gradient[c] == pytest.approx((up - down) / 2e-4, rel=1e-4, abs=1e-3)


def test_noises_of_the_whitened_rows_add_up_to_them(flight):
    motion = thinned(build_problem(flight, SETTINGS).problem).motion
    divided = motion.noise_parts()
    total = divided.parts.sum(axis=1) + divided.rest
    # The parts are of a few samples of an interval: its turns cost some per cent.
    np.testing.assert_allclose(total, np.broadcast_to(np.eye(15), total.shape), atol=0.15)


def test_what_is_stated_rightly_is_not_contradicted(flight):
    problem = prepared(flight)
    assert not any("used instead" in note for note in problem.notes)
    assert problem.problem.constants.width == 0


@pytest.mark.parametrize("wrong", [3.0, 1 / 3])
@pytest.mark.parametrize("name", ["position", "velocity", "gyroscope"])
def test_a_wrong_noise_is_named_with_its_factor(flight, name, wrong):
    changed = flight
    if name == "gyroscope":
        noise = GYROSCOPE_RADPS_PER_SQRT_HZ * wrong
        changed = replace(flight, imu=replace(flight.imu, gyroscope_noise_radps_per_sqrt_hz=noise))
    else:
        field = "position_sigma_m" if name == "position" else "velocity_sigma_mps"
        sigma = getattr(flight.fixes, field) * wrong
        changed = replace(flight, fixes=replace(flight.fixes, **{field: sigma}))
    found = found_in(changed)
    assert list(found.factors) == [name]
    assert found.factors[name] == pytest.approx(1 / wrong, rel=0.4)  # 200 s: sigma .2 at most


def test_noise_that_nobody_states_is_identified():
    flight = with_fixes(span_s=60.0)
    stated = dict.fromkeys(usual_noise.IMU)
    imu = replace(flight.imu, **usual_noise.imu_noise(stated, gyroscope=True))
    n = len(flight.fixes.t_s)
    fixes = replace(
        flight.fixes,
        unstated=("position", "velocity"),
        position_sigma_m=np.tile(usual_noise.POSITION_SIGMA_M, (n, 1)),
        velocity_sigma_mps=np.tile(usual_noise.VELOCITY_SIGMA_MPS, (n, 1)),
    )
    silent = replace(flight, imu=imu, fixes=fixes)
    problem = prepared(silent)
    assert any("Gyroscope noise in motion, not stated" in note for note in problem.notes)
    ratio = problem.imu.gyroscope_noise_radps_per_sqrt_hz / GYROSCOPE_RADPS_PER_SQRT_HZ
    assert 0.5 < ratio < 2.0
    estimate = Batch(resolver=Truth(), solver="chain").estimate_prepared(silent, problem)
    # Of 3; the mean of one short flight whose heading errs slowly.
    assert 1.0 < nees(errors_rad(silent, estimate), estimate.attitude_covariance_rad2) < 7.0


def test_late_velocities_are_found_named_and_estimated():
    flight = with_fixes(span_s=60.0)
    delay_s, truth, rng = 0.12, flight.truth, np.random.default_rng(20_002)
    late = interpolate(flight.fixes.t_s - delay_s, truth.t_s, truth.v_n_mps)
    late += 0.05 * rng.normal(size=late.shape)
    changed = replace(flight, fixes=replace(flight.fixes, v_n_mps=late))
    estimate = Batch(resolver=Truth(), solver="chain")(changed)
    assert any(note.startswith("Velocities of fixes are 0.1") for note in estimate.notes)
    constant = next(one for one in estimate.constants if one.name == "velocity delay")
    assert abs(constant.value[0] - delay_s) < 0.006
    assert nees(errors_rad(changed, estimate), estimate.attitude_covariance_rad2) < 9.0


def test_a_lever_arm_that_is_off_is_found_named_and_estimated():
    flight, off_b_m = with_fixes(20_003, 60.0), np.array([0.1, -0.05, -0.25])
    stated = replace(flight.antennas[0], position_b_m=flight.antennas[0].position_b_m - off_b_m)
    changed = replace(flight, antennas=(stated,))
    estimate = Batch(resolver=Truth(), solver="chain")(changed)
    assert any(note.startswith("The antenna is off where flight.toml") for note in estimate.notes)
    arm = next(one for one in estimate.constants if one.name == "lever-arm")
    apart = arm.value - off_b_m
    assert apart @ np.linalg.solve(arm.covariance, apart) < 16.3  # of 3, 1 in 1,000
    assert nees(errors_rad(changed, estimate), estimate.attitude_covariance_rad2) < 9.0


def test_a_noise_that_is_no_likelier_than_the_stated_is_not_believed():
    """A search begun above the stated ends where the likelihood has another, lesser maximum."""
    found = found_in(with_fixes(20_003, 60.0))
    assert not found.used.any()


def test_a_clock_off_by_more_than_a_swing_is_found_before_anything_is_aligned():
    flight = standing(20_009, span_s=90.0)
    late = replace(flight, imu=replace(flight.imu, t_s=flight.imu.t_s + 1.2))
    estimate = Batch(solver="chain")(late)
    clock = next(one for one in estimate.constants if one.name == "clock offset")
    assert abs(clock.value[0] + 1.2) < 4 * np.sqrt(clock.covariance[0, 0])
    assert nees(errors_rad(late, estimate), estimate.attitude_covariance_rad2) < 9.0


def test_noises_that_undo_each_other_end_the_search(flight, monkeypatch):
    """Of a likelihood that asks for more where there is less, and for less where there is more."""
    found_by = noise_search._free

    def contrary(chain, begin, is_stated):
        return found_by(chain, begin, is_stated)._replace(theta=np.where(begin > 0, -2.0, 2.0))

    monkeypatch.setattr(noise_search, "_free", contrary)
    monkeypatch.setattr(noise_search, "_ROUNDS", 3)
    with pytest.raises(NoSolutionError, match="another at every linearisation"):
        found_in(unstated(flight))


def unstated(flight):
    return replace(flight, imu=replace(flight.imu, unstated=tuple(FIELDS.values())))


def test_a_clock_about_which_full_steps_go_to_and_fro_is_tested_all_the_same():
    """Of one antenna's Doppler the clock's offset leaps between two places, .06 s apart."""
    flight, by_b_m = circling(), np.array([0.0, -0.08, 0.08])
    assert not [note for note in prepared(flight).notes if "could not be tested" in note]
    (antenna,) = flight.antennas
    moved = replace(antenna, position_b_m=antenna.position_b_m + by_b_m)
    notes = prepared(replace(flight, antennas=(moved,))).notes
    assert [note for note in notes if note.startswith("The antenna is off where")]


def test_what_exceeds_a_unit_s_own_samples_is_no_noise_however_little_is_stated(flight):
    said = found_in(flight)
    louder = replace(
        said,
        factor=np.full(len(said.names), 3.0),
        sigma=np.full(len(said.names), 0.1),
        greatest=np.array([1.0, 2.5, *[np.inf] * (len(said.names) - 2)]),
        used=np.ones(len(said.names), dtype=np.bool_),
        stated=np.ones(len(said.names), dtype=np.bool_),
    )
    assert list(louder.beyond_noise) == [said.names[0]]  # 3 beside 2.5 is within a factor of 1.5
