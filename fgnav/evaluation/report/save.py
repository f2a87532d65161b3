"""A comparison as a report: a page of HTML, or a figure, by the suffix of the file's name."""

from pathlib import Path

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import Comparison
from fgnav.evaluation.report.html.page import SUFFIX, check_page, save_page
from fgnav.evaluation.report.plots import FORMATS, check_figure, save_figure
from fgnav.io.flight.folder import files_of
from fgnav.types.flight import Flight

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
    if path.suffix.lower() == SUFFIX:
        check_page(path)
    elif path.suffix.lower() in FORMATS:
        check_figure(path)
    else:
        raise BadInputError(
            f"{path}: a report is HTML, PNG or PDF; end its name in .html, .png or .pdf"
        )


def save_report(
    comparison: Comparison, flight: Flight, path: Path | None, place: Path | None = None
) -> None:
    """Write the report of a comparison; None is none.

    Parameters
    ----------
    comparison : Comparison
    flight : Flight
        The one compared.
    path : Path or None
    place : Path, optional
        Where the flight was read from: a page quotes its ``flight.toml``.
    """
    if path is None:
        return
    check_report(path)
    if path.suffix.lower() == SUFFIX:
        toml = None if place is None else files_of(place)[0]
        source = "" if toml is None else _text(toml)
        seed = None if toml is None else _seed(toml.with_name(_DRAWN))
        save_page(comparison, flight, path, seed=seed, source=source)
    else:
        save_figure(comparison, path)


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
