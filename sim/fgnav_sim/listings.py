"""The commands ``fgnav scenarios`` and ``fgnav worlds``: the files that come along."""

from fgnav.json_file import JsonFile
from fgnav.terminal import show_shipped


def scenarios(name: str | None = None, /, *, json: JsonFile = None) -> None:
    """List the scenarios that come along, or print one, to begin one's own from.

    Example: fgnav scenarios rough > my-scenario.toml

    Parameters
    ----------
    name
        Of the scenario to print.
    """
    show_shipped("fgnav_sim", "scenarios", name, json)


def worlds(name: str | None = None, /, *, json: JsonFile = None) -> None:
    """List the worlds that come along, or print one, to begin one's own from.

    Example: fgnav worlds honest > my-world.toml

    Parameters
    ----------
    name
        Of the world to print.
    """
    show_shipped("fgnav_sim", "worlds", name, json)
