"""The command ``fgnav simulate``; everything heavy is imported when it runs."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fgnav.flight import Flight


def simulate(scenario: Path, *, seed: int, out: Path, json: bool = False) -> None:
    """Make a flight whose truth is known.

    Reads what is to fly, when and where, and which sensors are on board; writes a flight folder:
    flight.toml, RINEX observations and navigation, tables of the other sensors and of the truth.
    The same scenario and seed give the same bytes. Scenarios to start from are in sim/scenarios.

    Example: fgnav simulate sim/scenarios/demo.toml --seed 1 --out demo/flight

    Parameters
    ----------
    scenario : Path
        What to simulate, a TOML file.
    seed : int
        Of all random numbers: noise, biases, clocks, integers.
    out : Path
        The flight's folder; made if it is not there, refused if it holds anything.
    json : bool
        Print the summary as JSON.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415  # lazy, like all below

    if seed < 0:
        raise BadInputError(f"--seed: must be 0 or more, got {seed}")
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise BadInputError(f"--out: must be a new or an empty folder, got '{out}'")

    import numpy as np  # noqa: PLC0415

    from fgnav.io.flight_folder import save_flight  # noqa: PLC0415
    from fgnav_sim.scenario import load_scenario  # noqa: PLC0415
    from fgnav_sim.simulate import simulate as make  # noqa: PLC0415

    what = load_scenario(scenario)
    with _shown(what.name) as progress:
        flight = make(what, np.random.default_rng(seed), progress)
        save_flight(flight, out)
    _print_summary(_summary(flight, out, seed), as_json=json)


@contextmanager
def _shown(name: str) -> Iterator[Callable[[float], None]]:
    """Show a bar on a terminal, nothing on a pipe."""
    from rich.console import Console  # noqa: PLC0415
    from rich.progress import Progress  # noqa: PLC0415

    console = Console(stderr=True)
    with Progress(console=console, disable=not console.is_terminal, transient=True) as bar:
        task = bar.add_task(f"simulating {name}", total=1.0)
        yield lambda share: bar.update(task, completed=share)


def _summary(flight: "Flight", out: Path, seed: int) -> dict[str, str | int | float]:
    """Return what was made, in the order in which it is shown."""
    summary: dict[str, str | int | float] = {"flight": str(out), "name": flight.name, "seed": seed}
    if flight.truth is not None:
        summary["truth_samples"] = len(flight.truth.t_s)
    if flight.observations is not None:
        epochs, antennas, channels = flight.observations.code_m.shape
        summary |= {"epochs": epochs, "antennas": antennas, "channels": channels}
        summary["mean_tracked"] = float(flight.observations.tracked[:, 0].sum(axis=1).mean())
    samples = {"imu": flight.imu, "fixes": flight.fixes, "seeker": flight.seeker}
    summary |= {f"{k}_samples": len(v.t_s) for k, v in samples.items() if v is not None}
    return summary | {loss.what: loss.reason for loss in flight.losses}


def _print_summary(summary: dict[str, str | int | float], *, as_json: bool) -> None:
    if as_json:
        from json import dumps  # noqa: PLC0415

        print(dumps(summary, indent=2))  # noqa: T201
        return
    for key, value in summary.items():
        shown = f"{value:.1f}" if isinstance(value, float) else value
        print(f"{key.replace('_', ' '):15s}{shown}")  # noqa: T201
