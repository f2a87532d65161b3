"""Integers in time: fixed, refused or float, by method, and how many links are fixed."""

from collections import Counter
from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Comparison, Method
from fgnav.evaluation.report.html.drawing.chart import Axis, Chart, Line, figure, spanning
from fgnav.evaluation.report.html.drawing.markup import NONE, grid, table
from fgnav.evaluation.report.html.drawing.strip import LEFT, WIDE, cells, strip, time_ticks
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers

_STATES = (
    "wrong",
    "float",
    "refused",
    "fixed",
)  # a cell of several epochs shows the first that occurs
_CELLS = 300
_TOP, _ROW = 20.0, 30.0
_MOST_REASONS = 40


def integer_parts(flight: Flight, comparison: Comparison, marks: dict[str, str], time: Axis) -> str:
    """Return strips, diagram and tables of what became of integers; empty where none were used."""
    methods = comparison.solved
    of = list(_with_times(flight, methods))
    if not of:
        return ""
    lines = [
        Line(mark=marks[name], name=name, x=t_s, y=one.fixed.sum(axis=(1, 2)).astype(float))
        for name, t_s, one in of
    ]
    y = spanning("fixed links", [np.zeros(1), *(line.y for line in lines)])
    charts = [
        _strips(of, comparison.right_integers, time),
        str(Chart(title="links with fixed integers", x=time, y=y, lines=lines)),
    ]
    return grid(charts) + _counts(methods) + _reasons(of)


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


def _strips(of: list[tuple[str, FloatArray, Integers]], right: Integers | None, time: Axis) -> str:
    """Return a row for each method, coloured by what became of the epochs."""
    parts = [
        f'<path class="fill {state}" d="M{LEFT + 90 * k} 2h10v10h-10z"/>'
        f'<text x="{LEFT + 90 * k + 14}" y="11">{state}</text>'
        for k, state in enumerate(reversed(_STATES if right is not None else _STATES[1:]))
    ]
    for row, (name, t_s, integers) in enumerate(of):
        top = _TOP + _ROW * row
        outcome = np.array([_STATES.index(state) for state in integers.outcome])
        if right is not None and right.fixed.shape == integers.fixed.shape:
            judged = integers.fixed & right.fixed
            is_wrong = (judged & (integers.cycles != right.cycles)).any(axis=(1, 2))
            outcome[is_wrong] = _STATES.index("wrong")
        starts = cells(len(t_s), _CELLS)
        worst = np.minimum.reduceat(outcome, starts)
        parts.append(f'<text x="{LEFT}" y="{top + 10}">{escape(name)}</text>')
        at_s = np.append(t_s[starts], t_s[-1])
        parts.append(strip(worst, at_s, _STATES, time, (top + 20, 12.0)))
    bottom = _TOP + _ROW * len(of)
    parts.append(time_ticks(time, bottom + 14))
    title = "epochs by their integers: the worst of what a cell holds"
    return figure(title, "".join(parts), WIDE, bottom + 34)


def _counts(methods: Sequence[Method]) -> str:
    """Return a table of links: right, wrong, open."""
    rows = []
    for method in methods:
        counts = method.score.integers
        if counts is None:
            continue
        right, wrong = (NONE if n is None else str(n) for n in (counts.right, counts.wrong))
        rows.append([method.name, str(counts.fixed), right, wrong, str(counts.not_fixed)])
    return table(["method", "fixed", "right", "wrong", "not fixed"], rows, "links, over all epochs")


def _reasons(of: list[tuple[str, FloatArray, Integers]]) -> str:
    """Return why epochs are not fixed, most frequent first."""
    counted = Counter(
        (name, reason) for name, _, integers in of for reason in integers.reasons or () if reason
    )
    rows = [[name, reason, str(n)] for (name, reason), n in counted.most_common(_MOST_REASONS)]
    return table(["method", "why an epoch is not fixed, or lacks links", "epochs"], rows)
