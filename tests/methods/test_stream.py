"""The window fed epoch by epoch: what it estimates, and what it turns away."""

import dataclasses

import numpy as np
import pytest

from fgnav.assembly.calibration_request import (
    calibration_requests,
    mean_rate,
    with_landmark,
)
from fgnav.assembly.sensors.instruments import gravity_sensor, line_of_sight
from fgnav.assembly.sensors.surroundings import field_sensor, height_sensor
from fgnav.checks import BadInputError
from fgnav.geometry.earth import geodetic
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.factors.directions import Directions
from fgnav.graph.types.parameters import Parameters
from fgnav.methods.stream import Direction, Measured, Measurements, Stream, StreamConfig
from fgnav.solve.fixed_lag import solve_fixed_lag
from fgnav.types.surroundings import Barometer, Magnetometer
from tests.assembly.flights import ORIGIN, attitude_errors_rad, turning
from tests.methods.simulated import nees


def stream_of(case, more, lag_s=2.0, **known):
    """Feed a stream, some keyframes with more than the rest; return it and what has left it."""
    imu = case.imu
    config = StreamConfig(
        origin=ORIGIN,
        antenna_b_m=np.zeros(3),
        rate_prior=None if imu.w_b_radps is not None else case.rate_prior,
        **known,
    )
    stream, left = Stream(config, lag_s), []
    for row, t_s in enumerate(case.problem.t_s):
        near = (imu.t_s > t_s - 0.25) & (imu.t_s < t_s + 0.15)
        samples = {"t_s": imu.t_s[near], "f_b_mps2": imu.f_b_mps2[near]}
        if imu.w_b_radps is not None:
            samples["w_b_radps"] = imu.w_b_radps[near]
        measurements = Measurements(
            t_s=float(t_s),
            imu=dataclasses.replace(imu, **samples),
            array=case.form[np.array([row])],
            position=measured(case.position, row),
            velocity=measured(case.velocity, row),
        )
        left.append(stream.update(dataclasses.replace(measurements, **more.get(row, {}))))
    return stream, left


def measured(series, row):
    return Measured(value=series.value[row], covariance=series.covariance[row])


def with_sensors(case, sensors, parts):
    """Return the flight's problem with other instruments and constants."""
    imu = case.imu
    constants = Parameters(parts if imu.w_b_radps is not None else (*parts, mean_rate()))
    motion = case.problem.motion
    if imu.w_b_radps is None:
        motion = dataclasses.replace(motion, constants=constants)
    return dataclasses.replace(
        case.problem,
        start=case.problem.start._replace(constants=constants.start),
        motion=motion,
        sensors=tuple(one.bound(constants) for one in (*case.problem.sensors, *sensors)),
        constants=constants,
    )


COVARIANCE = "attitude_covariance_rad2"


def joined(parts, name):
    return np.concatenate([getattr(part, name) for part in parts])


@pytest.fixture(scope="module")
def case():
    return turning(np.random.default_rng(0), span_s=8.0)


@pytest.mark.parametrize("gyro", [False, True])
def test_a_stream_of_raw_samples_ends_where_the_window_ends(gyro):
    case = turning(np.random.default_rng(0), span_s=8.0, gyro=gyro)
    rows, e_b = np.array([20, 50]), np.array([[0.1, 0.2, 1.0], [-0.1, 0.0, 1.0]])
    e_b /= np.linalg.norm(e_b, axis=1, keepdims=True)
    covariance = np.tile(np.diag([0.01, 0.2, 0.1]) ** 2, (2, 1, 1))
    down = [Direction(e_b=e, covariance=C) for e, C in zip(e_b, covariance, strict=True)]
    more = {row: {"gravity": one} for row, one in zip(rows, down, strict=True)}
    stream, left = stream_of(case, more)
    parts = [part for part in (*left, stream.flush()) if len(part.t_s)]
    t_s = joined(parts, "t_s")
    np.testing.assert_array_equal(t_s, case.problem.t_s)
    seen = Directions.of("gravity", e_b, covariance).scatter(rows, len(t_s))
    gravity = gravity_sensor(seen, case.problem.motion.gravity_n_mps2)
    window = solve_fixed_lag(with_sensors(case, (gravity,), ()), 2.0)
    R_nb, sigma = joined(parts, "R_nb"), np.sqrt(np.einsum("nii->ni", window.covariance))
    apart = log(transpose(R_nb) @ window.states.R_nb) / sigma[:, :3]
    # The curve through few samples is not that through all; and the window of a recording is
    # updated with a second of it at a time.
    assert np.abs(apart[-20:]).max() < 0.1
    apart_m = np.abs(joined(parts, "p_n_m") - window.states.p_n_m).max(axis=1)
    assert (apart_m[-20:] < 0.1 * sigma[-20:, 3:6].max(axis=1)).all()
    assert nees(attitude_errors_rad(R_nb, case.truth), joined(parts, COVARIANCE)) < 5
    newest = stream.latest()
    np.testing.assert_array_equal(newest.R_nb[0], stream.flush().R_nb[-1])
    rate = joined(parts, "angular_rate_b_radps")
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
def test_what_a_keyframe_lacks_is_named(case, change, text):
    config = StreamConfig(origin=ORIGIN, antenna_b_m=np.zeros(3), rate_prior=case.rate_prior)
    first = Measurements(
        t_s=0.0,
        imu=case.imu,
        array=case.form[np.array([0])],
        position=measured(case.position, 0),
    )
    stream = Stream(config)
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


def test_a_stream_estimates_constants_as_the_window_does(surrounded):
    case, e_b, height_m, field_b_ut = surrounded
    n, doubt = len(e_b), SIGHT_RAD**2 * np.eye(3)
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
        calibrate=ASKED,
    )
    listed = {one.name: one for one in stream.latest().calibration}
    assert list(listed) == ["landmark", "boresight", "barometer", "hard iron"]
    truth = {"landmark": OFF_N_M, "boresight": np.zeros(2), "barometer": [HIGH_M]}
    for name, value in {**truth, "hard iron": IRON_B_UT}.items():
        one = listed[name]
        error = one.value - value
        assert error @ np.linalg.solve(one.covariance, error) < 16.3, name  # 99.9 % of three
    assert np.sqrt(np.diag(listed["landmark"].covariance)).max() < 3.0
    assert np.sqrt(listed["barometer"].covariance[0, 0]) < 0.5

    seen, nothing = np.isin(np.arange(n), list(more)), np.full(3, np.nan)
    p_n_m = case.truth.p_n_m
    heights_m = np.where(seen, height_m, np.nan)
    at = BAROMETER, np.zeros(3), ORIGIN, case.problem.t_s, p_n_m
    heights, offset = height_sensor(*at, heights_m)
    field, iron = field_sensor(MAGNETOMETER, np.where(seen[:, None], field_b_ut, nothing))
    sight = line_of_sight(Directions.isotropic(np.where(seen[:, None], e_b, nothing), SIGHT_RAD))
    asked = tuple(part for word in calibration_requests(ASKED) for part in word.parameters())
    parts = (*with_landmark(asked, LANDMARK_N_M), offset, iron)
    window = solve_fixed_lag(with_sensors(case, (sight, heights, field), parts), 2.0)
    left = [part for part in (*left, stream.flush()) if len(part.t_s)]
    R_nb = joined(left, "R_nb")
    sigma = np.sqrt(np.einsum("nii->ni", window.covariance))
    apart = log(transpose(R_nb) @ window.states.R_nb) / sigma[:, :3]
    assert np.abs(apart[-20:]).max() < 0.1
    assert 0.5 < nees(attitude_errors_rad(R_nb, case.truth), joined(left, COVARIANCE)) < 6


@pytest.mark.parametrize(
    ("known", "text"),
    [
        ({"calibrate": ("antennas",)}, "calibrate: antennas cannot be"),
        ({"calibrate": ("boresight",)}, "calibrate: boresight needs a landmark_n_m"),
        (
            {"barometer": dataclasses.replace(BAROMETER, wander_m=2.0)},
            "barometer: wander_m must be 0",
        ),
    ],
)
def test_what_a_stream_cannot_estimate_is_named(case, known, text):
    with pytest.raises(BadInputError, match=text):
        stream_of(case, {}, **known)


@pytest.mark.parametrize("name", ["sight", "height_m", "field_b_ut"])
def test_a_measurement_that_nothing_is_known_of_is_turned_away(case, name):
    value = Direction(e_b=np.array([1.0, 0, 0]), covariance=np.eye(3))
    with pytest.raises(BadInputError, match=f"measurements {name}: the set-up has no"):
        stream_of(case, {0: {name: value}})


def test_without_a_gyroscope_a_stream_needs_a_rate_prior(case):
    stream = Stream(StreamConfig(origin=ORIGIN, antenna_b_m=np.zeros(3)))
    first = Measurements(
        t_s=0.0,
        imu=case.imu,
        array=case.form[np.array([0])],
        position=measured(case.position, 0),
    )
    with pytest.raises(BadInputError, match="stream set-up rate_prior: needed without a gyroscope"):
        stream.update(first)
