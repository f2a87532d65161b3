"""Errors against the truth by axis: all methods together, then each beside its own 3-sigma band."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.blocks import Blocks, folded, grid, paragraph
from fgnav.evaluation.report.drawing.chart import Axis, Band, Chart, Line, nested
from fgnav.evaluation.report.lines import is_rough, limit
from fgnav.evaluation.scores import EULER, hidden

_SIGMAS = 3.0
_NORTH_EAST_DOWN = ("north", "east", "down")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AxisErrors:
    """Errors of one method along one axis, (n,), with 1-sigma where the method states one."""

    mark: str
    method: str
    t_s: FloatArray
    error: FloatArray
    sigma: FloatArray | None
    rough: bool


def error_charts(methods: Sequence[Method], marks: dict[str, str], time: Axis) -> Blocks:
    """Return diagrams of attitude, position and velocity errors; empty without truth."""
    blocks: Blocks = []
    for quantity, axes, unit in (
        ("attitude", EULER, "deg"),
        ("position", _NORTH_EAST_DOWN, "m"),
        ("velocity", _NORTH_EAST_DOWN, "m/s"),
    ):
        by_axis = [list(_of_axis(methods, marks, quantity, k)) for k in range(3)]
        names = [
            f"{axis} error" if quantity == "attitude" else f"{quantity} error {axis}"
            for axis in axes
        ]
        blocks += grid(
            _together(name, unit, errors, time).drawing()
            for name, errors in zip(names, by_axis, strict=True)
            if errors
        )
        blocks += _apart(quantity, names, unit, by_axis, time)
    if not blocks:
        return []
    return (
        paragraph(
            "Estimate minus truth. Shaded: three standard deviations as each method states them, "
            "around zero. An axis holds what the middle method does; worse ones leave it. Lines of "
            "methods that coincide are drawn thinner upon thicker ones."
        )
        + blocks
    )


def _of_axis(
    methods: Sequence[Method], marks: dict[str, str], quantity: str, k: int
) -> Iterator[AxisErrors]:
    """Yield the errors of each method that has any along an axis."""
    for method in methods:
        error, sigma = _errors_and_sigmas(method, quantity)
        if error is None or method.errors is None or not np.isfinite(error[:, k]).any():
            continue
        yield AxisErrors(
            mark=marks[method.name],
            method=method.name,
            t_s=method.errors.t_s,
            error=error[:, k],
            sigma=None if sigma is None else sigma[:, k],
            rough=is_rough(error),
        )


def _errors_and_sigmas(
    method: Method, quantity: str
) -> tuple[FloatArray | None, FloatArray | None]:
    """Return (n, 3) errors and standard deviations at the same epochs, in the unit shown."""
    errors, estimate = method.errors, method.estimate
    if errors is None or estimate is None or not len(errors.t_s):
        return None, None
    rows = common_epochs(estimate.t_s, errors.t_s)[0]
    if quantity == "attitude":
        return np.degrees(errors.euler_rad), _rows(estimate.sigma_deg, rows)
    if quantity in hidden(estimate):
        return None, None
    if quantity == "position":
        return errors.position_n_m, _rows(sigmas(estimate.position_covariance_m2), rows)
    return errors.velocity_n_mps, _rows(sigmas(estimate.velocity_covariance_m2ps2), rows)


def sigmas(covariance: FloatArray | None) -> FloatArray | None:
    """Return the standard deviations (n, 3) of covariances (n, 3, 3)."""
    if covariance is None:
        return None
    return np.asarray(np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0)))


def _rows(values: FloatArray | None, rows: IntArray) -> FloatArray | None:
    return None if values is None else np.asarray(values[rows])


def _together(name: str, unit: str, errors: list[AxisErrors], time: Axis) -> Chart:
    """Return one diagram of all methods: the worst behind, the thinnest line before."""
    behind = sorted(errors, key=lambda one: -float(np.nanmean(one.error**2)))
    half = limit([one.error for one in errors])
    smooth = [one.method for one in behind if not one.rough]
    widths = dict(zip(smooth, nested(len(smooth)).tolist(), strict=True))
    return Chart(
        title=f"{name}, all methods",
        x=time,
        y=Axis(name=f"{name}, {unit}", low=-half, high=half),
        lines=[_line(one, widths.get(one.method, 1.0)) for one in behind],
    )


def _apart(
    quantity: str, names: list[str], unit: str, by_axis: list[list[AxisErrors]], time: Axis
) -> Blocks:
    """Return, to be opened, a row of diagrams for each method, each on a scale of its own."""
    methods = dict.fromkeys(one.method for errors in by_axis for one in errors)
    rows: Blocks = []
    for method in methods:
        charts = [
            _alone(f"{method}: {name}", name, unit, one, time).drawing()
            for name, errors in zip(names, by_axis, strict=True)
            for one in errors
            if one.method == method
        ]
        rows += grid(charts)
    return folded(f"{quantity}: each method with its own ±3σ", rows)


def _alone(title: str, name: str, unit: str, one: AxisErrors, time: Axis) -> Chart:
    half = limit([one.error])
    bands = []
    if one.sigma is not None:
        band = _SIGMAS * one.sigma
        half = max(half, limit([band]))
        bands = [Band(mark=one.mark, name=f"±3σ of {one.method}", x=one.t_s, low=-band, high=band)]
    return Chart(
        title=title,
        x=time,
        y=Axis(name=f"{name}, {unit}", low=-half, high=half),
        lines=[_line(one, 1.0)],
        bands=bands,
    )


def _line(one: AxisErrors, width: float) -> Line:
    return Line(mark=one.mark, name=one.method, x=one.t_s, y=one.error, dots=one.rough, width=width)
