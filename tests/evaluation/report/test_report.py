"""A report: every part in every format, of the flight's data, in one colour for each method."""

import re
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from fgnav.checks import BadInputError, Unused
from fgnav.evaluation.comparison import compare
from fgnav.evaluation.report.charts import METHODS, TRUTH, Chart, Line, styles_of, unjumped_deg
from fgnav.evaluation.report.contents import comparison_report
from fgnav.evaluation.report.parts import Folded, Grid, Part, Report, Table
from fgnav.evaluation.report.render import sheets
from fgnav.evaluation.report.save import check_report, page, save_report, write
from fgnav.evaluation.report.text import text_lines
from fgnav.types.estimate import CalibratedParameter, Consistency, Rejected
from tests.evaluation.conftest import Lost, Off, true_state

PARTS = (
    *("summary", "errors", "motion", "sigmas", "sky", "integers"),
    *("exclusions", "consistency", "set-up", "versions"),
)
VOID = {"meta", "input", "br", "hr"}


class Nesting(HTMLParser):
    """Collects what is open, and what was closed in the wrong order."""

    def __init__(self):
        super().__init__()
        self.open, self.wrong, self.addresses, self.ids = [], [], [], []

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.addresses += [values[k] for k in ("src", "href", "srcset", "data") if k in values]
        self.ids += [values["id"]] if "id" in values else []
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.handle_starttag(tag, attrs)
        if tag not in VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)


def parsed(text):
    nesting = Nesting()
    nesting.feed(text)
    nesting.close()
    assert (nesting.open, nesting.wrong) == ([], [])
    return nesting


def blocks_of(blocks, kind):
    for block in blocks:
        if isinstance(block, kind):
            yield block
        if isinstance(block, Folded):
            yield from blocks_of(block.blocks, kind)


def charts_of(report, *names):
    for part in report.parts:
        for block in blocks_of(part.blocks, Grid) if part.name in (names or PARTS) else ():
            yield from block.charts


def part_of(report, name):
    (part,) = (part for part in report.parts if part.name == name)
    return part


def cells_of(report, name):
    return [c for t in blocks_of(part_of(report, name).blocks, Table) for r in t.rows for c in r]


def drawn(chart, report):
    """Return the axes of a chart."""
    axes = Figure().add_axes((0, 0, 1, 1), projection="polar" if chart.polar else None)
    chart.draw(axes, styles_of(report.methods))
    return axes


@pytest.fixture(scope="module")
def text(flown_report):
    return page(flown_report)


def test_a_page_is_well_formed_loads_nothing_and_has_every_part(text):
    nesting = parsed(text)
    assert set(PARTS) <= set(nesting.ids)
    assert len(nesting.ids) == len(set(nesting.ids))
    outside = [a for a in nesting.addresses if not a.startswith(("#", "data:image/png;base64,"))]
    assert outside == []
    assert not re.search(r"https?:(?!//www\.w3\.org)|@import|import\(|fetch\(|XMLHttp", text)


def test_every_figure_of_a_page_is_sound_named_and_of_finite_numbers(text, flown_report):
    figures = re.findall(r"<svg .*?</svg>", text, flags=re.DOTALL)
    assert len(figures) == len(list(charts_of(flown_report))) > 40
    for figure in figures:
        root = ET.fromstring(figure.replace("xlink:", ""))
        assert len(root.get("aria-label")) > 10
        assert root.findall(".//path")
    assert not re.search(r'\b(d|x|y)="[^"]*(nan|inf)', text)


def test_every_figure_has_data_of_the_flight_and_axes_with_names(flown_report):
    for chart in charts_of(flown_report):
        shown = [*(line.y for line in chart.lines), *([chart.cells.kinds] if chart.cells else [])]
        assert any(np.isfinite(values).any() for values in shown), chart.title
        assert chart.x
        assert chart.y or chart.rows, chart.title


def test_errors_in_a_figure_are_those_of_the_comparison_with_three_sigmas(flown, flown_report):
    _, comparison = flown
    method = comparison.methods[0]
    name = f"{method.name}: error of yaw"
    (chart,) = (one for one in charts_of(flown_report, "errors") if one.title == name)
    (line,) = chart.lines
    np.testing.assert_array_equal(line.y, np.degrees(method.errors.euler_rad[:, 2]))
    np.testing.assert_allclose(line.half, 3 * method.estimate.sigma_deg[:, 2])
    axes = drawn(chart, flown_report)
    band, (dots,) = axes.collections[0].get_paths()[0].vertices[:, 1], axes.lines
    np.testing.assert_allclose([band.max(), band.min()], [line.half.max(), -line.half.max()])
    np.testing.assert_array_equal(dots.get_ydata(), line.y)
    low, high = axes.get_ylim()
    assert low < line.y.min() < line.y.max() < high


def test_a_method_has_one_colour_in_every_figure_and_report(flown_report, text):
    styles = styles_of(flown_report.methods)
    for chart in charts_of(flown_report):
        lines = drawn(chart, flown_report).lines
        for line in (one for one in lines if one.get_gid() is not None):
            (style,) = (one for one in styles.values() if one.group == line.get_gid())
            assert to_hex(line.get_color()) == style.colour
    assert styles["rtk"] == styles_of(["rtk"])["rtk"]._replace(group="m1")
    assert text.count('class="m1"') > 20
    assert "stroke: #cc79a7" in text


def test_methods_beyond_the_colours_are_told_apart_by_dashes():
    names = [*METHODS, *(f"smoother without {k}" for k in range(8))]
    styles = styles_of(names)
    assert len({styles[name][:2] for name in names}) == len(names)


@pytest.mark.parametrize("suffix", [".pdf", ".png"])
def test_sheets_hold_every_text_and_figure_and_nothing_leaves_them(flown_report, suffix):
    high, cut = (595.3, False) if suffix == ".pdf" else (6000.0, True)
    for part in flown_report.parts:
        figures = list(sheets(flown_report, part, high, cut=cut))
        grids = blocks_of(part.blocks, Grid)
        titles = [axes.get_title(loc="left") for sheet in figures for axes in sheet.axes]
        assert titles == [chart.title for grid in grids for chart in grid.charts]
        written = [text.get_text() for sheet in figures for text in sheet.texts]
        words = {word for line in text_lines(part.blocks, 150) for word in line.split()}
        words -= {word for word in words if set(word) == {"─"}}
        assert words - set(" ".join(written).split()) == set()
        for sheet in figures:
            assert all(0 <= text.get_position()[1] <= 1 for text in sheet.texts)
            assert all(axes.get_position().y0 > 0 for axes in sheet.axes)


def test_a_long_table_has_its_head_on_every_sheet():
    rows = [[f"row {k}", "a reason of many words " * 20, str(k)] for k in range(80)]
    part = Part("a", "A", [Table(["name", "why", "number"], rows, "caption")])
    found = [
        [text.get_text() for text in sheet.texts]
        for sheet in sheets(Report("r", ["m"], [part]), part, 595.3, cut=False)
    ]
    assert len(found) > 2
    assert sum(line.startswith("row ") for lines in found for line in lines) == len(rows)


def test_each_format_is_written_and_pictures_of_an_earlier_report_go(flown_report, tmp_path):
    parts = [part_of(flown_report, name) for name in ("summary", "errors")]
    few = replace(flown_report, parts=parts)
    (tmp_path / "report-mine.png").write_bytes(b"not of fgnav")
    write(few, tmp_path / "report.png")
    assert {path.name for path in tmp_path.iterdir()} >= {"report.png", "report-errors.png"}
    write(replace(few, parts=parts[:1]), tmp_path / "report.png")
    assert {path.name for path in tmp_path.iterdir()} == {"report.png", "report-mine.png"}
    assert (tmp_path / "report.png").read_bytes().startswith(b"\x89PNG")
    for name in ("a.pdf", "b.pdf", "c.html"):
        assert write(few, tmp_path / name) == [tmp_path / name]
    assert (tmp_path / "a.pdf").read_bytes() == (tmp_path / "b.pdf").read_bytes()
    assert (tmp_path / "a.pdf").read_bytes().startswith(b"%PDF-")
    assert (tmp_path / "c.html").read_text().startswith("<!doctype html>")


def test_what_cannot_be_written_is_said_before_anything_is(flight, tmp_path):
    with pytest.raises(BadInputError, match=r"end its name in \.html, \.png or \.pdf"):
        check_report(tmp_path / "report.docx")
    (tmp_path / "file").touch()
    with pytest.raises(BadInputError, match="is a file, not a folder"):
        check_report(tmp_path / "file" / "new" / "report.html")
    check_report(tmp_path / "absent" / "report.html")  # will be made
    with pytest.raises(BadInputError, match="no method has an estimate to report"):
        save_report(compare(flight, [Lost()]), flight, tmp_path / "a.html")


def test_nothing_that_draws_is_loaded_before_a_figure_is_drawn():
    code = (
        "import sys, fgnav.evaluation.report.save;"
        "sys.exit(' '.join({'matplotlib', 'jinja2'} & set(sys.modules)) or 0)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_seed_set_up_and_versions_are_said_and_no_name_is_markup(text, flight):
    assert "simulated with seed 17" in text
    assert "&lt;demo&gt;" in text
    assert "<demo>" not in text
    for word in ("numpy", "gtsam", "gnss_noise phase_m", "antenna a8", " 1C"):
        assert word in text
    report = comparison_report(compare(flight, [Off("<b>&")]), flight)
    assert "<b>" not in page(report)


def test_what_was_left_out_and_estimated_stands_with_its_reason(flight):
    t_s = np.concatenate([np.arange(0, 4, 0.1), np.arange(6, 10, 0.1)])
    phase = Rejected(what="phase", link="a3 G05 1C", from_s=1.0, until_s=2.0, reason="echo")
    value, covariance = np.array([0.25]), np.array([[0.01]])
    boresight = CalibratedParameter(
        name="boresight", axes=("about y_b",), unit="rad", value=value, covariance=covariance
    )
    deciles = (*[2] * 5, *[8] * 5)
    tested = {"what": "doppler", "count": 50, "freedom": 150, "nis": 2.0, "beyond_99": 0.1}
    more = {
        "n_epochs": 100,
        "rejections": (phase,),
        "unused": (Unused(what="a2 link", reason="below the mask", count=7),),
        "consistency": (Consistency(**tested, deciles=deciles),),
        "calibration": (boresight,),
    }
    report = comparison_report(compare(flight, [Off("careful", t_s=t_s, more=more)]), flight)
    assert {"echo", "a3 G05 1C", "below the mask", "3.90", "6.00"} <= set(
        cells_of(report, "exclusions")
    )
    assert {"boresight", "about y_b", "0.25"} <= set(cells_of(report, "constants"))
    assert "above" in cells_of(report, "consistency")  # chi2 of 150: 1 ± 0.23
    (shares,) = (one for one in charts_of(report, "consistency") if "decile" in one.title)
    np.testing.assert_allclose(shares.lines[0].y, np.repeat([4.0, 16.0], 10))
    assert "95 % of 50 independent" in shares.rules.values()


def test_a_flight_without_truth_or_sensors_still_has_its_report(flight, tmp_path):
    flight = replace(flight, truth=None)
    blind = Off("blind", more={"unobservable": ("attitude",)})
    comparison = compare(flight, [blind, Off("b"), Lost()])
    report = comparison_report(comparison, flight)
    names = {part.name for part in report.parts}
    assert "errors" not in names
    assert {"summary", "motion"} <= names
    cells = cells_of(report, "summary")
    assert "blind − b" in cells
    assert "nan" not in cells
    assert "yaw: not in the data" in " ".join(text_lines(part_of(report, "summary").blocks, 200))
    save_report(comparison, flight, tmp_path / "a.html")
    assert (tmp_path / "a.html").stat().st_size > 1000


def test_an_hour_is_a_small_page_and_keeps_its_spikes(flight):
    t_s = np.arange(36_000) * 0.1
    covariance = np.tile(1e-4 * np.eye(3), (len(t_s), 1, 1))
    noise = 0.01 * np.random.default_rng(1).standard_normal((len(t_s), 3))
    stated = dict.fromkeys(
        ("attitude_covariance_rad2", "position_covariance_m2", "velocity_covariance_m2ps2"),
        covariance,
    )
    methods = [Off(f"m{k}", noise, 0.1, t_s=t_s, more=stated) for k in range(2)]
    flight = replace(flight, truth=true_state(t_s))
    assert len(page(comparison_report(compare(flight, methods), flight))) < 2.8e6
    y = np.zeros(len(t_s))
    y[12_345], y[20_001] = 5.0, -7.0
    spiky = Chart("t", "y", [Line(TRUTH, t_s, y)], y_limits=(-10, 10))
    drawn_page = page(Report("r", ["m"], [Part("a", "A", [Grid([spiky])])]))
    (figure,) = re.findall(r"<svg .*?</svg>", drawn_page)
    paths = re.findall(r'd="([^"]*)" clip-path[^>]*stroke: var\(--c1a1a1a\)', figure)
    heights = [float(y) for y in re.findall(r"[ML] \S+ (\S+)", paths[-1])]
    assert len(heights) < 500
    zero = np.median(heights)
    assert (zero - min(heights)) / (max(heights) - zero) == pytest.approx(5 / 7, abs=0.02)


def test_lines_break_at_gaps_and_where_an_angle_wraps(flown_report):
    t_s = np.concatenate([np.arange(0, 5, 0.1), np.arange(9, 12, 0.1)])
    chart = Chart("t", "y", [Line(TRUTH, t_s, np.ones(len(t_s)))])
    (line,) = drawn(chart, flown_report).lines
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(line.get_ydata())), [50])
    angle_deg = np.array([170.0, 179.0, -179.0, -170.0, -60.0, 40.0, 60.0])
    np.testing.assert_array_equal(
        np.isnan(unjumped_deg(angle_deg)), [False, False, True, False, True, True, False]
    )


def test_wrong_integers_show_in_time(flown):
    flight, comparison = flown
    method = comparison.methods[0]
    cycles = method.estimate.integers.cycles.copy()
    cycles[10:, 0, :] += method.estimate.integers.fixed[10:, 0, :]
    estimate = replace(method.estimate, integers=replace(method.estimate.integers, cycles=cycles))
    spoilt = replace(comparison, methods=(replace(method, estimate=estimate),))
    states, links = charts_of(comparison_report(spoilt, flight), "integers")
    shown = [list(states.cells.colours)[kind] for kind in states.cells.kinds[0]]
    assert shown == ["fixed"] * 10 + ["wrong"] * 10
    assert links.lines[0].y.max() == method.estimate.integers.fixed.sum(axis=(1, 2)).max()
    listed = method.to_dict()["arcs"]
    assert {one["by"] for one in listed} <= {"resolver", "arc", "array"}
    tables = blocks_of(part_of(comparison_report(comparison, flight), "integers").blocks, Table)
    (arcs,) = (table for table in tables if "arcs" in table.caption)
    assert f"of {sum(len(m.arcs) for m in comparison.methods)};" in arcs.caption


def test_residuals_by_satellite_are_the_noise_and_a_spoilt_one_stands_out(flown):
    flight, comparison = flown
    differences = comparison.double_differences
    spoilt = int(np.flatnonzero(differences.resolvable.all(axis=(0, 1)))[0])
    phase_m = differences.phase_m.copy()
    phase_m[:, ::2, spoilt] += 0.05
    other = replace(comparison, double_differences=replace(differences, phase_m=phase_m))
    name = f"{differences.satellites[spoilt]} {differences.signals[spoilt]}"
    rms = {}
    for key, of in (("noise", comparison), ("spoilt", other)):
        (folded,) = (b for b in part_of(comparison_report(of, flight), "sky").blocks[1:])
        phase, code = blocks_of([folded], Table)
        rms[key] = {row[0]: float(row[1]) for row in phase.rows}
    sigma_mm = 1e3 * np.sqrt(2 * differences.phase_variance_m2[:, spoilt].mean())
    assert 0.5 * sigma_mm < rms["noise"][name] < 1.5 * sigma_mm
    assert max(rms["spoilt"], key=rms["spoilt"].get) == name
    assert rms["spoilt"][name] > 20.0
    assert [head.split(", ")[0] for head in code.heads[1:]] == ["maximum-likelihood", "rtk"]
    assert all(0.05 < float(row[1]) < 3.0 for row in code.rows)
