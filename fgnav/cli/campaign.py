"""The command ``fgnav campaign``."""

import os
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from fgnav.terminal import progress, show_report


def campaign(
    order: Path,
    /,
    *,
    out: Path,
    flights: Annotated[
        int | None, Parameter(help="Of each case and value; the file's number by default.")
    ] = None,
    workers: Annotated[
        int | None, Parameter(help="Processes here; as many as there are cores by default.")
    ] = None,
    scheduler: Annotated[
        str | None, Parameter(help="A dask scheduler instead: tcp://host:8786.")
    ] = None,
    resume: Annotated[
        bool,
        Parameter(help="Keep runs that are there, fly those that are missing."),
    ] = False,
    report: Annotated[
        Path | None, Parameter(help="The report for print, too: .pdf, or .png, a picture by part.")
    ] = None,
) -> None:
    """Fly scenarios many times, run several methods on every flight, and judge them.

    Writes runs/ (a file for each flight), flights.csv and flights.parquet (a row for each flight
    and method), seconds.csv, report.txt and report.html. The same campaign gives the same tables,
    whatever the number of workers. Interrupted, it goes on with --resume.

    Example: fgnav campaign flown --out /tmp/flown

    Parameters
    ----------
    order
        A TOML file, or one that comes along: flown, restitution, degraded.
    out
        Folder for the results; new, unless resumed.
    """
    from fgnav.campaign.conduct import conduct  # noqa: PLC0415  # lazy, like all below
    from fgnav.campaign.engines import Dask, Local  # noqa: PLC0415
    from fgnav.campaign.order import load_order  # noqa: PLC0415
    from fgnav.checks import BadInputError, NoSolutionError  # noqa: PLC0415
    from fgnav.evaluation.report.save import check_report, write  # noqa: PLC0415
    from fgnav.shipped import file_or_shipped  # noqa: PLC0415

    if workers is not None and scheduler is not None:
        raise BadInputError("--workers: the cluster has its own; leave it out with --scheduler")
    check_report(report)
    engine = Dask(scheduler) if scheduler is not None else Local(workers or _cores())
    what = load_order(file_or_shipped(order, "fgnav_sim", "campaigns"), flights=flights)
    with progress(1) as step, step(f"{what.name}, {what.count} flights"):
        outcome = conduct(what, out, engine, resume=resume)
    print(outcome.text, end="")
    if report is not None:
        show_report(write(outcome.report, report))
    for loss in outcome.unused:
        print(f"{loss.count} × {loss.what}: {loss.reason}")
    print(f"{outcome.kept} of {outcome.asked} flights; tables are in {out}")
    if not outcome.kept:
        raise NoSolutionError(f"campaign {what.name}: no run was kept")


def _cores() -> int:
    """Count the processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
