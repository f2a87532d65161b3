"""Methods as the command line asks for them, and a flight compared by them, each step shown."""

import logging
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fgnav.cli.arguments.options import SmootherOptions
from fgnav.terminal import Steps, progress

if TYPE_CHECKING:
    from fgnav.evaluation.comparison import Comparison
    from fgnav.evaluation.flights import FlightsComparison
    from fgnav.types.estimate import Estimator
    from fgnav.types.flight import Flight

_LOG = logging.getLogger("fgnav")
_TOML = "flight.toml"  # what makes a folder a flight


def estimators_named(methods: str, integers: str, smoother: SmootherOptions) -> "list[Estimator]":
    """Return the methods of a comma-separated list, all with one resolver and the same options."""
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.face import method  # noqa: PLC0415
    from fgnav.gravity import gravity_named  # noqa: PLC0415
    from fgnav.integers.resolvers.registry import resolver_named  # noqa: PLC0415
    from fgnav.methods import SMOOTHERS, WITH_GRAVITY, WITH_LAG  # noqa: PLC0415

    resolver, names = resolver_named(integers), _words(methods)
    options: dict[str, Any] = {
        "gravity": None if smoother.gravity is None else gravity_named(smoother.gravity),
        "calibrate": _words(smoother.calibrate) or None,
        "factors": factors_named(smoother.factors),
        "noise": smoother.noise,
        "causal": smoother.causal,
        "lag_s": smoother.lag,
    }
    if not names:
        raise BadInputError(f"--method: names no method, got {methods!r}")
    takers = (WITH_GRAVITY, SMOOTHERS, WITH_GRAVITY, SMOOTHERS, ("smoother",), WITH_LAG)
    for (option, value), taken_by in zip(options.items(), takers, strict=True):
        if value not in (None, False) and not set(names) & set(taken_by):
            flag = f"--{option.removesuffix('_s')}"
            raise BadInputError(f"{flag}: only {', '.join(taken_by)} use it, got {methods!r}")
    return [method(name, integers=resolver, **options) for name in names]


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
        takers = [
            estimator for estimator in named if GRAVITY not in left_out or has_gravity(estimator)
        ]
        if not takers:
            raise BadInputError("--without gravity: there is none without --gravity; name one")
        out += [
            restricted(f"{estimator.name} without {word}", estimator, left_out)
            for estimator in takers
        ]
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


def flights_in(paths: tuple[Path, ...]) -> list[Path]:
    """Return the flights that are named, and those in folders that hold some, sorted.

    Raises
    ------
    BadInputError
        If a flight stands there twice.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415

    folders: list[Path] = []
    for path in paths:
        inside = [] if (path / _TOML).exists() else sorted(path.glob(f"*/{_TOML}"))
        folders += [toml.parent for toml in inside] or [path]
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
    for remark in (*findings, *(f"files: {line}" for line in lost)):
        _LOG.warning("check: %s", remark)


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
