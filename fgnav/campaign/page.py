"""What a campaign amounts to, as one page of HTML that needs no network."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fgnav.campaign.order import Order
from fgnav.checks import FloatArray
from fgnav.evaluation.report.html.drawing.chart import Axis, Chart, Line, nested, spanning
from fgnav.evaluation.report.html.drawing.markup import grid, paragraph, table
from fgnav.evaluation.report.html.page import method_marks, page
from fgnav.io.atomic_write import write_text

Rows = tuple[list[str], list[list[str]]]  # headings, and cells below them


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sweep:
    """What a sweep amounts to.

    Attributes
    ----------
    name : str
    values : ndarray, shape (c,)
    tables : mapping of str to Rows
        By caption.
    curves : mapping
        By angle, case and method: RMSE of each value, degrees, (c,).
    """

    name: str
    values: FloatArray
    tables: Mapping[str, Rows]
    curves: Mapping[tuple[str, str, str], FloatArray]


def write_page(
    path: Path,
    order: Order,
    head: Sequence[str],
    summaries: Mapping[str, Rows],
    sweeps: Sequence[Sweep],
) -> None:
    """Write the tables of a report, and errors by what was swept, whole or not at all."""
    first = "".join(table(*rows, name) for name, rows in summaries.items())
    sections = {"summary": ("Summary", paragraph(" ".join(head)) + first)}
    for number, sweep in enumerate(sweeps):
        tables = "".join(table(*rows, name) for name, rows in sweep.tables.items())
        sections[f"sweep-{number}"] = (f"By {sweep.name}", _charts(order, sweep) + tables)
    write_text(path, page(f"Campaign {order.name}", order.titles, sections))


def _charts(order: Order, sweep: Sweep) -> str:
    """Return a diagram for each angle and case: the logarithm of errors by what was swept."""
    marks = method_marks(order.titles)
    x = spanning(sweep.name, [sweep.values])
    charts = []
    for angle, case in dict.fromkeys((angle, case) for angle, case, _ in sweep.curves):
        lines = [
            Line(
                mark=marks[title],
                name=title,
                x=sweep.values,
                y=_log10(sweep.curves[angle, case, title]),
                as_is=True,
                width=width,
            )
            for title, width in zip(
                order.titles, nested(len(order.titles), 6.0, 1.2).tolist(), strict=True
            )
        ]
        y = spanning("RMSE, deg", [line.y for line in lines])
        y = Axis(name=y.name, low=np.floor(y.low), high=np.ceil(y.high), log=True)
        charts.append(str(Chart(title=f"{angle}, {case}", x=x, y=y, lines=lines)))
    return grid(charts)


def _log10(values: FloatArray) -> FloatArray:
    return np.asarray(np.log10(np.where(values > 0, values, np.nan)))
