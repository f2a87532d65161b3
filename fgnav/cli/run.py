"""The command ``fgnav run``."""

from pathlib import Path

from fgnav.cli.arguments.estimators import (
    compare_flight,
    estimators_named,
    log_findings_of_check,
)
from fgnav.cli.arguments.options import (
    SMOOTHER_DEFAULTS,
    IntegersName,
    RateHz,
    ReportFile,
    SmootherOptions,
    TimesFile,
)
from fgnav.cli.arguments.written import fail_if_inconsistent, write_method
from fgnav.integers.resolvers.registry import DEFAULT
from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import check_outputs, show_comparison, show_lines, show_report


def run(  # noqa: PLR0913  # a command has as many options as it takes
    flight: Path,
    /,
    *,
    out: Path,
    method: str = "smoother",
    integers: IntegersName = DEFAULT,
    smoother: SmootherOptions = SMOOTHER_DEFAULTS,
    at: TimesFile = None,
    rate: RateHz = None,
    json: JsonFile = None,
    report: ReportFile = None,
) -> None:
    """Estimate a flight with one method; write estimate.csv, estimate.npz and summary.json.

    Example: fgnav run demo/flight --method smoother --out demo/smoother

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    out
        Folder for the results; made if absent.
    method
        closed-form, maximum-likelihood, smoother, forward, batch, rtk, or an installed one.
    """
    from fgnav.checks import BadInputError, NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.save import check_report, save_report  # noqa: PLC0415
    from fgnav.methods.at_times import at_times  # noqa: PLC0415

    check_outputs(flight, json, report=report, folder=out)
    check_report(report)
    estimators = [
        at_times(estimator, at, rate) for estimator in estimators_named(method, integers, smoother)
    ]
    if len(estimators) > 1:
        raise BadInputError(f"--method {method}: run takes one method; compare takes several")
    data, comparison = compare_flight(flight, estimators)
    try:
        written = write_method(comparison, comparison.methods[0].name, data, out)
    except NoSolutionError:
        log_findings_of_check(data)
        raise
    files = save_report(comparison, data, report, flight)
    write_json(json, comparison.to_dict())
    if json != "-":
        show_lines([written])
        show_comparison(comparison)
        show_report(files)
    fail_if_inconsistent(comparison, strict=smoother.strict)
