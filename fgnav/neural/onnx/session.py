"""A network that runs beside this process, within bounds of memory and time; errors are one line.

Graphs hold no loops (``scan``), but how long one node takes, what it asks for and whether it
crashes is still the file's choice, which may be a stranger's: a process of its own can be ended.
It answers any number of questions.
"""

import os
import subprocess
import sys
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from threading import Lock
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError
from fgnav.neural.onnx.child import TOO_LONG
from fgnav.neural.onnx.messages import receive, send

# ambiguity-classification takes a second for 20,000 rows, trust 0.1 s for 4,096 candidates; with
# all that is before it, a run that is ended so has taken less than 10 s.
CPU_S = 5.0
_LONGEST_REASON = 200


@dataclass(frozen=True, slots=True)
class Port:
    """An input or output of a graph, as onnxruntime names its type: ``"tensor(float)"``."""

    name: str
    type: str
    shape: tuple[int | str | None, ...]


class Session:
    """A network ready to run on the CPU.

    Parameters
    ----------
    path : Path
        For the errors' texts.
    content : bytes
        The ONNX file.
    threads : int
        For one run.

    Attributes
    ----------
    inputs, outputs : tuple of Port
        The graph's.

    Raises
    ------
    BadInputError
        If onnxruntime is not installed or refuses the file.
    """

    def __init__(self, path: Path, content: bytes, threads: int) -> None:
        if find_spec("onnxruntime") is None:
            raise BadInputError(f"{path}: a network needs onnxruntime; pip install onnxruntime")
        self._path, self._content, self._threads = path, content, threads
        self._lock = Lock()
        self._open()

    def run(self, names: Sequence[str], feed: Mapping[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the outputs of those names.

        Raises
        ------
        BadInputError
            If the network fails, or wants more time or memory than it may have.
        """
        with self._lock:
            if self._owner != os.getpid():  # a fork: answers would go to whoever reads first
                self._open()
            words = {"inputs": list(feed), "outputs": list(names)}
            return self._answer("stops at it", words, list(feed.values()))[1]

    def _open(self) -> None:
        self._owner = os.getpid()
        paths = os.pathsep.join(path or str(Path.cwd()) for path in sys.path)  # finds what we find
        self._child = subprocess.Popen(  # this interpreter, fixed arguments
            (sys.executable, "-P", "-m", "fgnav.neural.onnx.child"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env=os.environ | {"PYTHONPATH": paths},
        )
        weakref.finalize(self, _end, self._child, self._owner)
        content = np.frombuffer(self._content, np.uint8)
        graph = self._answer("refuses it", {"threads": self._threads}, [content])[0]
        self.inputs, self.outputs = (
            tuple(Port(name, kind, tuple(shape)) for name, kind, shape in graph[side])
            for side in ("inputs", "outputs")
        )

    def _answer(
        self, what: str, words: dict[str, Any], arrays: Sequence[NDArray[Any]]
    ) -> tuple[dict[str, Any], list[NDArray[Any]]]:
        try:
            send(_pipe(self._child.stdin), {**words, "cpu_s": CPU_S}, arrays)
            header, results = receive(_pipe(self._child.stdout))
            reason = header.get("error")
        except (EOFError, OSError):
            reason = _ending(self._child)
            header, results = {}, []
            self._owner = 0  # whoever asks again asks another process
        if reason is not None:
            raise BadInputError(f"{self._path}: onnxruntime {what}: {reason:.{_LONGEST_REASON}}")
        return header, results


def _pipe(stream: Any) -> BinaryIO:  # noqa: ANN401  # None or a stream, by the arguments of Popen
    if stream is None:
        raise EOFError
    return stream  # type: ignore[no-any-return]


def _ending(child: "subprocess.Popen[bytes]") -> str:
    """Return why a process has ended."""
    status = child.wait()
    if status == TOO_LONG:
        return f"more than {CPU_S:g} s of computing"
    return f"its process ended with status {status}"


def _end(child: "subprocess.Popen[bytes]", owner: int) -> None:
    """End a process that nobody will ask again; a fork leaves it to whoever started it."""
    if os.getpid() == owner:
        child.kill()
        child.communicate()
