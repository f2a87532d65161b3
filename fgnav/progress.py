"""Progress of long work, for whoever watches it.

Work calls ``report(share)`` now and then; where nobody watches, that is one look at a variable.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_WATCHER: ContextVar[Callable[[float], None] | None] = ContextVar("watcher", default=None)


def report(share: float) -> None:
    """Report to the watcher, if any, which share of the work in hand is done, 0 to 1."""
    callback = _WATCHER.get()
    if callback is not None:
        callback(share)


def steps(count: int) -> Iterator[int]:
    """Yield 0, 1, … below ``count``, each with a report of the share before it."""
    for step in range(count):
        report(step / count)
        yield step


def watcher() -> Callable[[float], None] | None:
    """Return the callback of what is reported; None: nobody watches."""
    return _WATCHER.get()


@contextmanager
def watched_by(callback: Callable[[float], None]) -> Iterator[None]:
    """Pass every ``report`` to a callback while this lasts."""
    token = _WATCHER.set(callback)
    try:
        yield
    finally:
        _WATCHER.reset(token)
