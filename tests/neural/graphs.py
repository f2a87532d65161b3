"""Small networks to test with: their ONNX files and manifests."""

import json
from hashlib import sha256
from itertools import pairwise

import msgspec
import numpy as np
from onnx import TensorProto, helper, numpy_helper

from fgnav.neural.manifest import Covariance, Input, Manifest, Output, save_manifest
from fgnav.neural.measures import MEASURES, SENSORS


def model(nodes, inputs, outputs, weights, domain=""):
    """Return the bytes of a graph; inputs and outputs are shapes by name, rows left out."""

    def values(shapes):
        return [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, ["n", *shape])
            for name, shape in shapes.items()
        ]

    arrays = [numpy_helper.from_array(np.asarray(one), name) for name, one in weights.items()]
    graph = helper.make_graph(nodes, "g", values(inputs), values(outputs), arrays)
    opsets = [helper.make_opsetid("", 17)]
    if domain:
        opsets.append(helper.make_opsetid(domain, 1))
    return helper.make_model(graph, opset_imports=opsets, ir_version=8).SerializeToString()


def written(folder, name, content, one, output, **changes):
    """Write a network of one input, and the manifest that fits it but for changes; return that."""
    manifest = Manifest(
        format="fgnav-factor/1",
        name=name,
        purpose="Is tested with.",
        onnx=f"{name}.onnx",
        sha256=sha256(content).hexdigest(),
        licence="BSD-3-Clause",
        inputs=(one,),
        output=output,
    )
    (folder / manifest.onnx).write_bytes(content)
    save_manifest(msgspec.structs.replace(manifest, **changes), folder / f"{name}.json")
    return folder / f"{name}.json"


def seen(sensor, window, *, channels=3, rate_hz=100.0, scale=1.0, limit=1e3, unit=None):
    """Return the input of a sensor."""
    known = SENSORS.get(sensor)
    return Input(
        name="x",
        sensor=sensor,
        unit=unit or known.unit,
        frame="b" if known is None else known.frame,
        rate_hz=rate_hz,
        window=window,
        mean=(0.0,) * channels,
        scale=(scale,) * channels,
        range=((-limit, limit),) * channels,
    )


def told(name, measures, covariance, *, unit=None, frame=None, half_life_s=0.0, **more):
    """Return the output of what is measured."""
    what = MEASURES[measures]
    return Output(
        name=name,
        measures=measures,
        manifold=what.manifold,
        unit=unit or next(iter(what.units)),
        frame=frame or what.frames[0],
        covariance=covariance,
        half_life_s=half_life_s,
        **more,
    )


def constant(window, channels, value, spread):
    """Return a graph from x, (n, window, channels), to y and s, the same in each row."""
    values = {"y": np.atleast_1d(value), "s": np.atleast_1d(spread)}
    nodes = [
        helper.make_node("ReduceMean", ["x"], ["mean"], axes=[1, 2], keepdims=0),
        helper.make_node("Mul", ["mean", "zero"], ["none"]),
        helper.make_node("Unsqueeze", ["none", "axis"], ["column"]),
        *(helper.make_node("Add", ["column", f"{name}0"], [name]) for name in values),
    ]
    weights = {f"{name}0": np.float32(one)[None] for name, one in values.items()}
    weights |= {"zero": np.float32(0.0), "axis": np.array([1])}
    shapes = {name: (len(one),) for name, one in values.items()}
    return model(nodes, {"x": (window, channels)}, shapes, weights)


def heading(
    folder,
    *,
    measures="heading",
    sensor="gyroscope",
    value=0.5,
    spread=-3.0,
    form="log_sigma",
    unit_in=None,
    channels=3,
    rate_hz=100.0,
    limit=1e3,
    **output,
):
    """Write a network that always answers the same, and its manifest; return its path."""
    one = seen(sensor, 5, channels=channels, rate_hz=rate_hz, limit=limit, unit=unit_in)
    answer = told("y", measures, Covariance(form=form, name="s"), **output)
    return written(folder, "net", constant(5, channels, value, spread), one, answer)


def perceptron(folder, window, width, measures="heading", lasting=0.0):
    """Write a network of random weights that sees accelerations and hardly knows anything."""
    rng, freedom = np.random.default_rng(0), MEASURES[measures].freedom
    sizes = (3 * window, width, width, freedom)
    nodes, weights, at = [helper.make_node("Flatten", ["x"], ["h0"], axis=1)], {}, "h0"
    for k, (i, o) in enumerate(pairwise(sizes)):
        weights[f"w{k}"] = rng.normal(size=(i, o)).astype(np.float32) / np.float32(np.sqrt(i))
        nodes.append(helper.make_node("MatMul", [at, f"w{k}"], [f"a{k}"]))
        nodes.append(helper.make_node("Tanh", [f"a{k}"], [f"h{k + 1}"]))
        at = f"h{k + 1}"
    content = model(nodes, {"x": (window, 3)}, {at: (freedom,)}, weights)
    answer = told(at, measures, Covariance(form="none", sigma=(1e3,)), lasting=lasting)
    return written(folder, "perceptron", content, seen("accelerometer", window, scale=10.0), answer)


def changed(path, place, value):
    """Change one entry of a manifest's file."""
    content = json.loads(path.read_text())
    *tables, key = place
    part = content
    for name in tables:
        part = part[name]
    part[key] = value
    path.write_text(json.dumps(content))


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
