"""Errors against the truth with what methods state of them, and that alone over time."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.attitude.baseline_angles import baseline_angles, reported_baselines
from fgnav.attitude.receiver_baselines import KNOWN_RAD
from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.charts import Line, Series, Span, around_zero, is_rough, time_charts
from fgnav.evaluation.report.parts import Blocks, folded, grid, paragraph, table
from fgnav.evaluation.scores import EULER, hidden, open_heading_spans_s
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

_SIGMAS = 3.0
NORTH_EAST_DOWN = ("north", "east", "down")
_EXPLANATION = (
    "Estimate minus truth. Shaded: three standard deviations as each method states them, around "
    "zero. An axis holds what the middle method does; worse ones leave it. Lines of methods that "
    "coincide are drawn thinner upon thicker ones."
)


class _Quantity(NamedTuple):
    """Three components of the state, and where errors and estimates hold them."""

    name: str
    unit: str
    errors: str
    sigma: str
    components: Sequence[str] = NORTH_EAST_DOWN


_QUANTITIES = (
    _Quantity("attitude", "deg", "euler_deg", "sigma_deg", EULER),
    _Quantity("position", "m", "position_n_m", "position_sigma_m"),
    _Quantity("velocity", "m/s", "velocity_n_mps", "velocity_sigma_mps"),
)


def error_charts(methods: Sequence[Method], time: Span) -> Blocks:
    """Return errors of attitude, position and velocity; empty without truth."""
    blocks: Blocks = []
    for of in _QUANTITIES:
        series = {method.name: list(_errors(method, of)) for method in methods}
        together = [
            (f"{title}, all methods", y, replace(line, half=None))
            for by_component in series.values()
            for title, y, line in by_component
        ]
        blocks += grid(time_charts(together, time, around_zero))
        by_method = []
        for name, by_component in series.items():
            named = ((f"{name}: {title}", y, line) for title, y, line in by_component)
            by_method += grid(time_charts(named, time, around_zero))
        blocks += folded(f"{of.name}: each method with its own ±3σ", by_method)
    return paragraph(_EXPLANATION) + blocks if blocks else []


def _errors(method: Method, of: _Quantity) -> Series:
    """Yield the errors of a method by component, with their bands."""
    estimate, errors = method.solution, method.errors
    values = None if errors is None else getattr(errors, of.errors)
    if errors is None or values is None or of.name in hidden(estimate):
        return
    sigma = getattr(errors, of.sigma)
    for k, name in enumerate(of.components):
        title = f"error of {'' if of.name == 'attitude' else f'{of.name} '}{name}"
        half = None if sigma is None or name in hidden(estimate) else _SIGMAS * sigma[:, k]
        line = Line(method.name, errors.t_s, values[:, k], half=half, is_around_zero=True)
        yield title, f"error, {of.unit}", replace(line, dots=is_rough(values))


def sigma_charts(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return 1-sigma as stated, and a table of spans in which the heading is open."""
    rows = [
        [method.name, f"{a:.1f}", f"{b:.1f}", f"{b - a:.1f}"]
        for method in methods
        for a, b in open_heading_spans_s(method.solution)
    ]
    series = (
        (f"1σ of {name}", f"1σ, {unit}", Line(method.name, method.solution.t_s, values))
        for method in methods
        for name, unit, values in _sigmas(flight, method.solution)
    )
    charts = time_charts(series, time, log="y")
    caption = f"heading open: 1σ of yaw beyond {np.degrees(KNOWN_RAD):.0f} deg"
    spans = table(["method", "from, s", "until, s", "length, s"], rows, caption)
    return paragraph("1σ as each method states it.") + grid(charts) + spans if charts else []


def _sigmas(flight: Flight, estimate: Estimate) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield name, unit and 1-sigma, (n,), of what an estimate states."""
    for of in _QUANTITIES:
        values = getattr(estimate, of.sigma)
        for k, name in enumerate(of.components if values is not None else ()):
            if not {of.name, name} & hidden(estimate):
                yield name if of.name == "attitude" else f"{of.name} {name}", of.unit, values[:, k]
    for name, unit_b in reported_baselines(flight).items():
        if (sigma_rad := baseline_angles(estimate, unit_b).sigma_rad) is not None:
            for angle, component in zip(("azimuth", "elevation"), sigma_rad.T, strict=True):
                yield f"{angle}, {name}", "deg", np.degrees(component)
