"""The released gravity networks, on flights of the world they know and of others."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.cli import main
from fgnav.graph.custom import newest_keyframe
from fgnav.graph.keys import Timeline
from fgnav.gravity import gravity_named
from fgnav.integers.resolvers.truth import Truth
from fgnav.methods import method_named
from fgnav.methods.smoother import Forward, Smoother
from fgnav.neural import NeuralFactor
from fgnav_models.gravity_features import course_motion
from fgnav_models.runtime.factors import gravity, manifest
from fgnav_models.runtime.gravity import AccelerometerGravity, NetworkGravity, answers
from fgnav_models.runtime.load import load
from fgnav_sim.data_sets.gravity import gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld, WindowsTable
from fgnav_sim.motion import Arc, Motion, Rate, Straight
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario
from fgnav_sim.simulate import simulate

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


def error_deg(told, flight):
    """Return the angles to the true down at the answers' times."""
    row = np.searchsorted(flight.truth.t_s, told.t_s - 0.051).clip(max=len(flight.truth.t_s) - 1)
    down_b = flight.truth.R_nb[row, 2]
    return np.degrees(np.linalg.norm(np.cross(told.g_b, down_b), axis=1))


def reasons(told):
    return " | ".join(loss.reason for loss in told.losses)


@pytest.fixture(scope="module")
def unseen():
    """Return windows of 3000 flights: errors of one flight are alike, so few windows of each."""
    world = GravityWorld(windows=WindowsTable(per_flight=2))
    return gravity_epochs(world, np.random.default_rng(20_261), 6000)


@pytest.mark.parametrize("name", ["gravity", "gravity-accelerometer"])
def test_on_unseen_flights_the_mean_normalised_square_is_two(name, unseen):
    motion = course_motion(unseen.v_n_mps, unseen.a_n_mps2) if name == "gravity" else None
    g_b, covariance = answers(load(name), unseen.f_b_mps2, motion)
    apart = unseen.g_b - np.einsum("ni,ni->n", g_b, unseen.g_b)[:, None] * g_b
    sine = np.linalg.norm(apart, axis=1)
    angle = np.arctan2(sine, np.einsum("ni,ni->n", g_b, unseen.g_b))
    error = apart * (angle / sine)[:, None]
    nees = np.einsum("ni,nij,nj->n", error, np.linalg.pinv(covariance, rcond=1e-9), error)
    assert 1.8 <= nees.mean() <= 2.2


def test_with_velocities_down_is_known_in_level_flight_and_in_a_banked_turn():
    for motion in (CRUISE, BANKED):
        flight = flown(motion)
        told = NetworkGravity(interval_s=0.1)(flight)
        assert len(told.t_s) > 190
        assert np.sqrt(np.mean(error_deg(told, flight) ** 2)) < 3.0


def test_without_velocities_a_turn_is_told_by_a_wide_covariance():
    wide, narrow = (
        np.einsum("nii->n", AccelerometerGravity()(flown(motion)).covariance).min()
        for motion in (BANKED, CRUISE)
    )
    assert np.degrees(np.sqrt(wide)) > 20
    assert np.degrees(np.sqrt(narrow)) < 10


def test_answers_are_as_far_apart_as_their_errors_are_independent():
    flight = flown()
    told = NetworkGravity()(flight)
    wait_s = load("gravity").manifest.domain["independent_after_s"]
    assert np.median(np.diff(told.t_s)) == pytest.approx(wait_s, abs=0.051)
    assert "their errors are alike" in reasons(told)
    assert sum(loss.count for loss in told.losses) + len(told.t_s) == 198


@pytest.mark.parametrize(
    ("flight", "reason"),
    [
        (lambda: flown(Motion(path=Straight(speed_mps=600.0))), "horizontal speed mps outside"),
        (lambda: flown(Motion(path=Straight(climb_mps=300.0))), "upward speed mps outside"),
        (lambda: flown(rate_hz=1.0), "velocities before and after are not 0.2 s apart"),
        (lambda: flown(velocity_noise_mps=0.5), "velocities are noisier than 0.06 m/s"),
        (lambda: flown(imu=ImuTable(rate_hz=50.0)), "has no 10 samples, 0.01 s apart or less"),
        (
            lambda: flown(imu=ImuTable(position_b_m=(0.5, 0.0, 0.0))),
            "of an antenna 0.5 m from the accelerometer",
        ),
    ],
)
def test_outside_its_domain_there_is_no_answer_but_a_loss(flight, reason):
    told = NetworkGravity()(flight())
    assert len(told.t_s) == 0
    assert reason in reasons(told)


def test_a_flight_without_accelerometer_or_velocities_is_refused():
    flight = flown()
    with pytest.raises(BadInputError, match=r"network gravity needs an \[imu\]"):
        NetworkGravity()(replace(flight, imu=None))
    fixes = replace(flight.fixes, v_n_mps=None, velocity_sigma_mps=None)
    for bare in (None, fixes):
        with pytest.raises(BadInputError, match="needs velocities, of Doppler or of fixes"):
            NetworkGravity()(replace(flight, fixes=bare))
    assert len(AccelerometerGravity()(replace(flight, fixes=None)).t_s)


def test_an_interval_is_positive():
    with pytest.raises(BadInputError, match="network gravity interval_s: must be positive"):
        NetworkGravity(interval_s=0.0)


def test_installed_networks_are_found_by_name():
    assert gravity_named("network-accelerometer").network == "gravity-accelerometer"
    with pytest.raises(
        BadInputError, match="gravity estimator 'up': not one of low-dynamics"
    ) as refused:
        gravity_named("up")
    assert "network, network-accelerometer" in str(refused.value)


def test_only_methods_that_use_gravity_are_given_it():
    network = NetworkGravity()
    assert method_named("smoother", Truth(), network).gravity is network
    assert method_named("batch", Truth()).gravity is None
    assert method_named("rtk", Truth(), network).name == "rtk"


def test_the_command_refuses_gravity_that_no_method_uses(capsys):
    assert main(["compare", "nowhere", "--method", "rtk", "--gravity", "low-dynamics"]) == 2
    assert "--gravity: only smoother, forward, batch, gtsam use it" in capsys.readouterr().err


def test_the_smoother_of_a_flight_without_phase_keeps_its_tilt():
    flight = flown(BANKED)
    estimate = Smoother(gravity=NetworkGravity())(flight)
    row = np.searchsorted(flight.truth.t_s, estimate.t_s - 1e-6)
    sine = np.linalg.norm(np.cross(estimate.R_nb[:, 2], flight.truth.R_nb[row, 2]), axis=1)
    assert np.degrees(np.sqrt(np.mean(sine**2))) < 2.5
    assert any("their errors are alike" in loss.reason for loss in estimate.losses)


def test_gravity_is_a_factor_for_filters_too():
    """Its windows end at keyframes: what `--gravity network` refuses, it does."""
    flight = flown(TURN, velocity_noise_mps=0.05)
    with pytest.raises(BadInputError, match="its answers depend on what comes after them"):
        Forward(gravity=NetworkGravity())(flight)
    source = NeuralFactor(manifest("gravity-factor"))
    timeline = Timeline(t_s=flight.fixes.t_s, gyroscope=False)
    made = source(flight, timeline)
    named = gravity(flight, timeline)
    assert len(made.factors) == len(named.factors) > 2
    assert made.losses == named.losses
    assert any("within" in loss.reason for loss in made.losses)
    apart_s = np.diff([flight.fixes.t_s[newest_keyframe(one)] for one in made.factors])
    assert apart_s.min() >= source.between_s - 1e-6
    noisy = replace(flight, imu=replace(flight.imu, f_b_mps2=3 * flight.imu.f_b_mps2))
    lost = source(noisy, timeline)
    assert not lost.factors
    assert "the network's training domain" in reasons(lost)
