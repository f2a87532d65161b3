"""A filter against smoothers of the same flight, and how far what came later moved it."""

from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.evaluation.comparison import Method
from fgnav.evaluation.internal_consistency.filter_smoother import Separation, separations
from fgnav.evaluation.report.charts import Line, Span, time_charts
from fgnav.evaluation.report.parts import Blocks, folded, grid, number, paragraph, table
from fgnav.evaluation.report.sections.errors import NORTH_EAST_DOWN

_FILTER, _SMOOTHERS = "forward", ("smoother", "batch")
_SIGMAS = 3.0
_SHOWN = 8.0  # sigma: what leaves the axis is in the table
_UNITS = {
    "attitude": ("deg", 180 / np.pi, ("about x", "about y", "about z")),
    "position": ("m", 1.0, NORTH_EAST_DOWN),
    "velocity": ("m/s", 1.0, NORTH_EAST_DOWN),
}
_EXPLANATION = (
    "What later measurements changed: the estimate by the past alone less the smoothed one, over "
    "the root of the difference of their covariances. Two honest passes stay within 3. No method "
    "here runs backward in time: instead of the separation of forward and backward passes stands "
    "this one, of the same information."
)
_MISSING = (
    "Not compared: this needs the methods forward and smoother (or batch), both with their "
    "covariances. Add them to --method."
)


def separation_blocks(methods: Sequence[Method], time: Span) -> Blocks:
    """Return figures and a table of a filter less smoothers; a sentence where one is missing."""
    series, rows = [], []
    for name, apart in _pairs(methods):
        unit, scale, axes = _UNITS[apart.quantity]
        for k, axis in enumerate(axes):
            line = Line(name, apart.t_s, apart.ratio[:, k], f"forward less {name}")
            title = f"{apart.quantity} {axis}: forward less smoothed, over its σ"
            series.append((title, "difference / σ", line))
            rows.append([name, apart.quantity, axis, *_cells(apart, k, unit, scale)])
    rules = {_SIGMAS: "3σ", -_SIGMAS: "-3σ"}
    charts = time_charts(series, time, lambda _: (-_SHOWN, _SHOWN), rules=rules)
    heads = ["forward less", "state", "axis", "RMS", "RMS / σ", "within 3σ", "no σ"]
    caption = "99.7 % are expected within 3σ; no σ: epochs of which the smoother states more"
    figures = folded("filter against smoother in figures", table(heads, rows, caption))
    return paragraph(_EXPLANATION) + grid(charts) + figures if charts else paragraph(_MISSING)


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
