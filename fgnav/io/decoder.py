"""Child processes that run RTKLIB's reader, so that a crash or a hang ends as one clear error."""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError
from fgnav.io.rinex.header import Kind
from fgnav.io.rtklib import STRUCTURES

COMMAND = (sys.executable, "-m", "fgnav.io.rtklib")
TIMEOUT_S = 60.0  # for a file of no size; RTKLIB reads 70 MB/s
_TIMEOUT_S_PER_MB = 2.0
_FEW_BYTES = 5_000_000  # decoded in the time that another process takes to start


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """One file to decode."""

    kind: Kind
    source: Path  # the user's file, for error texts
    path: Path  # the plain, checked file to decode
    options: str = ""  # RTKLIB's reading options


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Decoded:
    """Arrays of the decoder, one per job, and what its numbers mean."""

    jobs: tuple[Job, ...]
    files: tuple[Path, ...]  # the records of each job, as they lay in memory
    # satellites, signals: RINEX names by RTKLIB's satellite and code numbers
    satellites: NDArray[np.str_]
    signals: NDArray[np.str_]

    def records(self, job: int) -> NDArray[Any]:
        """Return the records of a job, read-only; they take memory only while they are looked at.

        Returns
        -------
        ndarray, shape (k,)
            Of the fields of ``Record`` or ``Message`` in ``fgnav.io.rtklib``.
        """
        dtype = np.dtype(STRUCTURES[self.jobs[job].kind])
        if self.files[job].stat().st_size == 0:  # nothing to map
            return np.empty(0, dtype)
        mapped = np.memmap(self.files[job], dtype, mode="r")
        return np.asarray(mapped)  # numba does not know memory maps


class Decoder:
    """Processes that load RTKLIB while the caller checks the files, then decode what it sends.

    Parameters
    ----------
    files : sequence of Path
        What will come, of whoever made it; few bytes are decoded by one process, more by as many
        as there are files and processors.
    folder : Path
        Temporary folder for the arrays, which outlives this object's last result.
    command : sequence of str
        The program that decodes.
    timeout_s : float
        Limit for a file of no size; 2 s per megabyte are added.
    """

    def __init__(
        self,
        files: Sequence[Path],
        folder: Path,
        *,
        command: Sequence[str] = COMMAND,
        timeout_s: float = TIMEOUT_S,
    ) -> None:
        package_root = str(Path(__file__).resolve().parents[2])
        paths = [package_root, os.environ.get("PYTHONPATH", "")]
        environment = os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, paths))}
        self._folder = folder
        self._timeout_s = timeout_s
        self._children = [
            subprocess.Popen(  # this interpreter, fixed arguments
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                env=environment,
                text=True,
            )
            for _ in range(_processes(files))
        ]

    def __enter__(self) -> Self:
        """Return the decoder itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """End every process that still runs."""
        for child in self._children:
            child.kill()
            child.communicate()

    def decode(self, jobs: Sequence[Job]) -> Decoded:
        """Decode files, shared among the processes by size; may be called once.

        Returns
        -------
        Decoded
            In the order of the jobs.

        Raises
        ------
        BadInputError
            If the reader crashes or hangs: the text names the file.
        """
        sizes = [job.path.stat().st_size for job in jobs]
        shares: list[list[int]] = [[] for _ in self._children]
        for k in np.argsort(sizes)[::-1].tolist():  # largest first, to whoever has least
            min(shares, key=lambda share: sum(sizes[i] for i in share)).append(k)
        for number, (child, share) in enumerate(zip(self._children, shares, strict=True)):
            self._send(child, number, [jobs[k] for k in share], share)
        for child, share in zip(self._children, shares, strict=True):
            limit_s = self._timeout_s + _TIMEOUT_S_PER_MB * sum(sizes[k] for k in share) / 1e6
            self._finish(child, share, jobs, limit_s)
        names = json.loads((self._folder / "names0.json").read_text(encoding="utf-8"))
        return Decoded(
            jobs=tuple(jobs),
            files=tuple(self._out(k) for k in range(len(jobs))),
            satellites=np.array(names["satellites"], "U3"),
            signals=np.array(names["signals"], "U2"),
        )

    def _out(self, job: int) -> Path:
        return self._folder / f"records{job}"

    def _send(
        self, child: subprocess.Popen[str], number: int, jobs: Sequence[Job], share: Sequence[int]
    ) -> None:
        """Hand a process its jobs and close its input."""
        work = [
            {"kind": j.kind, "path": str(j.path), "options": j.options, "out": str(self._out(k))}
            for j, k in zip(jobs, share, strict=True)
        ]
        names = str(self._folder / f"names{number}.json")
        if child.stdin is None:  # closed: it was used before
            raise BadInputError("decoder: takes one list of jobs only")
        try:
            json.dump({"names": names, "jobs": work}, child.stdin)
            child.stdin.close()
        except BrokenPipeError:
            pass  # it died already: its exit status says why
        child.stdin = None

    def _finish(
        self,
        child: subprocess.Popen[str],
        share: Sequence[int],
        jobs: Sequence[Job],
        limit_s: float,
    ) -> None:
        """Wait for a process and turn whatever went wrong into an error that names the file."""
        try:
            _, errors = child.communicate(timeout=limit_s)
        except subprocess.TimeoutExpired as error:
            raise BadInputError(
                f"{self._unfinished(share, jobs)}: RTKLIB's reader did not end within "
                f"{limit_s:.0f} s; the file is damaged in a way that the checks do not see"
            ) from error
        if child.returncode > 0 and errors:
            raise BadInputError(f"RTKLIB's reader cannot run: {errors.strip().splitlines()[-1]}")
        if child.returncode:
            raise BadInputError(
                f"{self._unfinished(share, jobs)}: RTKLIB's reader crashed (status "
                f"{child.returncode}); the file is damaged in a way that the checks do not see"
            )

    def _unfinished(self, share: Sequence[int], jobs: Sequence[Job]) -> Path:
        """Return the file that a process was at: the first without a result."""
        unfinished = [k for k in share if not self._out(k).exists()]
        return jobs[unfinished[0] if unfinished else share[-1]].source


def _processes(files: Sequence[Path]) -> int:
    size = sum(file.stat().st_size for file in files if file.exists())  # else: told by who reads it
    return 1 if size < _FEW_BYTES else min(len(files), os.cpu_count() or 1)
