"""A heading network in every way of estimating: what it gains, and what its covariance promises."""

import dataclasses
from functools import cache

import msgspec
import numpy as np
import pytest

from fgnav.geometry import rotations
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.methods.stream import Measured, Measurements, Stream, StreamConfig
from fgnav.neural import NeuralFactor
from fgnav_sim.scenario import load_scenario
from fgnav_sim.simulate import simulate
from tests.assembly import flights
from tests.methods.simulated import SCENARIOS, errors_rad, euler_rmse_deg, nees
from tests.neural import sun_compass

SPAN_S, SEEDS = 15.0, (1, 2, 3)


@cache
def flown(seed):
    """Return a straight flight of one antenna, which nothing tells the heading."""
    scenario = load_scenario(SCENARIOS / "surroundings.toml")
    changes = {"duration_s": SPAN_S, "barometer": None, "magnetometer": None}
    scenario = msgspec.structs.replace(scenario, **changes)
    return simulate(scenario, np.random.default_rng(seed))


@pytest.fixture(scope="module", name="manifest")
def written(tmp_path_factory):
    return sun_compass.written(tmp_path_factory.mktemp("sun"))


def source(manifest, flight, seed):
    record = sun_compass.recorded(flight.truth, seed)
    return NeuralFactor(manifest, records={sun_compass.SENSOR: record})


@pytest.mark.parametrize("method", [Smoother(), Batch()], ids=lambda method: method.name)
def test_a_heading_network_tells_a_straight_flight_its_heading(method, manifest):
    squares = []
    for seed in SEEDS:
        flight = flown(seed)
        factors = (source(manifest, flight, seed),)
        found = dataclasses.replace(method, noise="nominal", factors=factors)(flight)
        assert euler_rmse_deg(flight, found)[2] < 1.2  # three of what it states
        assert found.sigma_deg[:, 2].max() < 1.2
        squares.append(nees(errors_rad(flight, found), found.attitude_covariance_rad2))
        test = next(one for one in found.consistency if one.what == sun_compass.NAME)
        assert 0.3 < test.nis < 0.9  # 1 / c = 0.6: covariances of answers are inflated
        assert "within 0.4 s of another" in " ".join(one.reason for one in found.unused)
    assert 1.0 < np.mean(squares) < 4.0


def test_without_it_the_heading_stays_open():
    found = Smoother(noise="nominal")(flown(1))
    assert found.sigma_deg[:, 2].min() > 90


def test_a_filter_knows_the_heading_as_soon_as_the_network_tells_it(manifest):
    squares = []
    for seed in SEEDS:
        flight = flown(seed)
        found = Forward(noise="nominal", factors=(source(manifest, flight, seed),))(flight)
        open_ = found.sigma_deg[:, 2] > 90
        assert 0 < open_.sum() < 0.5 * 10  # keyframes at 10 Hz, before the network's first windows
        assert not open_[open_.sum() :].any()
        squares.append(nees(errors_rad(flight, found), found.attitude_covariance_rad2))
    assert 1.0 < np.mean(squares) < 4.0


def test_degrees_taken_for_radians_show_in_the_innovations(manifest, tmp_path):
    flight = flown(1)
    content = manifest.read_text()
    manifest_deg = tmp_path / "sun.json"
    (tmp_path / "sun.onnx").write_bytes(manifest.with_name("sun.onnx").read_bytes())
    # Cosine and sine have no unit: only the network's sigma is read as a sixtieth of what it is.
    manifest_deg.write_text(content.replace('"unit": "rad"', '"unit": "deg"'))
    factors = (source(manifest_deg, flight, 1),)
    found = Smoother(noise="nominal", factors=factors)(flight)
    test = next(one for one in found.consistency if one.what == sun_compass.NAME)
    assert test.nis > 100


def test_a_stream_takes_a_network(manifest):
    """It is better with it, by as much as its covariances have it."""
    rms_rad: dict[str, list[float]] = {"without": [], "with": []}
    sigma_rad: dict[str, list[float]] = {"without": [], "with": []}
    squares: list[float] = []
    for seed in range(30_001, 30_009):
        case = flights.turning(
            np.random.default_rng(seed), span_s=10.0, gyro=True, amplitude_deg=15.0
        )
        record = sun_compass.recorded(case.truth, 4)
        factor = NeuralFactor(manifest, records={sun_compass.SENSOR: record})
        for name, sources in (("without", ()), ("with", (factor,))):
            parts = streamed(case, sources)
            t_s = np.concatenate([part.t_s for part in parts])
            np.testing.assert_array_equal(t_s, case.problem.t_s)
            R_nb = np.concatenate([part.R_nb for part in parts])
            error = flights.attitude_errors_rad(R_nb, case.truth)
            P = np.concatenate([part.attitude_covariance_rad2 for part in parts])
            sigma_rad[name].append(np.sqrt(np.einsum("nii->n", P).mean()))
            rms_rad[name].append(np.sqrt((error**2).mean()))
        squares.append(flights.nees(error, P).mean())
    gained, promised = (
        np.linalg.norm(by["with"]) / np.linalg.norm(by["without"]) for by in (rms_rad, sigma_rad)
    )
    assert gained < 1
    assert abs(gained - promised) < 0.1
    assert 1 < np.mean(squares) < 4
    tests = [one for part in parts for one in part.consistency]
    assert {one.what for one in tests} == {sun_compass.NAME}
    lost = sum(one.count for part in parts for one in part.unused)
    assert sum(one.count for one in tests) + lost == len(case.problem.t_s)


def streamed(case, sources):
    config = StreamConfig(origin=flights.ORIGIN, antenna_b_m=np.zeros(3))
    stream = Stream(config, 2.0, factors=sources)
    parts = [stream.update(now) for now in measured(case)]
    return [part for part in (*parts, stream.flush()) if len(part.t_s)]


def measured(case):
    """Yield what comes in with each keyframe of a case."""
    turn = rotations.exp(np.radians([[2.0, -2.0, 10.0]]))[0]
    for k, t_s in enumerate(case.problem.t_s):
        near = (case.imu.t_s > t_s - 0.25) & (case.imu.t_s < t_s + 0.15)
        imu = dataclasses.replace(
            case.imu,
            t_s=case.imu.t_s[near],
            f_b_mps2=case.imu.f_b_mps2[near],
            w_b_radps=case.imu.w_b_radps[near],
        )
        position, velocity = (
            Measured(value=series.value[k], covariance=series.covariance[k])
            for series in (case.position, case.velocity)
        )
        R_nb = case.truth.R_nb[0] @ turn if k == 0 else None
        yield Measurements(t_s=float(t_s), imu=imu, R_nb=R_nb, position=position, velocity=velocity)
