"""A flight that brings its networks: in every way of estimating what --factors would give."""

import dataclasses
import json

import numpy as np
import pytest

from fgnav import cli
from fgnav.geometry.rotations import to_euler
from fgnav.io.flight.folder import save_flight
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.methods.stream import Stream, StreamConfig
from fgnav.neural import NeuralFactor
from tests.assembly import flights
from tests.methods.simulated import flown
from tests.neural import graphs
from tests.neural.test_methods import measured


@pytest.fixture(scope="module", name="flight")
def straight():
    return dataclasses.replace(flown("surroundings", 6.0), magnetometer=None, barometer=None)


@pytest.fixture(name="manifest")
def written(flight, tmp_path):
    heading_rad = float(to_euler(flight.truth.R_nb)[0, 2])
    sensor = {"sensor": "accelerometer", "half_life_s": 0.1}
    return graphs.heading(tmp_path, value=heading_rad, **sensor)


METHODS = (Smoother(), Forward(), Batch())


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_a_network_of_the_flight_is_that_of_factors_and_counts_once(flight, manifest, method):
    method = dataclasses.replace(method, noise="nominal")
    given = dataclasses.replace(method, factors=(str(manifest),))
    brought = dataclasses.replace(flight, networks=(manifest,))
    expected = given(flight)
    assert expected.sigma_deg[-1, 2] < 5
    for found in (method(brought), given(brought)):
        np.testing.assert_array_equal(found.R_nb, expected.R_nb)
        np.testing.assert_array_equal(found.sigma_deg, expected.sigma_deg)
        assert "net" in {test.what for test in found.consistency}


def test_a_stream_takes_the_networks_of_its_set_up(tmp_path):
    case = flights.turning(np.random.default_rng(30_001), span_s=3.0, gyro=True, amplitude_deg=15.0)
    manifest = graphs.heading(tmp_path, value=0.3, half_life_s=0.1)
    config = StreamConfig(origin=flights.ORIGIN, antenna_b_m=np.zeros(3))
    bringing = dataclasses.replace(config, networks=(manifest,))
    found = []
    for one, factors in ((bringing, ()), (config, (NeuralFactor(manifest),)), (config, ())):
        stream = Stream(one, 1.0, factors=factors)
        parts = [stream.update(now) for now in measured(case)]
        found.append(np.concatenate([part.R_nb for part in (*parts, stream.flush())]))
    np.testing.assert_array_equal(found[0], found[1])
    assert np.abs(found[0] - found[2]).max() > 1e-6


def test_run_and_compare_use_what_flight_toml_names(flight, manifest, tmp_path, capsys):
    folder = tmp_path / "flight"
    save_flight(dataclasses.replace(flight, networks=(manifest,)), folder)
    assert '[[network]]\nmanifest = "network-1/net.json"' in (folder / "flight.toml").read_text()
    options = ["--noise", "nominal", "--json"]
    run = ["run", str(folder), "--out", str(tmp_path / "out"), *options]
    assert cli.main([*run, str(tmp_path / "run.json")]) == 0
    tests = json.loads((tmp_path / "run.json").read_text())["methods"]["smoother"]["consistency"]
    assert "net" in {one["what"] for one in tests}
    compare = ["compare", str(folder), "--method", "smoother", "--without", "networks", *options]
    assert cli.main([*compare, str(tmp_path / "compare.json")]) == 0
    both = json.loads((tmp_path / "compare.json").read_text())["methods"]
    yaw_deg = {name: one["rmse_deg"]["yaw"] for name, one in both.items()}
    assert yaw_deg["smoother"] < 2.9 < 10 < yaw_deg["smoother without networks"]  # its sigma

    (folder / "network-1" / "net.onnx").write_bytes(b"other")
    capsys.readouterr()
    assert cli.main([*run, str(tmp_path / "run.json")]) == 2
    *_, error = capsys.readouterr().err.splitlines()  # above it what `check` says
    assert error.startswith("fgnav: ")
    assert "net.json: key sha256: net.onnx has" in error
