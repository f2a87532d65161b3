"""Errors against the truth with what methods state of them, and that alone over time."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fgnav.attitude.baseline_angles import baseline_angles, reported_baselines
from fgnav.attitude.receiver_baselines import KNOWN_RAD
from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.charts import Chart, Line, Span, error_limits, is_rough
from fgnav.evaluation.report.parts import Blocks, folded, grid, paragraph, table
from fgnav.evaluation.scores import EULER, hidden, open_heading_spans_s
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

_SIGMAS = 3.0
_LISTED = 20  # spans
_NORTH_EAST_DOWN = ("north", "east", "down")


class Quantity(NamedTuple):
    """Three components of the state: their names and unit, and who holds them."""

    name: str
    unit: str
    names: Sequence[str]
    errors: str
    covariance: str = ""
    scale: float = 1.0


QUANTITIES = (
    Quantity("attitude", "deg", EULER, "euler_rad", scale=180 / np.pi),
    Quantity(
        "position",
        "m",
        [f"position {axis}" for axis in _NORTH_EAST_DOWN],
        "position_n_m",
        "position_covariance_m2",
    ),
    Quantity(
        "velocity",
        "m/s",
        [f"velocity {axis}" for axis in _NORTH_EAST_DOWN],
        "velocity_n_mps",
        "velocity_covariance_m2ps2",
    ),
)


def standard_deviations(covariance: FloatArray | None) -> FloatArray | None:
    """Return the standard deviations (n, 3) of covariances (n, 3, 3)."""
    if covariance is None:
        return None
    return np.asarray(np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0)))


def stated_sigmas(estimate: Estimate, of: Quantity) -> FloatArray | None:
    """Return 1-sigma as stated, (n, 3), in the unit shown; NaN of what is unobservable."""
    if of.covariance:
        values = standard_deviations(getattr(estimate, of.covariance))
        return None if of.name in hidden(estimate) else values
    if estimate.sigma_deg is None:
        return None
    return np.where([name in hidden(estimate) for name in EULER], np.nan, estimate.sigma_deg)


def error_charts(methods: Sequence[Method], time: Span) -> Blocks:
    """Return errors of attitude, position and velocity; empty without truth."""
    blocks: Blocks = []
    for of in QUANTITIES:
        lines = [dict(_error_lines(methods, of, k)) for k in range(3)]
        named = [
            (f"error of {name}", f"error, {of.unit}", by_method)
            for name, by_method in zip(of.names, lines, strict=True)
            if by_method
        ]
        blocks += grid(
            _chart(f"{title}, all methods", y, [_without_band(one) for one in by.values()], time)
            for title, y, by in named
        )
        apart = [
            block
            for method in methods
            for block in grid(
                _chart(f"{method.name}: {title}", y, [by[method.name]], time)
                for title, y, by in named
                if method.name in by
            )
        ]
        blocks += folded(f"{of.name}: each method with its own ±3σ", apart)
    text = (
        "Estimate minus truth. Shaded: three standard deviations as each method states them, "
        "around zero. An axis holds what the middle method does; worse ones leave it. Lines of "
        "methods that coincide are drawn thinner upon thicker ones."
    )
    return paragraph(text) + blocks if blocks else []


def _error_lines(methods: Sequence[Method], of: Quantity, k: int) -> Iterator[tuple[str, Line]]:
    """Yield the errors of each method that has any of one component, with its band."""
    for method in methods:
        estimate, errors = method.estimate, method.errors
        if estimate is None or errors is None or of.name in hidden(estimate):
            continue
        values = getattr(errors, of.errors)
        if values is None or not np.isfinite(values[:, k]).any():
            continue
        sigma = stated_sigmas(estimate, of)
        rows = common_epochs(estimate.t_s, errors.t_s)[0]
        yield (
            method.name,
            Line(
                of=method.name,
                x=errors.t_s,
                y=of.scale * values[:, k],
                dots=is_rough(values),
                half=None if sigma is None else _SIGMAS * sigma[rows, k],
                around_zero=True,
            ),
        )


def _without_band(line: Line) -> Line:
    return Line(of=line.of, x=line.x, y=line.y, dots=line.dots)


def _chart(title: str, y: str, lines: Sequence[Line], time: Span) -> Chart:
    limits = [error_limits([line.y for line in lines])]
    limits += [error_limits([line.half]) for line in lines if line.half is not None]
    widest = max(limits, key=lambda both: both[1])
    return Chart(title=title, y=y, lines=lines, x_limits=time, y_limits=widest)


def sigma_charts(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return 1-sigma as stated, and a table of spans in which the heading is open."""
    by_title: dict[tuple[str, str], list[Line]] = {}
    rows = []
    for method in methods:
        estimate = method.estimate
        if estimate is None or not len(estimate.t_s):
            continue
        for name, unit, values in _components(flight, estimate):
            if np.isfinite(values).any():
                line = Line(of=method.name, x=estimate.t_s, y=values)
                by_title.setdefault((f"1σ of {name}", f"1σ, {unit}"), []).append(line)
        spans_s = open_heading_spans_s(estimate)[:_LISTED]
        rows += [[method.name, f"{a:.1f}", f"{b:.1f}", f"{b - a:.1f}"] for a, b in spans_s]
    charts = [
        Chart(title=title, y=y, lines=lines, x_limits=time, log="y")
        for (title, y), lines in by_title.items()
    ]
    caption = f"heading open: 1σ of yaw beyond {np.degrees(KNOWN_RAD):.0f} deg"
    spans = table(["method", "from, s", "until, s", "length, s"], rows, caption)
    return paragraph("1σ as each method states it.") + grid(charts) + spans if charts else []


def _components(flight: Flight, estimate: Estimate) -> Iterator[tuple[str, str, FloatArray]]:
    """Yield name, unit and 1-sigma, (n,), of what an estimate states."""
    for of in QUANTITIES:
        values = stated_sigmas(estimate, of)
        if values is not None:
            yield from ((name, of.unit, values[:, k]) for k, name in enumerate(of.names))
    for name, unit_b in reported_baselines(flight).items():
        sigma_rad = baseline_angles(estimate, unit_b).sigma_rad
        for k, angle in enumerate(("azimuth", "elevation")):
            if sigma_rad is not None:
                yield f"{angle}, {name}", "deg", np.degrees(sigma_rad[:, k])
