"""Looks through an ONNX file before anything runs it: weights finite, operators standard."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from fgnav.checks import BadInputError

if TYPE_CHECKING:
    from onnx import GraphProto, ModelProto, NodeProto, TensorProto

_STANDARD_DOMAINS = ("", "ai.onnx")


def scan(where: str, content: bytes) -> None:
    """Raise unless a file holds one ONNX graph of standard operators with finite weights.

    Parameters
    ----------
    where : str
        Name of the file, for the error's text.
    content : bytes

    Raises
    ------
    BadInputError
        If the bytes are not ONNX, or the graph keeps weights in other files, brings its own
        functions, uses operators outside the standard, or holds a weight that is not finite.
    """
    from google.protobuf.message import DecodeError  # noqa: PLC0415  # lazy: .1 s
    from onnx import ModelProto  # noqa: PLC0415

    try:
        wrong = next(_wrong(ModelProto.FromString(content)), None)
    except DecodeError:
        wrong = "must be an ONNX file, its bytes are not"
    if wrong is not None:
        raise BadInputError(f"{where}: {wrong}; take the released file again")


def _wrong(model: "ModelProto") -> Iterator[str]:
    """Yield what a model has that is not run."""
    if not model.HasField("graph"):
        yield "must be an ONNX file with one graph, has 0"
    if model.functions:
        yield "brings functions of its own, only standard operators are run"
    if model.graph.sparse_initializer:
        yield "holds sparse weights, only dense ones are read"
    for node in model.graph.node:
        yield from _wrong_of_node(node)
    for tensor in _tensors(model.graph):
        yield from _wrong_of_tensor(tensor)


def _wrong_of_node(node: "NodeProto") -> Iterator[str]:
    if node.domain not in _STANDARD_DOMAINS:
        yield f"uses an operator of {node.domain!r}, only standard operators are run"
    if any(attribute.HasField("g") or attribute.graphs for attribute in node.attribute):
        yield "holds a graph in a node (If, Loop, Scan): it may never end"
    if any(
        attribute.HasField("sparse_tensor") or attribute.sparse_tensors
        for attribute in node.attribute
    ):
        yield "holds sparse weights, only dense ones are read"


def _tensors(graph: "GraphProto") -> Iterator["TensorProto"]:
    """Yield initial values and constants."""
    yield from graph.initializer
    for node in graph.node:
        for attribute in node.attribute:
            yield from ([attribute.t] if attribute.HasField("t") else [])
            yield from attribute.tensors


def _wrong_of_tensor(tensor: "TensorProto") -> Iterator[str]:
    from onnx import TensorProto, numpy_helper  # noqa: PLC0415  # lazy, as above

    kind = tensor.data_type
    if tensor.data_location == TensorProto.EXTERNAL or tensor.external_data:
        yield "keeps weights in other files, they must all be inside"
    elif not 1 <= kind <= TensorProto.UINT64 or kind == TensorProto.STRING:
        yield f"weights {tensor.name!r} have type {kind}, only plain numbers are read"
    else:
        try:
            finite = bool(np.isfinite(numpy_helper.to_array(tensor)).all())
        except (ValueError, TypeError):
            yield f"weights {tensor.name!r} are packed in a way that is not read"
        else:
            if not finite:
                yield f"weights {tensor.name!r} are not all finite"
