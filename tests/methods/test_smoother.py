"""The smoother on simulated and real flights: errors, and what it states of them."""

import dataclasses
from functools import cache

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.evaluation.span import within
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import log, transpose
from fgnav.gnss.single_point.solution import code_solution
from fgnav.integers.resolvers.truth import Truth, attitude_at
from fgnav.methods.maximum_likelihood import MaximumLikelihood
from fgnav.methods.smoother import Batch, Smoother
from tests.benchmarks import consistency
from tests.methods.simulated import errors_rad, euler_rmse_deg, flown, nees, shared
from tests.methods.test_maximum_likelihood import Off
from tests.recordings import uav, uav_field

RIGHT = Truth()


@pytest.mark.parametrize("scenario", ["demo", "ramp", "spin", "approach"])
@pytest.mark.parametrize("method", [Smoother(resolver=RIGHT), Batch(resolver=RIGHT)])
def test_every_motion_is_smoothed_with_a_believable_covariance(scenario, method):
    flight = flown(scenario, 30.0)
    estimate = shared(method, flight)
    assert estimate.converged
    assert estimate.available == 1
    single = euler_rmse_deg(flight, MaximumLikelihood(resolver=RIGHT)(flight))
    assert (euler_rmse_deg(flight, estimate) < 0.9 * single).all()
    # Errors last for seconds: thirty of them are ten samples of a mean of three.
    assert 0.8 < nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 4.5
    truth = flight.truth
    place = interpolate(estimate.t_s, truth.t_s, truth.p_n_m)
    error = estimate.p_n_m - place  # nearly the same all along a flight: a sample of chi-square
    nees_of_position = np.einsum(
        "ni,nij,nj->n", error, np.linalg.inv(estimate.position_covariance_m2), error
    )
    assert np.median(nees_of_position) < 16.3  # of three at 99.9 %
    speed = interpolate(estimate.t_s, truth.t_s, truth.v_n_mps)
    assert np.sqrt(((estimate.v_n_mps - speed) ** 2).sum(axis=1).mean()) < 0.05


def test_an_accelerometer_off_the_origin_gives_the_origin_all_the_same():
    arm = (0.3, -0.1, 0.2)
    flight = flown("demo", 30.0, imu_position_b_m=arm)
    estimate = Batch(resolver=RIGHT)(flight)
    assert estimate.converged
    place = interpolate(estimate.t_s, flight.truth.t_s, flight.truth.p_n_m)
    # Without the lever arm the error would turn with the body, 0.37 m long; satellites' stay.
    error = estimate.p_n_m - place
    assert np.sqrt(((error - error.mean(axis=0)) ** 2).sum(axis=1).mean()) < 0.2
    assert (euler_rmse_deg(flight, estimate) < [0.30, 0.15, 0.08]).all()


def test_the_line_of_sight_sharpens_the_attitude():
    flight = within(flown("approach", 60.0), 40.0, None)
    with_sight, without = (
        Batch(resolver=RIGHT)(f) for f in (flight, dataclasses.replace(flight, photodetector=None))
    )
    last = with_sight.t_s > flight.photodetector.t_s[0]
    sigma = [
        np.sqrt(np.einsum("nii->ni", e.attitude_covariance_rad2[last]).mean(axis=0))
        for e in (with_sight, without)
    ]
    assert (sigma[0][1:] < sigma[1][1:]).all()
    error = errors_rad(flight, with_sight)[last]
    assert nees(error, with_sight.attitude_covariance_rad2[last]) < 4


def test_epochs_with_wrong_integers_cost_nothing():
    flight = flown("demo", 20.0)
    estimate = Batch(resolver=Off(epochs=(50, 51, 52)))(flight)
    assert estimate.available == 1
    assert (euler_rmse_deg(flight, estimate) < [0.30, 0.15, 0.08]).all()
    corrected = [one for one in estimate.rejections if "mended by its arc" in one.reason]
    assert corrected
    assert {(one.what, one.from_s, one.until_s) for one in corrected} == {("phase", 5.0, 5.2)}
    assert not any("chi-square" in loss.reason for loss in estimate.unused)


def test_an_inertial_record_of_two_samples_bridges_its_hole_with_phase_alone():
    """What it says is wrong by all of gravity: the attitude must not believe it."""
    flight = flown("demo", 5.0)
    ends = flight.imu.t_s[[0, -1]]
    empty = dataclasses.replace(flight.imu, t_s=ends, f_b_mps2=np.zeros((2, 3)))
    estimate = Batch(resolver=RIGHT)(dataclasses.replace(flight, imu=empty))
    assert f"No inertial samples from 0.00 to {ends[1]:.2f} s." in estimate.notes
    single = euler_rmse_deg(flight, MaximumLikelihood(resolver=RIGHT)(flight))
    assert (euler_rmse_deg(flight, estimate) < 1.1 * single).all()


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Smoother(lag_s=0.0), "smoother lag_s: must be positive"),
        (lambda: Batch(sub_steps=0), "batch sub_steps: must be 1 or more"),
        (lambda: Batch(false_alarm=-1.0), "batch false_alarm: must be positive"),
        (lambda: Batch(calibrate=("landmrk",)), "calibrate: 'landmrk' is none of"),
    ],
)
def test_settings_that_mean_nothing_are_refused(make, text):
    with pytest.raises(BadInputError, match=text):
        make()


def test_same_flight_same_bytes():
    flight = flown("demo", 5.0)
    first, second = (Smoother(resolver=RIGHT)(flight) for _ in range(2))
    assert first.R_nb.tobytes() == second.R_nb.tobytes()
    assert first.position_covariance_m2.tobytes() == second.position_covariance_m2.tobytes()


@cache
def of_two_antennas(flight):
    """The same flight with its first antenna and the one a metre ahead of it."""
    keep = [0, 3]
    seen = flight.observations
    per_antenna = ("tag_s", "code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags")
    observations = dataclasses.replace(
        seen, **{name: getattr(seen, name)[:, keep] for name in per_antenna}
    )
    antennas = tuple(flight.antennas[k] for k in keep)
    return dataclasses.replace(flight, observations=observations, antennas=antennas)


def test_one_baseline_and_an_accelerometer_give_all_three_angles():
    """What phase leaves open, roll, gravity tells through the accelerometer."""
    flight = of_two_antennas(flown("demo", 30.0))
    single = MaximumLikelihood(resolver=RIGHT)(flight)
    assert single.unobservable == ("roll",)
    estimate = Batch(resolver=RIGHT)(flight)
    assert estimate.converged
    assert (euler_rmse_deg(flight, estimate) < [0.5, 0.3, 0.2]).all()
    assert nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 5


@pytest.mark.parametrize("method", [Smoother(resolver=RIGHT), Batch(resolver=RIGHT)])
def test_a_spin_is_followed_with_one_baseline(method):
    """Other vectors say where to start: a body at rest would be a turn away after a second."""
    flight = of_two_antennas(flown("spin", 20.0))
    estimate = shared(method, flight)
    assert estimate.converged
    assert (euler_rmse_deg(flight, estimate) < [0.1, 0.1, 0.1]).all()
    assert nees(errors_rad(flight, estimate), estimate.attitude_covariance_rad2) < 5


def test_errors_of_messages_do_not_keep_positions_from_phase():
    """Metres that stay with a satellite's code: its arcs have a constant for them."""
    flight = consistency.flown("a20", 3)
    estimate = Batch(resolver=RIGHT, noise="nominal")(flight)
    by_phase, by_code = (
        one.p_n_m - interpolate(one.t_s, flight.truth.t_s, flight.truth.p_n_m)
        for one in (estimate, code_solution(flight))
    )
    assert np.linalg.norm(by_phase.mean(axis=0)) > 1.0
    moved_m = [np.sqrt(np.nanvar(error, axis=0).sum()) for error in (by_phase, by_code)]
    assert moved_m[0] < 0.1 * moved_m[1]  # measured .03 and .59
    P = estimate.position_covariance_m2
    assert np.median(np.einsum("ni,nij,nj->n", by_phase, np.linalg.inv(P), by_phase)) < 16.3


@pytest.fixture(scope="module")
def real_flight(shared):
    """Return a minute and a half on the ground and four minutes in the air."""
    return within(uav(shared), 110.0, 400.0)


@pytest.fixture(scope="module")
def uav_by_window(real_flight):
    return real_flight, shared(Smoother(), real_flight)


def test_the_window_follows_a_real_flight_with_its_gyroscope(uav_by_window):
    """Against the filter on board, which saw the same data; on the ground nothing tells heading."""
    flight, estimate = uav_by_window
    assert estimate.converged
    R_nb, covered = attitude_at(flight.truth, estimate.t_s)
    airborne = covered & (np.linalg.norm(estimate.v_n_mps, axis=1) > 8)
    assert airborne.sum() > 2000
    gap = np.degrees(log(transpose(estimate.R_nb) @ R_nb)[airborne])
    assert (np.sqrt((gap**2).mean(axis=0)) < [2.0, 2.0, 6.0]).all()


def test_the_magnetometer_that_neither_uses_is_nearer_to_the_window_than_to_the_reference(
    uav_by_window, shared
):
    """In the air by what is left of the field; at rest the reference's heading is off."""
    flight, estimate = uav_by_window
    R_ref, covered = attitude_at(flight.truth, estimate.t_s)
    field = uav_field(shared, estimate.t_s)
    flown = covered & (estimate.t_s > 260.0)  # the reference has settled
    ours, theirs = (_calibrated(R[flown], field[flown]) for R in (estimate.R_nb, R_ref))
    assert ours[2] < theirs[2]
    K, c, _ = ours
    standing = covered & (estimate.t_s < 160.0)
    off = {}
    for name, R_nb in (("ours", estimate.R_nb), ("theirs", R_ref)):
        north = np.einsum("nij,nj->ni", R_nb, field @ K.T - c)
        declination = np.median(np.arctan2(north[flown, 1], north[flown, 0]))
        away = np.arctan2(north[standing, 1], north[standing, 0]) - declination
        off[name] = np.abs(np.degrees(np.angle(np.exp(1j * away).mean())))
    sigma_deg = np.degrees(np.sqrt(estimate.attitude_covariance_rad2[standing, 2, 2].mean()))
    assert off["ours"] < 3 * sigma_deg
    assert off["theirs"] > 2 * off["ours"]


def _calibrated(R_nb, field):
    """Return K, c that make ``R (K h - c)`` one vector, and what is left, as a share of it."""
    n = len(field)
    # Unknowns: all but the first of K, c, the vector.
    A = np.zeros((n, 3, 15))
    for i in range(3):
        A[:, :, 3 * i : 3 * i + 3] = R_nb[:, :, i, None] * field[:, None, :]
    A[:, :, 9:12], A[:, :, 12:] = -R_nb, -np.eye(3)
    A = A.reshape(-1, 15)
    x = np.linalg.lstsq(A[:, 1:], -A[:, 0])[0]
    full = np.concatenate([[1.0], x])
    left = np.sqrt(((A @ full) ** 2).mean()) / np.linalg.norm(full[12:])
    return full[:9].reshape(3, 3), full[9:12], left
