import numpy as np
from matplotlib.text import Text as Label

from fgnav.evaluation.report.blocks import Grid, Part, Report
from fgnav.evaluation.report.drawing.chart import Axis
from fgnav.evaluation.report.drawing.rows import Rows, rows_drawings
from fgnav.evaluation.report.drawing.shapes import Stroke, Text
from fgnav.evaluation.report.paper.pages import Pages

TIME = Axis(name="time, s", low=0.0, high=9.0)
LABELS = tuple(f"G{k:02d} 1C" for k in range(60))


def drawings(value):
    rows = Rows(mark="m0", name="a", t_s=np.arange(10.0), labels=LABELS, value=value)
    return rows_drawings("code: RMS, m", "m", [rows], TIME)


def test_many_channels_are_drawn_whole_in_as_many_drawings_as_a_sheet_takes():
    of = drawings(np.ones((10, len(LABELS))))
    names = [s.text for one in of for s in one.shapes if isinstance(s, Text) and "1C" in s.text]
    assert names == list(LABELS)
    scales = {s.text for one in of for s in one.shapes if isinstance(s, Text) and "row" in s.text}
    assert scales == {"row height: 1 m"}
    part = Part(name="a", title="A", blocks=[Grid(of)])
    pages = Pages(Report(title="r", methods=["a"], parts=[part]), part)
    (sheet,) = pages.sheets
    sizes = {t.get_fontsize() for t in sheet.figure.findobj(Label) if t.get_text() in LABELS}
    assert min(sizes) == max(sizes) > 5  # points: none made smaller than others to fit


def test_channels_without_a_value_have_no_row():
    value = np.full((10, len(LABELS)), np.nan)
    assert drawings(value) == []
    value[3, 7] = 2.0
    (one,) = drawings(value)
    assert [s.text for s in one.shapes if isinstance(s, Text) and "1C" in s.text] == ["G07 1C"]
    assert len([s for s in one.shapes if isinstance(s, Stroke) and s.mark == "m0"]) == 1
