"""What a campaign amounts to, as a report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fgnav.campaign.order import Order
from fgnav.checks import FloatArray
from fgnav.evaluation.report.blocks import Blocks, Part, Report, grid, paragraph, table
from fgnav.evaluation.report.drawing.chart import Chart, Line, decades, log10, nested, spanning
from fgnav.evaluation.report.palette import method_marks

Rows = tuple[list[str], list[list[str]]]  # headings, and cells below them


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sweep:
    """What a sweep amounts to."""

    name: str
    values: FloatArray  # (c,)
    tables: Mapping[str, Rows]  # by caption
    # by angle, case and method: RMSE of each value, degrees, (c,)
    curves: Mapping[tuple[str, str, str], FloatArray]


def campaign_report(
    order: Order, head: Sequence[str], summaries: Mapping[str, Rows], sweeps: Sequence[Sweep]
) -> Report:
    """Return the report of a campaign: a summary of each case, then what was swept."""
    first = [block for name, rows in summaries.items() for block in table(*rows, name)]
    parts = [Part(name="summary", title="Summary", blocks=paragraph(" ".join(head)) + first)]
    for number, sweep in enumerate(sweeps):
        tables = [block for name, rows in sweep.tables.items() for block in table(*rows, name)]
        blocks = _charts(order, sweep) + tables
        parts.append(Part(name=f"sweep-{number}", title=f"By {sweep.name}", blocks=blocks))
    return Report(title=f"Campaign {order.name}", methods=order.titles, parts=parts)


def _charts(order: Order, sweep: Sweep) -> Blocks:
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
                y=log10(sweep.curves[angle, case, title]),
                as_is=True,
                width=width,
            )
            for title, width in zip(
                order.titles, nested(len(order.titles), 6.0, 1.2).tolist(), strict=True
            )
        ]
        y = decades("RMSE, deg", [line.y for line in lines])
        charts.append(Chart(title=f"{angle}, {case}", x=x, y=y, lines=lines).drawing())
    return grid(charts)
