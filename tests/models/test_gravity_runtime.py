"""The released gravity networks as factors, on flights of the world they know and of others."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.evaluation.networks import calibration
from fgnav.graph.custom import touched_keyframes
from fgnav.graph.keys import Timeline, constant
from fgnav.gravity import LowDynamics
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods import Options, method_named
from fgnav.methods.smoother import Smoother
from fgnav.neural import NeuralFactor
from fgnav_models.runtime.factors import manifest
from fgnav_sim.data_sets.gravity import PHASES, gravity_flight
from fgnav_sim.data_sets.gravity_world import GravityWorld, WindowsTable
from fgnav_sim.motion import Arc, Motion, Rate, Straight
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario, load_scenario
from fgnav_sim.simulate import simulate

NAMES = ("gravity", "gravity-accelerometer")
CRUISE = Motion(path=Straight(speed_mps=90.0))
TURN = Motion(path=Arc(speed_mps=90.0, radius_m=800.0), yaw=Rate(rate_degps=np.degrees(90 / 800)))
BANKED = Motion(
    path=TURN.path, yaw=TURN.yaw, roll=Rate(rate_degps=0.0, start_deg=45.9)
)  # arctan(90²/800/9.81)


def flown(motion=CRUISE, *, seed=1, imu=None, **fixes):
    """Return twenty seconds of flight with an accelerometer and fixes."""
    scenario = Scenario(
        duration_s=20.0,
        motion=motion,
        imu=imu or ImuTable(),
        fixes=FixesTable(**{"rate_hz": 10.0, **fixes}),
    )
    return simulate(scenario, np.random.default_rng(seed))


def of_scenario(name, count):
    """Return flights of a shipped scenario, none of which has taught anything, with fixes."""
    fixes = FixesTable(rate_hz=10.0)
    scenario = msgspec.structs.replace(load_scenario(name), gnss=None, fixes=fixes)
    rngs = np.random.default_rng(77).spawn(count)
    return [simulate(scenario, rng) for rng in rngs]


def calibrated(name, flights):
    return calibration([NeuralFactor(manifest(name))] * len(flights), flights)


def asked(flight, name="gravity", **options):
    """Return what a network's source makes of a flight."""
    source = NeuralFactor(manifest(name), **options)
    t_s = flight.fixes[0].t_s
    keys = tuple(map(constant, range(len(source.constants))))
    return source, source(flight, Timeline(t_s=t_s, gyroscope=False, constants=keys))


def fivefold(flight):
    """Return a flight whose accelerometer measures five times too much."""
    return replace(flight, imu=replace(flight.imu, f_b_mps2=5 * flight.imu.f_b_mps2))


def reasons(made):
    return " | ".join(loss.reason for loss in made.unused)


@pytest.fixture(scope="module")
def unseen():
    """Return twenty flights of each kind that has air, none of which has taught anything."""
    kinds = [kind for kind in PHASES if kind != "vacuum"]
    rngs = np.random.default_rng(20_261).spawn(20 * len(kinds))
    world = GravityWorld(windows=WindowsTable(flight_s=24.0))
    return [gravity_flight(world, kinds[k % len(kinds)], rng=rng) for k, rng in enumerate(rngs)]


@pytest.mark.parametrize("name", NAMES)
def test_on_unseen_flights_of_all_kinds_the_covariance_is_that_of_the_errors(name, unseen):
    found = calibrated(name, unseen)
    assert 0.8 <= found.network.nees <= 1.3
    assert found.network.nll < found.constant.nll - 0.5


@pytest.mark.parametrize("name", ["rocket", "glider"])
def test_bodies_that_fly_by_themselves_are_answered_honestly(name):
    found = calibrated("gravity", of_scenario(name, 10))
    assert 0.6 <= found.network.nees <= 1.5  # of ten flights, whose errors last
    assert found.network.nll < found.constant.nll
    assert found.count > found.outside


def test_gravity_is_right_to_a_degree_in_a_level_turn():
    found = calibrated("gravity", [flown(BANKED, seed=k) for k in range(4)])
    errors = np.array([one.rms for one in found.bins])
    assert np.degrees(np.sqrt(2 * (errors**2).mean())) < 1.3


def test_without_velocities_a_turn_is_known_by_a_wide_covariance():
    source, made = asked(flown(BANKED), "gravity-accelerometer")
    assert not made.factors
    assert "stated sigma rad outside" in reasons(made)
    _, made = asked(flown(CRUISE), "gravity-accelerometer")
    assert made.factors
    assert source.name == "gravity-accelerometer"


@pytest.mark.parametrize(
    ("flight", "reason"),
    [
        (lambda: flown(Motion(path=Straight(speed_mps=900.0))), "horizontal speed mps outside"),
        (lambda: flown(Motion(path=Straight(climb_mps=500.0))), "upward speed mps outside"),
        (lambda: fivefold(flown(TURN)), "accelerometer less velocities mps2 outside"),
    ],
)
def test_outside_its_domain_there_is_no_answer_but_a_loss(flight, reason):
    _, made = asked(flight())
    assert len(made.factors) < 5
    assert reason in reasons(made)


def test_other_rates_and_missing_sensors_are_refused_by_name():
    flight = flown()
    bare = replace(flight.fixes[0], v_n_mps=None, velocity_sigma_mps=None)
    for wrong, text in (
        (flown(rate_hz=1.0), "rate_hz"),
        (flown(imu=ImuTable(rate_hz=50.0)), "rate_hz"),
        (replace(flight, fixes=(bare,)), "has no 'velocity'"),
    ):
        with pytest.raises(BadInputError, match=text):
            asked(wrong)


def test_answers_stand_two_half_lives_apart_and_share_what_lasts():
    """Windows end at keyframes and hold nothing later: filters and streams may have them."""
    flight = flown(TURN, velocity_noise_mps=0.05)
    source, made = asked(flight)
    assert [one.name for one in source.constants] == ["lasting error of gravity"]
    assert "their errors are alike" in reasons(made)
    rows = [touched_keyframes(one.factor)[-1] for one in made.factors]
    assert np.diff(flight.fixes[0].t_s[rows]).min() >= source.between_s - 1e-6
    assert all(constant(0) in one.factor.keys() for one in made.factors)  # noqa: SIM118  # no dict
    assert sum(loss.count for loss in made.unused) + len(rows) == len(flight.fixes[0].t_s)


def test_the_smoother_of_a_flight_without_phase_keeps_its_tilt():
    flight = flown(BANKED)
    estimate = Smoother(factors=(str(manifest("gravity")),), noise="nominal")(flight)
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    sine = np.linalg.norm(np.cross(estimate.R_nb[:, 2], flight.truth.R_nb[row, 2]), axis=1)
    assert np.degrees(np.sqrt(np.mean(sine**2))) < 2.5
    assert any("their errors are alike" in loss.reason for loss in estimate.unused)


def test_only_methods_that_use_gravity_are_given_it():
    estimator = LowDynamics()
    options = Options(gravity=estimator)
    assert method_named("smoother", Truth(), options).gravity is estimator
    assert method_named("batch", Truth()).gravity is None
    assert method_named("closed-form", Truth(), options).gravity is estimator
    assert method_named("rtk", Truth(), options).name == "rtk"


def test_the_command_refuses_gravity_that_no_method_uses(capsys):
    assert main(["compare", "nowhere", "--method", "rtk", "--gravity", "low-dynamics"]) == 2
    assert (
        "--gravity: only closed-form, closed-form-weighted, smoother, forward, batch use it"
        in capsys.readouterr().err
    )
