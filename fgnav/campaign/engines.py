"""Execution of runs: processes on this machine, or a dask cluster that is there already.

Both take a function and arguments and yield results as they come. A worker that dies takes nothing
with it but the run it was at, which is tried again; a run that kills three is given up.
"""

import os
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import get_context
from typing import Protocol, TypeVar

from fgnav.checks import BadInputError

T = TypeVar("T")
R = TypeVar("R")
DIED = "its worker died three times, for want of memory perhaps"

_TRIES = 3
_AHEAD = 2  # runs a worker has waiting or at work
_WATCH_S = 1.0
_CONNECT_S = 10
# Threads of libraries beside as many processes as there are cores only wait for each other.
_ONE_THREAD = dict.fromkeys(
    ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1"
)


class Engine(Protocol):
    """Function from tasks to results, in whatever order they come."""

    def __call__(
        self, work: Callable[[T], R], tasks: Iterable[T], lost: Callable[[T], R]
    ) -> Iterator[R]:
        """Yield ``work(task)`` of each task, or ``lost(task)`` where it kills its workers."""
        ...


class Local:
    """Processes on this machine.

    Parameters
    ----------
    workers : int
        How many; one works a run at a time.
    """

    def __init__(self, workers: int) -> None:
        if workers < 1:
            raise BadInputError(f"--workers: must be 1 or more, got {workers}")
        self._workers = workers

    def __call__(
        self, work: Callable[[T], R], tasks: Iterable[T], lost: Callable[[T], R]
    ) -> Iterator[R]:
        """Yield results; see ``Engine``."""
        waiting, alone = deque((task, 1) for task in tasks), deque[tuple[T, int]]()
        while waiting or alone:
            # Which run killed a worker is not known: those that were under way go on singly.
            queue = deque([alone.popleft()]) if alone else waiting
            running: dict[Future[R], tuple[T, int]] = {}
            with self._pool() as pool, suppress(BrokenProcessPool):
                while queue or running:
                    while queue and len(running) < _AHEAD * self._workers:
                        running[pool.submit(_under, os.getpid(), work, queue[0][0])] = queue[0]
                        queue.popleft()
                    for future in wait(running, return_when=FIRST_COMPLETED).done:
                        result = future.result()
                        del running[future]
                        yield result
            for task, tries in running.values():
                if tries < _TRIES:
                    alone.append((task, tries + 1))
                else:
                    yield lost(task)

    @contextmanager
    def _pool(self) -> Iterator[ProcessPoolExecutor]:
        """Yield processes; whatever they are at is left when this ends."""
        os.environ.update({k: os.environ.get(k, v) for k, v in _ONE_THREAD.items()})
        pool = ProcessPoolExecutor(
            self._workers,
            mp_context=get_context("spawn"),  # libraries that run threads do not survive a fork
            initializer=_end_with,
            initargs=(os.getpid(),),
        )
        try:
            yield pool
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _under(parent: int, work: Callable[[T], R], task: T) -> R:
    """Work for a parent that lives: whatever a worker began after its end would be done again."""
    if os.getppid() != parent:
        os._exit(1)
    return work(task)


def _end_with(parent: int) -> None:
    """End this process soon after its parent: a killed parent tells its workers nothing."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(_WATCH_S)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


class Dask:
    """Workers of a dask cluster; ``fgnav`` must be installed where they run.

    Parameters
    ----------
    scheduler : str
        Address: ``"tcp://host:8786"``.
    """

    def __init__(self, scheduler: str) -> None:
        self._scheduler = scheduler

    def __call__(
        self, work: Callable[[T], R], tasks: Iterable[T], lost: Callable[[T], R]
    ) -> Iterator[R]:
        """Yield results; see ``Engine``."""
        try:
            from distributed import Client, as_completed  # noqa: PLC0415  # an extra
            from distributed.scheduler import KilledWorker  # noqa: PLC0415
        except ImportError:
            raise BadInputError("--scheduler: needs dask; pip install 'fgnav[cluster]'") from None
        try:
            client = Client(self._scheduler, timeout=_CONNECT_S, set_as_default=False)
        except (OSError, ValueError, TimeoutError) as error:
            raise BadInputError(f"--scheduler {self._scheduler}: {error}") from None
        with client:
            waiting, running = iter(tasks), {}

            def submit(count: int) -> list[object]:
                batch = list(islice(waiting, count))
                # Each run is asked for once: a key of its content would be looked up on the way.
                futures = [client.submit(work, task, pure=False) for task in batch]
                running.update({f.key: t for f, t in zip(futures, batch, strict=True)})
                return futures

            threads = max(1, sum(client.nthreads().values()))
            completed = as_completed(submit(_AHEAD * threads), loop=client.loop)
            for future in completed:
                task = running.pop(future.key)
                try:
                    result = future.result()
                except KilledWorker:
                    result = lost(task)
                future.release()
                completed.update(submit(1))
                yield result
