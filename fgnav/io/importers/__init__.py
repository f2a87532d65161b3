"""Foreign recordings as flights, by format name.

An importer is a function ``(path) -> Flight``. Third parties add theirs through the entry-point
group ``fgnav.importers``.
"""

from collections.abc import Callable
from pathlib import Path

from fgnav import plugins
from fgnav.types.flight import Flight

GROUP = "fgnav.importers"
IMPORTERS = {"umn": "fgnav.io.importers.umn:read_umn"}


def importer_names() -> tuple[str, ...]:
    """Return the names of all formats: the library's own, then installed ones."""
    return plugins.names(GROUP, IMPORTERS)


def importer_named(name: str) -> Callable[[Path], Flight]:
    """Return the importer of that format.

    Raises
    ------
    BadInputError
        If there is none; the text lists what there is.
    """
    importer: Callable[[Path], Flight] = plugins.named(GROUP, IMPORTERS, name, kind="format")
    return importer
