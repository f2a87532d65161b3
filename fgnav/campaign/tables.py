"""All runs in one table: a row for each flight and method, as CSV and as Parquet.

Times are kept apart: they are the only figures that another machine, or another number of workers,
changes.
"""

import csv
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

from fgnav.campaign.fly import Record
from fgnav.campaign.order import Order
from fgnav.evaluation.figures import FIGURES
from fgnav.io.atomic_write import atomic_file

_KEYS = ("case", "column", "value", "flight", "method")
COLUMNS = (*_KEYS, *FIGURES, "converged", "failure")
Row = dict[str, Any]
_BATCH = 50_000  # rows of a group of the Parquet file, and in memory


def rows_of(order: Order, records: Iterable[Record]) -> Iterator[Row]:
    """Yield a row for each flight and method, in the order of cases, columns, flights, methods."""
    for record in records:
        head = {key: record[key] for key in _KEYS[:-1]}
        for title in order.titles:
            of = record["methods"].get(title)
            figures = dict.fromkeys(FIGURES) if of is None else of["figures"]
            yield {
                **head,
                "method": title,
                **figures,
                "converged": False if of is None else of["converged"],
                "failure": record["failure"] if of is None else of["failure"],
            }


def write_tables(order: Order, records: Iterable[Record], out: Path) -> tuple[Path, ...]:
    """Write flights.csv, flights.parquet where pyarrow is there, and seconds.csv.

    Parameters
    ----------
    records : iterable of Record
        Gone through once for each file, and never held at once.
    """
    files = [out / "flights.csv", out / "seconds.csv"]
    rows = rows_of(order, records)
    _write_csv(files[0], COLUMNS, ([row[name] for name in COLUMNS] for row in rows))
    seconds = (
        [*(record[key] for key in _KEYS[:-1]), title, of["seconds"]]
        for record in records
        for title, of in record["methods"].items()
    )
    _write_csv(files[1], (*_KEYS, "seconds"), seconds)
    try:
        import pyarrow  # noqa: PLC0415  # an extra
        from pyarrow import parquet  # noqa: PLC0415
    except ImportError:
        return tuple(files)
    kinds = {"column": pyarrow.int64(), "flight": pyarrow.int64(), "converged": pyarrow.bool_()}
    kinds |= dict.fromkeys(("case", "method", "failure"), pyarrow.string())
    schema = pyarrow.schema([(name, kinds.get(name, pyarrow.float64())) for name in COLUMNS])
    files.append(out / "flights.parquet")
    rows = rows_of(order, records)
    with atomic_file(files[-1]) as unfinished, parquet.ParquetWriter(unfinished, schema) as writer:
        while some := list(islice(rows, _BATCH)):
            writer.write_table(pyarrow.Table.from_pylist(some, schema=schema))
    return tuple(files)


def _write_csv(path: Path, columns: Sequence[str], rows: Iterator[list[Any]]) -> None:
    with (
        atomic_file(path) as unfinished,
        unfinished.open("w", encoding="utf-8", newline="") as file,
    ):
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(["" if value is None else value for value in row] for row in rows)
