"""Many short series below each other, one row for each channel, all on one scale."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.drawing.chart import Axis, nested
from fgnav.evaluation.report.drawing.shapes import GRID, Drawing, Shape, Stroke, Text, straight
from fgnav.evaluation.report.drawing.strip import LEFT, LENGTH, WIDE, across, time_ticks

_ROW, _TOP = 26.0, 16.0
_CELLS = 90  # of a row
_MOST = 28  # rows of a drawing
_SHOWN = 99.0  # percentile of all that a row holds


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Rows:
    """Series of one method: a row for each channel by its label; NaN where there is none."""

    mark: str
    name: str
    t_s: FloatArray  # (n,)
    labels: Sequence[str]  # length m
    value: FloatArray  # (n, m)


def rows_drawings(title: str, unit: str, of: Sequence[Rows], time: Axis) -> list[Drawing]:
    """Return rows of root mean squares in cells of time, one for each label, all on one scale.

    Methods stand upon each other, the first thickest, the last thinnest. A drawing holds so many
    rows that a sheet of paper holds it; without a value there is none.
    """
    labels = _labels(of)
    if not labels:
        return []
    edges_s = np.linspace(time.low, time.high, _CELLS + 1)
    rms = [_rms(one, edges_s) for one in of]
    full = float(np.median([np.nanpercentile(values, _SHOWN) for values in rms])) or 1.0
    legend = f"row height: {full:.3g} {unit}"
    x = across((edges_s[:-1] + edges_s[1:]) / 2, time)
    drawings = []
    for first in range(0, len(labels), _MOST):
        some = labels[first : first + _MOST]
        shapes = [
            shape for k, label in enumerate(some) for shape in _row(k, label, of, rms, (x, full))
        ]
        bottom = _TOP + _ROW * len(some)
        scale = Text(x=WIDE - 8, y=11.0, text=legend, anchor="end")
        drawings.append(
            Drawing(
                title=title if first == 0 else f"{title}, from {some[0]}",
                width=WIDE,
                height=bottom + 34,
                shapes=[*shapes, scale, *time_ticks(time, bottom + 14)],
            )
        )
    return drawings


def _row(
    k: int,
    label: str,
    of: Sequence[Rows],
    rms: Sequence[FloatArray],
    scale: tuple[FloatArray, float],
) -> list[Shape]:
    """Return the k-th row of a drawing: its name, its foot, and a line of each method."""
    x, full = scale
    foot, high = _TOP + _ROW * (k + 1) - 2, _ROW - 4
    shapes: list[Shape] = [
        straight(GRID, (LEFT, foot), (LEFT + LENGTH, foot)),
        Text(x=LEFT - 4, y=foot - 6, text=label, anchor="end"),
    ]
    for one, values, width in zip(of, rms, nested(len(of), 3.2, 0.9).tolist(), strict=True):
        if label in one.labels:
            y = foot - (values[:, one.labels.index(label)] / full * high).clip(None, high)
            shapes.append(Stroke(mark=one.mark, name=one.name, x=x, y=y, width=width))
    return shapes


def _labels(of: Sequence[Rows]) -> list[str]:
    """Return labels that have a value, in order."""
    return sorted(
        {
            one.labels[column]
            for one in of
            for column in np.flatnonzero(np.isfinite(one.value).any(axis=0)).tolist()
        }
    )


def _rms(one: Rows, edges_s: FloatArray) -> FloatArray:
    """Return root mean squares in cells of time, (c, m); NaN in a cell without a value."""
    cells = len(edges_s) - 1
    cell = (np.searchsorted(edges_s, one.t_s, side="right") - 1).clip(0, cells - 1)
    is_finite = np.isfinite(one.value)
    total, count = np.zeros((2, cells, one.value.shape[1]))
    np.add.at(total, cell, np.where(is_finite, one.value, 0.0) ** 2)
    np.add.at(count, cell, is_finite)
    return np.asarray(np.sqrt(total / np.where(count > 0, count, np.nan)))
