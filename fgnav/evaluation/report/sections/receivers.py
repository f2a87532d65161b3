"""Residuals of receivers' own solutions over time: fixes and baselines less estimates."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fgnav.attitude.receiver_baselines import body_baseline
from fgnav.checks import BadInputError, FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.charts import FIXES, Line, Span, around_zero, time_charts
from fgnav.evaluation.report.parts import Blocks, grid, number, paragraph, table
from fgnav.evaluation.report.sections.errors import NORTH_EAST_DOWN
from fgnav.evaluation.scores import hidden
from fgnav.geometry.rotations import wrap
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Baseline, Fixes, Flight

_EXPLANATION = (
    "What a receiver solved less what an estimate has at its antennas; shaded: three standard "
    "deviations as the receiver states them. The estimate has seen it: a residual is smaller than "
    "the receiver's error. What stays for seconds is set-up, delay or multipath."
)


class _Residual(NamedTuple):
    """Measured less estimated along one axis, (k,), with 1-sigma as measured."""

    title: str
    unit: str
    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray


def receiver_blocks(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return figures and a table of residuals; empty without fixes and baselines."""
    series, rows = [], []
    for method in methods:
        for residual in _residuals(flight, method.solution):
            y = f"residual, {residual.unit}"
            if method is methods[0]:  # what the receiver states is the same for all
                band = Line(FIXES, residual.t_s, 0 * residual.value, "3σ", half=3 * residual.sigma)
                series.append((residual.title, y, band))
            series.append(
                (residual.title, y, Line(method.name, residual.t_s, residual.value, dots=True))
            )
            rms, sigma = (
                float(np.sqrt((residual.value**2).mean())),
                float(np.median(residual.sigma)),
            )
            sizes = [f"{number(value)} {residual.unit}" for value in (rms, sigma)]
            rows.append([residual.title, method.name, str(len(residual.value)), *sizes])
    rows.sort(key=lambda row: row[0])
    heads = ["of", "method", "count", "RMS", "1σ, median"]
    figures = table(heads, rows, "residuals, and 1σ as the receiver states it")
    charts = grid(time_charts(series, time, around_zero))
    return paragraph(_EXPLANATION) + charts + figures if rows else []


def _residuals(flight: Flight, estimate: Estimate) -> Iterator[_Residual]:
    """Yield residuals along axes that have any."""
    lost = hidden(estimate)
    for fixes in flight.fixes:
        yield from _of_fixes(flight, estimate, fixes, lost)
    for of in flight.baselines if not lost & {"pitch", "yaw"} else ():
        yield from _of_baseline(flight, estimate, of)


def _of_fixes(
    flight: Flight, estimate: Estimate, fixes: Fixes, lost: set[str]
) -> Iterator[_Residual]:
    """Yield residuals of positions; of velocities where the estimate has the body's rate."""
    at, rows = common_epochs(estimate.t_s, fixes.t_s)
    arm_b_m, R_nb = flight.antenna(fixes.antenna).position_b_m, estimate.R_nb[at]
    if estimate.p_n_m is not None and "position" not in lost:
        value = fixes.p_n_m[rows] - estimate.p_n_m[at] - R_nb @ arm_b_m
        title = f"position of {fixes.antenna}"
        yield from _by_axis(title, "m", fixes.t_s[rows], value, fixes.position_sigma_m[rows])
    rate, v_n_mps, sigma = estimate.angular_rate_b_radps, fixes.v_n_mps, fixes.velocity_sigma_mps
    if rate is None or v_n_mps is None or sigma is None or estimate.v_n_mps is None:
        return
    lever_n_mps = np.einsum("nij,nj->ni", R_nb, np.cross(rate[at], arm_b_m))
    value = v_n_mps[rows] - estimate.v_n_mps[at] - lever_n_mps
    yield from _by_axis(f"velocity of {fixes.antenna}", "m/s", fixes.t_s[rows], value, sigma[rows])


def _by_axis(
    title: str, unit: str, t_s: FloatArray, value: FloatArray, sigma: FloatArray
) -> Iterator[_Residual]:
    for k, axis in enumerate(NORTH_EAST_DOWN):
        valid = np.isfinite(value[:, k])
        if valid.any():
            yield _Residual(f"{title}, {axis}", unit, t_s[valid], value[valid, k], sigma[valid, k])


def _of_baseline(flight: Flight, estimate: Estimate, of: Baseline) -> Iterator[_Residual]:
    """Yield residuals of the heading of a baseline and, where it is measured, of its pitch."""
    try:
        between = body_baseline(flight, of)
    except BadInputError:  # no direction
        return
    at, rows = common_epochs(estimate.t_s, of.t_s)
    if not len(rows):
        return
    measured = of[np.isin(np.arange(len(of.t_s)), rows)]
    here = estimate.R_nb[at] @ between.vector_b_m
    heading = wrap(measured.heading_rad - np.arctan2(here[:, 1], here[:, 0]))
    t_s, sigma_deg = measured.t_s, np.degrees(measured.heading_sigma_rad)
    yield _Residual(f"{between.name}, heading", "deg", t_s, np.degrees(heading), sigma_deg)
    if of.measured != "heading":
        both_n_m = measured.vector_n_m, here
        pitch = [np.arctan2(-v[:, 2], np.hypot(v[:, 0], v[:, 1])) for v in both_n_m]
        length_m = np.linalg.norm(measured.vector_n_m, axis=1)
        sigma_deg = np.degrees(np.sqrt(measured.covariance_m2[:, 2, 2]) / length_m)
        left_deg = np.degrees(pitch[0] - pitch[1])
        yield _Residual(f"{between.name}, pitch", "deg", t_s, left_deg, sigma_deg)
