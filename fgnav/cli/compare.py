"""The command ``fgnav compare``."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from fgnav.cli.arguments.estimators import (
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
from fgnav.terminal import check_outputs, show_blocks, show_comparison, show_lines, show_report

if TYPE_CHECKING:
    from fgnav.evaluation.comparison import Comparison
    from fgnav.evaluation.flights import FlightsComparison
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
    from fgnav.checks import BadInputError, NoSolutionError  # noqa: PLC0415  # lazy, like all below
    from fgnav.evaluation.report.contents import comparison_report, source_of  # noqa: PLC0415
    from fgnav.evaluation.report.flights import flights_report, on_screen  # noqa: PLC0415
    from fgnav.evaluation.report.save import check_report, write  # noqa: PLC0415

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
    comparison: Comparison | FlightsComparison
    estimates: Callable[[], list[str]] = list
    if len(folders) > 1:
        comparison = several = compare_folders(folders, estimators, span)
        show, report_of = partial(show_blocks, on_screen(several)), partial(flights_report, several)
    else:
        data, comparison = compare_flight(folders[0], estimators, span)
        show = partial(show_comparison, comparison)
        report_of = partial(comparison_report, comparison, data, **source_of(folders[0]))
        estimates = list if out is None else partial(_written, comparison, data, out)
    write_json(json, comparison.to_dict())
    if json != "-":
        show()
    if comparison.failure is not None:
        raise NoSolutionError(comparison.failure)
    written = estimates()
    files = [] if report is None else write(report_of(), report)
    if json != "-":
        show_lines(written)
        show_report(files)
    fail_if_inconsistent(comparison, strict=smoother.strict)


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
