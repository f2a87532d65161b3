"""A diagram as SVG inside the page: its colours are those of the page, light or dark.

Lines carry a class, ``m0`` for the first method, that gives them their colour everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.lines import drawable, every

WIDTH, HEIGHT = 480.0, 210.0
BINS = 480  # of a long line: one for each unit of width
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 8.0, 8.0, 34.0
_LINE = 12.0  # of text
_LAST = 16.0  # a tick nearer to the right edge has its text to the left
_TICKS = 5  # about so many on an axis
_SAMPLE = 960  # dots of a series


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Line:
    """A series: who it belongs to, its points, and how they are drawn.

    ``as_is`` is for a curve that is no function of x: it is neither thinned nor broken at gaps.
    """

    mark: str
    name: str
    x: FloatArray
    y: FloatArray
    dots: bool = False
    as_is: bool = False
    width: float = 1.2


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Band:
    """What lies between two series, shaded."""

    mark: str
    name: str
    x: FloatArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """Range and name of an axis; ``log`` for one in powers of ten."""

    name: str
    low: float
    high: float
    log: bool = False

    def ticks(self) -> list[tuple[float, str]]:
        """Return values and their texts: about five, at round numbers."""
        if self.log:
            powers = range(int(np.ceil(self.low)), int(np.floor(self.high)) + 1)
            return [(float(k), f"{10.0**k:g}") for k in powers]
        span = self.high - self.low
        power = 10.0 ** np.floor(np.log10(span / _TICKS))
        step = power * next(m for m in (1, 2, 5, 10) if m * power * _TICKS >= span)
        first, last = np.ceil(self.low / step), np.floor(self.high / step)
        return [(float(v), f"{v:g}") for v in np.arange(first, last + 1) * step + 0.0]  # no -0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Chart:
    """A diagram.

    Attributes
    ----------
    title : str
    x, y : Axis
    lines : sequence of Line
    bands : sequence of Band
    rules : dict
        Horizontal lines: where, and what they mean.
    height : float
    """

    title: str
    x: Axis
    y: Axis
    lines: Sequence[Line] = ()
    bands: Sequence[Band] = ()
    rules: dict[float, str] = field(default_factory=dict)
    height: float = HEIGHT

    def __str__(self) -> str:
        """Return the figure."""
        wide, high = WIDTH - _LEFT - _RIGHT, self.height - _TOP - _BOTTOM
        inside = [self._band(band, wide, high) for band in self.bands]
        inside += [self._rule(at, text, wide, high) for at, text in self.rules.items()]
        inside += [self._line(line, wide, high) for line in self.lines]
        return figure(
            self.title,
            self._axes(wide, high)
            # An inner drawing cuts off what leaves the axes.
            + f'<svg x="{_LEFT}" y="{_TOP}" width="{wide}" height="{high}">{"".join(inside)}</svg>',
            WIDTH,
            self.height,
        )

    def _axes(self, wide: float, high: float) -> str:
        """Return grid, ticks and names of the axes."""
        parts = []
        for value, text in self.x.ticks():
            at = _LEFT + _scaled(value, self.x, wide)
            parts.append(f'<path class="g" d="M{at:.1f} {_TOP}v{high}"/>')
            anchor = "end" if at > WIDTH - _LAST else "middle"
            parts.append(
                f'<text x="{at:.1f}" y="{_TOP + high + 13}" text-anchor="{anchor}">{text}</text>'
            )
        for value, text in self.y.ticks():
            at = _TOP + high - _scaled(value, self.y, high)
            parts.append(f'<path class="g" d="M{_LEFT} {at:.1f}h{wide}"/>')
            parts.append(
                f'<text x="{_LEFT - 5}" y="{at + 3.5:.1f}" text-anchor="end">{text}</text>'
            )
        middle = _TOP + high / 2
        parts.append(
            f'<text x="{_LEFT + wide / 2}" y="{self.height - 6}" text-anchor="middle">'
            f"{escape(self.x.name)}</text>"
            f'<text transform="translate(10 {middle}) rotate(-90)" text-anchor="middle">'
            f"{escape(self.y.name)}</text>"
        )
        return "".join(parts)

    def _line(self, line: Line, wide: float, high: float) -> str:
        if line.dots:
            rows = every(len(line.x), _SAMPLE)
            x, y = line.x[rows], line.y[rows]
            shape, width = dots(_scaled(x, self.x, wide), high - _scaled(y, self.y, high)), 2.2
        else:
            x, y = (line.x, line.y) if line.as_is else drawable(line.x, line.y, BINS)
            shape = path(_scaled(x, self.x, wide), high - _scaled(y, self.y, high))
            width = line.width
        return (
            f'<path class="l {line.mark}" stroke-width="{width}" d="{shape}">'
            f"<title>{escape(line.name)}</title></path>"
        )

    def _band(self, band: Band, wide: float, high: float) -> str:
        """Return the shaded area, a piece for each run of epochs without a gap."""
        rows = every(len(band.x), BINS)
        x = _scaled(band.x[rows], self.x, wide)
        low = high - _scaled(band.low[rows], self.y, high)
        top = high - _scaled(band.high[rows], self.y, high)
        steps = np.diff(x)
        gap = steps > 3 * np.median(steps) if len(steps) else np.zeros(0, dtype=np.bool_)
        known = np.isfinite(low) & np.isfinite(top)
        parts = []
        for run in np.split(np.arange(len(x)), np.flatnonzero(gap) + 1):
            own = run[known[run]]
            if len(own) > 1:
                around = np.concatenate([x[own], x[own][::-1]])
                parts.append(path(around, np.concatenate([top[own], low[own][::-1]])) + "Z")
        return (
            f'<path class="b {band.mark}" d="{"".join(parts)}">'
            f"<title>{escape(band.name)}</title></path>"
        )

    def _rule(self, value: float, text: str, wide: float, high: float) -> str:
        at = float(high - _scaled(value, self.y, high))
        foot = at - 3 if at > _LINE else at + _LINE
        return (
            f'<path class="r" d="M0 {at:.1f}h{wide}"/>'
            f'<text x="{wide - 3}" y="{foot:.1f}" text-anchor="end">{escape(text)}</text>'
        )


def figure(title: str, content: str, width: float, height: float) -> str:
    """Return a drawing with its title, also for those who do not see it."""
    return (
        f'<figure><figcaption>{escape(title)}</figcaption><svg viewBox="0 0 {width:g} {height:g}" '
        f'role="img" aria-label="{escape(title)}">{content}</svg></figure>'
    )


def path(x: FloatArray, y: FloatArray) -> str:
    """Return the path through points, with a new start after each NaN."""
    known = np.isfinite(x) & np.isfinite(y)
    is_start = known & ~np.concatenate([[False], known[:-1]])
    # Far outside the axes a coordinate is cut: browsers draw in single precision.
    places = np.stack([x, y], axis=1)[known].clip(-1e4, 1e4).tolist()
    letters = np.where(is_start, "M", "L")[known].tolist()
    return "".join(
        f"{letter}{a:.1f} {b:.1f}" for letter, (a, b) in zip(letters, places, strict=True)
    )


def dots(x: FloatArray, y: FloatArray) -> str:
    """Return the path of round dots at points."""
    known = np.isfinite(x) & np.isfinite(y) & (np.abs(y) < 1e4)
    places = np.stack([x, y], axis=1)[known].tolist()
    return "".join(f"M{a:.1f} {b:.1f}h0" for a, b in places)


def nested(count: int, thickest: float = 3.0, thinnest: float = 1.0) -> FloatArray:
    """Return widths of lines that may coincide, from the one behind to the one before: all show."""
    return np.linspace(thickest, thinnest, count) if count > 1 else np.full(count, thinnest)


def spanning(name: str, series: Sequence[FloatArray], margin: float = 0.04) -> Axis:
    """Return an axis that holds all finite values of series, with a margin."""
    known = [values[np.isfinite(values)] for values in series]
    known = [values for values in known if len(values)]
    low = min((float(values.min()) for values in known), default=0.0)
    high = max((float(values.max()) for values in known), default=1.0)
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-3):
        low, high = low - 0.5, high + 0.5
    room = margin * (high - low)
    return Axis(name=name, low=low - room, high=high + room)


def on_one_scale(x: Axis, y: Axis, height: float) -> tuple[Axis, Axis]:
    """Return both axes widened so that a unit is as long on either, in a diagram of that height."""
    wide, high = WIDTH - _LEFT - _RIGHT, height - _TOP - _BOTTOM
    scale = max((x.high - x.low) / wide, (y.high - y.low) / high)
    return _widened(x, scale * wide), _widened(y, scale * high)


def _widened(axis: Axis, span: float) -> Axis:
    middle = (axis.low + axis.high) / 2
    return Axis(name=axis.name, low=middle - span / 2, high=middle + span / 2)


def _scaled(value: FloatArray | float, axis: Axis, length: float) -> FloatArray:
    """Return where on an axis values lie, from 0 to its length."""
    return np.asarray((np.asarray(value) - axis.low) / (axis.high - axis.low) * length)
