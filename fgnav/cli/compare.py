"""The command ``fgnav compare``."""

from pathlib import Path

from fgnav.cli.estimators import Asked, compare_flight, estimators_named
from fgnav.cli.options import (
    CausalFlag,
    EstimateWords,
    FactorNames,
    GravityName,
    IntegersName,
    LagSeconds,
    NoiseName,
    ReportFile,
    SolverName,
)
from fgnav.json_file import JsonFile, write_json
from fgnav.terminal import check_outputs, show_comparison

_DEFAULT_METHODS = "closed-form,maximum-likelihood,smoother,batch,rtk"


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
    noise: NoiseName = None,
    json: JsonFile = None,
    report: ReportFile = None,
) -> None:
    """Run several methods on one flight and judge them, against truth or against each other.

    Example: fgnav compare demo/flight --method rtk,smoother --json - > figures.json

    Parameters
    ----------
    flight
        Folder with a flight.toml.
    method
        Names, separated by commas.
    """
    from fgnav.checks import NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.save import check_report, save_report  # noqa: PLC0415

    check_outputs(flight, json, report)
    check_report(report)
    asked = Asked(gravity, estimate, lag, solver, factors, causal, noise)
    estimators = estimators_named(method, integers, asked)
    data, comparison = compare_flight(flight, estimators)
    write_json(json, comparison.to_dict())
    if json != "-":
        show_comparison(comparison)
    if all(m.estimate is None for m in comparison.methods):
        failures = "; ".join(f"{m.name}: {m.score.failure}" for m in comparison.methods)
        raise NoSolutionError(f"no method has a solution: {failures}")
    save_report(comparison, data, report, flight)
