"""An outcome of a comparison as files of a folder."""

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fgnav.evaluation.comparison import Comparison
    from fgnav.evaluation.flights import FlightsComparison
    from fgnav.types.flight import Flight


def fail_if_inconsistent(comparison: "Comparison | FlightsComparison", *, strict: bool) -> None:
    """Raise if estimates are to be consistent and some are not.

    Raises
    ------
    NoSolutionError
        Naming the methods and the sensors that contradict the others, or the flights.
    """
    from fgnav.checks import NoSolutionError  # noqa: PLC0415  # lazy, like all below

    if strict and comparison.contradictions:
        named = "; ".join(comparison.contradictions)
        raise NoSolutionError(f"--strict: measurements contradict each other: {named}")


def write_method(comparison: "Comparison", name: str, flight: "Flight", folder: Path) -> str:
    """Write estimate.csv, estimate.npz and summary.json of one method; return a line that says so.

    They replace earlier ones together, once all are on the disk.

    Raises
    ------
    NoSolutionError
        If the method has no estimate, or one that is no minimum: a file of it would look right.
    """
    from fgnav.checks import NoSolutionError  # noqa: PLC0415  # lazy, like all below
    from fgnav.io.atomic_write import made_folder  # noqa: PLC0415
    from fgnav.io.exports.recorded import FILE, save_estimate  # noqa: PLC0415
    from fgnav.io.exports.tables import ESTIMATE, SUMMARY, write_outcome  # noqa: PLC0415

    method = comparison[name]
    estimate = method.solution
    if not estimate.converged:
        open_ = " and ".join(estimate.unobservable)
        raise NoSolutionError(
            f"{name}: did not end at a minimum, nothing is written"
            + (f"; the data leave open: {open_}" if open_ else "")
        )
    alone = replace(comparison, methods=(method,), differences=())
    made = made_folder(folder)
    replaced = ", for an earlier one" if (made / ESTIMATE).exists() else ""
    with TemporaryDirectory(prefix=".fgnav-", dir=made) as written:  # on the same disk
        save_estimate(estimate, flight, Path(written) / FILE)
        write_outcome(Path(written), estimate, flight.origin, alone.to_dict())
        for file in (FILE, ESTIMATE, SUMMARY):
            (Path(written) / file).replace(made / file)
    count = f"{len(estimate.t_s)} of {comparison.epochs} epochs"
    return f"{name}: {count} in {made / ESTIMATE}{replaced}"
