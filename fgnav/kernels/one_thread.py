"""Linear algebra in one thread: sums are the same to the last bit whatever number there may be.

And sooner done where matrices are small: scipy's L-BFGS-B of four variables takes five times as
long where its BLAS has two threads, which wait for each other, and a hundred times as long where
other programs keep the processors busy.
"""

from collections.abc import Callable
from contextlib import AbstractContextManager
from functools import cache, wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController

_P = ParamSpec("_P")
_T = TypeVar("_T")


def in_one_thread(function: Callable[_P, _T]) -> Callable[_P, _T]:
    """Return a function during which BLAS has one thread."""

    @wraps(function)
    def limited(*args: _P.args, **kwargs: _P.kwargs) -> _T:
        with one_thread():
            return function(*args, **kwargs)

    return limited


@cache
def _loaded() -> "ThreadpoolController":
    """Return all BLAS libraries of the process; 7 ms, so once, when scipy has brought its own."""
    from threadpoolctl import ThreadpoolController  # noqa: PLC0415  # lazy: it reads what is loaded

    return ThreadpoolController()


def one_thread() -> AbstractContextManager[Any]:
    """Return a context in which BLAS has one thread."""
    limited: AbstractContextManager[Any] = _loaded().limit(limits=1, user_api="blas")
    return limited
