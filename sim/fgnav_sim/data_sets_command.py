"""The command ``fgnav data-set``; everything heavy is imported when it runs."""

from pathlib import Path


def data_set(world: Path, /, *, seed: int, out: Path, json: bool = False) -> None:
    """Draw a data set for training from a world, in shards.

    Reads what skies, arrays, attitudes and noise there are, or what flights; writes shards of
    arrays (npz) and data_set.json, which says what they hold. Interrupted, the same call goes on
    where it stopped. The same world and seed give the same bytes. Worlds to start from are in
    sim/worlds.

    Example: fgnav data-set sim/worlds/honest.toml --seed 1 --out data/honest

    Parameters
    ----------
    world : Path
        What to draw from, a TOML file.
    seed : int
        Of all random numbers.
    out : Path
        The data set's folder; made if it is not there.
    json : bool
        Print the summary as JSON.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below

    if seed < 0:
        raise BadInputError(f"--seed: must be 0 or more, got {seed}")

    from rich.console import Console  # noqa: PLC0415
    from rich.progress import Progress  # noqa: PLC0415

    from fgnav_sim.data_sets_shards import make_data_set  # noqa: PLC0415
    from fgnav_sim.data_sets_world import load_world  # noqa: PLC0415

    what = load_world(world)
    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(f"drawing {what.name}", total=1.0)
        made = make_data_set(what, seed, out, lambda share: bar.update(task, completed=share))
    summary: dict[str, str | int] = {
        "folder": str(out),
        "name": what.name,
        "seed": seed,
        "epochs": made.manifest.epochs,
        "shards": len(made),
        "bytes": sum((out / shard.name).stat().st_size for shard in made.manifest.shards),
    }
    _print(summary, as_json=json)


def _print(summary: dict[str, str | int], *, as_json: bool) -> None:
    if as_json:
        from json import dumps  # noqa: PLC0415

        print(dumps(summary, indent=2))  # noqa: T201
        return
    for key, value in summary.items():
        print(f"{key:15s}{value}")  # noqa: T201
