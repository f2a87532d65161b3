"""Report of a campaign: each figure with its interval, each method against one."""

from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from fgnav.campaign.fly import Record
from fgnav.campaign.order import Order
from fgnav.checks import FloatArray
from fgnav.evaluation.figures import FIGURES
from fgnav.evaluation.flights import BOOTSTRAP_SEED
from fgnav.evaluation.paired import Interval, paired, pooled
from fgnav.evaluation.report.charts import Chart, Line
from fgnav.evaluation.report.parts import (
    Blocks,
    Report,
    grid,
    interval,
    paragraph,
    report,
    significant,
)
from fgnav.evaluation.report.parts import table as tabulated
from fgnav.evaluation.report.save import write
from fgnav.evaluation.report.text import text_lines
from fgnav.evaluation.scores import EULER, finite_mean
from fgnav.io.atomic_write import write_text

REPORT, PAGE = "report.txt", "report.html"
_MATCHED = "matched_attitude_rmse_deg"
_SUMMARY = (
    *("attitude_rmse_deg", "position_rmse_m", "velocity_rmse_mps", "attitude_nees"),
    *("attitude_nll", "attitude_energy_score_deg", "integers_wrong"),
)
_WIDTH = 400  # letters of a table


class Table:
    """Figures of a campaign by case: arrays of (flights, columns, methods, figures).

    Columns of a sweep share their random draws, flight by flight: intervals and tests are by
    flight number, over all columns of which a flight is averaged first. NaN where a flight has not
    been flown, or the method had no answer.
    """

    def __init__(self, order: Order, records: Iterable[Record]) -> None:
        cases, self._methods = [case.title for case in order.case], order.titles
        size = len(self._methods), len(FIGURES)
        self._of = [np.full((order.flights, c.columns, *size), np.nan) for c in order.case]
        self.flown = [0] * len(cases)
        for record in records:
            case = cases.index(record["case"])
            self.flown[case] += 1
            for m, method in enumerate(self._methods):
                figures = record["methods"].get(method, {}).get("figures", {})
                figures_of = self._of[case][record["flight"], record["column"], m]
                figures_of[:] = [figures.get(name) for name in FIGURES]

    def figure(self, name: str, method: str, case: int) -> FloatArray:
        """Return a figure of each flight and column of a case, (flights, columns)."""
        return self._of[case][..., self._methods.index(method), list(FIGURES).index(name)]


def write_report(order: Order, records: Iterable[Record], out: Path) -> tuple[str, Report]:
    """Write the report as text and as a page; return both.

    A summary of each case, then tables of what was swept, as papers print them.
    """
    table = Table(order, records)
    groups = _swept_alike(order)
    head = paragraph(_head(order, sum(table.flown)))
    parts = [("summary", "Summary", head + _summaries(order, table))]
    for number, cases in enumerate(groups):
        swept, tables, charts = _sweep(order, table, cases)
        parts.append((f"sweep-{number}", f"By {swept}", grid(charts) + tables))
    page = report(f"Campaign {order.name}", order.titles, parts)
    lines = [line for section in page.parts for line in ["", *text_lines(section.blocks, _WIDTH)]]
    text = "\n".join([*lines[1:], ""])
    write_text(out / REPORT, text)
    write(page, out / PAGE)
    return text, page


def _summaries(order: Order, table: Table) -> Blocks:
    """Return a table of each case."""
    heads = [
        "method",
        "answered",
        *(FIGURES[name].head or name.replace("_", " ") for name in _SUMMARY),
    ]
    heads += [f"ratio to {order.reference}", "of one only"]
    return [
        block
        for number, case in enumerate(order.case)
        for block in tabulated(heads, _summary(order, table, number), case.title)
    ]


def _head(order: Order, count: int) -> str:
    return (
        f"Campaign {order.name}: {count} of {order.count} flights, root seed {order.seed}. Figures "
        "over flights with intervals of 95 % by bootstrap of flights; ratios of RMSE to "
        f"{order.reference!r} on the epochs that all methods answer; * where interval and "
        "signed-rank test exclude 1. Values of a sweep share their random numbers: the flight, "
        "over all of them, is the unit."
    )


def _summary(order: Order, table: Table, number: int) -> Iterator[list[str]]:
    """Yield a row for each method of a case."""
    rng = np.random.default_rng([BOOTSTRAP_SEED, number])
    baseline = table.figure(_MATCHED, order.reference, number)
    for title in order.titles:
        answered = np.nansum(table.figure("available", title, number))
        share = 100 * float(answered) / max(table.flown[number], 1)
        cells = [
            interval(_pooled(table.figure(name, title, number), rng, squared=FIGURES[name].is_rms))
            for name in _SUMMARY
        ]
        ratio = unpaired = ""
        if title != order.reference:
            errors = table.figure(_MATCHED, title, number)
            both = np.isfinite(errors) & np.isfinite(baseline)
            first, second = (np.where(both, values, np.nan) for values in (errors, baseline))
            held = paired(_root_mean(first), _root_mean(second), rng)
            ratio = interval(held.ratio) + ("*" if held.is_significant else "")
            only = int((np.isfinite(errors) ^ np.isfinite(baseline)).sum())
            unpaired = f"{only} flights" if only else ""
        yield [title, f"{share:.1f} %", *cells, ratio, unpaired]


def _swept_alike(order: Order) -> list[list[int]]:
    """Return the numbers of cases that sweep the same values under one condition, together."""
    groups: dict[tuple[str, str, tuple[float, ...]], list[int]] = {}
    for number, case in enumerate(order.case):
        if case.sweep is not None:
            key = (case.condition, case.sweep.name, case.sweep.values)
            groups.setdefault(key, []).append(number)
    return list(groups.values())


def _sweep(order: Order, table: Table, cases: list[int]) -> tuple[str, Blocks, list[Chart]]:
    """Return the name of the sweep, a table for each angle, and their charts.

    A row for each method and case, then their average; last what methods amount to over all
    angles, values and cases.
    """
    sweep = order.case[cases[0]].sweep
    values = () if sweep is None else sweep.values
    swept = ", ".join(filter(None, (sweep.name if sweep else "", order.case[cases[0]].condition)))
    names = [order.case[number].name for number in cases]
    heads = ["method", "case", *(f"{value:g}" for value in values), "mean"]
    tables: Blocks = []
    charts = []
    for angle in EULER:
        rows: list[list[str]] = []
        lines: defaultdict[str, list[Line]] = defaultdict(list)
        for title in order.titles:
            by_case = [
                _root_mean(table.figure(f"{angle}_rmse_deg", title, number).T) for number in cases
            ]
            average = [("average", np.mean(by_case, axis=0))] if len(cases) > 1 else []
            for label, errors in [*zip(names, by_case, strict=True), *average]:
                cells = [significant(v) for v in (*errors, float(errors.mean()))]
                rows.append([title, label, *cells])
                line = Line(title, np.array(values), errors)
                lines[f"{angle}, {label}"].append(line)
        tables += tabulated(heads, rows, f"{angle}, RMSE in degrees by {swept}")
        charts += [Chart(title, "RMSE, deg", of, swept, log="y") for title, of in lines.items()]
    caption = "mean RMSE over angles, values and cases, deg; its ratio"
    tables += tabulated(["method", "mean, deg", "ratio"], _overall(order, table, cases), caption)
    return swept, tables, charts


def _overall(order: Order, table: Table, cases: list[int]) -> Iterator[list[str]]:
    """Yield for each method the mean RMSE over angles, values and cases, and its ratio."""

    def means(title: str) -> FloatArray:
        figures = [
            table.figure(f"{angle}_rmse_deg", title, number) for angle in EULER for number in cases
        ]
        return np.asarray(np.concatenate(figures, axis=1).mean(axis=1))  # NaN where one is missing

    rng = np.random.default_rng([BOOTSTRAP_SEED, *cases])
    baseline = means(order.reference)
    for title in order.titles:
        errors = means(title)
        held = paired(errors, baseline, rng)
        ratio = "" if title == order.reference else interval(held.ratio)
        mark = "*" if ratio and held.is_significant else ""
        yield [title, interval(pooled(errors, rng, squared=False)), ratio + mark]


def _pooled(values: FloatArray, rng: np.random.Generator, *, squared: bool) -> Interval:
    """Return a figure over flights, (flights, columns), each flight averaged first."""
    by_flight = _root_mean(values) if squared else finite_mean(values, -1)
    return pooled(by_flight, rng, squared=squared)


def _root_mean(values: FloatArray) -> FloatArray:
    """Return the root mean square over the last axis; NaN of nothing."""
    return np.asarray(np.sqrt(finite_mean(values**2, -1)))
