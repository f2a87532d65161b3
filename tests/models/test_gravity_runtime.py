"""The released gravity networks as factors, on flights of the world they know and of others."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.graph.custom import newest_keyframe
from fgnav.graph.keys import Timeline, constant
from fgnav.gravity import LowDynamics
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods import method_named
from fgnav.methods.smoother import Smoother
from fgnav.neural import NeuralFactor
from fgnav.neural.network import load_network
from fgnav_models.runtime.factors import manifest
from fgnav_models.training.gravity.features import SPAN_S
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld, WindowsTable
from fgnav_sim.motion import Arc, Motion, Rate, Straight
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario
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


def asked(flight, name="gravity", **options):
    """Return what a network's source makes of a flight."""
    source = NeuralFactor(manifest(name), **options)
    t_s = flight.fixes[0].t_s
    keys = tuple(map(constant, range(len(source.constants))))
    return source, source(flight, Timeline(t_s=t_s, gyroscope=False, constants=keys))


def thrice(flight):
    """Return a flight whose accelerometer measures three times too much."""
    return replace(flight, imu=replace(flight.imu, f_b_mps2=3 * flight.imu.f_b_mps2))


def reasons(made):
    return " | ".join(loss.reason for loss in made.losses)


@pytest.fixture(scope="module", name="unseen")
def windows():
    """Return windows of 3000 flights: errors of one flight are alike, so few windows of each."""
    world = GravityWorld(windows=WindowsTable(per_flight=2), velocity_age_s=0.1)
    return gravity_epochs(world, np.random.default_rng(20_261), 6000)


@pytest.mark.parametrize("name", NAMES)
def test_on_unseen_flights_the_mean_normalised_square_is_two(name, unseen):
    half_mps = unseen.a_n_mps2 * SPAN_S / 2
    v_n_mps = np.stack([unseen.v_n_mps - half_mps, unseen.v_n_mps, unseen.v_n_mps + half_mps], 1)
    network = load_network(manifest(name))
    answers = network([unseen.f_b_mps2, v_n_mps][: len(network.manifest.inputs)])
    g_b = answers.value
    apart = unseen.g_b - np.einsum("ni,ni->n", g_b, unseen.g_b)[:, None] * g_b
    sine = np.linalg.norm(apart, axis=1)
    angle = np.arctan2(sine, np.einsum("ni,ni->n", g_b, unseen.g_b))
    across = np.linalg.svd(g_b[:, None])[2][:, 1:]
    error = np.einsum("nij,nj->ni", across, apart * (angle / sine)[:, None])
    P = across @ answers.covariance @ across.swapaxes(1, 2)
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.inv(P), error)
    assert 1.8 <= nees.mean() <= 2.2


def test_without_velocities_a_turn_is_known_by_a_wide_covariance():
    network = load_network(manifest("gravity-accelerometer"))
    wide, narrow = (
        np.median(
            [
                np.trace(P) / 1.5
                for P in network([flight.imu.f_b_mps2[:1000].reshape(-1, 10, 3)]).covariance
            ]
        )
        for flight in map(flown, (BANKED, CRUISE))
    )
    assert np.degrees(np.sqrt(wide)) > 20
    assert np.degrees(np.sqrt(narrow)) < 10


@pytest.mark.parametrize(
    ("flight", "reason"),
    [
        (lambda: flown(Motion(path=Straight(speed_mps=600.0))), "horizontal speed mps outside"),
        (lambda: flown(Motion(path=Straight(climb_mps=300.0))), "upward speed mps outside"),
        (lambda: thrice(flown(TURN)), "specific force mps2 outside"),
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
    rows = [newest_keyframe(one) for one in made.factors]
    assert np.diff(flight.fixes[0].t_s[rows]).min() >= source.between_s - 1e-6
    assert all(constant(0) in one.factor.keys() for one in made.factors)  # noqa: SIM118  # no dict
    assert sum(loss.count for loss in made.losses) + len(rows) == len(flight.fixes[0].t_s)


def test_the_smoother_of_a_flight_without_phase_keeps_its_tilt():
    flight = flown(BANKED)
    estimate = Smoother(factors=(str(manifest("gravity")),))(flight)
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    sine = np.linalg.norm(np.cross(estimate.R_nb[:, 2], flight.truth.R_nb[row, 2]), axis=1)
    assert np.degrees(np.sqrt(np.mean(sine**2))) < 2.5
    assert any("their errors are alike" in loss.reason for loss in estimate.losses)


def test_only_methods_that_use_gravity_are_given_it():
    estimator = LowDynamics()
    assert method_named("smoother", Truth(), estimator).gravity is estimator
    assert method_named("batch", Truth()).gravity is None
    assert method_named("closed-form", Truth(), estimator).gravity is estimator
    assert method_named("rtk", Truth(), estimator).name == "rtk"


def test_the_command_refuses_gravity_that_no_method_uses(capsys):
    assert main(["compare", "nowhere", "--method", "rtk", "--gravity", "low-dynamics"]) == 2
    assert (
        "--gravity: only closed-form, closed-form-weighted, smoother, forward, batch use it"
        in capsys.readouterr().err
    )
