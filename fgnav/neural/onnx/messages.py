"""Messages between two processes through a pipe: words as JSON, then arrays byte by byte."""

import json
from collections.abc import Mapping, Sequence
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

_LENGTH_BYTES = 8


def send(stream: BinaryIO, words: Mapping[str, Any], arrays: Sequence[NDArray[Any]] = ()) -> None:
    """Write a message of words and arrays of plain numbers."""
    shapes = [[array.dtype.str, array.shape] for array in arrays]
    header = json.dumps({"words": words, "arrays": shapes}).encode()
    stream.write(len(header).to_bytes(_LENGTH_BYTES, "little") + header)
    for array in arrays:
        stream.write(array.tobytes())
    stream.flush()


def receive(stream: BinaryIO) -> tuple[dict[str, Any], list[NDArray[Any]]]:
    """Return words and arrays of the next message.

    Raises
    ------
    EOFError
        If the other side has ended.
    """
    header = json.loads(_exactly(stream, int.from_bytes(_exactly(stream, _LENGTH_BYTES), "little")))
    return header["words"], [_array(stream, *header_entry) for header_entry in header["arrays"]]


def _array(stream: BinaryIO, kind: str, shape: Sequence[int]) -> NDArray[Any]:
    dtype = np.dtype(kind)
    size = dtype.itemsize * int(np.prod(shape, dtype=np.int64))
    return np.frombuffer(bytearray(_exactly(stream, size)), dtype).reshape(shape)


def _exactly(stream: BinaryIO, size: int) -> bytes:
    content = stream.read(size)
    if len(content) < size:
        raise EOFError
    return content
