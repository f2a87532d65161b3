"""Looks through an ONNX file before anything runs it: weights finite, operators standard.

A reader of protobuf's wire format, field by field: onnx itself is needed for training only.
Field numbers are those of ``onnx.proto`` (ONNX 1.17), message by message.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from fgnav.checks import BadInputError

_MOST_FIELDS = 100_000  # nodes, or weights outside of raw bytes: released networks have 300
_STANDARD_DOMAINS = (b"", b"ai.onnx")
_FLOATS: dict[int, np.dtype[np.floating[Any]]] = {  # TensorProto.DataType
    1: np.dtype("<f4"),
    10: np.dtype("<f2"),
    11: np.dtype("<f8"),
}
_WHOLE_NUMBERS = frozenset({2, 3, 4, 5, 6, 7, 9, 12, 13})  # integers and bool: nothing to check


class _NotOnnx(Exception):  # noqa: N818  # inside this file only
    """The bytes are not what the format allows; the text says why."""


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
    try:
        graphs = _check_model(memoryview(content))
    except _NotOnnx as error:
        raise BadInputError(f"{where}: {error}; take the released file again") from None
    if graphs != 1:
        raise BadInputError(f"{where}: must be an ONNX file with one graph, has {graphs}")


def _check_model(model: memoryview) -> int:
    graphs = 0
    for number, value in _fields(model):
        if number == 7:
            graphs += 1
            _check_graph(_message(value))
        elif number == 25:
            raise _NotOnnx("brings functions of its own, only standard operators are run")
    return graphs


def _check_graph(graph: memoryview) -> None:
    for number, value in _fields(graph):
        if number == 1:
            _check_node(_message(value))
        elif number == 5:
            _check_tensor(_message(value))
        elif number == 15:
            raise _NotOnnx("holds sparse weights, only dense ones are read")


def _check_node(node: memoryview) -> None:
    for number, value in _fields(node):
        if number == 7 and bytes(_message(value)) not in _STANDARD_DOMAINS:
            domain = bytes(_message(value)).decode("utf-8", "replace")
            raise _NotOnnx(f"uses an operator of {domain!r}, only standard operators are run")
        if number == 5:
            for inner, part in _fields(_message(value)):
                if inner in (5, 10):  # a tensor, or one of several
                    _check_tensor(_message(part))
                elif inner in (6, 11):  # a graph, or one of several
                    raise _NotOnnx("holds a graph in a node (If, Loop, Scan): it may never end")


def _check_tensor(tensor: memoryview) -> None:
    kind, name, packed = 0, "", False
    parts: list[memoryview] = []
    for number, value in _fields(tensor):
        if isinstance(value, int):
            kind = value if number == 2 else kind
            if number == 14 and value:
                raise _NotOnnx("keeps weights in other files, they must all be inside")
        elif number == 8:
            name = bytes(value).decode("utf-8", "replace")
        elif number == 5:
            packed = True
        elif number in (4, 9, 10):
            parts.append(value)
    if kind not in _FLOATS and kind not in _WHOLE_NUMBERS:
        raise _NotOnnx(f"weights {name!r} have type {kind}, only plain numbers are read")
    if kind in _FLOATS:
        _check_floats(name, _FLOATS[kind], parts, packed=packed)


def _check_floats(
    name: str, dtype: np.dtype[np.floating[Any]], parts: list[memoryview], *, packed: bool
) -> None:
    if packed or any(len(part) % dtype.itemsize for part in parts):
        raise _NotOnnx(f"weights {name!r} are packed in a way that is not read")
    if not all(np.isfinite(np.frombuffer(part, dtype)).all() for part in parts):
        raise _NotOnnx(f"weights {name!r} are not all finite")


def _message(value: "int | memoryview") -> memoryview:
    if isinstance(value, int):
        raise _NotOnnx("must be an ONNX file, a number stands where a message is due")
    return value


def _fields(message: memoryview) -> "Iterator[tuple[int, int | memoryview]]":
    """Yield field number and value of a message: a whole number, or the bytes of the field."""
    at = count = 0
    while at < len(message):
        count += 1
        if count > _MOST_FIELDS:
            raise _NotOnnx(f"has more than {_MOST_FIELDS} fields in a message")
        key, at = _varint(message, at)
        wire = key & 7
        if wire == 0:
            value, at = _varint(message, at)
            yield key >> 3, value
            continue
        if wire == 2:
            length, at = _varint(message, at)
        elif wire in (1, 5):
            length = 8 if wire == 1 else 4
        else:
            raise _NotOnnx("must be an ONNX file, its bytes are not")
        if at + length > len(message):
            raise _NotOnnx("must be an ONNX file, its bytes end too early")
        yield key >> 3, message[at : at + length]
        at += length


def _varint(message: memoryview, at: int) -> tuple[int, int]:
    """Return the whole number at a place, and the place behind it."""
    value = shift = 0
    while True:
        if at >= len(message) or shift > 63:
            raise _NotOnnx("must be an ONNX file, its bytes are not")
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
