"""A report as a file: a page of HTML, a PDF or pictures, by the suffix of the file's name."""

from glob import escape
from importlib.resources import files
from itertools import count
from pathlib import Path
from typing import Any

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import Comparison
from fgnav.evaluation.report.charts import Chart, styles_of
from fgnav.evaluation.report.contents import comparison_report, source_of
from fgnav.evaluation.report.parts import Report
from fgnav.io.atomic_write import atomic_file, check_folder, made_folder, write_text
from fgnav.types.flight import Flight

_SHEET, _PICTURE = 595.3, 6000.0  # heights, points; pictures end below what they show
_DOTS = 200  # of an inch of a PNG
_OURS, _HEAD = "a report of fgnav", 400  # said within the first bytes of each picture


def check_report(path: Path | None) -> None:
    """Raise unless a report can be written into a file of that name; None is none.

    Raises
    ------
    BadInputError
        If its suffix is of no format, or its folder cannot be made.
    """
    if path is None:
        return
    if path.suffix.lower() not in (".html", ".pdf", ".png"):
        raise BadInputError(
            f"{path}: a report is HTML, PNG or PDF; end its name in .html, .png or .pdf"
        )
    if path.is_dir():
        raise BadInputError(f"{path}: is a folder; name a file")
    check_folder(path.parent)


def save_report(
    comparison: Comparison, flight: Flight, path: Path | None, folder: Path | None = None
) -> list[Path]:
    """Write the report of a comparison; return its files, none where ``path`` is None.

    Parameters
    ----------
    flight : Flight
        The one compared.
    path : Path or None
        Pictures are many: ``report.png`` is the summary, ``report-errors.png`` another part.
    place : Path, optional
        Where the flight was read from: the report quotes its ``flight.toml``.

    Raises
    ------
    BadInputError
        As ``check_report``, or if no method has an estimate.
    """
    if path is None:
        return []
    if not comparison.solved:
        raise BadInputError(f"{path}: no method has an estimate to report")
    source = {} if folder is None else source_of(folder)
    return write(comparison_report(comparison, flight, **source), path)


def write(report: Report, path: Path) -> list[Path]:
    """Write a report in the format that the name of its file says; return its files."""
    check_report(path)
    made_folder(path.parent)
    match path.suffix.lower():
        case ".html":
            write_text(path, page(report))
        case ".pdf":
            _save_pdf(report, path)
        case _:
            return _save_pngs(report, path)
    return [path]


def page(report: Report) -> str:
    """Return a report as one page that loads nothing; each method has a box that hides it."""
    from jinja2 import Environment, StrictUndefined  # noqa: PLC0415  # lazy
    from markupsafe import Markup  # noqa: PLC0415

    from fgnav.evaluation.report.render import DARK, page_colour, svg  # noqa: PLC0415

    styles, salts = styles_of(report.methods), count()
    source = files("fgnav.evaluation.report") / "page.html.j2"
    template = Environment(autoescape=True, undefined=StrictUndefined).from_string(
        source.read_text(encoding="utf-8")
    )

    def drawn(chart: Chart) -> Markup:
        return Markup(svg(chart, styles, f"f{next(salts)}"))  # escaped in there

    return template.render(report=report, styles=styles, dark=DARK, svg=drawn, colour=page_colour)


def _save_pdf(report: Report, path: Path) -> None:
    """Write all sheets into one file; the same report gives the same bytes."""
    from matplotlib.backends.backend_pdf import PdfPages  # noqa: PLC0415  # lazy

    from fgnav.evaluation.report.render import sheets  # noqa: PLC0415

    metadata: dict[str, Any] = {"Title": report.title, "CreationDate": None, "Creator": "fgnav"}
    with atomic_file(path) as unfinished, PdfPages(unfinished, metadata=metadata) as pdf:
        for section in report.parts:
            for sheet in sheets(report, section, _SHEET, cut=False):
                pdf.savefig(sheet)


def _save_pngs(report: Report, path: Path) -> list[Path]:
    """Write a picture of each part; return their paths. Those of an earlier report are removed."""
    from fgnav.evaluation.report.render import sheets  # noqa: PLC0415  # lazy

    written = []
    for index, section in enumerate(report.parts):
        for number, sheet in enumerate(sheets(report, section, _PICTURE, cut=True), 1):
            name = (f"-{section.name}" if index else "") + (f"-{number}" if number > 1 else "")
            written.append(path.with_name(f"{path.stem}{name}{path.suffix}"))
            with atomic_file(written[-1]) as unfinished:
                sheet.savefig(unfinished, format="png", dpi=_DOTS, metadata={"Software": _OURS})
    for earlier in set(path.parent.glob(f"{escape(path.stem)}-*{path.suffix}")) - set(written):
        if _OURS.encode() in earlier.read_bytes()[:_HEAD]:
            earlier.unlink()
    return written
