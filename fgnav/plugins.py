"""Interchangeable parts by name: the library's own, then those of installed packages."""

import json
import re
import sys
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from importlib import import_module
from importlib.metadata import entry_points
from inspect import getdoc
from pathlib import Path
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

    A name with a colon is ``module:attribute`` of any module that Python finds, those in the
    working folder among them.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    if name in own:
        return _loaded(own[name])
    for entry in entry_points(group=group):
        if entry.name == name:
            return entry.load()
    if ":" in name:
        return _from_module(name, kind)
    registered = names(group, own)
    meant = get_close_matches(name, registered, n=1)
    hint = f"did you mean {meant[0]}?" if meant else "module:attribute names any other"
    listed = ", ".join(registered) or "none is installed"
    raise BadInputError(f"{kind} {name!r}: not one of {listed}; {hint}")


def descriptions(group: str, own: Mapping[str, str]) -> dict[str, str]:
    """Return the first line of what each part of a group says of itself, by name.

    A part of an installed package says whose it is; one that cannot be imported says why.
    """
    texts = {name: _first_line(_loaded(target)) for name, target in own.items()}
    for entry in entry_points(group=group):
        if entry.name not in texts:
            try:
                text = _first_line(entry.load())
            except Exception as error:  # noqa: BLE001  # whatever a stranger's import raises
                text = f"cannot be imported: {error}"
            dist = entry.dist.name if entry.dist is not None else "an installed package"
            texts[entry.name] = text if dist == "fgnav" else f"{text} ({dist})"
    return texts


def _loaded(target: str) -> Any:  # noqa: ANN401  # any part
    """Import the object that ``module:attribute``, or ``module``, names."""
    module, _, attribute = target.partition(":")
    loaded = import_module(module)
    return getattr(loaded, attribute) if attribute else loaded


def _from_module(name: str, kind: str) -> Any:  # noqa: ANN401  # any part
    """Import the object that ``module:attribute`` names, the working folder searched, too."""
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        return _loaded(name)
    except (ImportError, AttributeError, ValueError) as error:
        raise BadInputError(f"{kind} {name!r}: {error}") from error
    finally:
        sys.path.remove(here)


def _first_line(part: object) -> str:
    """Return the first line of a part's docstring; of a network's manifest its purpose."""
    if isinstance(part, Path):
        text = part.read_text(encoding="utf-8")
        stated = json.loads(text) if part.suffix == ".json" else tomllib.loads(text)
        return str(stated["purpose"])
    line = (getdoc(part) or "says nothing of itself").splitlines()[0]
    return re.sub(r" \[\d+\]_", "", line)  # references stand further down
