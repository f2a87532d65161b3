"""Of what quality each method's answers are, epoch by epoch."""

from collections.abc import Sequence

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.blocks import Blocks, grid
from fgnav.evaluation.report.drawing.chart import Axis
from fgnav.evaluation.report.drawing.strip import key, named_strips
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

# From the worst: a cell of several epochs shows the first that occurs.
_FLAGS = ("absent", "predicted", "refused", "fixed")
_LABELS = ("no answer", "no GNSS", "no integers", "integers fixed")
_CELLS = 300
_NEAR = 0.75  # usual intervals: epochs that follow each other have none further away than a half


def quality_strips(flight: Flight, methods: Sequence[Method], time: Axis) -> Blocks:
    """Return a row for each method: integers, none, no GNSS at all, or no answer."""
    edges_s = np.linspace(time.low, time.high, _CELLS + 1)
    measured_s = _measured(flight)
    rows = []
    for method in methods:
        estimate = method.estimate
        if estimate is not None and len(estimate.t_s):
            flags = _with_gaps(estimate.t_s, _flags(flight, estimate, measured_s))
            rows.append((method.name, _in_cells(*flags, edges_s), edges_s))
    title = "quality of answers: the worst of what a cell holds"
    above = key(list(zip(_FLAGS[::-1], _LABELS[::-1], strict=True)), 2.0, 104.0)
    return grid([named_strips(title, rows, _FLAGS, time, above)])


def _measured(flight: Flight) -> FloatArray:
    """Return when satellites were received, or a receiver gave a fix."""
    times: list[FloatArray] = []
    if flight.observations is not None:
        of = flight.observations
        times.append(of.t_s[np.isfinite(of.code_m).any(axis=(1, 2))])
    times += [one.t_s for one in flight.fixes]
    return np.unique(np.concatenate([np.zeros(0), *times]))


def _flags(flight: Flight, estimate: Estimate, measured_s: FloatArray) -> IntArray:
    """Return the flag of each answer, (n,)."""
    flags = np.where(_near(estimate.t_s, measured_s), 2, 1)
    integers, observations = estimate.integers, flight.observations
    if integers is not None and observations is not None:
        own, rows = common_epochs(estimate.t_s, observations.t_s)
        if len(integers.fixed) == len(observations.t_s):
            flags[own[integers.fixed[rows].any(axis=(1, 2))]] = 3
    return flags


def _with_gaps(t_s: FloatArray, flags: IntArray) -> tuple[FloatArray, IntArray]:
    """Return epochs with one more in the middle of each gap, without an answer."""
    steps_s = np.diff(t_s)
    at = np.flatnonzero(steps_s > 2 * _NEAR * np.median(steps_s)) if len(steps_s) else steps_s[:0]
    after = at.astype(np.int64) + 1
    middle_s = (t_s[after - 1] + t_s[after]) / 2
    return np.insert(t_s, after, middle_s), np.insert(flags, after, 0)


def _in_cells(t_s: FloatArray, flags: IntArray, edges_s: FloatArray) -> IntArray:
    """Return the worst flag in each cell; of a cell between two answers the nearest one's."""
    middle_s = (edges_s[:-1] + edges_s[1:]) / 2
    after = np.searchsorted(t_s, middle_s).clip(1, max(len(t_s) - 1, 1))
    nearest = np.where(
        middle_s - t_s[after - 1] < t_s[after.clip(0, len(t_s) - 1)] - middle_s,
        after - 1,
        after.clip(0, len(t_s) - 1),
    )
    kinds = np.where(_near(middle_s, t_s), flags[nearest], 0)
    cell = (np.searchsorted(edges_s, t_s, side="right") - 1).clip(0, len(middle_s) - 1)
    has = np.bincount(cell, minlength=len(middle_s)) > 0
    kinds[has] = len(_FLAGS) - 1
    np.minimum.at(kinds, cell, flags)
    return kinds


def _near(t_s: FloatArray, of_s: FloatArray) -> BoolArray:
    """Return whether times are as near to one of some epochs as these are to each other."""
    if len(of_s) < 2:
        return np.asarray(np.isin(t_s, of_s))
    usual_s = float(np.median(np.diff(of_s)))
    after = np.searchsorted(of_s, t_s).clip(1, len(of_s) - 1)
    away_s = np.minimum(np.abs(t_s - of_s[after - 1]), np.abs(t_s - of_s[after]))
    return np.asarray(away_s <= _NEAR * usual_s)
