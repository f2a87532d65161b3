"""A row of coloured cells along the axis of time."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.evaluation.report.html.drawing.chart import Axis

WIDE, LEFT = 480.0, 60.0
LENGTH = WIDE - LEFT - 8.0


def cells(count: int, most: int) -> IntArray:
    """Return the first epoch of each of at most so many cells."""
    return np.unique(np.linspace(0, count, min(most, count), endpoint=False).astype(np.int64))


def strip(
    kinds: IntArray,
    t_s: FloatArray,
    classes: Sequence[str],
    time: Axis,
    at: tuple[float, float],
) -> str:
    """Return one stroke for each run of cells of one kind.

    Parameters
    ----------
    kinds : ndarray of int, shape (c,)
        Place in ``classes``; negative where nothing is drawn.
    t_s : ndarray, shape (c + 1,)
        Edges of the cells.
    classes : sequence of str
    time : Axis
    at : tuple of float
        Height of the middle, and thickness.
    """
    y, thickness = at
    edges, codes = across(t_s, time).tolist(), kinds.tolist()
    bounds = [0, *(k for k in range(1, len(codes)) if codes[k] != codes[k - 1]), len(codes)]
    return "".join(
        f'<path class="l cell {classes[codes[a]]}" stroke-width="{thickness}" '
        f'd="M{edges[a]:.1f} {y}H{edges[b]:.1f}"/>'
        for a, b in pairwise(bounds)
        if codes[a] >= 0
    )


def time_ticks(time: Axis, y: float) -> str:
    """Return the texts of the axis of time, and below them its name."""
    name = f'<text x="{LEFT + LENGTH / 2}" y="{y + 14}" text-anchor="middle">{time.name}</text>'
    return name + "".join(
        f'<text x="{across(value, time):.1f}" y="{y}" text-anchor="middle">{text}</text>'
        for value, text in time.ticks()
    )


def across(t_s: FloatArray | float, time: Axis) -> FloatArray:
    """Return where along a row times lie."""
    return np.asarray((t_s - time.low) / (time.high - time.low) * LENGTH + LEFT)
