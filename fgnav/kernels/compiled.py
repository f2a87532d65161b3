"""How compiled functions are compiled: those that Python calls, and those that only these call.

Each could be called from Python and from C, and the code for that is half of what is compiled of a
short one. A ``kernel`` leaves out the one, an ``inner`` function both: called from Python it would
end the process, so it is private to a file of kernels (``tests/test_house.py`` looks). It is kept
with those that call it, and needs no file of its own. What is divided by zero is infinite or NaN,
as in numpy: else a check of each division would be compiled, too.

LLVM optimises a function and all below it, and again within each function above it. What one place
alone calls is ``inlined`` there, before types are inferred, and compiled once.
"""

import gc
from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])
_njit: Callable[..., Any] = njit  # its types leave out options without wrappers
# CPython keeps frames in pieces of 16 kB and maps a new piece for each call across a border: 49,000
# times while one kernel compiles, 5 s of system time of a first run. A frame that asks for more
# than half of 1 MB gets a piece of that size, and the calls within it the rest.
_STACK_SLOTS = 70_000  # of 8 bytes


def kernel_with(*, fastmath: bool | set[str] = False) -> Callable[[Function], Function]:
    """Return a decorator for what Python calls, with such rounding as numba's option allows."""
    options = {"no_cfunc_wrapper": True, "error_model": "numpy", "fastmath": fastmath}
    decorator = _njit(cache=True, nogil=True, **options)

    def compiled(function: Function) -> Function:
        dispatcher: Function = _compiled_at_ease(decorator(function))
        return dispatcher

    return compiled


def _compiled_at_ease(dispatcher: Any) -> Any:  # noqa: ANN401  # numba has no types
    """Let a kernel compile with its frames in one piece and no search for garbage.

    Millions of small objects are made meanwhile, and most of them stay: to collect by default is a
    seventh of a first run.
    """
    compile_now = dispatcher.compile

    def compile_at_ease(signature: object) -> object:
        collects = gc.isenabled()
        gc.disable()
        try:
            return compile_now(signature)
        finally:
            if collects:
                gc.enable()

    compile_at_ease.__code__ = compile_at_ease.__code__.replace(co_stacksize=_STACK_SLOTS)
    dispatcher.compile = compile_at_ease
    _without_stale_cache(dispatcher._cache)  # numba has no other door to it
    return dispatcher


def _without_stale_cache(cache: Any) -> None:  # noqa: ANN401  # numba has no types
    """Let a kernel that an earlier version compiled be compiled anew where its modules are gone."""
    load = cache.load_overload

    def load_overload(signature: object, context: object) -> object:
        try:
            return load(signature, context)
        except (ImportError, AttributeError):
            cache.flush()
            return None

    cache.load_overload = load_overload


def inner_with(*, fastmath: bool | set[str] = False) -> Callable[[Function], Function]:
    """Return a decorator for what only kernels call, rounded as numba's option allows."""
    decorator: Callable[[Function], Function] = _njit(
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        error_model="numpy",
        fastmath=fastmath,
    )
    return decorator


def kernel(function: Function) -> Function:
    """Compile what Python calls."""
    return kernel_with()(function)


def inner(function: Function) -> Function:
    """Compile what only kernels call."""
    return inner_with()(function)


def inlined(function: Function) -> Function:
    """Make a function a part of the only one that calls it; called from Python it is a kernel."""
    decorated: Function = _njit(
        cache=True, nogil=True, no_cfunc_wrapper=True, error_model="numpy", inline="always"
    )(function)
    return decorated
