"""A printed report: all of the page, on sheets, in the same colours, and nothing cut off."""

import subprocess
import sys
from dataclasses import replace

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_hex
from matplotlib.lines import Line2D
from matplotlib.text import Text

from fgnav.checks import BadInputError
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report import save
from fgnav.evaluation.report.blocks import Folded, Grid, Paragraph, Part, Report, Source, Table
from fgnav.evaluation.report.palette import LIGHT, method_marks
from fgnav.evaluation.report.paper.pages import Pages
from fgnav.evaluation.report.paper.save import save_pdf, save_pngs
from fgnav.evaluation.report.save import check_report, save_report

PNG = b"\x89PNG\r\n\x1a\n"


def texts_of(blocks):
    """Yield every text of blocks, those of drawings too."""
    for block in blocks:
        match block:
            case Paragraph(text):
                yield text
            case Source(text):
                yield from text.splitlines()
            case Table(heads, rows, caption):
                yield from (caption, *heads, *(cell for row in rows for cell in row))
            case Grid(drawings):
                for one in drawings:
                    yield one.title
                    yield from (shape.text for shape in one.shapes if hasattr(shape, "text"))
            case Folded(title, inner):
                yield title
                yield from texts_of(inner)


@pytest.fixture(scope="module")
def pages(flown_report):
    return {part.name: Pages(flown_report, part) for part in flown_report.parts}


@pytest.fixture(scope="module")
def sheets(pages):
    return {name: of.sheets for name, of in pages.items()}


def written(sheets):
    texts = [one.get_text() for sheet in sheets for one in sheet.figure.findobj(Text)]
    return " ".join(" ".join(texts).split())


def test_every_text_of_every_part_is_on_its_sheets(flown_report, sheets):
    assert len(flown_report.parts) >= 13
    for part in flown_report.parts:
        found = written(sheets[part.name])
        words = {word for text in texts_of(part.blocks) for word in text.split()}
        assert {word for word in words if word not in found} == set()


def test_every_line_of_a_method_has_its_colour(flown_report, sheets):
    marks = method_marks(flown_report.methods)
    known = {colour.lower() for colour in map(to_hex, LIGHT.values())}
    for name, of in sheets.items():
        drawn = {to_hex(line.get_color()) for one in of for line in one.figure.findobj(Line2D)}
        assert drawn <= known
        if name in ("errors", "motion", "residuals", "consistency"):
            assert {to_hex(LIGHT[mark]) for mark in marks.values()} <= drawn


def outside(pages):
    """Yield texts that leave a sheet cut where its content is said to end."""
    for sheet, foot in zip(pages.sheets, pages.feet, strict=True):
        renderer = FigureCanvasAgg(sheet.figure).get_renderer()
        width, top = sheet.figure.bbox.size
        low = top - foot * sheet.figure.dpi / 72
        for text in sheet.figure.findobj(Text):
            box = text.get_window_extent(renderer)
            if not (0 <= box.x0 <= box.x1 <= width and low <= box.y0 <= box.y1 <= top):
                yield text.get_text()


def test_nothing_written_leaves_its_sheet(pages):
    assert [list(outside(of)) for of in pages.values()] == [[]] * len(pages)


def test_a_long_table_is_broken_and_each_piece_has_its_head():
    rows = [[f"row {k}", "a reason of many words " * 20, str(k)] for k in range(80)]
    part = Part(name="a", title="A", blocks=[Table(["name", "why", "number"], rows, "c")])
    pages = Pages(Report(title="r", methods=["m"], parts=[part]), part)
    assert len(pages.sheets) > 2
    found = [written([sheet]) for sheet in pages.sheets]
    assert all("name why number" in text for text in found)
    assert sum(text.count("row ") for text in found) == len(rows)
    assert list(outside(pages)) == []


def test_a_narrow_table_fills_a_sheet_in_columns():
    rows = [[f"row {k}", str(k)] for k in range(120)]
    part = Part(name="a", title="A", blocks=[Table(["name", "number"], rows, "")])
    assert len(Pages(Report(title="r", methods=["m"], parts=[part]), part).sheets) == 1


def test_pictures_are_named_by_their_parts_and_those_of_an_earlier_report_go(
    flown_report, tmp_path
):
    few = replace(flown_report, parts=flown_report.parts[:3])
    (tmp_path / "report-mine.png").write_bytes(b"not of fgnav")
    save_pngs(few, tmp_path / "report.png")
    names = {
        path.name for path in save_pngs(replace(few, parts=few.parts[:2]), tmp_path / "report.png")
    }
    assert {"report.png", "report-errors.png"} <= names
    assert {path.name for path in tmp_path.iterdir()} == names | {"report-mine.png"}
    assert (tmp_path / "report.png").read_bytes().startswith(PNG)


def test_the_same_report_gives_the_same_pdf(flown_report, tmp_path):
    few = replace(flown_report, parts=flown_report.parts[:2])
    for name in ("a.pdf", "b.pdf"):
        save_pdf(few, tmp_path / name)
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()


def test_without_truth_or_attitude_a_report_is_still_printed(flight, off, tmp_path):
    blind = off("blind", more={"unobservable": ("attitude",)})
    flight = replace(flight, truth=None)
    files = save_report(compare(flight, [blind, off("b")]), flight, tmp_path / "a.png")
    names = {path.name for path in files}
    assert {"a.png", "a-motion.png"} <= names
    assert "a-errors.png" not in names
    assert (tmp_path / "a.png").read_bytes().startswith(PNG)


def test_without_matplotlib_the_error_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setattr(save, "find_spec", lambda _: None)
    with pytest.raises(BadInputError, match=r"needs matplotlib; pip install 'fgnav\[report\]'"):
        check_report(tmp_path / "report.png")
    check_report(tmp_path / "report.html")


def test_matplotlib_is_not_loaded_before_a_figure_is_drawn():
    code = "import sys, fgnav.evaluation.report.save; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True)
