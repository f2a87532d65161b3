"""Methods as the command line asks for them, and a flight compared by them, each step shown."""

import gc
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from fgnav.cli.arguments.options import SmootherOptions
from fgnav.terminal import Steps, progress

if TYPE_CHECKING:
    from fgnav.evaluation.comparison import Comparison
    from fgnav.evaluation.flights import FlightsComparison
    from fgnav.types.estimate import Estimator
    from fgnav.types.flight import Flight

_LOG = logging.getLogger("fgnav")
_TOML = "flight.toml"  # what makes a folder a flight


@contextmanager
def _loading() -> Iterator[None]:
    """Let the garbage collector rest: what modules make stays, and counting it takes 0.1 s."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@_loading()
def estimators_named(methods: str, integers: str, smoother: SmootherOptions) -> "list[Estimator]":
    """Return the methods of a comma-separated list, all with one resolver and the same options."""
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.gravity import gravity_named  # noqa: PLC0415
    from fgnav.integers.resolvers.registry import resolver_named  # noqa: PLC0415
    from fgnav.methods import SMOOTHERS, WITH_GRAVITY, WITH_LAG, Options, method_named  # noqa: PLC0415

    resolver, names = resolver_named(integers), list(_words(methods))
    options = Options(
        gravity=None if smoother.gravity is None else gravity_named(smoother.gravity),
        calibrate=_words(smoother.calibrate),
        factors=factors_named(smoother.factors),
        causal=smoother.causal,
        noise=smoother.noise,
        lag_s=smoother.lag,
    )
    if not names:
        raise BadInputError(f"--method: names no method, got {methods!r}")
    takers = {
        "--gravity": (options.gravity is not None, WITH_GRAVITY),
        "--calibrate": (bool(options.calibrate), SMOOTHERS),
        "--factors": (options.factors is not None, WITH_GRAVITY),
        "--noise": (options.noise is not None, SMOOTHERS),
        "--causal": (options.causal, ("smoother",)),
        "--lag": (options.lag_s is not None, WITH_LAG),
    }
    for option, (is_given, taken_by) in takers.items():
        if is_given and not set(names) & set(taken_by):
            raise BadInputError(f"{option}: only {', '.join(taken_by)} use it, got {methods!r}")
    return [method_named(name, resolver, options) for name in names]


def factors_named(text: str) -> tuple[str, ...] | None:
    """Return the sources that ``--factors`` names: none of "none"; None where it names nothing."""
    words = _words(text)
    return () if words == ("none",) else words or None


def ablated(
    methods: str, integers: str, smoother: SmootherOptions, kinds: str
) -> "list[Estimator]":
    """Return the methods once more for each word of a list, without the sensors that it names.

    Without gravity are those alone that take it: the others never had it.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.evaluation.ablation import GRAVITY, has_gravity, restricted  # noqa: PLC0415

    named: list[Estimator] = estimators_named(methods, integers, smoother)
    out: list[Estimator] = []
    for word in _words(kinds):
        left_out = tuple(kind.strip() for kind in word.split("+"))
        takers = [one for one in named if GRAVITY not in left_out or has_gravity(one)]
        if not takers:
            raise BadInputError("--without gravity: there is none without --gravity; name one")
        out += [restricted(f"{one.name} without {word}", one, left_out) for one in takers]
    return out


def _words(text: str) -> tuple[str, ...]:
    """Split a list at its commas."""
    return tuple(word.strip() for word in text.split(",") if word.strip())


Span = tuple[float | None, float | None]  # of a flight, s


def compare_flight(
    folder: Path, by: "list[Estimator]", span: Span = (None, None)
) -> "tuple[Flight, Comparison]":
    """Read a flight and compare methods on it, showing each step."""
    from fgnav.evaluation.comparison import compare as compare_methods  # noqa: PLC0415

    with progress(2 + len(by)) as step:
        flight = _loaded(folder, span, step)
        return flight, compare_methods(flight, by, watch=step)


def compare_folders(
    folders: list[Path], by: "list[Estimator]", span: Span = (None, None)
) -> "FlightsComparison":
    """Read flights, one after the other, and compare methods on each, showing each step."""
    from fgnav.checks import FgnavError  # noqa: PLC0415
    from fgnav.evaluation.flights import compare_flights  # noqa: PLC0415

    with progress((2 + len(by)) * len(folders)) as step:

        def loaded() -> "Iterator[tuple[str, Flight | FgnavError]]":
            for folder in folders:
                try:
                    flight: Flight | FgnavError = _loaded(folder, span, step)
                except FgnavError as error:
                    flight = error
                yield str(folder), flight

        return compare_flights(loaded(), by, watch=step)


def flights_in(places: tuple[Path, ...]) -> list[Path]:
    """Return the flights that are named, and those in folders that hold some, sorted.

    Raises
    ------
    BadInputError
        If a flight stands there twice.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415

    folders: list[Path] = []
    for place in places:
        inside = [] if (place / _TOML).exists() else sorted(place.glob(f"*/{_TOML}"))
        folders += [toml.parent for toml in inside] or [place]
    for folder in folders:
        if folders.count(folder) > 1:
            raise BadInputError(f"{folder}: is named twice; a flight counts once")
    return folders


def _loaded(folder: Path, span: Span, step: Steps) -> "Flight":
    """Read a flight, cut it, and check what is left."""
    from fgnav.evaluation.span import within  # noqa: PLC0415

    flight = within(load(folder, step), *span)
    with step("checking"):
        _check_set_up(flight)
    return flight


def _check_set_up(flight: "Flight") -> None:
    """Log what a quick check finds, and what of the files could not be read.

    Raises
    ------
    BadInputError
        For what makes every estimate of the flight worthless.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.diagnostics import describe  # noqa: PLC0415
    from fgnav.evaluation.report.summary import unused_lines  # noqa: PLC0415

    findings = describe(flight, quick=True).findings
    for finding in findings:
        if finding.certain:
            raise BadInputError(f"{flight.name}: {finding}")
    lost = unused_lines({"files": flight.unused})
    for said in (*findings, *(f"files: {line}" for line in lost)):
        _LOG.warning("check: %s", said)


def log_findings_of_check(flight: "Flight") -> None:
    """Log what all checks find of a flight without a solution.

    But for what was said before its estimate.
    """
    from fgnav.checks import NoSolutionError  # noqa: PLC0415  # lazy, as above
    from fgnav.diagnostics import describe  # noqa: PLC0415

    before = describe(flight, quick=True).findings
    try:
        every = describe(flight).findings
    except NoSolutionError:  # what a check needs is what the method had not
        return
    for finding in every:
        if finding not in before:
            _LOG.warning("check: %s", finding)


def load(folder: Path, step: Steps) -> "Flight":
    """Read a flight, showing the step."""
    from fgnav.io.flight.folder import load_flight  # noqa: PLC0415

    with step(f"reading {folder}"):
        return load_flight(folder)
