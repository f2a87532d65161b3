"""Epochs shared out among threads; compiled kernels release the interpreter's lock meanwhile."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

from numba import config

_BLOCKS = 4  # per thread: blocks differ in work


def in_blocks(work: Callable[[slice], None], n: int, *, least: int) -> None:
    """Call ``work`` on slices that make up ``range(n)``, in ``NUMBA_NUM_THREADS`` threads.

    Parameters
    ----------
    work : callable
        Writes what it finds of its slice, and nothing else.
    least : int
        Of a slice; fewer than twice as many are done here and now.
    """
    most: int = config.NUMBA_NUM_THREADS  # type: ignore[attr-defined, unused-ignore]
    threads = min(most, n // least)
    if threads < 2:
        work(slice(0, n))
        return
    size = max(least, -(-n // (_BLOCKS * threads)))
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(work, [slice(i, min(i + size, n)) for i in range(0, n, size)]))
