"""What methods leave of receivers' own solutions over time: fixes and baselines less estimates."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fgnav.attitude.receiver_baselines import body_baseline
from fgnav.checks import BadInputError, FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.blocks import Blocks, grid, number, paragraph, table
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line
from fgnav.evaluation.report.lines import limit
from fgnav.evaluation.scores import hidden
from fgnav.geometry.rotations import wrap
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Baseline, Fixes, Flight

_AXES = ("north", "east", "down")


class _Residual(NamedTuple):
    """Measured less estimated along one axis, (k,), with 1-sigma as measured."""

    title: str
    unit: str
    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray


def receiver_parts(
    flight: Flight, methods: Sequence[Method], marks: dict[str, str], time: Axis
) -> Blocks:
    """Return diagrams and a table of residuals; empty without fixes and baselines."""
    of: dict[str, list[tuple[str, _Residual]]] = {}
    for method in methods:
        if method.estimate is not None:
            for one in _residuals(flight, method.estimate):
                of.setdefault(one.title, []).append((method.name, one))
    charts = [_chart(parts, marks, time).drawing() for parts in of.values()]
    rows = [
        [
            title,
            name,
            str(len(one.value)),
            f"{number(float(np.sqrt((one.value**2).mean())))} {one.unit}",
            f"{number(float(np.median(one.sigma)))} {one.unit}",
        ]
        for title, parts in of.items()
        for name, one in parts
    ]
    if not rows:
        return []
    heads = ["of", "method", "count", "RMS", "1σ, median"]
    return (
        paragraph(
            "What a receiver solved less what an estimate has at its antennas. The estimate has "
            "seen it: a residual is smaller than the receiver's error. What stays for seconds is "
            "set-up, delay or multipath."
        )
        + grid(charts)
        + table(heads, rows, "residuals, and 1σ as the receiver states it")
    )


def _residuals(flight: Flight, estimate: Estimate) -> Iterator[_Residual]:
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
        named = f"position of {fixes.antenna}", "m"
        yield from _by_axis(named, fixes.t_s[rows], value, fixes.position_sigma_m[rows])
    rate, v_n_mps, sigma = (
        estimate.angular_rate_b_radps,
        fixes.v_n_mps,
        fixes.velocity_sigma_mps,
    )
    if rate is None or v_n_mps is None or sigma is None or estimate.v_n_mps is None:
        return
    swing = np.einsum("nij,nj->ni", R_nb, np.cross(rate[at], arm_b_m))
    value = v_n_mps[rows] - estimate.v_n_mps[at] - swing
    yield from _by_axis(
        (f"velocity of {fixes.antenna}", "m/s"), fixes.t_s[rows], value, sigma[rows]
    )


def _by_axis(
    named: tuple[str, str], t_s: FloatArray, value: FloatArray, sigma: FloatArray
) -> Iterator[_Residual]:
    title, unit = named
    for k, axis in enumerate(_AXES):
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
    sigma = np.degrees(measured.heading_sigma_rad)
    name = between.name
    yield _Residual(f"{name}, heading", "deg", measured.t_s, np.degrees(heading), sigma)
    if of.measured == "heading":
        return
    pitch = [np.arctan2(-v[:, 2], np.hypot(v[:, 0], v[:, 1])) for v in (measured.vector_n_m, here)]
    length = np.linalg.norm(measured.vector_n_m, axis=1)
    sigma = np.degrees(np.sqrt(measured.covariance_m2[:, 2, 2]) / length)
    yield _Residual(f"{name}, pitch", "deg", measured.t_s, np.degrees(pitch[0] - pitch[1]), sigma)


def _chart(parts: list[tuple[str, _Residual]], marks: dict[str, str], time: Axis) -> Chart:
    one = parts[0][1]
    half = limit([part.value for _, part in parts])
    return Chart(
        title=one.title,
        x=time,
        y=Axis(name=f"residual, {one.unit}", low=-half, high=half),
        lines=[
            Line(mark=marks[name], name=name, x=part.t_s, y=part.value, dots=True)
            for name, part in parts
        ],
        rules={3 * float(np.median(one.sigma)): "3σ", -3 * float(np.median(one.sigma)): "-3σ"},
    )
