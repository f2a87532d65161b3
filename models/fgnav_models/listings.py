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


def cards(name: str | None = None, /, *, reproduce: bool = False, json: JsonFile = None) -> None:
    """List what is known of each released network, or print its card.

    Example: fgnav cards trust --reproduce

    Parameters
    ----------
    name
        Of the network.
    reproduce : bool
        Print the command that trains it again, and what it was made with.
    """
    if not reproduce:
        show_shipped("fgnav_models", "cards", name, json)
        return
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below
    from fgnav.neural.manifest import read_manifest  # noqa: PLC0415
    from fgnav.shipped import file_or_shipped, shipped  # noqa: PLC0415

    if name is None:
        raise BadInputError("--reproduce: needs the name of a network; fgnav cards lists them")
    networks = shipped("fgnav_models", "weights") | shipped("fgnav_models", "factors")
    stem = file_or_shipped(name, "fgnav_models", "cards").stem
    path = networks[stem].with_suffix(".json")
    origin = read_manifest(path).origin
    if origin is None:
        raise BadInputError(f"{path}: key origin: is absent; the network's making is not recorded")
    made_with = ", ".join(f"{key} {value}" for key, value in origin.made_with.items())
    notes = {"commit": origin.commit, "scale": origin.scale, "seed": origin.seed, "with": made_with}
    lines = [f"# {key}: {value}" for key, value in notes.items()]
    print("\n".join([*lines, f"{origin.command} --out {stem}"]))  # noqa: T201
