"""Announcement of a kernel's compilation, to a program that shows why its first run takes long."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

_listeners: list[Callable[[str], None]] = []  # of all threads: kernels are compiled in any


def announce(kernel: str) -> None:
    """Tell the name of a kernel whose compilation begins."""
    for listener in _listeners:
        listener(kernel)


@contextmanager
def announced_to(listener: Callable[[str], None]) -> Iterator[None]:
    """Call a function with the name of each kernel that is compiled while this lasts."""
    _listeners.append(listener)
    try:
        yield
    finally:
        _listeners.remove(listener)
