"""A diagram: lines, bands and rules between two axes.

Lines carry a mark, ``m0`` for the first method, that gives them their colour everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.drawing.shapes import (
    GRID,
    RULE,
    Area,
    Dots,
    Drawing,
    Frame,
    Shape,
    Stroke,
    Text,
    straight,
    within_reach,
)
from fgnav.evaluation.report.lines import drawable, every

WIDTH, HEIGHT = 480.0, 210.0
BINS = 480  # of a long line: one for each unit of width
_LEFT, _RIGHT, _TOP, _BOTTOM = 52.0, 8.0, 8.0, 34.0
_LINE = 12.0  # of text
_LAST = 16.0  # a tick nearer to the right edge has its text to the left
_TICKS = 5  # about so many on an axis
_SAMPLE = 960  # dots of a series
_FEW, _BIG, _SMALL = 60, 5.0, 2.2  # so few dots are as big as that, more are small


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
    """A diagram."""

    title: str
    x: Axis
    y: Axis
    lines: Sequence[Line] = ()
    bands: Sequence[Band] = ()
    # horizontal lines: where, and what they mean
    rules: dict[float, str] = field(default_factory=dict)
    height: float = HEIGHT

    def drawing(self) -> Drawing:
        """Return the figure."""
        wide, high = WIDTH - _LEFT - _RIGHT, self.height - _TOP - _BOTTOM
        inside: list[Shape] = [self._band(band, wide, high) for band in self.bands]
        places = [float(high - _scaled(value, self.y, high)) for value in self.rules]
        inside += [straight(RULE, (0.0, at), (wide, at)) for at in places]
        inside += [self._line(line, wide, high) for line in self.lines]
        inside += [
            Text(x=wide - 3, y=at - 3 if at > _LINE else at + _LINE, text=text, anchor="end")
            for at, text in zip(places, self.rules.values(), strict=True)
            if text
        ]
        frame = Frame(left=_LEFT, top=_TOP, width=wide, height=high, shapes=inside)
        return Drawing(
            title=self.title,
            width=WIDTH,
            height=self.height,
            shapes=[*self._axes(wide, high), frame],
        )

    def _axes(self, wide: float, high: float) -> list[Shape]:
        """Return grid, ticks and names of the axes."""
        shapes: list[Shape] = []
        foot = _TOP + high
        for value, text in self.x.ticks():
            at = _LEFT + float(_scaled(value, self.x, wide))
            shapes.append(straight(GRID, (at, _TOP), (at, foot)))
            is_last = at > WIDTH - _LAST
            anchor: Literal["end", "middle"] = "end" if is_last else "middle"
            shapes.append(Text(x=at, y=foot + 13, text=text, anchor=anchor))
        for value, text in self.y.ticks():
            at = foot - float(_scaled(value, self.y, high))
            shapes.append(straight(GRID, (_LEFT, at), (_LEFT + wide, at)))
            shapes.append(Text(x=_LEFT - 5, y=at + 3.5, text=text, anchor="end"))
        return [
            *shapes,
            Text(x=_LEFT + wide / 2, y=self.height - 6, text=self.x.name),
            Text(x=10.0, y=_TOP + high / 2, text=self.y.name, upright=True),
        ]

    def _line(self, line: Line, wide: float, high: float) -> Shape:
        if line.dots:
            rows = every(len(line.x), _SAMPLE)
            x = _scaled(line.x[rows], self.x, wide)
            y = high - _scaled(line.y[rows], self.y, high)
            size = _BIG if len(x) <= _FEW else _SMALL
            return Dots(mark=line.mark, name=line.name, x=x, y=within_reach(y), size=size)
        x, y = (line.x, line.y) if line.as_is else drawable(line.x, line.y, BINS)
        return Stroke(
            mark=line.mark,
            name=line.name,
            x=within_reach(_scaled(x, self.x, wide)),
            y=within_reach(high - _scaled(y, self.y, high)),
            width=line.width,
        )

    def _band(self, band: Band, wide: float, high: float) -> Area:
        """Return the shaded area, a piece for each run of epochs without a gap."""
        rows = every(len(band.x), BINS)
        x = _scaled(band.x[rows], self.x, wide)
        low = within_reach(high - _scaled(band.low[rows], self.y, high))
        top = within_reach(high - _scaled(band.high[rows], self.y, high))
        steps = np.diff(x)
        gap = steps > 3 * np.median(steps) if len(steps) else np.zeros(0, dtype=np.bool_)
        finite = np.isfinite(low) & np.isfinite(top)
        outlines = []
        for run in np.split(np.arange(len(x)), np.flatnonzero(gap) + 1):
            own = run[finite[run]]
            if len(own) > 1:
                around = np.concatenate([x[own], x[own][::-1]])
                outlines.append((around, np.concatenate([top[own], low[own][::-1]])))
        return Area(mark=band.mark, name=band.name, outlines=outlines)


def nested(count: int, thickest: float = 3.6, thinnest: float = 1.3) -> FloatArray:
    """Return widths of lines that may coincide, from the one behind to the one before: all show."""
    return np.linspace(thickest, thinnest, count) if count > 1 else np.full(count, thinnest)


def spanning(name: str, series: Sequence[FloatArray], margin: float = 0.04) -> Axis:
    """Return an axis that holds all finite values of series, with a margin."""
    finite = [values[np.isfinite(values)] for values in series]
    finite = [values for values in finite if len(values)]
    low = min((float(values.min()) for values in finite), default=0.0)
    high = max((float(values.max()) for values in finite), default=1.0)
    if high - low <= 1e-9 * max(abs(low), abs(high), 1e-3):
        low, high = low - 0.5, high + 0.5
    room = margin * (high - low)
    return Axis(name=name, low=low - room, high=high + room)


def log10(values: FloatArray) -> FloatArray:
    """Return where values stand on an axis in powers of ten; NaN of none above zero."""
    return np.asarray(np.log10(np.where(values > 0, values, np.nan)))


def decades(name: str, series: Sequence[FloatArray], margin: float = 0.04) -> Axis:
    """Return an axis in whole powers of ten that holds series of ``log10``, with a margin."""
    y = spanning(name, series, margin)
    return Axis(name=name, low=np.floor(y.low), high=np.ceil(y.high), log=True)


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
