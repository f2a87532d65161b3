"""Content of a report: parts of paragraphs, tables and figures, in whatever format it is written.

A function that returns ``Blocks`` returns none where there is nothing to say.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from fgnav.evaluation.paired import Interval
from fgnav.evaluation.report.charts import Chart

NONE = "–"
_NUMERIC = "0123456789-−–+"  # a number begins with


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A paragraph of plain text, or lines as they stand where there are several."""

    text: str
    kind: ClassVar = "paragraph"


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells below their headings; the first of a row names it."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str
    kind: ClassVar = "table"

    def numeric(self) -> list[bool]:
        """Return of each column whether it holds numbers, which stand to the right."""
        return [k > 0 and is_numeric(c) for k, c in enumerate(zip(*self.rows, strict=True))]


@dataclass(frozen=True, slots=True)
class Grid:
    """Figures side by side, as many as there is room for."""

    charts: Sequence[Chart]
    kind: ClassVar = "grid"


@dataclass(frozen=True, slots=True)
class Folded:
    """Blocks that a page on a screen opens on demand."""

    title: str
    blocks: "Sequence[Block]"
    kind: ClassVar = "folded"


Block = Paragraph | Table | Grid | Folded
Blocks = list[Block]


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a report: a name for links and files, a heading, and what stands below it."""

    name: str
    title: str
    blocks: Blocks


@dataclass(frozen=True, slots=True)
class Report:
    """A report: what methods are compared, and its parts, none of them empty."""

    title: str
    methods: Sequence[str]
    parts: Sequence[Part]


def report(title: str, methods: Sequence[str], parts: Iterable[tuple[str, str, Blocks]]) -> Report:
    """Return a report of those parts that hold anything."""
    return Report(title, methods, [Part(*section) for section in parts if section[-1]])


def paragraph(*texts: str) -> Blocks:
    """Return a paragraph of each text."""
    return [Paragraph(text) for text in texts]


def table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "", most: int | None = None
) -> Blocks:
    """Return a table of the first rows, which says how many are not shown; nothing of none."""
    filled = list(rows)
    more = f"; {len(filled) - most} more in --json" if most and len(filled) > most else ""
    return [Table(heads, filled[:most], caption + more)] if filled else []


def grid(charts: Iterable[Chart]) -> Blocks:
    """Return figures side by side; nothing where there is none."""
    filled = list(charts)
    return [Grid(filled)] if filled else []


def folded(title: str, blocks: Blocks) -> Blocks:
    """Return blocks that open on demand; nothing where there are none."""
    return [Folded(title, blocks)] if blocks else []


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with fixed decimals, or in four digits where these show little."""
    if value is None or value != value:  # NaN
        return NONE
    return f"{value:.{digits}f}" if 0.01 <= abs(value) < 1000 or value == 0 else f"{value:.4g}"


def significant(value: float | None) -> str:
    """Return three significant digits."""
    return NONE if value is None or value != value else f"{value:.3g}"  # NaN


def interval(of: Interval) -> str:
    """Return a figure with its bounds, where flights are enough to tell."""
    if not np.isfinite([of.low, of.high]).all():
        return significant(of.value)
    return f"{significant(of.value)} [{significant(of.low)}, {significant(of.high)}]"


def is_numeric(column: Sequence[str]) -> bool:
    """Return True if all cells of a column that are not empty are numbers."""
    return any(column) and all(cell[0] in _NUMERIC for cell in column if cell)
