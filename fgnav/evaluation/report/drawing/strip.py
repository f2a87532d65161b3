"""Rows of coloured cells along the axis of time."""

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.evaluation.report.drawing.chart import Axis
from fgnav.evaluation.report.drawing.shapes import Drawing, Shape, Stroke, Text, square

WIDE, LEFT = 480.0, 60.0
LENGTH = WIDE - LEFT - 8.0
_TOP, _ROW = 20.0, 30.0  # of strips with their names above them


def cells(count: int, most: int) -> IntArray:
    """Return the first epoch of each of at most so many cells."""
    return np.unique(np.linspace(0, count, min(most, count), endpoint=False).astype(np.int64))


def strip(
    kinds: IntArray,
    t_s: FloatArray,
    marks: Sequence[str],
    time: Axis,
    at: tuple[float, float],
) -> list[Shape]:
    """Return one stroke for each run of cells of one kind.

    Parameters
    ----------
    kinds : ndarray of int, shape (c,)
        Place in ``marks``; negative where nothing is drawn.
    t_s : ndarray, shape (c + 1,)
        Edges of the cells.
    at : tuple of float
        Height of the middle, and thickness.
    """
    y, thickness = at
    edges, codes = across(t_s, time), kinds.tolist()
    bounds = [0, *(k for k in range(1, len(codes)) if codes[k] != codes[k - 1]), len(codes)]
    return [
        Stroke(mark=marks[codes[a]], x=edges[[a, b]], y=np.full(2, y), width=thickness, butt=True)
        for a, b in pairwise(bounds)
        if codes[a] >= 0
    ]


def named_strips(
    title: str,
    of: Iterable[tuple[str, IntArray, FloatArray]],
    marks: Sequence[str],
    time: Axis,
    above: Sequence[Shape],
) -> Drawing:
    """Return strips below each other, each with its name: kinds and edges as of ``strip``.

    ``above`` them stands what the marks mean.
    """
    shapes, bottom = list(above), _TOP
    for name, kinds, t_s in of:
        shapes.append(Text(x=LEFT, y=bottom + 10, text=name, anchor="start"))
        shapes += strip(kinds, t_s, marks, time, (bottom + 20, 12.0))
        bottom += _ROW
    shapes += time_ticks(time, bottom + 14)
    return Drawing(title=title, width=WIDE, height=bottom + 34, shapes=shapes)


def time_ticks(time: Axis, y: float) -> list[Shape]:
    """Return the texts of the axis of time, and below them its name."""
    ticks = time.ticks()
    places = across(np.array([value for value, _ in ticks]), time).tolist()
    return [
        Text(x=LEFT + LENGTH / 2, y=y + 14, text=time.name),
        *(Text(x=at, y=y, text=text) for at, (_, text) in zip(places, ticks, strict=True)),
    ]


def key(kinds: Sequence[tuple[str, str]], top: float, step: float) -> list[Shape]:
    """Return a row of squares, one for each mark, with what it means beside it."""
    return [
        shape
        for k, (mark, text) in enumerate(kinds)
        for shape in (
            square(mark, LEFT + k * step, top),
            Text(x=LEFT + k * step + 14, y=top + 9, text=text, anchor="start"),
        )
    ]


def across(t_s: FloatArray | float, time: Axis) -> FloatArray:
    """Return where along a row times lie."""
    return np.asarray((t_s - time.low) / (time.high - time.low) * LENGTH + LEFT)
