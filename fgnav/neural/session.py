"""onnxruntime's session within bounds: memory and time, and errors that are one line.

Graphs hold no loops (``onnx_scan``), so that a run ends; how long one node takes and how much it
asks for is still the file's choice, which may be a stranger's.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import Event, Thread
from time import process_time
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from fgnav.checks import BadInputError

if TYPE_CHECKING:
    from onnxruntime import InferenceSession, RunOptions

# Of the released networks the widest, ambiguity-classification, takes 0.5 GB and a second for
# 20,000 rows, twice what its resolver sends at a time; trust 0.1 s for its 4,096 candidates.
MEMORY_BYTES, CPU_S = 3 << 29, 10.0
_POLL_S = 0.05
_LONGEST_REASON = 200


class Session:
    """A network in memory, ready to run on the CPU.

    Parameters
    ----------
    path : Path
        For the errors' texts.
    content : bytes
        The ONNX file.
    threads : int
        For one run.

    Raises
    ------
    BadInputError
        If onnxruntime is not installed or refuses the file.
    """

    def __init__(self, path: Path, content: bytes, threads: int) -> None:
        try:
            import onnxruntime  # noqa: PLC0415  # heavy, and an extra
        except ModuleNotFoundError:
            raise BadInputError(
                f"{path}: a network needs onnxruntime; pip install 'fgnav[networks]'"
            ) from None
        _bound_memory()
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 4  # an error is raised, not printed
        options.add_session_config_entry("session.use_env_allocators", "1")
        self._path, self._run_options = path, onnxruntime.RunOptions
        with _named(path, "refuses it"):
            self._session: InferenceSession = onnxruntime.InferenceSession(
                content,
                options,
                providers=["CPUExecutionProvider"],
                # Constants would be computed while the file is loaded, without a limit.
                disabled_optimizers=["ConstantFolding"],
                enable_fallback=0,  # prints, then fails again
            )

    def inputs(self) -> Any:  # noqa: ANN401  # onnxruntime has no types
        """Return the graph's inputs: name, type, shape."""
        return self._session.get_inputs()

    def outputs(self) -> Any:  # noqa: ANN401  # as above
        """Return the graph's outputs: name, type, shape."""
        return self._session.get_outputs()

    def run(self, names: Sequence[str], feed: dict[str, NDArray[Any]]) -> list[NDArray[Any]]:
        """Return the outputs of those names.

        Raises
        ------
        BadInputError
            If the network fails, or wants more than ``CPU_S`` or ``MEMORY_BYTES``.
        """
        options = self._run_options()
        options.log_severity_level = 4
        with _named(self._path, "stops at it"), _ended_in_time(options):
            answer: list[NDArray[Any]] = self._session.run(list(names), feed, options)
        return answer


@cache
def _bound_memory() -> None:
    """Give all sessions of this process one arena that ends somewhere."""
    import onnxruntime  # noqa: PLC0415  # as above

    kind = onnxruntime.OrtAllocatorType.ORT_ARENA_ALLOCATOR
    info = onnxruntime.OrtMemoryInfo("Cpu", kind, 0, onnxruntime.OrtMemType.DEFAULT)
    onnxruntime.create_and_register_allocator(
        info, onnxruntime.OrtArenaCfg({"max_mem": MEMORY_BYTES, "arena_extend_strategy": 1})
    )


@contextmanager
def _named(path: Path, what: str) -> Iterator[None]:
    """Turn onnxruntime's errors, and its texts that are no UTF-8, into one line."""
    from onnxruntime.capi import onnxruntime_pybind11_state as errors  # noqa: PLC0415  # as above

    refusals = (
        errors.EPFail,
        errors.EngineError,
        errors.Fail,
        errors.InvalidArgument,
        errors.InvalidGraph,
        errors.InvalidProtobuf,
        errors.NotImplemented,
        errors.RuntimeException,
        MemoryError,
        RuntimeError,
        UnicodeDecodeError,
    )
    try:
        yield
    except refusals as error:
        reason = " ".join(str(error).split())
        if "terminate flag" in reason:
            reason = f"more than {CPU_S:g} s of computing"
        raise BadInputError(f"{path}: onnxruntime {what}: {reason:.{_LONGEST_REASON}}") from None


@contextmanager
def _ended_in_time(options: "RunOptions") -> Iterator[None]:
    """Ask a run to end, after the node it is at, once it has computed for too long."""
    done, limit_s = Event(), process_time() + CPU_S

    def watch() -> None:
        while not done.wait(_POLL_S):
            if process_time() > limit_s:
                options.terminate = True

    watcher = Thread(target=watch, daemon=True)
    watcher.start()
    try:
        yield
    finally:
        done.set()
        watcher.join()
