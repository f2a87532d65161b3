"""Epoch by epoch: what became of the integers."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.checks import IntArray
from fgnav.evaluation.comparison import Comparison, Method
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
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers

# From the worst: a cell of several epochs shows the first that occurs.
_OUTCOMES = {"wrong": WRONG, "float": POOR, "refused": FAIR, "fixed": GOOD}
_WORST = ": the worst of what a cell holds"
_CELLS = 300
_MOST_ARCS = 20


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
        ("links with fixed integers", "links", Line(n, t_s, integers.fixed.sum(axis=(1, 2)) * 1.0))
        for n, integers in of.items()
    )
    states = cells_chart(f"epochs by their integers{_WORST}", rows, edges_s, _OUTCOMES, time)
    charts = grid([states, *time_charts(series, time, spanning)])
    return charts + _counts(comparison.solved) + _arcs(comparison.solved) + _reasons(of)


def _integers(flight: Flight, methods: Sequence[Method]) -> Iterator[tuple[str, Integers]]:
    """Yield each method's integers, those at the epochs of the observations."""
    epochs = -1 if flight.observations is None else len(flight.observations.t_s)
    for method in methods:
        integers = method.solution.integers
        if integers is not None and len(integers.cycles) == epochs:
            yield method.name, integers


def _outcomes(integers: Integers, right: Integers | None) -> IntArray:
    """Return the place in ``_OUTCOMES`` of each epoch; wrong ones are known by the truth alone."""
    outcome: IntArray = np.array([list(_OUTCOMES).index(state) for state in integers.outcome])
    if right is not None and right.fixed.shape == integers.fixed.shape:
        comparable = integers.fixed & right.fixed
        outcome[(comparable & (integers.cycles != right.cycles)).any(axis=(1, 2))] = 0
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
    arcs = [
        (arc.wrong_probability, method.name, arc)
        for method in methods
        for arc in method.arcs
        if arc.wrong_probability is not None
    ]
    arcs.sort(key=lambda row: -row[0])
    rows = [
        [name, arc.link, f"{arc.from_s:.2f}", f"{arc.until_s:.2f}", f"{wrong:.2g}", arc.by]
        for wrong, name, arc in arcs
    ]
    mean = sum(wrong for wrong, _, _ in arcs) / max(len(arcs), 1)
    title = f"arcs by the chance that their integer is wrong, of {len(arcs)}; mean {mean:.2g}"
    heads = ["method", "link", "from, s", "until, s", "chance", "by"]
    return table(heads, rows, title, most=_MOST_ARCS)


def _reasons(of: dict[str, Integers]) -> Blocks:
    """Return why epochs are not fixed, most frequent first."""
    counted = Counter(
        (name, reason)
        for name, integers in of.items()
        for reason in integers.reasons or ()
        if reason
    )
    rows = [[name, reason, str(n)] for (name, reason), n in counted.most_common()]
    return table(["method", "why an epoch is not fixed, or lacks links", "epochs"], rows)
