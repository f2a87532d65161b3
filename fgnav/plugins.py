"""Interchangeable parts by name: the library's own, then those of installed packages."""

from collections.abc import Mapping
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any

from fgnav.checks import BadInputError


def names(group: str, own: Mapping[str, str]) -> tuple[str, ...]:
    """Return all names of an entry-point group, the library's own first.

    Parameters
    ----------
    group : str
        Entry-point group: ``"fgnav.methods"``.
    own : mapping of str to str
        The library's own parts, ``"module:attribute"`` by name.
    """
    installed = (entry.name for entry in entry_points(group=group))
    return (*own, *(name for name in installed if name not in own))


def named(group: str, own: Mapping[str, str], name: str, *, kind: str) -> Any:  # noqa: ANN401  # any part
    """Return the part of that name, imported only now; ``kind`` is what errors call it.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    if name in own:
        module, _, attribute = own[name].partition(":")
        return getattr(import_module(module), attribute)
    for entry in entry_points(group=group):
        if entry.name == name:
            return entry.load()
    raise BadInputError(f"{kind} {name!r}: not one of {', '.join(names(group, own))}")
