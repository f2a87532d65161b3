"""The commands ``fgnav recipes`` and ``fgnav cards``: the files that come along."""

from fgnav.json_file import JsonFile
from fgnav.terminal import show_shipped


def recipes(name: str | None = None, /, *, json: JsonFile = None) -> None:
    """List the recipes that come along, or print one, to begin one's own from.

    Example: fgnav recipes trust > my-recipe.toml

    Parameters
    ----------
    name
        Of the recipe to print.
    """
    show_shipped("fgnav_models", "recipes", name, json)


def cards(name: str | None = None, /, *, json: JsonFile = None) -> None:
    """List what is known of each released network, or print its card.

    Example: fgnav cards trust

    Parameters
    ----------
    name
        Of the network.
    """
    show_shipped("fgnav_models", "cards", name, json)
