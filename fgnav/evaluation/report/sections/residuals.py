"""What each method leaves of the observations, satellite by satellite."""

from collections.abc import Callable, Sequence

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.internal_consistency.residuals import (
    Residuals,
    array_phase_residuals,
    code_residuals,
    phase_residuals,
)
from fgnav.evaluation.report.blocks import Blocks, folded, grid, number, paragraph, table
from fgnav.evaluation.report.drawing.chart import Axis
from fgnav.evaluation.report.drawing.rows import Rows, rows_drawings
from fgnav.evaluation.scores import EULER, finite_mean, hidden
from fgnav.gnss.undifferenced import Undifferenced, undifferenced
from fgnav.types.flight import Flight

_Of = list[tuple[Method, Residuals]]


def residual_parts(
    flight: Flight, comparison: Comparison, marks: dict[str, str], time: Axis
) -> Blocks:
    """Return rows and tables of residuals by satellite; empty without observations."""
    methods = comparison.solved
    array, code, phase = _of_array(comparison), [], []
    observed = _observed(flight)
    if observed is not None:
        code = _of_antenna(flight, methods, observed, code_residuals)
        phase = _of_antenna(flight, methods, observed, phase_residuals)
    kinds = [
        ("phase of the array", "mm", 1e3, array),
        ("code of the first antenna", "m", 1.0, code),
        ("phase of the first antenna", "mm", 1e3, phase),
    ]
    drawings = [
        drawing
        for title, unit, scale, of in kinds
        for drawing in rows_drawings(f"{title}: RMS, {unit}", unit, _rows(of, marks, scale), time)
    ]
    if not drawings:
        return []
    return (
        paragraph(
            "RMS in cells of time. The array's phase less what the attitude makes of it, whole "
            "cycles taken off, over all baselines; code and phase of the first antenna less what "
            "the position makes of them, clocks of each epoch and a constant of each arc of phase "
            "taken off: errors of the position, of orbits and of the atmosphere that drift within "
            "an arc stay in. A row is cut at its upper edge."
        )
        + grid(drawings)
        + folded(
            "RMS by satellite and method",
            [block for kind in kinds if kind[-1] for block in _table(*kind)],
        )
    )


def _of_array(comparison: Comparison) -> _Of:
    differences = comparison.double_differences
    if differences is None:
        return []
    return [
        (method, array_phase_residuals(differences, method.estimate))
        for method in comparison.solved
        if method.estimate is not None and not hidden(method.estimate) & set(EULER)
    ]


def _observed(flight: Flight) -> Undifferenced | None:
    if flight.observations is None:
        return None
    try:
        return undifferenced(flight)
    except NoSolutionError:  # too few satellites: then no method has a position by them either
        return None


def _of_antenna(
    flight: Flight,
    methods: Sequence[Method],
    observed: Undifferenced,
    residuals: Callable[..., Residuals | None],
) -> _Of:
    arm_b_m = flight.antennas[0].position_b_m
    out: _Of = []
    for method in methods:
        if method.estimate is None or "position" in hidden(method.estimate):
            continue
        own = residuals(observed, method.estimate, arm_b_m)
        if own is not None and np.isfinite(own.value_m).any():
            out.append((method, own))
    return out


def _rows(of: _Of, marks: dict[str, str], scale: float) -> list[Rows]:
    """Return what is drawn, the largest residuals first, so behind."""
    behind = sorted(of, key=lambda one: -float(np.nanmean(one[1].value_m ** 2)))
    return [
        Rows(
            mark=marks[method.name],
            name=method.name,
            t_s=own.t_s,
            labels=own.channels,
            value=scale * own.value_m,
        )
        for method, own in behind
    ]


def _table(title: str, unit: str, scale: float, of: _Of) -> Blocks:
    heads = ["channel", *(f"{method.name}, {unit}" for method, _ in of)]
    rms = [
        dict(zip(own.channels, np.sqrt(finite_mean(squared, 0)).tolist(), strict=True))
        for own, squared in ((own, (scale * own.value_m) ** 2) for _, own in of)
    ]
    channels = sorted({name for one in rms for name, value in one.items() if np.isfinite(value)})
    rows = [[name, *(number(one.get(name)) for one in rms)] for name in channels]
    return table(heads, rows, title)
