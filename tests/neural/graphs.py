"""ONNX graphs whose answer is known: a constant, whatever they see."""

from hashlib import sha256
from itertools import pairwise

import numpy as np
from onnx import TensorProto, helper, numpy_helper

from fgnav.neural.manifest import Covariance, Input, Manifest, Output, save_manifest
from fgnav.neural.measures import MEASURES, SENSORS


def constant(window, channels, value, spread):
    """Return a graph from x, (n, window, channels), to y and s, the same in each row."""
    names = {"y": np.atleast_1d(value), "s": np.atleast_1d(spread)}
    nodes = [
        helper.make_node("ReduceMean", ["x"], ["mean"], axes=[1, 2], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["none"]),
        helper.make_node("Unsqueeze", ["none", "axis"], ["column"]),
        *(helper.make_node("Add", ["column", f"{name}0"], [name]) for name in names),
    ]
    weights = {f"{name}0": np.float32(one)[None] for name, one in names.items()}
    weights |= {"zero": np.float32(0.0), "axis": np.array([1])}
    graph = helper.make_graph(
        nodes,
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", window, channels])],
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", len(one)])
            for name, one in names.items()
        ],
        [numpy_helper.from_array(np.asarray(one), name) for name, one in weights.items()],
    )
    opset = [helper.make_opsetid("", 17)]
    return helper.make_model(graph, opset_imports=opset, ir_version=8).SerializeToString()


def heading(
    folder,
    *,
    measures="heading",
    sensor="gyroscope",
    value=0.5,
    spread=-3.0,
    form="log_sigma",
    unit=None,
    unit_in=None,
    channels=3,
    rate_hz=100.0,
    limit=1e3,
    half_life_s=0.0,
    lasting=0.0,
    over_s=None,
    frame=None,
):
    """Write a network that always answers the same, and its manifest; return its path."""
    content = constant(5, channels, value, spread)
    (folder / "net.onnx").write_bytes(content)
    known, what = SENSORS.get(sensor), MEASURES[measures]
    manifest = Manifest(
        format="fgnav-factor/1",
        name="net",
        purpose="Answers always the same.",
        onnx="net.onnx",
        sha256=sha256(content).hexdigest(),
        licence="BSD-3-Clause",
        inputs=(
            Input(
                name="x",
                sensor=sensor,
                unit=unit_in or known.unit,
                frame="b" if known is None else known.frame,
                rate_hz=rate_hz,
                window=5,
                mean=(0.0,) * channels,
                scale=(1.0,) * channels,
                range=((-limit, limit),) * channels,
            ),
        ),
        output=Output(
            name="y",
            measures=measures,
            manifold=what.manifold,
            unit=unit or next(iter(what.units)),
            frame=frame or what.frames[0],
            covariance=Covariance(form=form, name="s"),
            half_life_s=half_life_s,
            lasting=lasting,
            over_s=over_s,
        ),
    )
    path = folder / "net.json"
    save_manifest(manifest, path)
    return path


def perceptron(folder, window, width, measures="heading", lasting=0.0):
    """Write a network of random weights that sees accelerations and hardly knows anything."""
    rng, what = np.random.default_rng(0), MEASURES[measures]
    sizes = (3 * window, width, width, what.freedom)
    nodes, weights, at = [helper.make_node("Flatten", ["x"], ["h0"], axis=1)], {}, "h0"
    for k, (i, o) in enumerate(pairwise(sizes)):
        weights[f"w{k}"] = rng.normal(size=(i, o)).astype(np.float32) / np.float32(np.sqrt(i))
        ends = f"a{k}", f"h{k + 1}"
        nodes.append(helper.make_node("MatMul", [at, f"w{k}"], [ends[0]]))
        nodes.append(helper.make_node("Tanh", [ends[0]], [ends[1]]))
        at = ends[1]
    graph = helper.make_graph(
        nodes,
        "g",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, ["n", window, 3])],
        [helper.make_tensor_value_info(at, TensorProto.FLOAT, ["n", what.freedom])],
        [numpy_helper.from_array(one, name) for name, one in weights.items()],
    )
    opset = [helper.make_opsetid("", 17)]
    content = helper.make_model(graph, opset_imports=opset, ir_version=8).SerializeToString()
    (folder / "perceptron.onnx").write_bytes(content)
    manifest = Manifest(
        format="fgnav-factor/1",
        name="perceptron",
        purpose="Costs what a network costs.",
        onnx="perceptron.onnx",
        sha256=sha256(content).hexdigest(),
        licence="BSD-3-Clause",
        inputs=(
            Input(
                name="x",
                sensor="accelerometer",
                unit="m/s2",
                frame="b",
                rate_hz=100.0,
                window=window,
                mean=(0.0,) * 3,
                scale=(10.0,) * 3,
                range=((-1e3, 1e3),) * 3,
            ),
        ),
        output=Output(
            name=at,
            measures=measures,
            manifold=what.manifold,
            unit=next(iter(what.units)),
            frame=what.frames[0],
            covariance=Covariance(form="none", sigma=(1e3,)),
            half_life_s=0.0,
            lasting=lasting,
        ),
    )
    path = folder / "perceptron.json"
    save_manifest(manifest, path)
    return path


def toml(content):
    """Return a manifest's plain content as TOML."""

    def value(one):
        if isinstance(one, list):
            return f"[{', '.join(map(value, one))}]"
        return repr(one) if not isinstance(one, str) else f'"{one}"'

    def lines(table):
        return [f"{key} = {value(one)}" for key, one in table.items() if one is not None]

    output = dict(content["output"])
    covariance = output.pop("covariance")
    top = {k: v for k, v in content.items() if k not in ("inputs", "output")}
    parts = [*lines(top)]
    for one in content["inputs"]:
        parts += ["[[inputs]]", *lines(one)]
    parts += ["[output]", *lines(output), "[output.covariance]", *lines(covariance)]
    return "\n".join(parts) + "\n"
