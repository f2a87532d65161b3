"""Figures of a report, drawn by matplotlib, and the colours of what they show.

Lengths are in points of a figure as it is printed; a page on a screen enlarges it.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH, HEIGHT = 250.0, 109.0
RIGHT, BOTTOM = 9.0, 23.0  # room beside and below the axes
INK, DIM, LINES = "#1a1a1a", "#5a5a5a", "#e2e2e2"
# Okabe and Ito's set, told apart by the colour-blind; black last, and in place of its yellow, which
# white paper swallows, the red that is furthest from the others in CIELAB to any kind of eye.
COLOURS = ("#e69f00", "#56b4e9", "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e1004b", "#000000")
METHODS = ("closed-form", "maximum-likelihood", "smoother", "forward", "batch", "rtk")
CN0_COLOURS = ("#3a5a9b", "#5d6f96", "#7f8287", "#a39a73", "#c8b54f", "#e8d12c")
GOOD, FAIR, POOR, WRONG = "#c9d3da", "#8a97a0", "#46515a", "#c00020"
TRUTH, FIXES, INK_LINE = "truth", "fixes", "ink"
TIME = "time, s"
Span = tuple[float, float]  # of an axis
_GAP = 3.0  # usual intervals; a line is broken across a longer step
_MOST = 960  # dots of a series, points of a band
_FEW, _LARGE, _SMALL = 60, 2.6, 1.3  # so few dots are as large as that, more are small
_THICK, _THIN = 1.8, 0.7  # lines that may coincide, from the one behind to the one before: all show
_LETTER, _ROW = 3.7, 7.0  # width of a letter; height of a row


class Style(NamedTuple):
    """Colour and dashes of a line; ``group`` names those of a method, which a page can hide."""

    colour: str
    dashes: Literal["-", "--"] = "-"
    group: str | None = None


def styles_of(methods: Sequence[str]) -> dict[str, Style]:
    """Return the style of each method, and of whatever else has lines.

    The library's methods have colours of their own, the same in every report; others take those
    that are left, and where none is, dashes.
    """
    free = [Style(colour) for colour in COLOURS] + [Style(colour, "--") for colour in COLOURS]
    fixed = {name: free[METHODS.index(name)] for name in methods if name in METHODS}
    left = [curve for curve in free if curve not in fixed.values()]
    others = [name for name in methods if name not in fixed]
    fixed |= {name: left[k % len(left)] for k, name in enumerate(others)}
    styles = {TRUTH: Style(INK, "--"), INK_LINE: Style(INK), FIXES: Style(FAIR)}
    return styles | {name: fixed[name]._replace(group=f"m{k}") for k, name in enumerate(methods)}


@dataclass(frozen=True, eq=False, slots=True)
class Line:
    """A series in the style of a method, or of what else ``styles_of`` has.

    ``half``, (n,), is half the width of a band around it, or around zero.
    """

    style: str
    x: FloatArray
    y: FloatArray
    name: str = ""
    dots: bool = False
    half: FloatArray | None = None
    is_around_zero: bool = False

    @property
    def roughness(self) -> float:
        """Median size of steps, of which the largest are drawn behind."""
        steps = np.abs(np.diff(self.y))
        return float(np.median(steps[np.isfinite(steps)])) if np.isfinite(steps).any() else 0.0


Series = Iterator[tuple[str, str, Line]]  # title, name of the axis, and a line of it


class Cells(NamedTuple):
    """Rows of coloured cells between edges, (cells + 1,), on the axis of time."""

    edges_s: FloatArray
    kinds: IntArray  # (rows, cells), places in ``colours``; negative where nothing is drawn
    colours: Mapping[str, str]


@dataclass(frozen=True, eq=False, slots=True)
class Chart:
    """A figure of lines and bands, or of cells, between two axes, which ``x`` and ``y`` name.

    ``rules`` are horizontal lines and their meaning, ``rows`` names of rows in place of numbers,
    ``notes`` texts at places, ``log`` holds the axes in powers of ten.
    """

    title: str
    y: str = ""
    lines: Sequence[Line] = ()
    x: str = TIME
    cells: Cells | None = None
    x_limits: Span | None = None
    y_limits: Span | None = None
    log: str = ""
    rules: Mapping[float, str] = field(default_factory=dict)
    rows: Sequence[str] = ()
    notes: Sequence[tuple[float, float, str]] = ()
    equal: bool = False
    polar: bool = False
    height: float = HEIGHT

    @property
    def margins(self) -> tuple[float, float]:
        """Room at the left of the axes, for names, and above them."""
        left = _LETTER * max(map(len, self.rows)) + 8 if self.rows else 34.0
        return left, 18.0 if self.polar else 14.0 if self.cells else 7.0

    @property
    def description(self) -> str:
        """Content of the figure in words."""
        names = dict.fromkeys([*(line.name or line.style for line in self.lines), *self.rows])
        return f"{self.title}: {self.y} by {self.x}; {', '.join(names)}"

    def draw(self, axes: "Axes", styles: Mapping[str, Style]) -> None:
        """Draw: truth over the methods, smooth lines over rough ones."""
        if self.cells is not None:
            _draw_cells(axes, self.cells)
        behind = sorted(
            self.lines, key=lambda line: (line.style == TRUTH, not line.dots, -line.roughness)
        )
        for line, width in zip(behind, np.linspace(_THICK, _THIN, len(behind)), strict=True):
            is_thin = line.style == TRUTH or len(behind) == 1
            thickness = _THIN if is_thin else float(width)
            _draw_line(axes, line, styles[line.style], thickness, in_time=self.x == TIME)
        for value, text in self.rules.items():
            axes.axhline(value, color=DIM, linestyle="--", linewidth=0.5)
            pale = {"facecolor": "#ffffff", "alpha": 0.7, "linewidth": 0, "pad": 0.3}
            anchor, of = (1, value), axes.get_yaxis_transform()
            style: dict[str, Any] = {"textcoords": "offset points", "ha": "right", "bbox": pale}
            axes.annotate(text, anchor, (-2, 1.5), of, color=DIM, **style)
        for x, y, text in self.notes:
            axes.annotate(text, (x, y), (2, 2), textcoords="offset points", color=DIM, size=5.5)
        self._scale(axes)

    def _scale(self, axes: "Axes") -> None:
        """Set names, limits and ticks of the axes."""
        if self.polar:
            axes.set(theta_zero_location="N", theta_direction=-1, ylim=(0, 90))
            axes.set_xticks(np.radians([0, 90, 180, 270]), ["N", "E", "S", "W"])
            axes.set_yticks([30, 60], ["60°", "30°"])
            return
        for axis, limits in (("x", self.x_limits), ("y", self.y_limits)):
            if axis in self.log:
                values = [getattr(line, axis) for line in self.lines]
                _set_powers_of_ten(axes, axis, [np.array(limits)] if limits else values)
            elif limits is not None:
                getattr(axes, f"set_{axis}lim")(limits)
        axes.set(xlabel=self.x, ylabel=self.y)
        if self.rows:
            axes.set_yticks(range(len(self.rows)), self.rows)
            axes.set_ylim(len(self.rows) - 0.5, -0.5)
        if self.equal:
            axes.set_aspect("equal", adjustable="datalim")
        left = self.margins[0]
        axes.yaxis.set_label_coords((8.5 - left) / (WIDTH - left - RIGHT), 0.5)


def time_charts(
    series: Iterable[tuple[str, str, Line]],
    time: Span,
    limits: Callable[[Sequence[Line]], Span | None] = lambda _: None,
    **more: Any,  # noqa: ANN401  # of ``Chart``
) -> list[Chart]:
    """Return a chart of each title and name of its axis, with all lines that hold a number."""
    lines: dict[tuple[str, str], list[Line]] = {}
    for title, y, line in series:
        if np.isfinite(line.y).any():
            lines.setdefault((title, y), []).append(line)
    return [
        Chart(*names, of, x_limits=time, y_limits=limits(of), **more) for names, of in lines.items()
    ]


def cells_chart(
    title: str,
    rows: Mapping[str, IntArray],
    edges_s: FloatArray,
    colours: Mapping[str, str],
    time: Span,
) -> Chart:
    """Return rows of coloured cells along the axis of time, by their names."""
    cells = Cells(edges_s, np.array(list(rows.values())), colours)
    height = 39.0 + _ROW * max(len(rows), 2)
    return Chart(title, rows=list(rows), cells=cells, x_limits=time, height=height)


def cells_of(t_s: FloatArray, most: int) -> tuple[IntArray, FloatArray]:
    """Return the first epoch of each of at most so many cells, (c,), and their edges, (c + 1,)."""
    count = len(t_s)
    starts = np.unique(np.linspace(0, count, min(most, count), endpoint=False).astype(np.int64))
    step_s = (t_s[-1] - t_s[0]) / max(count - 1, 1) or 1.0
    return starts, np.append(t_s[starts], t_s[-1] + step_s)


def unjumped_deg(angle_deg: FloatArray) -> FloatArray:
    """Return an angle with NaN where it changes by more than a quarter turn: it wraps or flips."""
    out = angle_deg.copy()
    out[1:][np.abs(np.diff(angle_deg)) > 90] = np.nan
    return out


def is_rough(values: FloatArray) -> bool:
    """Return True if (n, 3) values change from epoch to epoch about as much as white noise."""
    finite = values[:, np.isfinite(values).all(axis=0)]
    if len(finite) < 3 or not finite.any():
        return False
    size = np.maximum(finite.std(axis=0), np.finfo(float).tiny)
    return bool(np.median(np.diff(finite, axis=0).std(axis=0) / size) > 1.2)  # white noise has 1.41


def around_zero(lines: Sequence[Line]) -> Span:
    """Return limits that hold bands, and most of what the middle one of several lines does.

    One bad method would flatten all others; its RMS is in a table, so its line may leave the axis.
    """
    halves = [_reach([line.y for line in lines])]
    halves += [_reach([line.half]) for line in lines if line.half is not None]
    return -max(halves), max(halves)


def _reach(series: Sequence[FloatArray]) -> float:
    sizes = [np.abs(y[np.isfinite(y)]) for y in series]
    reach = [float(np.percentile(size, 99.5)) for size in sizes if size.size]
    return 1.5 * float(np.median(reach)) if reach and np.median(reach) > 0 else 1.0


def spanning(lines: Sequence[Line]) -> Span | None:
    """Return limits that hold lines, and bands of the later half: they begin wide."""
    values = [line.y for line in lines]
    for line in lines:
        if line.half is not None:
            later = slice(len(line.y) // 2, None)
            values += [line.y[later] + side * line.half[later] for side in (-1, 1)]
    finite = np.concatenate([v[np.isfinite(v)] for v in values])
    margin = 0.04 * np.ptp(finite)
    return (float(finite.min() - margin), float(finite.max() + margin)) if margin > 0 else None


def _draw_line(axes: "Axes", line: Line, style: Style, width: float, *, in_time: bool) -> None:
    """Draw a band, and a line, both broken at gaps of time, or a fair sample of dots."""
    same: dict[str, Any] = {"color": style.colour, "gid": style.group}
    sample = slice(None, None, -(-len(line.x) // _MOST) or 1)
    steps = np.diff(line.x)
    usual = np.median(steps[steps > 0]) if in_time and (steps > 0).any() else np.inf
    gaps = np.flatnonzero(steps > _GAP * usual) + 1
    x, y = np.insert(line.x, gaps, line.x[gaps]), np.insert(line.y, gaps, np.nan)
    if line.half is not None:
        middle, half = 0 * y if line.is_around_zero else y, np.insert(line.half, gaps, np.nan)
        ends = (middle - half)[sample], (middle + half)[sample]
        axes.fill_between(x[sample], *ends, alpha=0.2, linewidth=0.3, **same)
    if line.dots:
        size = _LARGE if len(x) <= _FEW else _SMALL
        axes.plot(x[sample], y[sample], "o", markersize=size, markeredgewidth=0, **same)
    else:
        axes.plot(x, y, linewidth=width, linestyle=style.dashes, **same)


def _draw_cells(axes: "Axes", cells: Cells) -> None:
    """Draw cells, and above them what their colours mean."""
    from matplotlib.colors import ListedColormap  # noqa: PLC0415  # lazy
    from matplotlib.patches import Patch  # noqa: PLC0415

    kinds = np.ma.masked_less(cells.kinds, 0)
    rows, most = np.arange(len(kinds) + 1) - 0.5, len(cells.colours) - 0.5
    colours = ListedColormap(list(cells.colours.values()))
    shown = axes.pcolormesh(cells.edges_s, rows, kinds, cmap=colours, vmin=-0.5, vmax=most)
    shown.set_rasterized(True)
    axes.hlines(rows, cells.edges_s[0], cells.edges_s[-1], color="#ffffff", linewidth=0.8)
    axes.grid(visible=False)
    axes.legend(
        [Patch(color=colour) for colour in cells.colours.values()],
        list(cells.colours),
        loc="lower right",
        bbox_to_anchor=(1.0, 1.0),
        ncols=len(cells.colours),
        columnspacing=0.8,
        handlelength=0.8,
        handletextpad=0.3,
    )


def _set_powers_of_ten(axes: "Axes", axis: str, series: Sequence[FloatArray]) -> None:
    """Have an axis hold whole powers of ten around all positive values."""
    from matplotlib.ticker import NullLocator  # noqa: PLC0415  # lazy

    logs = [np.log10(values[np.isfinite(values) & (values > 0)]) for values in series]
    logs = [values for values in logs if len(values)] or [np.zeros(1)]
    low, high = (np.floor(min(v.min() for v in logs)), np.ceil(max(v.max() for v in logs)))
    getattr(axes, f"set_{axis}scale")("log")
    getattr(axes, f"set_{axis}lim")(10.0**low, 10.0 ** max(high, low + 1))
    scale = getattr(axes, f"{axis}axis")
    scale.set_major_formatter("{x:g}")
    scale.set_minor_locator(NullLocator())
