"""What a report holds: parts of paragraphs, tables and drawings, whoever writes them down.

A function that makes blocks returns a list of them, empty where there is nothing to say.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fgnav.evaluation.report.drawing.shapes import Drawing

NONE = "–"
_FIGURES = "0123456789-−–+"  # a number begins with


@dataclass(frozen=True, slots=True)
class Paragraph:
    """A paragraph of plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Source:
    """A text whose lines stand as they are."""

    text: str


@dataclass(frozen=True, slots=True)
class Table:
    """Rows of cells below their headings; the first of a row names it."""

    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str

    def figures(self) -> list[bool]:
        """Return of each column whether it holds numbers, which stand to the right."""
        columns = [[cell for cell in column if cell] for column in zip(*self.rows, strict=True)]
        return [
            place > 0 and bool(column) and all(cell[0] in _FIGURES for cell in column)
            for place, column in enumerate(columns)
        ]


@dataclass(frozen=True, slots=True)
class Grid:
    """Drawings side by side, as many as there is room for."""

    drawings: Sequence[Drawing]


@dataclass(frozen=True, slots=True)
class Folded:
    """Blocks that a page on a screen opens on demand."""

    title: str
    blocks: "Sequence[Block]"


Block = Paragraph | Source | Table | Grid | Folded
Blocks = list[Block]


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part of a report: a name for links and files, a heading, and what stands below it."""

    name: str
    title: str
    blocks: Blocks


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """A report."""

    title: str
    methods: Sequence[str]  # each has a colour, by its place
    parts: Sequence[Part]  # none of them empty


def paragraph(*texts: str) -> Blocks:
    """Return a paragraph of each text."""
    return [Paragraph(text) for text in texts]


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> Blocks:
    """Return a table; nothing where it has no row."""
    filled = list(rows)
    return [Table(heads, filled, caption)] if filled else []


def grid(drawings: Iterable[Drawing]) -> Blocks:
    """Return drawings side by side; nothing where there is none."""
    filled = list(drawings)
    return [Grid(filled)] if filled else []


def folded(title: str, blocks: Blocks) -> Blocks:
    """Return what opens on demand; nothing where there is nothing in it."""
    return [Folded(title, blocks)] if blocks else []


def number(value: float | None, digits: int = 3) -> str:
    """Return a figure with fixed decimals, or in four digits where these show little."""
    if value is None or value != value:  # NaN
        return NONE
    return f"{value:.{digits}f}" if 0.01 <= abs(value) < 1000 or value == 0 else f"{value:.4g}"
