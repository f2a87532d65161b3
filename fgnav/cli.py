"""The command line: reads arguments, calls the library, and has ``terminal`` show the answer.

Nothing heavy is imported before a command runs, so that ``fgnav --help`` answers at once.
"""

import gc
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, Parameter

from fgnav import __version__
from fgnav.terminal import (
    check_places,
    progress,
    show_comparison,
    show_set_up,
    step,
    write_json,
)

if TYPE_CHECKING:
    from rich.progress import Progress

    from fgnav.checks import FgnavError
    from fgnav.estimate import Estimator
    from fgnav.evaluation.comparison import Comparison
    from fgnav.flight import Flight

_DEFAULT_METHODS = "closed-form,maximum-likelihood,smoother,batch,rtk"
_HELP = """\
Attitude, position and velocity from recorded flights, with honest uncertainty.

A flight is a folder with a flight.toml and the files it names. Start with:

    fgnav simulate sim/scenarios/demo.toml --seed 1 --out demo/flight
    fgnav check demo/flight
    fgnav compare demo/flight --report demo/report.png

Exit status: 0 done, 1 no solution, 2 bad input.
"""
# Shown without importing the packages that bring these commands.
_INSTALLED_HELP = {
    "simulate": "Fly a scenario and write what its sensors would have recorded.",
    "data-set": "Draw a data set for training from a world, in shards.",
    "campaign": "Fly and compare many scenarios at once.",
    "train": "Train a network from a recipe.",
    "restitution": "Restore commanded angles by the source paper's method and by others.",
}

app = App(
    name="fgnav",
    help=_HELP,
    help_format="plaintext",
    version=__version__,
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)


def _file_or_dash(_type: object, place: str | None) -> None:
    if place is not None and place.startswith("-") and place != "-":
        raise ValueError(f"wants a file or -, got {place!r}")


JsonFile = Annotated[
    str | None,
    Parameter(
        help="Write all figures here; - for standard output.",
        allow_leading_hyphen=True,
        validator=_file_or_dash,
    ),
]
IntegersName = Annotated[
    str,
    Parameter(
        help="Who resolves the integers: rounding, lambda, constrained, lambda-arcs, "
        "constrained-arcs, truth, or an installed resolver such as network."
    ),
]
GravityName = Annotated[
    str | None,
    Parameter(help="Who tells the smoother where down is: low-dynamics, or an installed one."),
]
EstimateWords = Annotated[
    str,
    Parameter(
        help="What the smoother estimates with the flight: landmark, boresight, gravity, "
        "lever-arm, antennas or antenna:NAME, separated by commas; landmark=30 states a 1-sigma, "
        "m or deg."
    ),
]
TimesFile = Annotated[
    Path | None, Parameter(help="Estimate at the times of this CSV, column t_s, of the flight.")
]
RateHz = Annotated[
    float | None, Parameter(help="Estimate this many times a second, between epochs, too.")
]
LagSeconds = Annotated[
    float | None,
    Parameter(
        help="How long the smoother's window waits for what comes after a keyframe, s; its own "
        "default is 5."
    ),
]
SolverName = Annotated[
    str | None,
    Parameter(help="Who solves the smoother's graph: gtsam (its default) or chain, compiled."),
]
FactorNames = Annotated[
    str,
    Parameter(help="Installed sources of factors of your own for the smoother, by commas."),
]
CausalFlag = Annotated[
    bool,
    Parameter(help="Let the smoother know nothing beyond its lag, settings included.", negative=""),
]
TuneFlag = Annotated[
    bool,
    Parameter(
        help="Tell the noise of phase, position and velocity from the flight first.", negative=""
    ),
]


@app.command
def check(flight: Path, /, *, json: JsonFile = None) -> None:
    """Say what is in a flight, and what is wrong with its set-up, by name.

    Example: fgnav check demo/flight

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    """
    from fgnav.set_up import describe  # noqa: PLC0415  # lazy, like all below

    check_places(json)
    with progress() as shown:
        set_up = describe(_load(flight, shown))
    write_json(json, set_up.to_dict())
    if json != "-":
        show_set_up(set_up)


@app.command
def run(  # noqa: PLR0913  # a command has as many options as it takes
    flight: Path,
    /,
    *,
    out: Path,
    method: str = "smoother",
    integers: IntegersName = "lambda",
    gravity: GravityName = None,
    estimate: EstimateWords = "",
    lag: LagSeconds = None,
    solver: SolverName = None,
    factors: FactorNames = "",
    causal: CausalFlag = False,
    tune: TuneFlag = False,
    at: TimesFile = None,
    rate: RateHz = None,
    json: JsonFile = None,
) -> None:
    """Estimate a flight with one method; write estimate.csv and summary.json.

    Example: fgnav run demo/flight --method smoother --out demo/smoother

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    out
        Folder for the results; made if absent.
    method
        closed-form, maximum-likelihood, smoother, forward, batch, gtsam, rtk, or an installed one.
    """
    from fgnav.checks import BadInputError, NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.table import remarks  # noqa: PLC0415
    from fgnav.evaluation.report.whole_file import made_folder  # noqa: PLC0415
    from fgnav.io.exports import write_estimate  # noqa: PLC0415
    from fgnav.methods.at_times import at_times  # noqa: PLC0415

    check_places(json)
    asked = _Asked(gravity, estimate, lag, solver, factors, causal)
    estimators = [at_times(one, at, rate) for one in _estimators(method, integers, asked)]
    if len(estimators) > 1:
        raise BadInputError(f"--method {method}: run takes one method; compare takes several")
    data, comparison = _compare(flight, estimators, integers if tune else None)
    outcome = comparison.methods[0]
    if outcome.estimate is None:
        raise NoSolutionError(f"{outcome.name}: {outcome.score.failure}")
    if not outcome.estimate.converged:  # a file of it would look like a success
        open_ = " and ".join(outcome.estimate.unobservable)
        raise NoSolutionError(
            f"{outcome.name}: did not end at a minimum, nothing is written"
            + (f"; the data leave open: {open_}" if open_ else "")
        )
    folder = made_folder(out)
    write_estimate(outcome.estimate, data.origin, folder / "estimate.csv")
    write_json(str(folder / "summary.json"), comparison.to_dict())
    write_json(json, comparison.to_dict())
    if json != "-":
        n = len(outcome.estimate.t_s)
        print(f"{outcome.name}: {n} of {comparison.epochs} epochs in {folder / 'estimate.csv'}")
        for line in remarks(comparison):
            print(line)


@app.command
def compare(  # noqa: PLR0913  # a command has as many options as it takes
    flight: Path,
    /,
    *,
    method: str = _DEFAULT_METHODS,
    integers: IntegersName = "lambda",
    gravity: GravityName = None,
    estimate: EstimateWords = "",
    lag: LagSeconds = None,
    solver: SolverName = None,
    factors: FactorNames = "",
    causal: CausalFlag = False,
    tune: TuneFlag = False,
    json: JsonFile = None,
    report: Path | None = None,
) -> None:
    """Run several methods on one flight and judge them, against truth or against each other.

    Example: fgnav compare demo/flight --method rtk,smoother --json - > figures.json

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    method
        Names, separated by commas.
    report
        Draw errors in time with their 3-sigma bands into this PNG file.
    """
    from fgnav.checks import NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.plots import check_figure, save_figure  # noqa: PLC0415

    check_places(json)
    if report is not None:
        check_figure(report)
    asked = _Asked(gravity, estimate, lag, solver, factors, causal)
    estimators = _estimators(method, integers, asked)
    _, comparison = _compare(flight, estimators, integers if tune else None)
    write_json(json, comparison.to_dict())
    if json != "-":
        show_comparison(comparison)
    if all(m.estimate is None for m in comparison.methods):
        failures = "; ".join(f"{m.name}: {m.score.failure}" for m in comparison.methods)
        raise NoSolutionError(f"no method has a solution: {failures}")
    if report is not None:
        save_figure(comparison, report)


@app.command(name="import")
def import_(
    recording: Path,
    /,
    *,
    out: Path,
    format: Annotated[str, Parameter(help="umn, or an installed one.")],  # noqa: A002
) -> None:
    """Turn a foreign recording into a flight folder.

    Example: fgnav import thor75.mat --format umn --out flights/thor75

    Parameters
    ----------
    recording
        The file to read.
    out
        Folder for the flight; made, and refused if it holds anything.
    """
    from fgnav.io.flight_folder import save_flight  # noqa: PLC0415
    from fgnav.io.importers import importer_named  # noqa: PLC0415

    importer = importer_named(format)
    with progress() as shown, step(shown, f"reading {recording}"):
        flight = importer(recording)
        save_flight(flight, out)
    print(f"{flight.name}: written to {out}")
    for line in _loss_lines(flight):
        print(line)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status: 0 done, 1 no solution, 2 bad input."""
    _add_installed()
    try:
        app(arguments, exit_on_error=False, print_error=False, verbose=False)
        sys.stdout.flush()
    except CycloptsError as error:
        return _fail(error, 2)
    except _deliberate() as error:
        from fgnav.checks import NoSolutionError  # noqa: PLC0415

        return _fail(error, 1 if isinstance(error, NoSolutionError) else 2)
    except BrokenPipeError:  # the reader of our output has gone; leave the rest to nobody
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:
        return _fail(error, 2)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)
    return 0


def _add_installed() -> None:
    """Add the commands that installed packages bring, by name, without importing them."""
    for entry in entry_points(group="fgnav.commands"):
        if entry.name not in app:
            brought_by = entry.dist.name if entry.dist is not None else "an installed package"
            text = _INSTALLED_HELP.get(entry.name, f"From {brought_by}.")
            app.command(entry.value, name=entry.name, help=text)


def _deliberate() -> "type[FgnavError]":
    """Return the base of all deliberate errors; asked only once something was raised."""
    from fgnav.checks import FgnavError  # noqa: PLC0415

    return FgnavError


def _fail(error: object, status: int) -> int:
    """Print an error as one line; return the exit status."""
    print("fgnav:", " ".join(str(error).split()), file=sys.stderr)
    return status


def _loss_lines(flight: "Flight") -> list[str]:
    from fgnav.evaluation.report.table import loss_lines  # noqa: PLC0415

    return loss_lines({"recording": flight.losses})


@contextmanager
def _loading() -> Iterator[None]:
    """Let the garbage collector rest: what modules make stays, and counting it takes 0.1 s."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@dataclass(frozen=True, slots=True)
class _Asked:
    """What the command line says of smoothers, as text."""

    gravity: str | None
    estimate: str
    lag_s: float | None
    solver: str | None
    factors: str
    causal: bool


@_loading()
def _estimators(methods: str, integers: str, asked: _Asked) -> "list[Estimator]":
    """Return the methods of a comma-separated list, all with one resolver and the same options."""
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.gravity import gravity_named  # noqa: PLC0415
    from fgnav.integers.registry import resolver_named  # noqa: PLC0415
    from fgnav.methods import SMOOTHERS, WITH_LAG, Options, method_named  # noqa: PLC0415

    resolver, names = resolver_named(integers), list(_words(methods))
    options = Options(
        gravity=None if asked.gravity is None else gravity_named(asked.gravity),
        estimate=_words(asked.estimate),
        factors=_words(asked.factors),
        solver=asked.solver,
        causal=asked.causal,
        lag_s=asked.lag_s,
    )
    if not names:
        raise BadInputError(f"--method: names no method, got {methods!r}")
    takers = {
        "--gravity": (options.gravity is not None, SMOOTHERS),
        "--estimate": (bool(options.estimate), SMOOTHERS),
        "--factors": (bool(options.factors), SMOOTHERS),
        "--solver": (options.solver is not None, SMOOTHERS),
        "--causal": (options.causal, ("smoother",)),
        "--lag": (options.lag_s is not None, WITH_LAG),
    }
    for option, (is_given, taken_by) in takers.items():
        if is_given and not set(names) & set(taken_by):
            raise BadInputError(f"{option}: only {', '.join(taken_by)} use it, got {methods!r}")
    return [method_named(name, resolver, options=options) for name in names]


def _words(text: str) -> tuple[str, ...]:
    """Return what stands between commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


def _compare(
    folder: Path, estimators: "list[Estimator]", tuned_by: str | None
) -> "tuple[Flight, Comparison]":
    """Read a flight and compare methods on it, showing each step; tune its noise first if asked."""
    from fgnav.evaluation.comparison import compare as compare_methods  # noqa: PLC0415

    with progress() as shown:
        flight = _load(folder, shown)
        notes: tuple[str, ...] = ()
        if tuned_by is not None:
            from fgnav.integers.registry import resolver_named  # noqa: PLC0415
            from fgnav.methods.tuned import tuned  # noqa: PLC0415

            with step(shown, "tuning"):
                found = tuned(flight, resolver_named(tuned_by))
            flight, notes = found.flight, found.notes
        watch = partial(step, shown)
        return flight, compare_methods(flight, estimators, watch=watch).noted(notes)


def _load(folder: Path, shown: "Progress") -> "Flight":
    from fgnav.io.flight_folder import load_flight  # noqa: PLC0415

    with step(shown, f"reading {folder}"):
        return load_flight(folder)
