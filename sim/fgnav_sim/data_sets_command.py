"""The command ``fgnav data-set``; everything heavy is imported when it runs."""

from pathlib import Path

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress, show_names
from fgnav_sim.commands import check_new


def data_set(world: Path, /, *, seed: int, out: Path, json: JsonFile = None) -> None:
    """Draw a data set for training from a world, in shards.

    Reads what skies, arrays, attitudes and noise there are, or what flights; writes shards of
    arrays (npz) and data_set.json, which says what they hold. The same world and seed give the same
    bytes. `fgnav worlds` lists some to start from.

    Example: fgnav data-set honest --seed 1 --out data/honest

    Parameters
    ----------
    world : Path
        What to draw from: a TOML file, or the name of a world that comes along.
    seed : int
        Of all random numbers.
    out : Path
        The data set's folder; made if it is not there, refused if it holds anything.
    """
    check_new(seed, out)
    check_places(json)

    from fgnav_sim.data_sets.shards import write_data_set  # noqa: PLC0415  # lazy, like all below
    from fgnav_sim.data_sets.world import load_world  # noqa: PLC0415

    what = load_world(world)
    with progress(1) as step, step(f"drawing {what.name}"):
        shards = write_data_set(what, seed, out)
    summary: dict[str, str | int] = {
        "folder": str(out),
        "name": what.name,
        "seed": seed,
        "epochs": what.epochs,
        "shards": len(shards),
        "bytes": sum((out / name).stat().st_size for name in shards),
    }
    write_json(json, summary)
    if json != "-":
        show_names({key: str(value) for key, value in summary.items()})
