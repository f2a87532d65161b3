"""A report as a file: a page of HTML, a PDF or pictures, by the suffix of the file's name."""

from importlib.util import find_spec
from pathlib import Path

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import Comparison
from fgnav.evaluation.flights import FlightsComparison
from fgnav.evaluation.report.blocks import Report
from fgnav.evaluation.report.contents import comparison_report
from fgnav.evaluation.report.flights import flights_report
from fgnav.evaluation.report.html.page import save_page
from fgnav.io.atomic_write import check_place
from fgnav.io.flight.folder import files_of
from fgnav.types.flight import Flight

_PAGE, _PDF, _PICTURES = ".html", ".pdf", ".png"
_DRAWN = "dispersions.json"  # of the simulator: says the seed


def check_report(path: Path | None) -> None:
    """Raise unless a report can be written into a file of that name; None is none.

    Raises
    ------
    BadInputError
        If its suffix is of no format, its folder is absent, or what draws is not installed.
    """
    if path is None:
        return
    suffix = path.suffix.lower()
    if suffix not in (_PAGE, _PDF, _PICTURES):
        raise BadInputError(
            f"{path}: a report is HTML, PNG or PDF; end its name in .html, .png or .pdf"
        )
    check_place(path)
    if suffix != _PAGE and find_spec("matplotlib") is None:
        raise BadInputError(f"{path}: a figure needs matplotlib; pip install 'fgnav[report]'")


def save_report(
    comparison: Comparison, flight: Flight, path: Path | None, place: Path | None = None
) -> list[Path]:
    """Write the report of a comparison; return its files, none where ``path`` is None.

    Parameters
    ----------
    flight : Flight
        The one compared.
    path : Path or None
        One file, but pictures are many: the summary is ``report.png``, and each other part has its
        name added, ``report-errors.png``.
    place : Path, optional
        Where the flight was read from: the report quotes its ``flight.toml``.

    Raises
    ------
    BadInputError
        As ``check_report``, or if no method has an estimate.
    """
    check_report(path)
    if path is None:
        return []
    if not comparison.solved:
        raise BadInputError(f"{path}: no method has an estimate to report")
    toml = None if place is None else files_of(place)[0]
    source = "" if toml is None else _text(toml)
    seed = None if toml is None else _seed(toml.with_name(_DRAWN))
    return write(comparison_report(comparison, flight, seed=seed, source=source), path)


def save_flights_report(comparison: FlightsComparison, path: Path | None) -> list[Path]:
    """Write the report of several flights, as ``save_report``."""
    check_report(path)
    return [] if path is None else write(flights_report(comparison), path)


def write(report: Report, path: Path) -> list[Path]:
    """Write a report in the format that the name of its file says; return its files.

    Raises
    ------
    BadInputError
        As ``check_report``.
    """
    check_report(path)
    if path.suffix.lower() == _PAGE:
        save_page(report, path)
        return [path]
    from fgnav.evaluation.report.paper.save import save_pdf, save_pngs  # noqa: PLC0415  # matplotlib

    if path.suffix.lower() == _PICTURES:
        return save_pngs(report, path)
    save_pdf(report, path)
    return [path]


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):  # gone meanwhile: it was read once
        return ""


def _seed(drawn: Path) -> int | None:
    """Return the seed that the simulator wrote beside a flight, if it did."""
    import json  # noqa: PLC0415  # only here

    try:
        seed = json.loads(_text(drawn)).get("seed")
    except (ValueError, AttributeError):
        return None
    return seed if isinstance(seed, int) else None
