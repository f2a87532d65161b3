"""Summaries of a flight, an estimate or a comparison: five lines, in a notebook a table."""

from collections.abc import Callable
from html import escape
from typing import Any

import numpy as np

# The three types import this module, so it names none of them.
_WIDTH = 60  # of the list of names on a line


def summary(part: Any) -> str:  # noqa: ANN401  # one of the three
    """Return the lines of a flight, an estimate or a comparison."""
    head, lines = _FACTS[type(part).__name__](part)
    width = max(map(len, lines))
    return "\n".join([f"<{head}", *(f"  {name:<{width}}  {lines[name]}" for name in lines)]) + ">"


def summary_html(part: Any) -> str:  # noqa: ANN401  # one of the three
    """Return the summary as an HTML table."""
    head, lines = _FACTS[type(part).__name__](part)
    rows = (
        f"<tr><th style='text-align:left'>{escape(name)}</th>"
        f"<td style='text-align:left'>{escape(text)}</td></tr>"
        for name, text in lines.items()
    )
    return f"<table><caption>{escape(head)}</caption>{''.join(rows)}</table>"


def _of_flight(flight: Any) -> tuple[str, dict[str, str]]:  # noqa: ANN401  # a Flight
    origin, observed = flight.origin, flight.observations
    sensors = [*flight.records, *(["base"] if flight.base is not None else [])]
    gnss = "none"
    if observed is not None:
        epochs, antennas, channels = observed.code_m.shape
        gnss = f"{epochs} epochs, {antennas} antennas, {channels} channels"
    location = f"{_deg(origin.latitude_rad)}, {_deg(origin.longitude_rad)}, {origin.height_m:.1f} m"
    return f"Flight {flight.name!r}", {
        "origin": location,
        "gnss": gnss,
        "sensors": _list(sensors),
        **({"networks": _list([path.stem for path in flight.networks])} if flight.networks else {}),
        "lost": f"{sum(loss.count for loss in flight.unused)} measurements and files",
    }


def _of_estimate(estimate: Any) -> tuple[str, dict[str, str]]:  # noqa: ANN401  # an Estimate
    t_s, sigma_deg = estimate.t_s, estimate.sigma_deg
    span = f"{len(t_s)} of {estimate.n_epochs} epochs"
    if len(t_s):
        span += f", {t_s[0]:.3f} to {t_s[-1]:.3f} s"
    states = {
        "attitude": estimate.R_nb,
        "position": estimate.p_n_m,
        "velocity": estimate.v_n_mps,
        "rate": estimate.angular_rate_b_radps,
        "accelerometer bias": estimate.accelerometer_bias_mps2,
        "gyroscope bias": estimate.gyroscope_bias_radps,
    }
    sigma = "not stated"
    if sigma_deg is not None and len(t_s):
        middle = np.median(sigma_deg, axis=0).tolist()
        sigma = ", ".join(f"{sigma:.3f}" for sigma in middle) + " deg (median, roll, pitch, yaw)"
    ended = "at a minimum" if estimate.converged else "at no minimum: not to be used"
    open_ = f"; open: {_list(list(estimate.unobservable))}" if estimate.unobservable else ""
    return f"Estimate by {estimate.method!r}", {
        "epochs": span,
        "states": _list([name for name, value in states.items() if value is not None]),
        "sigma": sigma,
        "ended": ended + open_,
        **({} if estimate.graph is None else {"graph": str(estimate.graph)}),
    }


def _of_comparison(comparison: Any) -> tuple[str, dict[str, str]]:  # noqa: ANN401  # a Comparison
    names = [method.name for method in comparison.methods]
    solved = {
        method.name: method.score.attitude_rmse_deg
        for method in comparison.methods
        if method.score.attitude_rmse_deg is not None
    }
    best = "no truth"
    if solved:
        name = min(solved, key=lambda estimate: solved[estimate])
        best = f"{name}, {solved[name]:.3f} deg RMS of attitude"
    failed = [method.name for method in comparison.methods if method.score.failure is not None]
    return f"Comparison on {comparison.flight!r}", {
        "epochs": str(comparison.epochs),
        "methods": _list(names),
        "best": best,
        "failed": _list(failed),
    }


_FACTS: dict[str, Callable[[Any], tuple[str, dict[str, str]]]] = {
    "Flight": _of_flight,
    "Estimate": _of_estimate,
    "Comparison": _of_comparison,
}


def _deg(angle_rad: float) -> str:
    return f"{np.degrees(angle_rad):.6f} deg"


def _list(names: list[str]) -> str:
    """Return names with commas, as many as fit a line, and how many more there are."""
    text = ", ".join(names)
    if len(text) <= _WIDTH:
        return text or "none"
    shown = text[:_WIDTH].rsplit(", ", 1)[0]
    return f"{shown} and {len(names) - shown.count(', ') - 1} more"
