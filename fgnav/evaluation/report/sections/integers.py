"""Integers in time: fixed, refused or float, by method, and how many links are fixed."""

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.report.blocks import NONE, Blocks, grid, table
from fgnav.evaluation.report.drawing.chart import Axis, Chart, Line, spanning
from fgnav.evaluation.report.drawing.shapes import Drawing
from fgnav.evaluation.report.drawing.strip import cells, key, named_strips
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers

_STATES = (
    "wrong",
    "float",
    "refused",
    "fixed",
)  # a cell of several epochs shows the first that occurs
_CELLS = 300
_MOST_REASONS = 40
_MOST_ARCS = 20


def integer_parts(
    flight: Flight, comparison: Comparison, marks: dict[str, str], time: Axis
) -> Blocks:
    """Return strips, diagram and tables of what became of integers; empty where none were used."""
    methods = comparison.solved
    of = list(_with_times(flight, methods))
    if not of:
        return []
    lines = [
        Line(mark=marks[name], name=name, x=t_s, y=one.fixed.sum(axis=(1, 2)).astype(float))
        for name, t_s, one in of
    ]
    y = spanning("fixed links", [np.zeros(1), *(line.y for line in lines)])
    charts = [
        _strips(of, comparison.right_integers, time),
        Chart(title="links with fixed integers", x=time, y=y, lines=lines).drawing(),
    ]
    return grid(charts) + _counts(methods) + _arcs(methods) + _reasons(of)


def _with_times(
    flight: Flight, methods: Sequence[Method]
) -> Iterator[tuple[str, FloatArray, Integers]]:
    """Yield each method's integers and their epochs, those of the observations."""
    if flight.observations is None:
        return
    t_s = flight.observations.t_s
    for method in methods:
        integers = None if method.estimate is None else method.estimate.integers
        if integers is not None and len(integers.cycles) == len(t_s):
            yield method.name, t_s, integers


def _strips(
    of: list[tuple[str, FloatArray, Integers]], right: Integers | None, time: Axis
) -> Drawing:
    """Return a row for each method, coloured by what became of the epochs."""
    shown = _STATES if right is not None else _STATES[1:]
    rows = []
    for name, t_s, integers in of:
        outcome = np.array([_STATES.index(state) for state in integers.outcome])
        if right is not None and right.fixed.shape == integers.fixed.shape:
            judged = integers.fixed & right.fixed
            is_wrong = (judged & (integers.cycles != right.cycles)).any(axis=(1, 2))
            outcome[is_wrong] = _STATES.index("wrong")
        starts = cells(len(t_s), _CELLS)
        worst = np.minimum.reduceat(outcome, starts)
        rows.append((name, worst, np.append(t_s[starts], t_s[-1])))
    title = "epochs by their integers: the worst of what a cell holds"
    above = key([(state, state) for state in reversed(shown)], 2.0, 90.0)
    return named_strips(title, rows, _STATES, time, above)


def _counts(methods: Sequence[Method]) -> Blocks:
    """Return a table of links: right, wrong, open."""
    rows = []
    for method in methods:
        counts = method.score.integers
        if counts is None:
            continue
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
    if not stated:
        return []
    mean = np.mean([wrong for wrong, _, _ in stated])
    stated.sort(key=lambda row: -row[0])
    rows = [
        [name, one.link, f"{one.from_s:.2f}", f"{one.until_s:.2f}", f"{wrong:.2g}", one.by]
        for wrong, name, one in stated[:_MOST_ARCS]
    ]
    title = f"arcs by the chance that their integer is wrong, of {len(stated)}; mean {mean:.2g}"
    return table(["method", "link", "from, s", "until, s", "chance", "by"], rows, title)


def _reasons(of: list[tuple[str, FloatArray, Integers]]) -> Blocks:
    """Return why epochs are not fixed, most frequent first."""
    counted = Counter(
        (name, reason) for name, _, integers in of for reason in integers.reasons or () if reason
    )
    rows = [[name, reason, str(n)] for (name, reason), n in counted.most_common(_MOST_REASONS)]
    return table(["method", "why an epoch is not fixed, or lacks links", "epochs"], rows)
