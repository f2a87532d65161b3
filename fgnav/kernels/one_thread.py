"""Small linear algebra in one thread: several would wait for each other, 2 ms of each call.

scipy's L-BFGS-B of four variables takes five times as long where its BLAS has two threads, and a
hundred times as long where other programs keep the processors busy.
"""

from contextlib import AbstractContextManager
from functools import cache
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


@cache
def _loaded() -> "ThreadpoolController":
    """Return all BLAS libraries of the process; 7 ms, so once, when scipy has brought its own."""
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415  # lazy: it reads what is loaded

    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which BLAS has one thread."""
    limited: AbstractContextManager[Any] = _loaded().limit(limits=1, user_api="blas")
    return limited
