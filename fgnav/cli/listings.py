"""The commands ``fgnav methods``, ``fgnav resolvers`` and ``fgnav factors``: what there is."""

from collections.abc import Mapping

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import show_names


def methods(*, json: JsonFile = None) -> None:
    """List the methods that --method takes, installed ones too.

    Example: fgnav methods
    """
    from fgnav.methods import GROUP, METHODS  # noqa: PLC0415  # lazy, like all below

    _show(GROUP, METHODS, json)


def resolvers(*, json: JsonFile = None) -> None:
    """List the resolvers that --integers takes, installed ones too.

    Example: fgnav resolvers
    """
    from fgnav.integers.resolvers.registry import GROUP, RESOLVERS  # noqa: PLC0415

    _show(GROUP, RESOLVERS, json)


def factors(*, json: JsonFile = None) -> None:
    """List the factors that the graph builds by itself, and installed ones that --factors takes.

    Example: fgnav factors
    """
    from importlib import import_module  # noqa: PLC0415
    from pkgutil import iter_modules  # noqa: PLC0415

    from fgnav.graph import factors as room  # noqa: PLC0415

    modules = {
        module.name: f"{room.__name__}.{module.name}" for module in iter_modules(room.__path__)
    }
    built_in = {
        name: module
        for name, module in modules.items()
        if any(hasattr(member, "factor") for member in vars(import_module(module)).values())
    }
    _show("fgnav.factors", built_in, json)


def _show(group: str, built_in: Mapping[str, str], json: str | None) -> None:
    """Print or write names with what each says of itself."""
    from fgnav.plugins import descriptions  # noqa: PLC0415

    check_places(json)
    texts = descriptions(group, built_in)
    write_json(json, texts)
    if json != "-":
        show_names(texts)
