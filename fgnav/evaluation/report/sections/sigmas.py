"""What methods state of their own errors over time, and where a heading is open."""

from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.attitude.baseline_angles import baseline_angles, reported_baselines
from fgnav.attitude.receiver_baselines import KNOWN_RAD
from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.blocks import Blocks, grid, paragraph, table
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, decades, log10, nested
from fgnav.evaluation.report.sections.errors import sigmas
from fgnav.evaluation.scores import EULER, hidden, open_heading_spans_s
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

_AXES = ("north", "east", "down")
_LISTED = 20  # spans


def sigma_parts(
    flight: Flight, methods: Sequence[Method], marks: dict[str, str], time: Axis
) -> Blocks:
    """Return diagrams of 1-sigma, and a table of spans in which the heading is open."""
    of: dict[tuple[str, str], list[tuple[str, FloatArray, FloatArray]]] = {}
    rows = []
    for method in methods:
        estimate = method.estimate
        if estimate is None or not len(estimate.t_s):
            continue
        for title, unit, values in _sigmas(flight, estimate):
            of.setdefault((title, unit), []).append((method.name, estimate.t_s, values))
        spans_s = open_heading_spans_s(estimate)[:_LISTED]
        rows += [[method.name, f"{a:.1f}", f"{b:.1f}", f"{b - a:.1f}"] for a, b in spans_s]
    if not of:
        return []
    caption = f"heading open: 1σ of yaw beyond {np.degrees(KNOWN_RAD):.0f} deg"
    return (
        paragraph("1σ as each method states it.")
        + grid(
            _chart(title, unit, lines, marks, time).drawing() for (title, unit), lines in of.items()
        )
        + table(["method", "from, s", "until, s", "length, s"], rows, caption)
    )


def _sigmas(flight: Flight, estimate: Estimate) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield title, unit and values, (n,), of what an estimate states and observes."""
    lost, sigma_deg = hidden(estimate), estimate.sigma_deg
    for k, name in enumerate(EULER):
        if sigma_deg is not None and name not in lost:
            yield f"1σ of {name}", "deg", sigma_deg[:, k]
    for name, unit_b in reported_baselines(flight).items():
        angles = baseline_angles(estimate, unit_b).sigma_rad
        for k, angle in enumerate(("azimuth", "elevation")):
            if angles is not None:
                yield f"1σ of {angle}, {name}", "deg", np.degrees(angles[:, k])
    for quantity, unit, covariance in (
        ("position", "m", estimate.position_covariance_m2),
        ("velocity", "m/s", estimate.velocity_covariance_m2ps2),
    ):
        values = None if quantity in lost else sigmas(covariance)
        for k, axis in enumerate(_AXES):
            if values is not None and np.isfinite(values[:, k]).any():
                yield f"1σ of {quantity} {axis}", unit, values[:, k]


def _chart(
    title: str,
    unit: str,
    of: list[tuple[str, FloatArray, FloatArray]],
    marks: dict[str, str],
    time: Axis,
) -> Chart:
    widths = nested(len(of)).tolist()
    lines = [
        Line(mark=marks[name], name=name, x=t_s, y=log10(values), width=width)
        for (name, t_s, values), width in zip(of, widths, strict=True)
    ]
    y = decades(f"1σ, {unit}", [line.y for line in lines])
    return Chart(title=title, x=time, y=y, lines=lines)
