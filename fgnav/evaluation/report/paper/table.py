"""A table on paper: how wide its columns are, and where its cells break."""

import textwrap
from collections.abc import Iterator, Sequence

from fgnav.evaluation.report.blocks import Table
from fgnav.evaluation.report.drawing.shapes import GRID, INK
from fgnav.evaluation.report.palette import LIGHT
from fgnav.evaluation.report.paper.canvas import Sheet

SIZE, LINE = 6.8, 8.4  # of letters, and from line to line
_LETTER = 0.62 * SIZE  # usual width of a letter
_BOLD = 1.1  # width of bold letters
_GAP = 8.0  # between columns
_FOOT = 2.5  # below the last line of a row
_LEAST = 3  # letters of a column

Cells = Sequence[Sequence[str]]  # of a row, each as its lines


class Layout:
    """A table of a given width.

    Parameters
    ----------
    width : float
        Points; wider tables have their widest cells broken into lines.
    """

    def __init__(self, table: Table, width: float) -> None:
        columns = list(zip(*table.rows, strict=True))
        room = int((width - _GAP * len(columns)) / _LETTER)
        natural = [
            max(*map(len, column), round(_BOLD * len(head)))
            for head, column in zip(table.heads, columns, strict=True)
        ]
        words = [
            max(len(word) for cell in (head, *column) for word in (cell.split() or [""]))
            for head, column in zip(table.heads, columns, strict=True)
        ]
        self._letters = _fitting(natural, words, room)
        self._is_figure = table.figures()
        self.width = sum(self._letters) * _LETTER + _GAP * (len(columns) - 1)
        self.head = self._broken(table.heads)
        self._rows = table.rows

    def rows(self) -> Iterator[Cells]:
        """Yield the rows below the head."""
        yield from map(self._broken, self._rows)

    def height(self, row: Cells) -> float:
        """Return the height of a row."""
        return LINE * max(map(len, row)) + _FOOT

    def draw(self, sheet: Sheet, row: Cells, left: float, top: float, *, bold: bool) -> None:
        """Write a row, and a line below it."""
        at, weight = left, "bold" if bold else "normal"
        for lines, letters, figures in zip(row, self._letters, self._is_figure, strict=False):
            wide = letters * _LETTER
            for k, line in enumerate(lines):
                sheet.text(
                    at + wide if figures else at,
                    top + LINE * (k + 0.8),
                    line,
                    SIZE,
                    ha="right" if figures else "left",
                    weight=weight,
                    color=LIGHT[INK],
                )
            at += wide + _GAP
        sheet.line(left, top + self.height(row) - 0.6, self.width, GRID, 0.5)

    def _broken(self, row: Sequence[str]) -> Cells:
        return [
            textwrap.wrap(cell, letters, break_on_hyphens=False) or [""]
            for cell, letters in zip(row, self._letters, strict=False)
        ]


def _fitting(natural: Sequence[int], words: Sequence[int], room: int) -> list[int]:
    """Return letters of each column: all they ask, or the widest cut to one width that fits.

    No column is narrower than its longest word, unless these alone are too wide.
    """
    least = words if sum(words) <= room else [_LEAST] * len(words)
    widest = max(natural)
    while widest > _LEAST and sum(_cut(natural, least, widest)) > room:
        widest -= 1
    return _cut(natural, least, widest)


def _cut(natural: Sequence[int], least: Sequence[int], widest: int) -> list[int]:
    return [max(1, min(own, max(widest, low))) for own, low in zip(natural, least, strict=True)]
