"""The window fed epoch by epoch: what it says, what it finds, what it turns away."""

import dataclasses

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.earth import geodetic
from fgnav.methods.smoother import Direction, Measured, Measurements, Stream, StreamSetUp
from fgnav.methods.smoother.constants import asked, of_vehicle
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.surroundings import field_of, heights_of, with_offsets
from fgnav.methods.smoother.window import solve_window
from fgnav.rotations import log, transpose
from fgnav.surroundings import Barometer, Magnetometer
from tests.methods.simulated import nees

from .flights import ORIGIN, attitude_errors_rad, turning


def stream_of(case, more, lag_s=2.0, **known):
    """Feed a stream, some keyframes with more than the rest; return it and what has left it."""
    keyframes = case.keyframes
    imu, pre = keyframes.preintegrate.imu, keyframes.preintegrate
    set_up = StreamSetUp(
        origin=ORIGIN,
        antenna_b_m=np.zeros(3),
        slot_sigma=keyframes.slot_sigma,
        angular_acceleration_density=pre.angular_acceleration_density,
        first_rate_b_radps=-keyframes.slot[0, 3:],
        **known,
    )
    stream, left = Stream(set_up, lag_s), []
    for row, t_s in enumerate(keyframes.t_s):
        near = (imu.t_s > t_s - 0.25) & (imu.t_s < t_s + 0.15)
        samples = {"t_s": imu.t_s[near], "f_b_mps2": imu.f_b_mps2[near]}
        if imu.w_b_radps is not None:
            samples["w_b_radps"] = imu.w_b_radps[near]
        told = {
            name: Measured(value=timed.value[row], covariance=timed.covariance[row])
            for name in ("position", "velocity")
            if (timed := getattr(keyframes, name)) is not None
        }
        array = case.form[np.array([row])]
        samples = dataclasses.replace(imu, **samples)
        measurements = Measurements(t_s=float(t_s), imu=samples, array=array, **told)
        left.append(stream.update(dataclasses.replace(measurements, **more.get(row, {}))))
    return stream, left


@pytest.fixture(scope="module")
def case():
    return turning(np.random.default_rng(0), span_s=8.0)


@pytest.mark.parametrize("gyro", [False, True])
def test_a_stream_of_raw_samples_says_what_the_window_says(gyro):
    case = turning(np.random.default_rng(0), span_s=8.0, gyro=gyro)
    rows, e_b = np.array([20, 50]), np.array([[0.1, 0.2, 1.0], [-0.1, 0.0, 1.0]])
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    covariance = np.tile(np.diag([0.01, 0.2, 0.1]) ** 2, (2, 1, 1))
    told = [Direction(e_b=e, covariance=C) for e, C in zip(e_b, covariance, strict=True)]
    stream, left = stream_of(
        case, {row: {"gravity": one} for row, one in zip(rows, told, strict=True)}
    )
    parts = [part for part in (*left, stream.rest()) if len(part.t_s)]
    t_s = np.concatenate([part.t_s for part in parts])
    np.testing.assert_array_equal(t_s, case.keyframes.t_s)
    gravity = Directions.of("gravity", e_b, covariance).at(rows, len(t_s))
    window = solve_window(dataclasses.replace(case.keyframes, gravity=gravity), 2.0)
    R_nb = np.concatenate([part.R_nb for part in parts])
    sigma = np.sqrt(np.einsum("nii->ni", window.covariance))
    apart = attitude_errors_rad(R_nb, window) / sigma[:, :3]
    assert np.abs(apart).max() < 0.05  # the curve through few samples is not that through all
    p_n_m = np.concatenate([part.p_n_m for part in parts])
    assert (np.abs(p_n_m - window.p_n_m).max(axis=1) < 0.05 * sigma[:, 3:6].max(axis=1)).all()
    newest = stream.newest()
    np.testing.assert_array_equal(newest.R_nb[0], stream.rest().R_nb[-1])
    rate = np.concatenate([part.angular_rate_b_radps for part in parts])
    turn = log(transpose(case.truth.R_nb[:-1]) @ case.truth.R_nb[1:]) / 0.1
    assert np.abs(rate[5:-5] - turn[5:-4]).max() < 0.15


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"t_s": 0.0}, "measurements t_s: must come after"),
        ({"array": None}, "first measurements R_nb: needed where no array"),
        ({"position": None}, "first measurements position: needed"),
    ],
)
def test_a_stream_says_what_a_keyframe_lacks(case, change, text):
    keyframes, imu = case.keyframes, case.keyframes.preintegrate.imu
    set_up = StreamSetUp(
        origin=ORIGIN,
        antenna_b_m=np.zeros(3),
        slot_sigma=keyframes.slot_sigma,
        angular_acceleration_density=keyframes.preintegrate.angular_acceleration_density,
    )
    first = Measurements(
        t_s=0.0,
        imu=imu,
        array=case.form[np.array([0])],
        position=Measured(value=keyframes.p_n_m[0], covariance=np.eye(3)),
    )
    stream = Stream(set_up)
    if "t_s" in change:
        assert not len(stream.update(first).t_s)
    with pytest.raises(BadInputError, match=text):
        stream.update(dataclasses.replace(first, **change))


LANDMARK_N_M, OFF_N_M, HIGH_M = np.array([2000.0, 300.0, 10.0]), np.array([4.0, -6.0, 3.0]), 12.0
IRON_B_UT, FIELD_N_UT, SIGHT_RAD = np.array([2.0, -1.0, 0.5]), np.array([25.8, -0.2, 36.6]), 1e-3
BAROMETER = Barometer(t_s=[0.0], height_m=[0.0], noise_m=0.3, offset_m=20.0)
MAGNETOMETER = Magnetometer(
    t_s=[0.0], field_b_ut=[FIELD_N_UT], field_n_ut=FIELD_N_UT, noise_ut=0.3, hard_iron_ut=3.0
)
ASKED = ("landmark", "boresight=1")


@pytest.fixture(scope="module")
def surrounded():
    """A flight that sees a landmark, and what its other instruments say at each keyframe."""
    rng = np.random.default_rng(5)
    case = turning(rng, span_s=20.0)
    n, R_bn = len(case.truth.t_s), transpose(case.truth.R_nb)
    to_n_m = LANDMARK_N_M + OFF_N_M - case.truth.p_n_m
    e_n = to_n_m / np.linalg.norm(to_n_m, axis=1, keepdims=True)
    e_b = np.einsum("nij,nj->ni", R_bn, e_n) + SIGHT_RAD * rng.standard_normal((n, 3))
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    field_b_ut = np.einsum("nij,j->ni", R_bn, FIELD_N_UT) + IRON_B_UT
    field_b_ut += MAGNETOMETER.noise_ut * rng.standard_normal((n, 3))
    height_m = geodetic(ORIGIN.to_e(case.truth.p_n_m))[:, 2] + HIGH_M
    height_m += BAROMETER.noise_m * rng.standard_normal(n)
    return case, e_b, height_m, field_b_ut


def test_a_stream_estimates_what_stays_as_it_is_as_the_window_does(surrounded):
    case, e_b, height_m, field_b_ut = surrounded
    n, keyframes, doubt = len(e_b), case.keyframes, SIGHT_RAD**2 * np.eye(3)
    sights = [Direction(e_b=e, covariance=doubt) for e in e_b]
    more = {
        row: {"sight": sights[row], "height_m": height_m[row], "field_b_ut": field_b_ut[row]}
        for row in range(n)
        if row % 3  # not every keyframe has one
    }
    stream, left = stream_of(
        case,
        more,
        landmark_n_m=LANDMARK_N_M,
        barometer=BAROMETER,
        magnetometer=MAGNETOMETER,
        estimate=ASKED,
    )
    found = {one.name: one for one in stream.newest().constants}
    assert list(found) == ["landmark", "boresight", "barometer", "hard iron"]
    truth = {"landmark": OFF_N_M, "boresight": np.zeros(2), "barometer": [HIGH_M]}
    for name, value in {**truth, "hard iron": IRON_B_UT}.items():
        one = found[name]
        error = one.value - value
        assert error @ np.linalg.solve(one.covariance, error) < 16.3, name  # 99.9 % of three
    assert np.sqrt(np.diag(found["landmark"].covariance)).max() < 3.0
    assert np.sqrt(found["barometer"].covariance[0, 0]) < 0.5

    told, nothing = np.isin(np.arange(n), list(more)), np.full(3, np.nan)
    heights = heights_of(BAROMETER, np.zeros(3), ORIGIN, keyframes.t_s, case.truth.p_n_m, height_m)
    heights = dataclasses.replace(heights, down_n_m=np.where(told, heights.down_n_m, np.nan))
    field = field_of(MAGNETOMETER, np.where(told[:, None], field_b_ut, nothing))
    sight = Directions.isotropic(np.where(told[:, None], e_b, nothing), SIGHT_RAD)
    constants = tuple(of_vehicle(word) for word in asked(ASKED))
    same = dataclasses.replace(
        keyframes,
        sight=sight,
        landmark_n_m=LANDMARK_N_M,
        heights=heights,
        field=field,
        constants=with_offsets(constants, heights, field),
    )
    window = solve_window(same, 2.0)
    R_nb = np.concatenate([part.R_nb for part in (*left, stream.rest()) if len(part.t_s)])
    sigma = np.sqrt(np.einsum("nii->ni", window.covariance))
    assert np.abs(attitude_errors_rad(R_nb, window) / sigma[:, :3]).max() < 0.1
    error = attitude_errors_rad(R_nb, case.truth)
    P = np.concatenate([p.attitude_covariance_rad2 for p in (*left, stream.rest()) if len(p.t_s)])
    assert 0.5 < nees(error, P) < 6


def test_a_stream_states_the_doubt_of_biases(case):
    stream, left = stream_of(case, {})
    parts = [part for part in left if len(part.t_s)]
    sigma = [part.accelerometer_bias_covariance_m2ps4.trace(axis1=1, axis2=2) for part in parts]
    assert sigma[-1][-1] < 0.5 * sigma[0][0]
    assert stream.newest().gyroscope_bias_radps is None


@pytest.mark.parametrize(
    ("known", "text"),
    [
        ({"estimate": ("antennas",)}, "estimate: antennas cannot be"),
        ({"estimate": ("boresight",)}, "estimate: boresight needs a landmark_n_m"),
        (
            {"barometer": dataclasses.replace(BAROMETER, wander_m=2.0)},
            "barometer: wander_m must be 0",
        ),
    ],
)
def test_a_set_up_says_what_a_stream_cannot_estimate(case, known, text):
    with pytest.raises(BadInputError, match=text):
        stream_of(case, {}, **known)


@pytest.mark.parametrize("name", ["sight", "height_m", "field_b_ut"])
def test_a_measurement_that_nothing_is_known_of_is_turned_away(case, name):
    value = Direction(e_b=np.array([1.0, 0, 0]), covariance=np.eye(3))
    with pytest.raises(BadInputError, match=f"measurements {name}: the set-up has no"):
        stream_of(case, {0: {name: value}})
