"""A figure as SVG, and a report as sheets of figures and text: all by matplotlib."""

import re
from collections.abc import Iterator, Mapping, Sequence
from html import escape
from io import StringIO
from typing import Any, NamedTuple

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from fgnav.evaluation.report.charts import (
    BOTTOM,
    DIM,
    INK,
    LINES,
    RIGHT,
    TRUTH,
    WIDTH,
    Chart,
    Style,
    styles_of,
)
from fgnav.evaluation.report.parts import Block, Folded, Grid, Part, Report, Table
from fgnav.evaluation.report.text import text_lines

TICKS = {"color": DIM, "major.size": 0.0, "minor.size": 0.0, "major.pad": 2.0}
STYLE: Any = {
    "font.family": "sans-serif",
    "font.size": 6.5,
    "axes.titlesize": 6.5,
    "axes.titlelocation": "left",
    "axes.labelpad": 1.0,
    "axes.linewidth": 0.4,
    "axes.edgecolor": DIM,
    "axes.labelcolor": DIM,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "axes.grid": True,
    "grid.color": LINES,
    "grid.linewidth": 0.5,
    "legend.borderaxespad": 0.0,
    "legend.borderpad": 0.1,
    "legend.fontsize": 6.0,
    "legend.frameon": False,
    "path.simplify_threshold": 0.2,
    "text.color": INK,
    "text.parse_math": False,
    **{f"{axis}tick.{key}": value for axis in "xy" for key, value in TICKS.items()},
    "xtick.major.pad": 3.5,
    "pdf.fonttype": 42,  # letters stay letters
    "svg.fonttype": "none",
    "svg.hashsalt": "fgnav",  # the same report gives the same bytes
}
DARK = {
    "#1a1a1a": "#ececec",
    "#5a5a5a": "#b0b0b0",
    "#e2e2e2": "#33383f",
    "#ffffff": "#1f242a",
    "#0072b2": "#6f9dff",
    "#000000": "#fafafa",
    "#0060a0": "#7cc4ff",
}
_WIDE, _MARGIN, _GAP = 841.9, 34.0, 12.0  # A4 on its side: three figures side by side
_COLUMNS = 3
_SIZE, _LINE, _LETTER = 6.4, 8.4, 0.602  # of text: letters, from line to line, and their width
_LETTERS = int((_WIDE - 2 * _MARGIN) / (_LETTER * _SIZE))
_PIECE = 44  # rows of a table below one head


def svg(chart: Chart, styles: Mapping[str, Style], salt: str) -> str:
    """Return a figure for a page: colours are variables, groups of a method a class.

    Parameters
    ----------
    salt : str
        Differs between the figures of a page, whose names must not meet.
    """
    out = StringIO()
    with rc_context(STYLE):
        figure = Figure(figsize=(WIDTH / 72, chart.height / 72), facecolor="none")
        _draw(figure, chart, styles, (0.0, 0.0))
        FigureCanvasSVG(figure).print_svg(out, metadata={"Date": None})  # type: ignore[no-untyped-call]
    text = out.getvalue()
    text = text[text.index('<g id="figure_1">') :]
    text = re.sub(r'<g id="(m\d{1,2})">', r'<g class="\1">', text)
    text = re.sub(r' id="(?!C\d)[\w.]+_\d+"', "", text)
    text = re.sub(r'( id="|href="#|url\(#)', rf"\1{salt}", text)
    text = _dots(text)
    text = re.sub(r"font-family: [^;]*; ", "", text)
    text = re.sub(r"<[^>]*>", _rounded, text)
    text = re.sub(r"\s*\n\s*", " ", text)
    for colour in DARK:
        text = text.replace(colour, page_colour(colour))
    label = escape(chart.description)
    size = f"0 0 {WIDTH:g} {chart.height:g}"
    return f'<svg viewBox="{size}" role="img" aria-label="{label}">{text}'


def page_colour(colour: str) -> str:
    """Return a colour as a page names it: a variable where it differs on dark ground."""
    return f"var(--c{colour[1:]})" if colour in DARK else colour


def _dots(text: str) -> str:
    """Return a figure whose markers are one path of round dots, a tenth as long."""
    radius = dict(re.findall(r'<path id="(\w+)" d="M 0 (\S+)', text))

    def path(uses: re.Match[str]) -> str:
        moves = "".join(f"M{x} {y}h0" for x, y in re.findall(r'x="(.*?)" y="(.*?)"', uses[0]))
        stroke = f"stroke: {uses['colour']}; stroke-width: {2 * float(radius[uses['name']])}"
        return f'<path class="dots" d="{moves}" style="{stroke}"/>'

    use = r'<use xlink:href="#(?P<name>\w+)"[^>]*style="fill: (?P<colour>#\w+)"/>\s*'
    return re.sub(f"(?:{use})+", path, text)


def _rounded(tag: re.Match[str]) -> str:
    """Return a tag whose numbers have one decimal."""
    return re.sub(r"(?<=\d\.\d)\d+", "", tag[0])


class _Row(NamedTuple):
    """A row of a sheet: its height, and a line of text or figures side by side."""

    height: float
    text: str = ""
    bold: bool = False
    charts: Sequence[Chart] = ()


def sheets(report: Report, part: Part, high: float, *, cut: bool) -> Iterator[Figure]:
    """Yield the sheets of a part, so high in points; ``cut`` ones end below what they hold."""
    free = high - 2 * _MARGIN - _head(report)
    pages: list[list[_Row]] = [[]]
    for row in _rows(part.blocks):
        if pages[-1] and sum(above.height for above in pages[-1]) + row.height > free:
            pages.append([])
        pages[-1].append(row)
    for number, page in enumerate(pages, 1):
        title = part.title + (f" ({number})" if number > 1 else "")
        spare = free - sum(row.height for row in page)
        with rc_context(STYLE):  # also while a sheet is saved
            yield _sheet(report, title, page, high - max(spare, 0) if cut else high)


def _rows(blocks: Sequence[Block]) -> Iterator[_Row]:
    """Yield blocks row by row."""
    for block in blocks:
        lines: list[str] = []
        match block:
            case Grid(charts):
                for first in range(0, len(charts), _COLUMNS):
                    charts_in_row = charts[first : first + _COLUMNS]
                    yield _Row(
                        max(chart.height for chart in charts_in_row) + 8.0, charts=charts_in_row
                    )
            case Folded(title, inner):
                yield _Row(2.6 * _LINE, title, bold=True)
                yield from _rows(inner)
            case Table(heads, rows, caption):
                for first in range(0, len(rows), _PIECE):
                    piece = Table(heads, rows[first : first + _PIECE], "" if first else caption)
                    lines += [*text_lines([piece], _LETTERS), ""]
            case _:
                lines += [*text_lines([block], _LETTERS), ""]
        yield from (_Row(_LINE, line) for line in lines)


def _head(report: Report) -> float:
    """Return the height of what stands above each sheet."""
    return 30.0 + _LINE * -(-(len(report.methods) + 1) // 7)


def _sheet(report: Report, title: str, rows: Sequence[_Row], high: float) -> Figure:
    """Return a sheet: what it is of, the colours of the methods, then its rows."""
    figure, styles = Figure(figsize=(_WIDE / 72, high / 72)), styles_of(report.methods)

    def write(text: str, top: float, size: float, **more: Any) -> None:  # noqa: ANN401  # matplotlib's
        figure.text(_MARGIN / _WIDE, 1 - top / high, text, va="top", size=size, **more)

    write(report.title[:_LETTERS], _MARGIN, _SIZE, color=DIM)
    write(title, _MARGIN + 9, 11, weight="bold")
    labels = {**dict.fromkeys(report.methods, ""), TRUTH: "truth, or what is expected"}
    keys = [Line2D([], [], color=styles[n].colour, ls=styles[n].dashes) for n in labels]
    corner = _MARGIN / _WIDE, 1 - (_MARGIN + 22) / high
    names = [label or name for name, label in labels.items()]
    figure.legend(keys, names, ncols=7, loc="upper left", bbox_to_anchor=corner)
    top = _MARGIN + _head(report)
    for row in rows:
        foot = top + row.height
        if row.bold:
            write(row.text, foot - 1.5 * _LINE, 8.5, weight="bold")
        elif row.text:
            write(row.text, foot - _LINE, _SIZE, family="monospace")
        for column, chart in enumerate(row.charts):
            axes = _draw(figure, chart, styles, (_MARGIN + column * (WIDTH + _GAP), top + 6))
            axes.set_title(chart.title, pad=chart.margins[1] - 4)
        top = foot
    return figure


def _draw(
    figure: Figure, chart: Chart, styles: Mapping[str, Style], corner: tuple[float, float]
) -> Axes:
    """Draw a chart with its upper left corner at a place, in points."""
    width, height = (72 * inches for inches in figure.get_size_inches())
    left, top = chart.margins
    wide, high = WIDTH - left - RIGHT, chart.height - top - BOTTOM
    bottom = height - corner[1] - chart.height + BOTTOM
    box = ((corner[0] + left) / width, bottom / height, wide / width, high / height)
    axes = figure.add_axes(box, facecolor="none", projection="polar" if chart.polar else None)
    chart.draw(axes, styles)
    return axes
