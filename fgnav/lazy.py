"""Public names of a package, loaded when they are first used."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy(package: str, homes: Mapping[str, tuple[str, ...]]) -> Callable[[str], Any]:
    """Return a package's ``__getattr__``, which imports a public name on first use.

    Parameters
    ----------
    package : str
        Its ``__name__``.
    homes : mapping of str to tuple of str
        Public names by the module that defines them, relative to the package.

    Returns
    -------
    callable
        It raises AttributeError for any other name.

    Examples
    --------
    >>> from fgnav.lazy import lazy
    >>> lazy("fgnav", {"checks": ("BadInputError",)})("BadInputError").__name__
    'BadInputError'
    """
    home_of = {name: home for home, names in homes.items() for name in names}

    def load(name: str) -> Any:  # noqa: ANN401  # of a module
        if name not in home_of:
            msg = f"module {package!r} has no attribute {name!r}"
            raise AttributeError(msg)
        return getattr(import_module(f"{package}.{home_of[name]}"), name)

    return load
