"""What a campaign amounts to, as text: each figure with its interval, each method against one."""

from array import array
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from fgnav.campaign.fly import Record
from fgnav.campaign.order import CaseTable, Order
from fgnav.checks import FloatArray
from fgnav.evaluation.figures import FIGURES
from fgnav.evaluation.paired import Interval, paired, pooled
from fgnav.evaluation.scores import EULER
from fgnav.io.atomic_write import write_text

REPORT = "report.txt"
_WHOLE = "attitude_rmse_deg"
_MATCHED = "matched_attitude_rmse_deg"
# Column heading, figure, whether it is a root mean square.
_SUMMARY = (
    ("attitude deg", _WHOLE, True),
    ("position m", "position_rmse_m", True),
    ("velocity m/s", "velocity_rmse_mps", True),
    ("NEES of 3", "attitude_nees", False),
    ("NLL", "attitude_nll", False),
    ("energy deg", "attitude_energy_score_deg", False),
)
_RESAMPLED = 0x5EED  # intervals are the same whenever the flights are


class Table:
    """Figures of a campaign by case, column, flight and method: 8 bytes each, no more.

    Columns of a sweep share their random draws, flight by flight: intervals and tests are by
    flight number, over all columns of which a flight is averaged first.

    Parameters
    ----------
    order : Order
    records : iterable of Record
    """

    def __init__(self, order: Order, records: Iterable[Record]) -> None:
        self._methods = order.titles
        self._columns = [case.columns for case in order.case]
        cases = [case.name for case in order.case]
        flat: dict[tuple[int, int], array[float]] = {}
        flights: dict[tuple[int, int], array[int]] = {}
        for record in records:
            key = (cases.index(record["case"]), record["column"])
            own = flat.setdefault(key, array("d"))
            flights.setdefault(key, array("q")).append(record["flight"])
            for method in self._methods:
                figures = record["methods"].get(method, {}).get("figures", {})
                values = (figures.get(name) for name in FIGURES)
                own.extend(np.nan if value is None else value for value in values)
        shape = (-1, len(self._methods), len(FIGURES))
        self._of = {key: np.array(flat[key]).reshape(shape) for key in sorted(flat)}
        self._flights = {key: np.array(flights[key]) for key in self._of}

    def __len__(self) -> int:
        """Return the number of records."""
        return sum(map(len, self._of.values()))

    def flown(self, case: int) -> int:
        """Return the number of records of a case."""
        return sum(len(v) for (c, _), v in self._flights.items() if c == case)

    def figure(self, name: str, method: str, case: int) -> FloatArray:
        """Return a figure of each flight and column of a case, (flights, columns).

        NaN where a flight has not been flown, or the method had no answer.
        """
        m, k = self._methods.index(method), FIGURES.index(name)
        own = {column: v for (c, column), v in self._flights.items() if c == case}
        numbers = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *own.values()]))
        values = np.full((len(numbers), self._columns[case]), np.nan)
        for column, flights in own.items():
            rows = np.searchsorted(numbers, flights)
            values[rows, column] = self._of[case, column][:, m, k]
        return values


def write_report(order: Order, records: Iterable[Record], out: Path) -> str:
    """Write and return the report: a summary of each case, then tables of what was swept."""
    table = Table(order, records)
    text = "\n".join(_lines(order, table, len(table))) + "\n"
    write_text(out / REPORT, text)
    return text


def _lines(order: Order, table: Table, count: int) -> Iterator[str]:
    asked = order.flights * sum(case.columns for case in order.case)
    yield f"Campaign {order.name}: {count} of {asked} flights, root seed {order.seed}."
    yield (
        "Figures over flights with intervals of 95 % by bootstrap of flights; ratios of RMSE to "
        f"{order.reference!r}"
    )
    yield (
        "on the epochs that all methods answer; * where interval and signed-rank test exclude 1. "
        "Values of a"
    )
    yield "sweep share their random numbers: the flight, over all of them, is the unit."
    for number, case in enumerate(order.case):
        yield ""
        yield from _summary(order, table, number, case)
    for cases in _swept_alike(order):
        yield ""
        yield from _swept(order, table, cases)


def _summary(order: Order, table: Table, number: int, case: CaseTable) -> Iterator[str]:
    """Yield a line for each method of a case."""
    rng = np.random.default_rng([_RESAMPLED, number])
    width = max(len("method"), *map(len, order.titles))
    yield f"{case.name}"
    heads = "".join(f"  {head:>22}" for head, _, _ in _SUMMARY)
    yield f"  {'method':<{width}}  answered{heads}  {'ratio':>24}"
    baseline = table.figure(_MATCHED, order.reference, number)
    for title in order.titles:
        answered = np.nansum(table.figure("available", title, number))
        share = 100 * float(answered) / max(table.flown(number), 1)
        cells = "".join(
            f"  {_cell(_pooled(table.figure(name, title, number), rng, squared=squared)):>22}"
            for _, name, squared in _SUMMARY
        )
        line = f"  {title:<{width}}  {share:>6.1f} %{cells}"
        if title != order.reference:
            own = table.figure(_MATCHED, title, number)
            both = np.isfinite(own) & np.isfinite(baseline)
            first, second = (np.where(both, values, np.nan) for values in (own, baseline))
            held = paired(_root_mean(first), _root_mean(second), rng)
            line += f"  {_cell(held.ratio) + ('*' if held.is_significant else ' '):>24}"
            if unpaired := int((np.isfinite(own) ^ np.isfinite(baseline)).sum()):
                line += f"  ({unpaired} flights of one only)"
        yield line.rstrip()


def _swept_alike(order: Order) -> list[list[int]]:
    """Return the numbers of cases that sweep the same values of the same thing, together."""
    groups: dict[tuple[str, tuple[float, ...]], list[int]] = {}
    for number, case in enumerate(order.case):
        if case.sweep is not None:
            groups.setdefault((case.sweep.name, case.sweep.values), []).append(number)
    return list(groups.values())


def _swept(order: Order, table: Table, cases: list[int]) -> Iterator[str]:
    """Yield a table for each angle, swept values from left to right, as papers print them.

    A row for each method and case, then their average; last what methods amount to over all
    angles, values and cases.
    """
    sweep = order.case[cases[0]].sweep
    if sweep is None:
        return
    names = [order.case[number].name for number in cases]
    rows = [*names, "average"] if len(cases) > 1 else names
    width = max(map(len, order.titles))
    label = max(map(len, rows))
    values = "".join(f"{value:>9g}" for value in sweep.values)
    for angle in EULER:
        yield f"{angle}, RMSE in degrees by {sweep.name}"
        yield f"  {'':<{width}}  {'':<{label}}{values}{'mean':>9}"
        for title in order.titles:
            by_case = [
                _root_mean(table.figure(f"{angle}_rmse_deg", title, number).T) for number in cases
            ]
            lines = [*by_case, np.mean(by_case, axis=0)][: len(rows)]
            for k, (name, by_column) in enumerate(zip(rows, lines, strict=True)):
                cells = "".join(f"{_number(v):>9}" for v in (*by_column, float(by_column.mean())))
                yield f"  {'' if k else title:<{width}}  {name:<{label}}{cells}"
    yield from _overall(order, table, cases, width)


def _overall(order: Order, table: Table, cases: list[int], width: int) -> Iterator[str]:
    """Yield for each method the mean RMSE over angles, values and cases, and its ratio."""

    def means(title: str) -> FloatArray:
        figures = [
            table.figure(f"{angle}_rmse_deg", title, number) for angle in EULER for number in cases
        ]
        return np.asarray(np.concatenate(figures, axis=1).mean(axis=1))  # NaN where one is missing

    rng = np.random.default_rng([_RESAMPLED, *cases])
    if len({len(table.figure(_WHOLE, order.reference, number)) for number in cases}) > 1:
        return  # flights of one of them are still to come
    yield "mean RMSE over angles, values and cases, deg; its ratio"
    baseline = means(order.reference)
    for title in order.titles:
        own = means(title)
        held = paired(own, baseline, rng)
        ratio = "" if title == order.reference else _cell(held.ratio)
        mark = "*" if ratio and held.is_significant else ""
        mean = _cell(pooled(own, rng, squared=False))
        yield f"  {title:<{width}}  {mean:>24}  {ratio + mark:>25}".rstrip()


def _pooled(values: FloatArray, rng: np.random.Generator, *, squared: bool) -> Interval:
    """Return a figure over flights, (flights, columns), each flight averaged first."""
    by_flight = _root_mean(values) if squared else _mean(values)
    return pooled(by_flight, rng, squared=squared)


def _root_mean(values: FloatArray) -> FloatArray:
    """Return the root mean square over the last axis; NaN of nothing."""
    return np.asarray(np.sqrt(_mean(values**2)))


def _mean(values: FloatArray) -> FloatArray:
    """Return the mean of what is finite over the last axis; NaN of nothing."""
    known = np.isfinite(values)
    count = known.sum(axis=-1)
    total = np.where(known, values, 0.0).sum(axis=-1)
    return np.asarray(np.where(count > 0, total / np.maximum(count, 1), np.nan))


def _cell(of: Interval) -> str:
    if not np.isfinite(of.value):
        return "–"
    if not np.isfinite([of.low, of.high]).all():
        return _number(of.value)
    return f"{_number(of.value)} [{_number(of.low)}, {_number(of.high)}]"


def _number(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{value:.3g}"
