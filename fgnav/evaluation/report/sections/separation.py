"""A filter against smoothers of the same flight, and how far what came later moved it."""

from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.evaluation.comparison import Method
from fgnav.evaluation.internal_consistency.filter_smoother import Separation, separations
from fgnav.evaluation.report.charts import Chart, Line, Span
from fgnav.evaluation.report.parts import Blocks, folded, grid, number, paragraph, table

_FILTER, _SMOOTHERS = "forward", ("smoother", "batch")
_SIGMAS = 3.0
_SHOWN = 8.0  # sigma: what leaves the axis is in the table
_UNITS = {
    "attitude": ("deg", 180 / np.pi, ("about x", "about y", "about z")),
    "position": ("m", 1.0, ("north", "east", "down")),
    "velocity": ("m/s", 1.0, ("north", "east", "down")),
}


def separation_blocks(methods: Sequence[Method], time: Span) -> Blocks:
    """Return figures and a table of a filter less smoothers; a sentence where one is missing."""
    pairs = list(_pairs(methods))
    if not pairs:
        return paragraph(
            "Not compared: this needs the methods forward and smoother (or batch), both with their "
            "covariances. Add them to --method."
        )
    rows, charts = [], []
    for quantity, (unit, scale, axes) in _UNITS.items():
        of = [(name, apart) for name, apart in pairs if apart.quantity == quantity]
        for k, axis in enumerate(axes if of else ()):
            lines = [
                Line(of=name, name=f"forward less {name}", x=apart.t_s, y=apart.ratio[:, k])
                for name, apart in of
            ]
            charts.append(
                Chart(
                    title=f"{quantity} {axis}: forward less smoothed, over its σ",
                    y="difference / σ",
                    lines=lines,
                    x_limits=time,
                    y_limits=(-_SHOWN, _SHOWN),
                    rules={_SIGMAS: "3σ", -_SIGMAS: "-3σ"},
                )
            )
            rows += [[n, quantity, axis, *_cells(apart, k, unit, scale)] for n, apart in of]
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


def _pairs(methods: Sequence[Method]) -> Iterator[tuple[str, Separation]]:
    """Yield the separations of each smoother from the filter of the same measurements."""
    for smoother in methods:
        base, _, without = smoother.name.partition(" ")
        name = " ".join([_FILTER, without]).strip()
        forward = next((m.estimate for m in methods if m.name == name), None)
        if base in _SMOOTHERS and forward is not None and smoother.estimate is not None:
            for apart in separations(forward, smoother.estimate):
                if np.isfinite(apart.ratio).any():
                    yield smoother.name, apart


def _cells(apart: Separation, k: int, unit: str, scale: float) -> list[str]:
    ratio = apart.ratio[:, k]
    finite = ratio[np.isfinite(ratio)]
    rms = scale * float(np.sqrt(np.nanmean(apart.difference[:, k] ** 2)))
    inside = f"{100 * float((np.abs(finite) < _SIGMAS).mean()):.1f} %" if len(finite) else "–"
    normalised = number(float(np.sqrt((finite**2).mean())) if len(finite) else None)
    return [f"{number(rms)} {unit}", normalised, inside, str(len(ratio) - len(finite))]
