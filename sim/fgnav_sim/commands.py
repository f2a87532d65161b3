"""The command ``fgnav simulate``; everything heavy is imported when it runs."""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from fgnav.json_file import JsonFile, check_places, write_json
from fgnav.terminal import progress

if TYPE_CHECKING:
    from fgnav_sim.dispersions import Numbers
    from fgnav_sim.scenario import Scenario
    from fgnav_sim.simulate import Simulated

Summary: TypeAlias = "dict[str, str | int | float | dict[str, Numbers]]"


def simulate(
    scenario: Path, *, seed: int, out: Path, batch: int | None = None, json: JsonFile = None
) -> None:
    """Make a flight whose truth is known, or many.

    Reads what is to fly, when and where, and which sensors are on board; writes a flight folder:
    flight.toml, RINEX observations and navigation, tables of the other sensors and of the truth;
    dispersions.json says what was drawn, where the scenario has a table [dispersions]. The same
    scenario and seed give the same bytes. `fgnav scenarios` lists some to start from.

    Example: fgnav simulate demo --seed 1 --out demo/flight

    Parameters
    ----------
    scenario : Path
        What to simulate: a TOML file, or the name of a scenario that comes along.
    seed : int
        Of all random numbers: noise, biases, clocks, integers.
    out : Path
        The flight's folder; made if it is not there, refused if it holds anything.
    batch : int
        Make so many flights, with this seed and those that follow it, in out/0001, out/0002, …
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below

    check_new(seed, out)
    if batch is not None and batch < 1:
        raise BadInputError(f"--batch: must be 1 or more, got {batch}")
    check_places(json)

    from fgnav.io.atomic_write import atomic_folder  # noqa: PLC0415
    from fgnav_sim.scenario import load_scenario  # noqa: PLC0415

    what = load_scenario(scenario)
    names = [""] if batch is None else [f"{k + 1:04d}" for k in range(batch)]
    summaries = []
    with atomic_folder(out) as folder, progress(len(names)) as step:
        try:
            for k, name in enumerate(names):
                with step(f"simulating {what.name}"):
                    summary = _written(what, seed + k, folder / name)
                summaries.append(summary | {"flight": str(out / name)})
        except BadInputError as error:
            raise BadInputError(f"{scenario}: {error}") from None
    summary = summaries[0] if batch is None else _summary_of_batch(summaries, out)
    write_json(json, summary)
    if json != "-":
        _print_summary(summary)


def check_new(seed: int, out: Path) -> None:
    """Raise unless a seed is one, and a folder new or empty."""
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy

    if seed < 0:
        raise BadInputError(f"--seed: must be 0 or more, got {seed}")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInputError(f"--out: must be a new or an empty folder, got '{out}'")


def _written(what: "Scenario", seed: int, folder: Path) -> Summary:
    """Write the flight of a seed; return what was made."""
    import numpy as np  # noqa: PLC0415

    from fgnav.io.flight.folder import save_flight  # noqa: PLC0415
    from fgnav_sim.simulate import simulate_dispersed  # noqa: PLC0415

    made = simulate_dispersed(what, np.random.default_rng(seed))
    save_flight(made.flight, folder, rinex=what.gnss.rinex if what.gnss else "3.04")
    if made.draws:
        drawn = {x.key: {"nominal": x.nominal, "value": x.value} for x in made.draws}
        write_json(str(folder / "dispersions.json"), {"seed": seed, "drawn": drawn})
    return _summary(made, seed)


def _summary(made: "Simulated", seed: int) -> Summary:
    """Return the contents of a flight, in the order in which they are shown."""
    flight = made.flight
    summary: Summary = {"flight": "", "name": flight.name, "seed": seed}
    if flight.truth is not None:
        summary["truth_samples"] = len(flight.truth.t_s)
    if flight.observations is not None:
        epochs, antennas, channels = flight.observations.code_m.shape
        summary |= {"epochs": epochs, "antennas": antennas, "channels": channels}
        summary["mean_tracked"] = float(flight.observations.tracked[:, 0].sum(axis=1).mean())
    counts: Counter[str] = Counter()  # of all receivers together
    for name, record in flight.records.items():
        counts[name.split()[0]] += len(record.t_s)
    summary |= {f"{kind}_samples": n for kind, n in counts.items() if kind != "truth"}
    for loss in flight.unused:
        summary[loss.what] = f"{loss.count} times: {loss.reason}" if loss.count > 1 else loss.reason
    if made.draws:
        summary["dispersions"] = {draw.key: draw.value for draw in made.draws}
    return summary


def _summary_of_batch(summaries: list[Summary], out: Path) -> Summary:
    """Return the contents that all flights of a batch share."""
    first, last = summaries[0], summaries[-1]
    seeds = f"{first['seed']} to {last['seed']}"
    batch: Summary = {
        "folder": str(out),
        "name": first["name"],
        "flights": len(summaries),
        "seeds": seeds,
    }
    alike = {
        key: value for key, value in first.items() if all(s.get(key) == value for s in summaries)
    }
    return batch | {key: value for key, value in alike.items() if key not in batch}


def _print_summary(summary: Summary) -> None:
    for key, value in summary.items():
        if isinstance(value, dict):
            for name, drawn in value.items():
                figures = drawn if isinstance(drawn, tuple) else (drawn,)
                print(f"{name} = {', '.join(f'{x:.6g}' for x in figures)}")  # noqa: T201
            continue
        shown = f"{value:.1f}" if isinstance(value, float) else value
        print(f"{key.replace('_', ' '):15s}{shown}")  # noqa: T201
