"""onnxruntime in a process of its own: ``python -m fgnav.neural.onnx.child``, asked through pipes.

The first message is an ONNX file and how many threads run it, every other one a network's inputs.
Whatever takes too long or too much ends the process, within any node of the graph.
"""

import os
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread
from time import process_time
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fgnav.neural.onnx.messages import receive, send

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

TOO_LONG = 75  # exit status
# Of the released networks the widest, ambiguity-classification, takes 0.5 GB for 20,000 rows, twice
# what its resolver sends at a time; Python, numpy and onnxruntime have 0.2 GB of data.
_ARENA_BYTES, _DATA_BYTES = 3 << 29, 7 << 28
_ANSWER_BYTES = 1 << 28  # 4,096 windows have 64 kB each
_POLL_S = 0.05


def main() -> None:
    """Answer until nobody asks any more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever onnxruntime prints goes elsewhere
    session: InferenceSession | None = None
    with suppress(EOFError, BrokenPipeError):
        while True:
            words, arrays = receive(sys.stdin.buffer)
            header: dict[str, Any] = {}
            results: list[NDArray[Any]] = []
            try:
                with _ended_after(words["cpu_s"]):
                    if session is None:
                        _bound_memory()
                        session = _opened(arrays[0].tobytes(), words["threads"])
                        header = {side: _ports(session, side) for side in ("inputs", "outputs")}
                    else:
                        feed = dict(zip(words["inputs"], arrays, strict=True))
                        results = _run(session, words["outputs"], feed)
            except Exception as error:  # noqa: BLE001  # whatever it is, the parent raises it
                header = {"error": " ".join(str(error).split()) or type(error).__name__}
            send(answers, header, results)


def _bound_memory() -> None:
    """Limit this process' data, and what all nodes hold at a time."""
    import onnxruntime  # noqa: PLC0415  # heavy

    resource.setrlimit(resource.RLIMIT_DATA, (_DATA_BYTES, _DATA_BYTES))
    kind = onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR
    info = onnxruntime.OrtMemoryInfo("Cpu", kind, 0, onnxruntime.OrtMemType.DEFAULT)
    onnxruntime.create_and_register_allocator(
        info, onnxruntime.OrtArenaCfg({"max_mem": _ARENA_BYTES, "arena_extend_strategy": 1})
    )


def _opened(content: bytes, threads: int) -> "InferenceSession":
    import onnxruntime  # noqa: PLC0415  # heavy

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # an error is raised, not printed
    options.add_session_config_entry("session.use_env_allocators", "1")
    return onnxruntime.InferenceSession(
        content,
        options,
        providers=["CPUExecutionProvider"],
        # Parameters would be computed while the file is loaded, out of the arena.
        disabled_optimizers=["ConstantFolding"],
        enable_fallback=0,  # prints, then fails again
    )


def _ports(session: "InferenceSession", side: str) -> list[Any]:
    return [[port.name, port.type, port.shape] for port in getattr(session, f"get_{side}")()]


def _run(
    session: "InferenceSession", outputs: list[str], feed: dict[str, NDArray[Any]]
) -> list[NDArray[Any]]:
    results = [np.asarray(output) for output in session.run(outputs, feed)]
    for name, output in zip(outputs, results, strict=True):
        if output.dtype.kind not in "biuf":
            raise ValueError(f"output {name!r} is no array of numbers")
    if sum(output.nbytes for output in results) > _ANSWER_BYTES:
        raise ValueError(f"more than {_ANSWER_BYTES} bytes of outputs")
    return results


@contextmanager
def _ended_after(cpu_s: float) -> Iterator[None]:
    """End this process once it has computed for longer; onnxruntime lets other threads run."""
    done, limit_s = Event(), process_time() + cpu_s

    def watch() -> None:
        while not done.wait(_POLL_S):
            if process_time() > limit_s:
                os._exit(TOO_LONG)

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()


if __name__ == "__main__":
    main()
