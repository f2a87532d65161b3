"""A stranger's network stays within bounds, and its errors are one line."""

import os

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper

from fgnav.checks import BadInputError
from fgnav.neural.integers import integer_answers
from fgnav.neural.onnx import session
from fgnav_models.runtime.load import load
from tests.models.test_load import onnx_bytes, said, written
from tests.neural import graphs

X = np.ones((4, 3))


def of_nodes(*nodes, **constants):
    """Return a graph from x (n, 3) to y (n, 2)."""
    return graphs.model(nodes, {"x": (3,)}, {"y": (2,)}, constants)


def summed(name):
    """Return nodes that end a graph with the sum of a tensor."""
    return (
        helper.make_node("ReduceSum", [name], ["sum"], keepdims=0),
        helper.make_node("MatMul", ["x", "w"], ["product"]),
        helper.make_node("Add", ["product", "sum"], ["y"]),
    )


W = np.ones((3, 2), np.float32)


def test_a_network_that_wants_too_much_memory_is_refused(tmp_path):
    content = of_nodes(
        helper.make_node("ConstantOfShape", ["s"], ["c"]), *summed("c"), s=[10**6, 10**4], w=W
    )
    network = load(written(tmp_path, content))
    with pytest.raises(BadInputError, match=r"onnxruntime stops at it: .*ConstantOfShape"):
        said(network, X)


def test_a_network_that_takes_too_long_is_ended(tmp_path, monkeypatch):
    products = [helper.make_node("MatMul", [f"c{k}", f"c{k}"], [f"c{k + 1}"]) for k in range(200)]
    start = helper.make_node("ConstantOfShape", ["s"], ["c0"])
    content = of_nodes(start, *products, *summed("c200"), s=[500, 500], w=W)
    network = load(written(tmp_path, content))
    monkeypatch.setattr(session, "CPU_S", 0.1)
    with pytest.raises(BadInputError, match=r"more than 0\.1 s of computing"):
        said(network, X)


def of_one_product(size):
    """Return a graph whose time is that of one node."""
    return of_nodes(
        helper.make_node("ConstantOfShape", ["s"], ["c"]),
        helper.make_node("MatMul", ["c", "c"], ["long"]),
        *summed("long"),
        s=[size, size],
        w=W,
    )


def test_a_single_node_that_takes_too_long_is_ended_and_the_next_run_begins_anew(
    tmp_path, monkeypatch
):
    network = load(written(tmp_path, of_one_product(2500)))
    monkeypatch.setattr(session, "CPU_S", 0.05)
    with pytest.raises(BadInputError, match=r"more than 0\.05 s of computing"):
        said(network, X)
    monkeypatch.setattr(session, "CPU_S", 30.0)
    assert said(network, X).tolist() == [[3.0, 3.0]] * 4  # all that c holds is zero


def test_memory_beside_the_arena_is_bounded(tmp_path):
    content = of_nodes(
        helper.make_node("ConstantOfShape", ["s"], ["c"], value=of_ones()),
        helper.make_node("NonZero", ["c"], ["places"]),
        helper.make_node("Cast", ["places"], ["floats"], to=TensorProto.FLOAT),
        *summed("floats"),
        s=[10**4, 2 * 10**4],
        w=W,
    )
    with pytest.raises(BadInputError, match=r"onnxruntime stops at it: "):
        said(load(written(tmp_path, content)), X)


def of_ones():
    return helper.make_tensor("one", TensorProto.BOOL, [1], [True])


def test_a_fork_asks_a_process_of_its_own(tmp_path):
    network = load(written(tmp_path, onnx_bytes()))
    right = said(network, X)
    reader, writer = os.pipe()
    pid = os.fork()
    if not pid:
        os.write(writer, said(network, 2 * X).tobytes())
        os._exit(0)
    os.waitpid(pid, 0)
    assert os.read(reader, 1 << 12) != right.tobytes()
    np.testing.assert_array_equal(said(network, X), right)


def test_a_process_that_crashes_is_one_line(tmp_path):
    network = load(written(tmp_path, onnx_bytes()))
    network.runtime._child.kill()
    with pytest.raises(BadInputError, match=r"toy\.onnx: .*its process ended with status -9"):
        said(network, X)
    assert said(network, X).shape == (4, 2)


def test_answers_that_are_not_finite_or_of_another_shape_are_refused(tmp_path):
    weights = np.full((3, 2), 3e38, np.float32)
    network = load(written(tmp_path, onnx_bytes(weights)))
    with pytest.raises(BadInputError, match=r"toy\.json: output\.name: not finite"):
        integer_answers(network, [X[:, None]])
    content = of_nodes(
        helper.make_node("MatMul", ["x", "w"], ["product"]),
        helper.make_node("Slice", ["product", "zero", "one"], ["y"]),
        w=W,
        zero=[0],
        one=[1],
    )
    network = load(written(tmp_path, content))
    with pytest.raises(BadInputError, match=r"output 'y': must have one row per window, 4, got"):
        said(network, X)


def test_a_network_that_fails_as_it_runs_is_refused(tmp_path):
    content = of_nodes(
        helper.make_node("Reshape", ["x", "s"], ["sevens"]),
        helper.make_node("MatMul", ["sevens", "w"], ["y"]),
        s=[-1, 7],
        w=np.ones((7, 2), np.float32),
    )
    with pytest.raises(BadInputError, match=r"onnxruntime stops at it: .*Reshape"):
        said(load(written(tmp_path, content)), X)


def test_texts_that_are_no_utf8_are_one_line(tmp_path, capsys):
    content = onnx_bytes().replace(b"MatMul", b"Mat\xfful")
    # By Python's release the text that is none, or the error's kind alone.
    text = r"toy\.onnx: onnxruntime refuses it: ('utf-8' codec|InvalidGraph)"
    with pytest.raises(BadInputError, match=text):
        load(written(tmp_path, content))
    assert capsys.readouterr().out == ""


def test_graphs_within_nodes_are_refused_before_anything_runs(tmp_path):
    body = onnx.load_model_from_string(onnx_bytes()).graph
    loop = helper.make_node("Loop", ["n", "go"], ["y"], body=body)
    content = of_nodes(loop, n=10**9, go=True)
    with pytest.raises(BadInputError, match=r"holds a graph in a node \(If, Loop, Scan\)"):
        load(written(tmp_path, content))
