"""Each way in which a manifest can be wrong is one line: file, key, mend."""

import json

import numpy as np
import pytest

from fgnav import cli
from fgnav.checks import BadInputError
from fgnav.graph.keys import Timeline
from fgnav.io.flight.folder import save_flight
from fgnav.neural import NeuralFactor, Record, read_manifest
from fgnav.neural.network import load_network
from tests.methods.simulated import flown
from tests.neural import graphs, sun_compass

WRONG = {
    "unit": (("inputs", 0, "unit"), "deg/s", r"inputs\[0\].unit: must be rad/s, the unit of a fl"),
    "frame": (("inputs", 0, "frame"), "n", r"inputs\[0\].frame: must be b, the frame of a fli"),
    "negative rate": (("inputs", 0, "rate_hz"), -1.0, r"inputs\[0\].rate_hz: must be float >= 0.0"),
    "no window": (("inputs", 0, "window"), 0, r"inputs\[0\]\.window: must be int >= 1, got 0"),
    "window of another length": (("inputs", 0, "window"), 7, r"inputs\[0\].window: 'x' takes"),
    "channels": (("inputs", 0, "mean"), [0.0], r"inputs\[0\].mean: must have 3 entries, one per"),
    "scale of zero": (("inputs", 0, "scale"), [1.0, 0.0, 1.0], r"inputs\[0\].scale\[1\]: must be"),
    "rate of an epoch": (
        ("inputs", 0, "rate_hz"),
        0.0,
        r"inputs\[0\].rate_hz: must be above 0",
    ),
    "range upside down": (
        ("inputs", 0, "range"),
        [[1.0, -1.0]] * 3,
        r"inputs\[0\].range: each must be \[low, high\]",
    ),
    "input's name": (("inputs", 0, "name"), "w", "inputs: net.onnx takes x, the manifest names w"),
    "manifold": (("output", "manifold"), "R1", "output.manifold: must be S1, the manifold of head"),
    "quantity": (("output", "measures"), "colour", "output.measures: must be"),
    "output's unit": (("output", "unit"), "m", "output.unit: must be rad or deg, a unit of headi"),
    "output's frame": (("output", "frame"), "b", "output.frame: must be n, a frame of heading"),
    "output's name": (("output", "name"), "yaw", "output.name: net.onnx has no output 'yaw'; it"),
    "half-life": (("output", "half_life_s"), -1.0, "output.half_life_s: must be float >= 0.0"),
    "lasting": (("output", "lasting"), 1.0, "output.lasting: must be float < 1.0"),
    "form": (
        ("output", "covariance", "form"),
        "fog",
        "output.covariance.form: must be cholesky or log_sigma or none or posterior or probability",
    ),
    "sigma of zero": (
        ("output", "covariance"),
        {"form": "none", "sigma": [0.0]},
        r"output.covariance.sigma\[0\]: must be float > 0.0",
    ),
    "no sigma": (("output", "covariance"), {"form": "none"}, "output.covariance.sigma: form none"),
    "displacement's span": (("output", "over_s"), 1.0, "output.over_s: goes with displacement"),
    "domain's figure": (
        ("domain",),
        [{"name": "z", "unit": "1", "range": [0.0, 1.0]}],
        r"domain\[0\].name: net.onnx has no output 'z'; it has y, s",
    ),
    "domain upside down": (
        ("domain",),
        [{"name": "s", "unit": "1", "range": [1.0, 0.0]}],
        r"domain\[0\].range: must be \[low, high\], low first",
    ),
    "hash": (("sha256",), "0" * 64, "sha256: net.onnx has .*; take the file that the manifest was"),
    "no hash": (("sha256",), "abc", "sha256: must be str matching regex"),
    "file elsewhere": (("onnx",), "../net.onnx", "onnx: must be the name of an .onnx file in the"),
    "format": (("format",), "fgnav-factor/9", "format: must be"),
    "unknown key": (("output", "half_live_s"), 1.0, "output.half_live_s: unknown; the nearest kno"),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_manifest_is_one_line(tmp_path, wrong):
    place, value, text = WRONG[wrong]
    path = graphs.heading(tmp_path)
    graphs.changed(path, place, value)
    with pytest.raises(BadInputError, match=rf"^{path}: key {text}") as raised:
        load_network(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("missing", ["sha256", "licence", "inputs", "output"])
def test_a_missing_key_is_one_line(tmp_path, missing):
    path = graphs.heading(tmp_path)
    content = json.loads(path.read_text())
    del content[missing]
    path.write_text(json.dumps(content))
    with pytest.raises(BadInputError, match=f"^{path}: key top level: '{missing}' is missing"):
        load_network(path)


def test_toml_and_json_are_the_same_manifest(tmp_path):
    path = graphs.heading(tmp_path)
    as_toml = tmp_path / "net.toml"
    as_toml.write_text(graphs.toml(json.loads(path.read_text())))
    assert read_manifest(as_toml) == read_manifest(path)


ANSWERS = {
    "degrees as radians": (
        {"value": 38.0},
        "output.unit: a heading of 38 rad is more than a turn; state unit = 'deg'",
    ),
    "covariance not positive": (
        {"form": "cholesky", "spread": -0.1},
        "output.covariance.name 's': the diagonal of the Cholesky factor must be positive, got -0",
    ),
    "sigma for its logarithm": (
        {"spread": 1e3},
        "output.covariance.name 's': must be the logarithm of a 1-sigma, within 30 of 0, got 1000",
    ),
    "two sigmas of one angle": (
        {"spread": [0.0, 0.0]},
        "output.covariance.name 's': log_sigma of heading has 1 numbers, has 2",
    ),
    "three numbers of an angle": (
        {"value": [0.0, 0.0, 0.0]},
        "output.name: heading has 1 or 2 numbers, 'y' has 3",
    ),
    "cosine and sine of nothing": (
        {"value": [0.0, 0.0]},
        "output.name: cosine and sine are both zero",
    ),
    "no unit vector": (
        {"measures": "direction", "value": [0.0, 0.0, 9.8]},
        "output.manifold: a direction must have the size 1, got 9.8; normalise",
    ),
}


@pytest.mark.parametrize("wrong", ANSWERS)
def test_an_answer_that_breaks_the_contract_is_one_line(tmp_path, wrong):
    what, text = ANSWERS[wrong]
    network = load_network(graphs.heading(tmp_path, **what))
    with pytest.raises(BadInputError, match=f"{tmp_path}/net.json: {text}") as raised:
        network([np.zeros((3, 5, 3))])
    assert "\n" not in str(raised.value)


def test_an_answer_that_is_not_finite_is_one_line(tmp_path):
    network = load_network(graphs.heading(tmp_path))
    with pytest.raises(BadInputError, match="output\\.name 'y': not finite in 2 of 3 windows"):
        network([np.array([0.0, np.nan, np.nan])[:, None, None] * np.ones((1, 5, 3))])


def test_degrees_are_converted_where_they_are_stated(tmp_path):
    network = load_network(graphs.heading(tmp_path, value=38.0, spread=np.log(2.0), unit="deg"))
    answers = network([np.zeros((3, 5, 3))])
    np.testing.assert_allclose(np.degrees(answers.value), 38.0, rtol=1e-6)
    np.testing.assert_allclose(np.degrees(np.sqrt(answers.covariance)), 2.0, rtol=1e-6)


def test_another_rate_is_refused_by_name(tmp_path):
    flight = flown("surroundings", 5.0)
    factor = NeuralFactor(graphs.heading(tmp_path, rate_hz=50.0))
    text = r"inputs\[0\].rate_hz: the network sees samples at 50 Hz, the record has 100 Hz"
    with pytest.raises(BadInputError, match=text):
        factor(flight, Timeline(t_s=np.arange(1.0, 4.0, 0.1), gyroscope=True))


def test_a_sensor_that_is_not_there_is_named(tmp_path):
    path = sun_path(tmp_path)
    text = r"inputs\[0\].sensor: flight .* has no 'photodiodes'; known are accelerometer,"
    with pytest.raises(BadInputError, match=text):
        NeuralFactor(path)(flown("surroundings", 5.0), Timeline(t_s=np.arange(3.0), gyroscope=True))


WRONG_RECORDS = {
    r"unit: the network sees A of 'photodiodes', the record has mA": {"unit": "mA"},
    r"frame: the network sees b of 'photodiodes', the record has n": {"frame": "n"},
    r"range: the network sees 9 channels of 'photodiodes'": {"values": np.zeros((40, 4))},
    r"rate_hz: the network sees samples at 20 Hz, the record has 10": {"t_s": np.arange(40) / 10},
}


@pytest.mark.parametrize("text", WRONG_RECORDS)
def test_a_record_that_is_not_what_the_network_sees_is_refused(tmp_path, text):
    right = {"t_s": np.arange(40) / 20, "values": np.zeros((40, 9)), "unit": "A", "frame": "b"}
    record = Record(**{**right, **WRONG_RECORDS[text]})
    with pytest.raises(BadInputError, match=text):
        NeuralFactor(sun_path(tmp_path), records={"photodiodes": record})


def sun_path(folder):
    """Return a manifest of photodiodes over a graph that answers nothing of use."""
    return graphs.heading(folder, sensor=sun_compass.SENSOR, unit_in="A", channels=9, rate_hz=20.0)


def test_a_manifest_stands_for_a_source_on_the_command_line(tmp_path, capsys):
    save_flight(flown("demo", 5.0), tmp_path / "flight")
    value, spread = [0.0, 0.0, -50.0], np.log(1000.0)
    path = graphs.heading(
        tmp_path, measures="velocity", sensor="accelerometer", value=value, spread=spread
    )
    words = ["run", str(tmp_path / "flight"), "--integers", "truth", "--out", str(tmp_path / "out")]
    words += ["--noise", "nominal"]
    assert cli.main([*words, "--factors", str(path)]) == 0
    assert '"net"' in (tmp_path / "out" / "summary.json").read_text()
    capsys.readouterr()
    path.write_text(path.read_text().replace('"m/s2"', '"g"'))
    assert cli.main([*words, "--factors", str(path)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "inputs[0].unit: must be m/s2" in error
    assert cli.main([*words, "--factors", str(tmp_path / "none.toml")]) == 2
    assert "none.toml" in capsys.readouterr().err
