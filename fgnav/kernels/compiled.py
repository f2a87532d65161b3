"""Compilation of functions, ``kernel``: from Python once and for good, within each other once.

Called from Python, a kernel is compiled with all that it calls and kept on disk. Called from
another kernel it is a part of that: no entry from Python or C, no file of its own, and neither
optimised nor made machine code for itself (``linking``). What is divided by zero is infinite or
NaN, as in numpy: else a check of each division would be compiled, too.
"""

import gc
from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit
from numba.core import event

from fgnav.kernels.announcement import announce
from fgnav.kernels.linking import linked_once

Function = TypeVar("Function", bound=Callable[..., Any])
# CPython keeps frames in pieces of 16 kB and maps a new piece for each call across a border: 49,000
# times while one kernel compiles, 5 s of system time of a first run. A frame that asks for more
# than half of 1 MB gets a piece of that size, and the calls within it the rest.
_STACK_SLOTS = 70_000  # of 8 bytes


def kernel_with(*, fastmath: bool | set[str] = False) -> Callable[[Function], Function]:
    """Return a decorator that compiles, with such rounding as numba's option allows."""
    options = {"no_cfunc_wrapper": True, "error_model": "numpy", "fastmath": fastmath}

    def compiled(function: Function) -> Function:
        dispatcher = njit(cache=True, nogil=True, **options)(function)
        within_kernels = njit(no_cpython_wrapper=True, **options)(function)
        dispatcher.get_call_template = within_kernels.get_call_template
        dispatcher.get_overload = within_kernels.get_overload
        kernel: Function = _compiled_at_ease(dispatcher)
        return kernel

    return compiled


def kernel(function: Function) -> Function:
    """Compile a function when it is first called."""
    return kernel_with()(function)


class _Announced(event.Listener):  # type: ignore[misc]  # numba is Any
    """Announces the compilation of one kernel; reading it from disk is none."""

    def __init__(self, dispatcher: Any) -> None:  # noqa: ANN401
        self.dispatcher = dispatcher

    def on_start(self, event: Any) -> None:  # noqa: ANN401
        """Announce it, but not what it calls."""
        if event.data["dispatcher"] is self.dispatcher:
            announce(self.dispatcher.__name__)

    def on_end(self, event: Any) -> None:  # noqa: ANN401
        """Say nothing."""


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
            with linked_once(), event.install_listener("numba:compile", _Announced(dispatcher)):
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
