"""Epoch by epoch: of what quality answers are, and what became of the integers."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.reference import common_epochs
from fgnav.evaluation.report.charts import (
    FAIR,
    GOOD,
    POOR,
    WRONG,
    Line,
    Span,
    cells_chart,
    cells_of,
    spanning,
    time_charts,
)
from fgnav.evaluation.report.parts import NONE, Blocks, grid, table
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers

# From the worst: a cell of several epochs shows the first that occurs.
_QUALITY = {"no answer": WRONG, "no GNSS": POOR, "no integers": FAIR, "integers fixed": GOOD}
_OUTCOMES = {"wrong": WRONG, "float": POOR, "refused": FAIR, "fixed": GOOD}
_WORST = ": the worst of what a cell holds"
_CELLS = 300
_MOST_ARCS = 20
_NEAR = 0.75  # usual intervals: epochs that follow each other have none further away than a half


def quality_strips(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return a row for each method: integers, none, no GNSS at all, or no answer."""
    edges_s = np.linspace(*time, _CELLS + 1)
    rows = {
        method.name: _worst(method.estimate.t_s, _flags(flight, method.estimate), edges_s)
        for method in methods
        if method.estimate is not None and len(method.estimate.t_s)
    }
    title = f"quality of answers{_WORST}"
    return grid([cells_chart(title, rows, edges_s, _QUALITY, time)] if rows else [])


def _flags(flight: Flight, estimate: Estimate) -> IntArray:
    """Return the place in ``_QUALITY`` of each answer, (n,)."""
    times = [np.zeros(0), *(one.t_s for one in flight.fixes)]
    observations, integers = flight.observations, estimate.integers
    if observations is not None:
        times.append(observations.t_s[np.isfinite(observations.code_m).any(axis=(1, 2))])
    flags: IntArray = np.where(_near(estimate.t_s, np.unique(np.concatenate(times))), 2, 1)
    if integers is not None and observations is not None:
        answers, rows = common_epochs(estimate.t_s, observations.t_s)
        if len(integers.fixed) == len(observations.t_s):
            flags[answers[integers.fixed[rows].any(axis=(1, 2))]] = 3
    return flags


def _worst(t_s: FloatArray, flags: IntArray, edges_s: FloatArray) -> IntArray:
    """Return the worst flag in each cell, 0 where answers are missing; the nearest of none."""
    usual_s = float(np.median(np.diff(t_s))) if len(t_s) > 1 else float(np.diff(edges_s)[0])
    expected_s = np.arange(edges_s[0], edges_s[-1], usual_s)
    missing_s = expected_s[~_near(expected_s, t_s)]
    times_s = np.concatenate([t_s, missing_s])
    order = np.argsort(times_s)
    kinds = np.concatenate([flags, np.zeros(len(missing_s), np.int64)])[order]
    times_s, middle_s = times_s[order], (edges_s[:-1] + edges_s[1:]) / 2
    nearest = np.rint(np.interp(middle_s, times_s, np.arange(len(times_s))))
    worst: IntArray = kinds[nearest.astype(np.int64)]
    cell = (np.searchsorted(edges_s, times_s, side="right") - 1).clip(0, len(worst) - 1)
    worst[np.unique(cell)] = len(_QUALITY) - 1
    np.minimum.at(worst, cell, kinds)
    return worst


def _near(t_s: FloatArray, of_s: FloatArray) -> BoolArray:
    """Return whether times are as near to one of some epochs as these are to each other."""
    if len(of_s) < 2:
        return np.asarray(np.isin(t_s, of_s))
    after = np.searchsorted(of_s, t_s).clip(1, len(of_s) - 1)
    away_s = np.minimum(np.abs(t_s - of_s[after - 1]), np.abs(t_s - of_s[after]))
    return np.asarray(away_s <= _NEAR * np.median(np.diff(of_s)))


def integer_blocks(flight: Flight, comparison: Comparison, time: Span) -> Blocks:
    """Return strips, a chart and tables of what became of integers; empty where none were used."""
    of = dict(_integers(flight, comparison.solved))
    if flight.observations is None or not of:
        return []
    t_s = flight.observations.t_s
    starts, edges_s = cells_of(t_s, _CELLS)
    rows = {
        name: np.minimum.reduceat(_outcomes(integers, comparison.right_integers), starts)
        for name, integers in of.items()
    }
    series = (
        ("links with fixed integers", "links", Line(n, t_s, one.fixed.sum(axis=(1, 2)) * 1.0))
        for n, one in of.items()
    )
    states = cells_chart(f"epochs by their integers{_WORST}", rows, edges_s, _OUTCOMES, time)
    charts = grid([states, *time_charts(series, time, spanning)])
    return charts + _counts(comparison.solved) + _arcs(comparison.solved) + _reasons(of)


def _integers(flight: Flight, methods: Sequence[Method]) -> Iterator[tuple[str, Integers]]:
    """Yield each method's integers, those at the epochs of the observations."""
    epochs = -1 if flight.observations is None else len(flight.observations.t_s)
    for method in methods:
        integers = None if method.estimate is None else method.estimate.integers
        if integers is not None and len(integers.cycles) == epochs:
            yield method.name, integers


def _outcomes(integers: Integers, right: Integers | None) -> IntArray:
    """Return the place in ``_OUTCOMES`` of each epoch; wrong ones are known by the truth alone."""
    outcome: IntArray = np.array([list(_OUTCOMES).index(state) for state in integers.outcome])
    if right is not None and right.fixed.shape == integers.fixed.shape:
        judged = integers.fixed & right.fixed
        outcome[(judged & (integers.cycles != right.cycles)).any(axis=(1, 2))] = 0
    return outcome


def _counts(methods: Sequence[Method]) -> Blocks:
    """Return a table of links: right, wrong, open."""
    rows = []
    for method in methods:
        counts = method.score.integers
        if counts is not None:
            right, wrong = (NONE if n is None else str(n) for n in (counts.right, counts.wrong))
            rows.append([method.name, str(counts.fixed), right, wrong, str(counts.not_fixed)])
    return table(["method", "fixed", "right", "wrong", "not fixed"], rows, "links, over all epochs")


def _arcs(methods: Sequence[Method]) -> Blocks:
    """Return the integers of arcs that are least sure, with their chance of being wrong."""
    stated = [
        (one.wrong_probability, method.name, one)
        for method in methods
        for one in method.arcs
        if one.wrong_probability is not None
    ]
    stated.sort(key=lambda row: -row[0])
    rows = [
        [name, one.link, f"{one.from_s:.2f}", f"{one.until_s:.2f}", f"{wrong:.2g}", one.by]
        for wrong, name, one in stated
    ]
    mean = sum(wrong for wrong, _, _ in stated) / max(len(stated), 1)
    title = f"arcs by the chance that their integer is wrong, of {len(stated)}; mean {mean:.2g}"
    heads = ["method", "link", "from, s", "until, s", "chance", "by"]
    return table(heads, rows, title, most=_MOST_ARCS)


def _reasons(of: dict[str, Integers]) -> Blocks:
    """Return why epochs are not fixed, most frequent first."""
    counted = Counter(
        (name, reason) for name, one in of.items() for reason in one.reasons or () if reason
    )
    rows = [[name, reason, str(n)] for (name, reason), n in counted.most_common()]
    return table(["method", "why an epoch is not fixed, or lacks links", "epochs"], rows)
