"""The command ``fgnav data-set``; everything heavy is imported when it runs."""

import sys
from pathlib import Path

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress, show_names


def data_set(world: Path, /, *, seed: int, out: Path, json: JsonFile = None) -> None:
    """Draw a data set for training from a world, in shards.

    Reads what skies, arrays, attitudes and noise there are, or what flights; writes shards of
    arrays (npz) and data_set.json, which says what they hold. Interrupted, the same call goes on
    where it stopped. The same world and seed give the same bytes. `fgnav worlds` lists some to
    start from.

    Example: fgnav data-set honest --seed 1 --out data/honest

    Parameters
    ----------
    world : Path
        What to draw from: a TOML file, or the name of a world that comes along.
    seed : int
        Of all random numbers.
    out : Path
        The data set's folder; made if it is not there.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below

    if seed < 0:
        raise BadInputError(f"--seed: must be 0 or more, got {seed}")

    check_places(json)

    from fgnav_sim.data_sets.shards import MANIFEST, load_data_set, make_data_set  # noqa: PLC0415
    from fgnav_sim.data_sets.world import load_world  # noqa: PLC0415

    what = load_world(world)
    if (out / MANIFEST).is_file():
        before = load_data_set(out)
        text = f"{out}: holds {len(before)} of {before.planned} shards, goes on from there"
        print(text, file=sys.stderr)  # noqa: T201
    with progress(1) as step, step(f"drawing {what.name}"):
        made = make_data_set(what, seed, out, step.share)
    summary: dict[str, str | int] = {
        "folder": str(out),
        "name": what.name,
        "seed": seed,
        "epochs": made.manifest.epochs,
        "shards": len(made),
        "bytes": sum((out / shard.name).stat().st_size for shard in made.manifest.shards),
    }
    write_json(json, summary)
    if json != "-":
        show_names({key: str(value) for key, value in summary.items()})
