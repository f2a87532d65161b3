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

    Parameters
    ----------
    order : Order
    records : iterable of Record
    """

    def __init__(self, order: Order, records: Iterable[Record]) -> None:
        self._methods = order.titles
        cases = [case.name for case in order.case]
        flat: dict[tuple[int, int], array[float]] = {}
        for record in records:
            key = (cases.index(record["case"]), record["column"])
            own = flat.setdefault(key, array("d"))
            for method in self._methods:
                figures = record["methods"].get(method, {}).get("figures", {})
                values = (figures.get(name) for name in FIGURES)
                own.extend(np.nan if value is None else value for value in values)
        shape = (-1, len(self._methods), len(FIGURES))
        self._of = {key: np.array(flat[key]).reshape(shape) for key in sorted(flat)}

    def __len__(self) -> int:
        """Return the number of records."""
        return sum(map(len, self._of.values()))

    def figure(self, name: str, method: str, case: int, column: int | None = None) -> FloatArray:
        """Return a figure of each flight of a case, of all columns where none is named."""
        m, k = self._methods.index(method), FIGURES.index(name)
        parts = [
            values[:, m, k]
            for (c, own), values in self._of.items()
            if c == case and (column is None or own == column)
        ]
        return np.concatenate([np.zeros(0), *parts])


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
    yield "on the epochs that all methods answer; * where interval and signed-rank test exclude 1."
    for number, case in enumerate(order.case):
        yield ""
        yield from _summary(order, table, number, case)
        if case.sweep is not None:
            yield from _swept(order, table, number, case)


def _summary(order: Order, table: Table, number: int, case: CaseTable) -> Iterator[str]:
    """Yield a line for each method of a case."""
    rng = np.random.default_rng([_RESAMPLED, number])
    width = max(len("method"), *map(len, order.titles))
    yield f"{case.name}"
    heads = "".join(f"  {head:>22}" for head, _, _ in _SUMMARY)
    yield f"  {'method':<{width}}  flights  answered{heads}  {'ratio':>24}"
    baseline = table.figure(_MATCHED, order.reference, number)
    for title in order.titles:
        available = table.figure("available", title, number)
        answered = np.nan_to_num(available)
        cells = "".join(
            f"  {_cell(pooled(table.figure(name, title, number), rng, squared=squared)):>22}"
            for _, name, squared in _SUMMARY
        )
        flights = int((answered > 0).sum())
        share = 100 * float(answered.mean()) if len(answered) else 0.0
        line = f"  {title:<{width}}  {flights:>7}  {share:>6.1f} %{cells}"
        if title != order.reference:
            held = paired(table.figure(_MATCHED, title, number), baseline, rng)
            mark = "*" if held.is_significant else " "
            line += f"  {_cell(held.ratio) + mark:>24}"
            if held.unpaired:
                line += f"  ({held.unpaired} flights of one only)"
        yield line.rstrip()


def _swept(order: Order, table: Table, number: int, case: CaseTable) -> Iterator[str]:
    """Yield a table for each angle, swept values from left to right, as papers print them."""
    if case.sweep is None:
        return
    width = max(map(len, order.titles))
    values = "".join(f"{value:>9g}" for value in case.sweep.values)
    for angle in EULER:
        yield f"  {angle}, RMSE in degrees by {case.sweep.name}"
        yield f"    {'':<{width}}{values}{'mean':>9}"
        for title in order.titles:
            by_column = [
                _rms(table.figure(f"{angle}_rmse_deg", title, number, column))
                for column in range(case.columns)
            ]
            cells = "".join(
                f"{_number(value):>9}" for value in (*by_column, float(np.mean(by_column)))
            )
            yield f"    {title:<{width}}{cells}"


def _rms(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt((known**2).mean())) if len(known) else float("nan")


def _cell(of: Interval) -> str:
    if not np.isfinite(of.value):
        return "–"
    if not np.isfinite([of.low, of.high]).all():
        return _number(of.value)
    return f"{_number(of.value)} [{_number(of.low)}, {_number(of.high)}]"


def _number(value: float) -> str:
    return "–" if not np.isfinite(value) else f"{value:.3g}"
