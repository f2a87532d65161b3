"""The command ``fgnav compare``."""

from pathlib import Path
from typing import TYPE_CHECKING

from fgnav.cli.arguments.estimators import (
    Span,
    ablated,
    compare_flight,
    compare_folders,
    estimators_named,
    flights_in,
)
from fgnav.cli.arguments.options import (
    SMOOTHER_DEFAULTS,
    FromSeconds,
    IntegersName,
    ReportFile,
    SmootherOptions,
    UntilSeconds,
    WithoutKinds,
)
from fgnav.cli.arguments.written import fail_if_inconsistent, write_method
from fgnav.integers.resolvers.registry import DEFAULT
from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import check_outputs, show_comparison, show_lines, show_report, width

if TYPE_CHECKING:
    from fgnav.evaluation.comparison import Comparison
    from fgnav.types.estimate import Estimator
    from fgnav.types.flight import Flight

_DEFAULT_METHODS = "closed-form,maximum-likelihood,smoother,batch,rtk"


def compare(  # noqa: PLR0913  # a command has as many options as it takes
    *flights: Path,
    method: str = _DEFAULT_METHODS,
    integers: IntegersName = DEFAULT,
    smoother: SmootherOptions = SMOOTHER_DEFAULTS,
    from_: FromSeconds = None,
    until: UntilSeconds = None,
    without: WithoutKinds = "",
    out: Path | None = None,
    json: JsonFile = None,
    report: ReportFile = None,
) -> None:
    """Run several methods on flights and judge them, against truth or against each other.

    Several flights, or a folder of flights, give figures pooled over flights and differences to the
    first method, with bootstrap intervals by flight and the p-value of Wilcoxon's test.

    Example: fgnav compare demo/flight --method rtk,smoother --json - > figures.json

    Parameters
    ----------
    flights
        Folders with a flight.toml, or folders of such folders.
    method
        Names, separated by commas.
    out
        Folder for the estimates of one flight, in one of its own by each method's name, as run
        writes them.
    """
    from fgnav.checks import BadInputError  # noqa: PLC0415
    from fgnav.evaluation.report.save import check_report  # noqa: PLC0415

    if not flights:
        raise BadInputError("compare: requires an argument: a flight, or several")
    folders = flights_in(flights)
    span = (from_, until)
    if out is not None and len(folders) > 1:
        raise BadInputError(f"--out {out}: keeps estimates of one flight, not of {len(folders)}")
    estimators = estimators_named(method, integers, smoother)
    estimators += ablated(method, integers, smoother, without) if without else []
    for folder in folders:
        check_outputs(folder, json, report=report)
        for estimator in estimators:
            check_outputs(folder, folder=None if out is None else out / estimator.name)
    check_report(report)
    if len(folders) > 1:
        _several(folders, estimators, span, json, report, strict=smoother.strict)
    else:
        comparison = _one(folders[0], estimators, span, out, json, report)
        fail_if_inconsistent(comparison, strict=smoother.strict)


def _one(
    flight: Path,
    estimators: "list[Estimator]",
    span: Span,
    out: Path | None,
    json: str | None,
    report: Path | None,
) -> "Comparison":
    from fgnav.checks import NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.save import save_report  # noqa: PLC0415

    data, comparison = compare_flight(flight, estimators, span)
    write_json(json, comparison.to_dict())
    if json != "-":
        show_comparison(comparison)
    if not comparison.solved:
        failures = "; ".join(f"{m.name}: {m.score.failure}" for m in comparison.methods)
        raise NoSolutionError(f"no method has a solution: {failures}")
    written = [] if out is None else _written(comparison, data, out)
    files = save_report(comparison, data, report, flight)
    if json != "-":
        show_lines(written)
        show_report(files)
    return comparison


def _written(comparison: "Comparison", data: "Flight", out: Path) -> list[str]:
    """Write each method's estimate; return a line of each, of those that are none as well."""
    from fgnav.checks import NoSolutionError  # noqa: PLC0415

    lines = []
    for method in comparison.methods:
        try:
            lines.append(write_method(comparison, method.name, data, out / method.name))
        except NoSolutionError as error:
            lines.append(str(error))
    return lines


def _several(
    folders: list[Path],
    estimators: "list[Estimator]",
    span: Span,
    json: str | None,
    report: Path | None,
    *,
    strict: bool,
) -> None:
    from fgnav.checks import NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.flights import on_screen  # noqa: PLC0415
    from fgnav.evaluation.report.save import save_flights_report  # noqa: PLC0415
    from fgnav.evaluation.report.text import text_lines  # noqa: PLC0415

    comparison = compare_folders(folders, estimators, span)
    write_json(json, comparison.to_dict())
    if json != "-":
        print("\n".join(text_lines(on_screen(comparison), width())))
    if not any(outcome.figures for outcome in comparison.flights):
        why = comparison.flights[0].failure or "; ".join(comparison.flights[0].failures.values())
        raise NoSolutionError(f"no method has a solution of any flight, of the first: {why}")
    files = save_flights_report(comparison, report)
    if json != "-":
        show_report(files)
    inconsistent = [
        outcome.flight
        for outcome in comparison.flights
        if any(method.get("verdicts") for method in outcome.detail.get("methods", {}).values())
    ]
    if strict and inconsistent:
        raise NoSolutionError(
            f"--strict: measurements contradict each other: {', '.join(inconsistent)}"
        )
