"""A released network runs as its manifest says, or is refused in one line."""

import pickle
import subprocess
import sys

import msgspec
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from fgnav.checks import BadInputError
from fgnav.neural.integers import integer_answers
from fgnav.neural.manifest import Covariance
from fgnav.neural.measures import Sensor
from fgnav_models.runtime import load as load_module
from fgnav_models.runtime.load import load, released
from fgnav_models.training.contract import epoch_input, integers_output
from tests.neural import graphs

WEIGHTS = np.array([[2.0, 0.0], [0.0, -1.0], [0.5, 0.5]], dtype=np.float32)


def onnx_bytes(weights=WEIGHTS, *, operator="MatMul", domain=""):
    """Return a graph y = x @ weights, as a tool of its own would write it."""
    node = helper.make_node(operator, ["x", "w"], ["y"], domain=domain)
    return graphs.model([node], {"x": (3,)}, {"y": (2,)}, {"w": weights}, domain)


def written(folder, content, **changes):
    """Write a network and a manifest that fits it but for the changes; return the manifest."""
    one = epoch_input("x", "lengths", Sensor("m", "none", 3), 1)
    output = integers_output("y", Covariance(form="none"))
    return graphs.written(folder, "toy", content, one, output, **changes)


def said(network, x):
    """Return the output of rows, (n, 3), whose one sample the graph has no axis for."""
    return network.run([np.asarray(x, dtype=float)[:, None]])[0]


def test_a_network_computes_what_its_graph_says(tmp_path):
    network = load(written(tmp_path, onnx_bytes()))
    x = np.arange(12.0).reshape(4, 3)
    np.testing.assert_allclose(said(network, x), x @ WEIGHTS, rtol=1e-6, atol=0)
    assert network.manifest.name == "toy"


class Trap:
    """Unpickling it leaves a trace."""

    def __reduce__(self):
        return exec, ("raise SystemExit('a pickle was run')",)


def nan_weights():
    weights = WEIGHTS.copy()
    weights[1, 1] = np.nan
    return onnx_bytes(weights)


def external_weights():
    model = onnx.load_model_from_string(onnx_bytes())
    tensor = model.graph.initializer[0]
    tensor.data_location = TensorProto.EXTERNAL
    entry = tensor.external_data.add()
    entry.key, entry.value = "location", "/etc/passwd"
    tensor.ClearField("raw_data")
    return model.SerializeToString()


def with_function():
    model = onnx.load_model_from_string(onnx_bytes())
    opset = [helper.make_opsetid("", 17)]
    body = [helper.make_node("Identity", ["a"], ["b"])]
    model.functions.append(helper.make_function("own", "f", ["a"], ["b"], body, opset))
    return model.SerializeToString()


def hidden_nan():
    """Return a graph with a bad number in a constant node instead of the weights."""
    model = onnx.load_model_from_string(onnx_bytes())
    value = numpy_helper.from_array(np.array([np.inf], dtype=np.float16), "c")
    model.graph.node.append(helper.make_node("Constant", [], ["c"], value=value))
    return model.SerializeToString()


def text_weights():
    model = onnx.load_model_from_string(onnx_bytes())
    words = helper.make_tensor("words", TensorProto.STRING, [1], [b"no number"])
    model.graph.initializer.append(words)
    return model.SerializeToString()


def packed_halves():
    """Return weights in a field where their bits are not those of the number."""
    model = onnx.load_model_from_string(onnx_bytes())
    halves = helper.make_tensor("h", TensorProto.FLOAT16, [1], [float("nan")])
    model.graph.initializer.append(halves)
    return model.SerializeToString()


def sparse():
    model = onnx.load_model_from_string(onnx_bytes())
    model.graph.sparse_initializer.add().dims.append(1)
    return model.SerializeToString()


@pytest.mark.parametrize(
    ("content", "text"),
    [
        (pickle.dumps(Trap()), "must be an ONNX file"),
        (b"", "must be an ONNX file with one graph, has 0"),
        (b"\xff" * 40, "must be an ONNX file, its bytes are not"),
        (b"\x3b" * 8, "must be an ONNX file, its bytes are not"),
        (b"\x38\x01", "with one graph, has 0"),
        (onnx_bytes()[:-9], "its bytes are not"),
        (nan_weights(), "weights 'w' are not all finite"),
        (hidden_nan(), "weights 'c' are not all finite"),
        (external_weights(), "keeps weights in other files"),
        (with_function(), "brings functions of its own"),
        (sparse(), "holds sparse weights"),
        (text_weights(), "weights 'words' have type 8, only plain numbers are read"),
        (packed_halves(), "weights 'h' are not all finite"),
        (onnx_bytes(domain="com.example"), "uses an operator of 'com.example'"),
        (onnx_bytes(operator="NoSuch"), "onnxruntime refuses it"),
    ],
)
def test_what_is_no_plain_network_is_refused_even_with_a_manifest_that_fits(
    tmp_path, content, text
):
    with pytest.raises(BadInputError, match=text):
        load(written(tmp_path, content))


def test_a_byte_that_changed_is_seen(tmp_path):
    path = written(tmp_path, onnx_bytes())
    for changed in (lambda c: c[:-20] + bytes([c[-20] ^ 1]) + c[-19:], lambda c: c[:-1]):
        path.with_suffix(".onnx").write_bytes(changed(onnx_bytes()))
        with pytest.raises(BadInputError, match=r"toy\.json: key sha256: toy\.onnx has [0-9a-f]"):
            load(path)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"range": ((0.0, 1.0),) * 4, "mean": (0.0,) * 4, "scale": (1.0,) * 4}, r"inputs\[0\]"),
        ({"name": "other"}, "inputs: toy.onnx takes x, the manifest names other"),
        (
            {"window": 2},
            r"inputs\[0\]\.window: 'x' takes .*, must take .* \['n', 2, 3\]",
        ),
    ],
)
def test_a_manifest_of_another_graph_is_refused(tmp_path, change, text):
    one = epoch_input("x", "lengths", Sensor("m", "none", 3), 1)
    inputs = (msgspec.structs.replace(one, **change),)
    with pytest.raises(BadInputError, match=rf"toy\.json: key {text}"):
        load(written(tmp_path, onnx_bytes(), inputs=inputs))


def test_missing_files_and_names_are_told(tmp_path):
    with pytest.raises(BadInputError, match=r"network 'nobody': not one of .* nor a manifest"):
        load("nobody")
    with pytest.raises(BadInputError, match=r"a\.json: no such file"):
        load(tmp_path / "a.json")
    path = written(tmp_path, onnx_bytes())
    path.with_suffix(".onnx").unlink()
    with pytest.raises(BadInputError, match=r"toy\.onnx: no such file; check the name"):
        load(path)


def test_without_onnxruntime_the_text_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInputError, match="pip install onnxruntime"):
        load(written(tmp_path, onnx_bytes()))


def test_every_released_network_loads_and_is_small():
    assert {"ambiguity-classification", "ambiguity-regression"} <= set(released())
    assert sum(path.stat().st_size for path in load_module.WEIGHTS.iterdir()) < 10_000_000
    for name in released():
        network = load(name)
        zeros = [np.zeros((2, one.window or 5, len(one.range))) for one in network.manifest.inputs]
        answers = integer_answers(network, zeros)
        assert answers.value.shape[0] == 2
        assert (answers.sure is None) == (network.manifest.output.covariance.form == "none")
        assert answers.within.all()


def test_running_a_network_needs_neither_torch_nor_the_simulator(tmp_path):
    path = written(tmp_path, onnx_bytes())
    code = (
        "import sys; from fgnav_models.runtime.load import load; import numpy as np;"
        "load(sys.argv[1]).run([np.zeros((1, 1, 3))]);"
        "sys.exit(any(m in sys.modules for m in ('torch', 'fgnav_sim', 'safetensors')))"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], check=False).returncode == 0
