"""A filter against smoothers of the same flight, and how far what came later moved it."""

from collections.abc import Sequence

import numpy as np

from fgnav.evaluation.comparison import Method
from fgnav.evaluation.internal_consistency.filter_smoother import Separation, separations
from fgnav.evaluation.report.blocks import Blocks, folded, grid, number, paragraph, table
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, nested

_FILTER, _SMOOTHERS = "forward", ("smoother", "batch")
_SIGMAS = 3.0
_SHOWN = 8.0  # sigma: what leaves the axis is in the table
_UNITS = {
    "attitude": ("deg", 180 / np.pi, ("about x", "about y", "about z")),
    "position": ("m", 1.0, ("north", "east", "down")),
    "velocity": ("m/s", 1.0, ("north", "east", "down")),
}


def separation_parts(methods: Sequence[Method], marks: dict[str, str], time: Axis) -> Blocks:
    """Return diagrams and a table of a filter less smoothers; a sentence where one is missing."""
    of = [
        (method, apart)
        for method in methods
        for apart in _apart(methods, method)
        if np.isfinite(apart.ratio).any()
    ]
    if not of:
        return paragraph(
            "Not compared: this needs the methods forward and smoother (or batch), both with their "
            "covariances. Add them to --method."
        )
    rows, charts = [], []
    for quantity, (unit, scale, axes) in _UNITS.items():
        pairs = [(method, apart) for method, apart in of if apart.quantity == quantity]
        for k, axis in enumerate(axes):
            lines = [
                Line(
                    mark=marks[method.name],
                    name=f"forward less {method.name}",
                    x=apart.t_s,
                    y=apart.ratio[:, k],
                    width=width,
                )
                for (method, apart), width in zip(pairs, nested(len(pairs)).tolist(), strict=True)
            ]
            charts += [_chart(f"{quantity} {axis}", lines, time).drawing()] if lines else []
            rows += [_row(method, apart, k, (unit, scale, axis)) for method, apart in pairs]
    heads = ["forward less", "state", "axis", "RMS", "RMS / σ", "within 3σ", "no σ"]
    caption = "99.7 % are expected within 3σ; no σ: epochs of which the smoother states more"
    return (
        paragraph(
            "What later measurements changed: the estimate by the past alone less the smoothed "
            "one, over the root of the difference of their covariances. Two honest passes stay "
            "within 3. No method here runs backward in time: instead of the separation of forward "
            "and backward passes stands this one, of the same information."
        )
        + grid(charts)
        + folded("filter against smoother in figures", table(heads, rows, caption))
    )


def _apart(methods: Sequence[Method], smoother: Method) -> list[Separation]:
    """Return the separations of a smoother from the filter of the same measurements."""
    base, _, without = smoother.name.partition(" ")
    name = " ".join([_FILTER, without]).strip()
    forward = next((m.estimate for m in methods if m.name == name), None)
    if base not in _SMOOTHERS or forward is None or smoother.estimate is None:
        return []
    return separations(forward, smoother.estimate)


def _chart(title: str, lines: list[Line], time: Axis) -> Chart:
    return Chart(
        title=f"{title}: forward less smoothed, over its σ",
        x=time,
        y=Axis(name="sigma", low=-_SHOWN, high=_SHOWN),
        lines=lines,
        rules={_SIGMAS: "3σ", -_SIGMAS: "-3σ"},
    )


def _row(method: Method, apart: Separation, k: int, of: tuple[str, float, str]) -> list[str]:
    unit, scale, axis = of
    ratio = apart.ratio[:, k]
    finite = ratio[np.isfinite(ratio)]
    difference = scale * apart.difference[:, k]
    inside = f"{100 * float((np.abs(finite) < _SIGMAS).mean()):.1f} %" if len(finite) else "–"
    return [
        method.name,
        apart.quantity,
        axis,
        f"{number(float(np.sqrt(np.nanmean(difference**2))))} {unit}",
        number(float(np.sqrt((finite**2).mean())) if len(finite) else None),
        inside,
        str(len(ratio) - len(finite)),
    ]
