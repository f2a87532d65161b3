"""The files of a printed report: one PDF of all sheets, or a PNG of each."""

from glob import escape
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages

from fgnav.evaluation.report.blocks import Report
from fgnav.evaluation.report.paper.canvas import Sheet
from fgnav.evaluation.report.paper.pages import Pages
from fgnav.io.atomic_write import atomic_file

_DOTS = 200  # of an inch of a PNG
_BELOW = 8.0  # points of ground below what a PNG shows
_OURS, _HEAD = "a report of fgnav", 400  # said within the first bytes of each picture
_METADATA = {"Software": _OURS}
_STYLE: Any = {"font.family": "sans-serif", "pdf.fonttype": 42}  # letters stay letters


def save_pdf(report: Report, path: Path) -> None:
    """Write all sheets into one file, whole or not at all; the same report gives the same bytes."""
    meta = {"Title": report.title, "CreationDate": None, "Creator": "fgnav"}
    with (
        rc_context(_STYLE),
        atomic_file(path) as part,
        PdfPages(part, metadata=meta) as file,
    ):
        for one in report.parts:
            for sheet in Pages(report, one).sheets:
                file.savefig(sheet.figure)


def save_pngs(report: Report, path: Path) -> list[Path]:
    """Write a picture of each sheet, cut below its content; return their paths.

    The first part is the file that was asked for, others have their name and number added to it:
    ``report.png``, ``report-errors.png``, ``report-errors-2.png``. Pictures of an earlier report of
    that name are removed, so that all that lie there are of one report.
    """
    written = []
    with rc_context(_STYLE):
        for place, one in enumerate(report.parts):
            pages = Pages(report, one)
            for number, (sheet, foot) in enumerate(zip(pages.sheets, pages.feet, strict=True), 1):
                name = f"-{one.name}" if place else ""
                name += f"-{number}" if number > 1 else ""
                own = path.with_name(f"{path.stem}{name}{path.suffix}")
                _save_png(sheet, foot, own)
                written.append(own)
    for earlier in set(path.parent.glob(f"{escape(path.stem)}-*{path.suffix}")) - set(written):
        if _OURS.encode() in earlier.read_bytes()[:_HEAD]:
            earlier.unlink()
    return written


def _save_png(sheet: Sheet, foot: float, path: Path) -> None:
    FigureCanvasAgg(sheet.figure)
    sheet.cut(foot + _BELOW)
    with atomic_file(path) as part:
        sheet.figure.savefig(part, format="png", dpi=_DOTS, metadata=_METADATA)
