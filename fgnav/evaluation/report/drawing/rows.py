"""Many short series below each other, one row for each channel, all on one scale."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.drawing.chart import Axis, nested
from fgnav.evaluation.report.drawing.shapes import GRID, Drawing, Shape, Stroke, Text, straight
from fgnav.evaluation.report.drawing.strip import LEFT, LENGTH, WIDE, across, time_ticks

_ROW, _TOP = 26.0, 16.0
_CELLS = 90  # of a row
_SHOWN = 99.0  # percentile of all that a row holds


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Rows:
    """Series of one method, (n, m): a row for each channel by its label; NaN where there is none.

    Attributes
    ----------
    mark, name : str
    t_s : ndarray, shape (n,)
    labels : sequence of str, length m
    value : ndarray, shape (n, m)
    """

    mark: str
    name: str
    t_s: FloatArray
    labels: Sequence[str]
    value: FloatArray


def rows_drawing(title: str, unit: str, of: Sequence[Rows], time: Axis) -> Drawing | None:
    """Return a row of root mean squares in cells of time for each label, all on one scale.

    Methods stand upon each other, the first thickest, the last thinnest. None without a value.
    """
    labels = _labels(of)
    if not labels:
        return None
    edges_s = np.linspace(time.low, time.high, _CELLS + 1)
    x = across((edges_s[:-1] + edges_s[1:]) / 2, time)
    rms = [_rms(one, edges_s) for one in of]
    high = _ROW - 4
    full = float(np.median([np.nanpercentile(values, _SHOWN) for values in rms])) or 1.0
    shapes: list[Shape] = []
    for label, row in labels.items():
        foot = _TOP + _ROW * (row + 1) - 2
        shapes.append(straight(GRID, (LEFT, foot), (LEFT + LENGTH, foot)))
        shapes.append(Text(x=LEFT - 4, y=foot - 6, text=label, anchor="end"))
        for one, values, width in zip(of, rms, nested(len(of), 3.2, 0.9).tolist(), strict=True):
            if label in one.labels:
                y = foot - (values[:, one.labels.index(label)] / full * high).clip(None, high)
                shapes.append(Stroke(mark=one.mark, name=one.name, x=x, y=y, width=width))
    bottom = _TOP + _ROW * len(labels)
    scale = Text(x=WIDE - 8, y=11.0, text=f"row height: {full:.3g} {unit}", anchor="end")
    return Drawing(
        title=title,
        width=WIDE,
        height=bottom + 34,
        shapes=[*shapes, scale, *time_ticks(time, bottom + 14)],
    )


def _labels(of: Sequence[Rows]) -> Mapping[str, int]:
    """Return the rows of labels that have a value, in the order of their names."""
    shown = {
        one.labels[column]
        for one in of
        for column in np.flatnonzero(np.isfinite(one.value).any(axis=0)).tolist()
    }
    return {label: row for row, label in enumerate(sorted(shown))}


def _rms(one: Rows, edges_s: FloatArray) -> FloatArray:
    """Return root mean squares in cells of time, (c, m); NaN in a cell without a value."""
    cells = len(edges_s) - 1
    cell = (np.searchsorted(edges_s, one.t_s, side="right") - 1).clip(0, cells - 1)
    known = np.isfinite(one.value)
    total, count = np.zeros((2, cells, one.value.shape[1]))
    np.add.at(total, cell, np.where(known, one.value, 0.0) ** 2)
    np.add.at(count, cell, known)
    return np.asarray(np.sqrt(total / np.where(count > 0, count, np.nan)))
