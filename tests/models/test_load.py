"""A released network runs as its manifest says, or is refused in one line."""

import json
import pickle
import subprocess
import sys
from hashlib import sha256

import msgspec
import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

from fgnav.checks import BadInputError
from fgnav_models.runtime import load as load_module
from fgnav_models.runtime.load import load, released
from fgnav_models.runtime.manifest import Manifest, Port, manifest_text

WEIGHTS = np.array([[2.0, 0.0], [0.0, -1.0], [0.5, 0.5]], dtype=np.float32)


def onnx_bytes(weights=WEIGHTS, *, operator="MatMul", domain=""):
    """Return a graph y = x @ weights, as a tool of its own would write it."""
    node = helper.make_node(operator, ["x", "w"], ["y"], domain=domain)
    graph = helper.make_graph(
        [node],
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", 3])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, ["n", 2])],
        [numpy_helper.from_array(weights, "w")],
    )
    opsets = [helper.make_opsetid("", 17)]
    if domain:
        opsets.append(helper.make_opsetid(domain, 1))
    return helper.make_model(graph, opset_imports=opsets, ir_version=8).SerializeToString()


def written(folder, content, **changes):
    """Write a network and a manifest that fits it but for the changes."""
    manifest = Manifest(
        format="fgnav-network/1",
        name="toy",
        purpose="A product.",
        sha256=sha256(content).hexdigest(),
        size_bytes=len(content),
        inputs=(Port(name="x", shape=("n", 3), unit="m", meaning="lengths"),),
        outputs=(Port(name="y", shape=("n", 2), unit="m", meaning="products"),),
        domain={},
        recipe={},
        seed=1,
        metrics={},
        made_with={},
    )
    path = folder / "toy.onnx"
    path.write_bytes(content)
    text = manifest_text(msgspec.structs.replace(manifest, **changes))
    path.with_suffix(".json").write_text(text, encoding="utf-8")
    return path


def test_a_network_computes_what_its_graph_says(tmp_path):
    network = load(written(tmp_path, onnx_bytes()))
    x = np.arange(12.0).reshape(4, 3)
    np.testing.assert_allclose(network(x=x)["y"], x @ WEIGHTS, rtol=1e-6, atol=0)
    assert network.manifest.purpose == "A product."


@pytest.mark.parametrize(
    ("inputs", "text"),
    [
        ({"z": np.zeros((1, 3))}, "toy: inputs must be x, got z"),
        ({}, "toy: inputs must be x, got nothing"),
        ({"x": np.zeros((1, 4))}, r"input x must have shape \('n', 3\), got \(1, 4\)"),
        ({"x": np.zeros(3)}, r"input x must have shape \('n', 3\), got \(3,\)"),
        ({"x": np.zeros((1, 3), dtype=complex)}, "input x must be float32, got complex128"),
        ({"x": [[0, 0, 0], [0, np.nan, 0]]}, "input x is not finite, first at row 1"),
    ],
)
def test_inputs_that_break_the_contract_are_refused(tmp_path, inputs, text):
    network = load(written(tmp_path, onnx_bytes()))
    with pytest.raises(BadInputError, match=text):
        network(**inputs)


def test_a_length_that_two_inputs_share_must_be_the_same_in_both(tmp_path):
    node = helper.make_node("Add", ["a", "b"], ["y"])
    ports = [helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n"]) for name in "aby"]
    graph = helper.make_graph([node], "g", ports[:2], ports[2:])
    opset = [helper.make_opsetid("", 17)]
    content = helper.make_model(graph, opset_imports=opset, ir_version=8).SerializeToString()
    a, b, y = (Port(name=name, shape=("n",), unit="m", meaning="") for name in "aby")
    network = load(written(tmp_path, content, inputs=(a, b), outputs=(y,)))
    with pytest.raises(BadInputError, match=r"input b must have shape \('n',\) with \{'n': 2\}"):
        network(a=np.zeros(2), b=np.zeros(1))


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
        (b"\x38\x01", "a number stands where a message is due"),
        (onnx_bytes()[:-9], "its bytes end too early"),
        (nan_weights(), "weights 'w' are not all finite"),
        (hidden_nan(), "weights 'c' are not all finite"),
        (external_weights(), "keeps weights in other files"),
        (with_function(), "brings functions of its own"),
        (sparse(), "holds sparse weights"),
        (text_weights(), "weights 'words' have type 8, only plain numbers are read"),
        (packed_halves(), "weights 'h' are packed in a way that is not read"),
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
    content = bytearray(path.read_bytes())
    content[-20] ^= 1
    path.write_bytes(content)
    with pytest.raises(BadInputError, match=r"toy\.onnx: sha256 must be [0-9a-f]{64}, is [0-9a-f]"):
        load(path)


def test_a_truncated_file_is_seen(tmp_path):
    path = written(tmp_path, onnx_bytes())
    content = path.read_bytes()
    path.write_bytes(content[:-1])
    with pytest.raises(
        BadInputError, match=f"must have {len(content)} bytes, has {len(content) - 1}"
    ):
        load(path)


@pytest.mark.parametrize(
    "port",
    [
        Port(name="x", shape=("n", 4), unit="m", meaning=""),
        Port(name="other", shape=("n", 3), unit="m", meaning=""),
        Port(name="x", shape=("n", 3), unit="m", meaning="", dtype="int64"),
    ],
)
def test_a_manifest_of_another_graph_is_refused(tmp_path, port):
    path = written(tmp_path, onnx_bytes(), inputs=(port,))
    with pytest.raises(BadInputError, match=r"inputs must be .* by its manifest, are"):
        load(path)


def test_missing_files_and_names_are_told(tmp_path):
    with pytest.raises(BadInputError, match=r"network 'nobody': not one of .* nor a file"):
        load("nobody")
    with pytest.raises(BadInputError, match=r"a\.json: no such file; .*NAME\.json beside it"):
        load(tmp_path / "a.onnx")
    path = written(tmp_path, onnx_bytes())
    path.unlink()
    with pytest.raises(BadInputError, match=r"toy\.onnx: no such file; check the name"):
        load(path)


@pytest.mark.parametrize("text", ["{", '{"format": "fgnav-network/1"}', '{"format": "other"}'])
def test_a_manifest_that_is_none_is_refused(tmp_path, text):
    path = written(tmp_path, onnx_bytes())
    path.with_suffix(".json").write_text(text, encoding="utf-8")
    with pytest.raises(BadInputError, match=r"toy\.json: must be a network's manifest"):
        load(path)


def test_a_manifest_with_a_key_nobody_knows_is_refused(tmp_path):
    path = written(tmp_path, onnx_bytes())
    manifest = json.loads(path.with_suffix(".json").read_text(encoding="utf-8")) | {"more": 1}
    path.with_suffix(".json").write_text(json.dumps(manifest), encoding="utf-8")
    with pytest.raises(BadInputError, match="unknown field `more`"):
        load(path)


def test_without_onnxruntime_the_text_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInputError, match=r"pip install 'fgnav\[networks\]'"):
        load(written(tmp_path, onnx_bytes()))


def test_every_released_network_loads_and_is_small():
    assert {"ambiguity-classification", "ambiguity-regression"} <= set(released())
    assert sum(path.stat().st_size for path in load_module.WEIGHTS.iterdir()) < 10_000_000
    for name in released():
        network = load(name)
        zeros = {
            p.name: np.zeros([2 if isinstance(k, str) else k for k in p.shape], p.dtype)
            for p in network.manifest.inputs
        }
        assert network(**zeros).keys() == {p.name for p in network.manifest.outputs}


def test_running_a_network_needs_neither_torch_nor_the_simulator(tmp_path):
    path = written(tmp_path, onnx_bytes())
    code = (
        "import sys; from fgnav_models.runtime.load import load; load(sys.argv[1])(x=[[0, 0, 0]]);"
        "sys.exit(any(m in sys.modules for m in ('torch', 'onnx', 'fgnav_sim', 'safetensors')))"
    )
    assert subprocess.run([sys.executable, "-c", code, str(path)], check=False).returncode == 0
