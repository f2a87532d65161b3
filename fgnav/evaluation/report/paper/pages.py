"""A report laid out on sheets: each part begins a page, tables and rows of drawings break."""

import textwrap
from collections.abc import Sequence

from fgnav.evaluation.report.blocks import (
    Block,
    Folded,
    Grid,
    Paragraph,
    Part,
    Report,
    Source,
    Table,
)
from fgnav.evaluation.report.drawing.shapes import INK, TRUTH, Drawing
from fgnav.evaluation.report.palette import DIM, LIGHT, method_marks
from fgnav.evaluation.report.paper.canvas import Sheet
from fgnav.evaluation.report.paper.table import Cells, Layout

_WIDE, _HIGH = 841.9, 595.3  # points: A4 on its side, so that three axes stand side by side
_MARGIN = 34.0
_WITHIN = _WIDE - 2 * _MARGIN
_COLUMNS, _GAP = 3, 12.0
_CELL = (_WITHIN - (_COLUMNS - 1) * _GAP) / _COLUMNS
_UNITS = 480.0  # of a drawing as wide as a cell
_CAPTION = 12.0  # above a drawing
_SIZE, _LINE, _LETTER = 7.6, 10.5, 0.53  # letters of text, their lines, and their usual width
_MONO, _MONO_LINE, _MONO_LETTER = 6.6, 8.4, 0.602  # the same of a text as it stands
_KEY = 16.0  # length of the line before the name of a method


class Pages:
    """The sheets of a part, filled from the top.

    Attributes
    ----------
    sheets : list of Sheet
    feet : list of float
        Where the content of each ends, in points from its top.
    """

    def __init__(self, report: Report, part: Part) -> None:
        self._report, self._title = report, part.title
        self.sheets: list[Sheet] = []
        self.feet: list[float] = []
        self._begin()
        for block in part.blocks:
            self._put(block)

    def _begin(self) -> None:
        """Begin a sheet: what it is of, and the colours of the methods."""
        self.sheets.append(Sheet(_WIDE, _HIGH))
        self.feet.append(_MARGIN)
        letters = int(_WITHIN / (_LETTER * _SIZE))
        self._write(textwrap.shorten(self._report.title, letters), _SIZE, _LINE, color=LIGHT[DIM])
        more = f" ({len(self.sheets)})" if len(self.sheets) > 1 else ""
        self._write(self._title + more, 12.0, 15.0, weight="bold")
        self._keys()

    def _keys(self) -> None:
        """Write the methods with their colours, in as many lines as they need."""
        keys = [*method_marks(self._report.methods).items(), ("truth, or what is expected", TRUTH)]
        at, foot = _MARGIN, self.feet[-1] + _LINE
        for name, mark in keys:
            wide = _KEY + 4 + 1.1 * _LETTER * _SIZE * len(name) + 12
            if at > _MARGIN and at + wide > _WIDE - _MARGIN:
                at, foot = _MARGIN, foot + _LINE
            self.sheets[-1].line(at, foot - 2.6, _KEY, mark, 2.2)
            self.sheets[-1].text(at + _KEY + 4, foot, name, _SIZE, color=LIGHT[DIM])
            at += wide
        self.feet[-1] = self._head = foot + 6

    def _put(self, block: Block) -> None:
        match block:
            case Paragraph(text):
                letters = int(_WITHIN / (_LETTER * _SIZE))
                for line in textwrap.wrap(text, letters, break_on_hyphens=False):
                    self._keep(_LINE)
                    self._write(line, _SIZE, _LINE)
                self.feet[-1] += 3
            case Source(text):
                self._source(text)
            case Table():
                self._table(block)
            case Grid(drawings):
                for first in range(0, len(drawings), _COLUMNS):
                    self._row(drawings[first : first + _COLUMNS])
            case Folded(title, blocks):
                self._keep(20 + _least(blocks[0]))
                self.feet[-1] += 6
                self._write(title, 9.0, 12.0, weight="bold")
                for one in blocks:
                    self._put(one)

    def _source(self, text: str) -> None:
        """Write lines as they stand, those too long broken."""
        letters = int(_WITHIN / (_MONO_LETTER * _MONO))
        for line in text.splitlines():
            for piece in textwrap.wrap(line, letters, drop_whitespace=False) or [""]:
                self._keep(_MONO_LINE)
                self._write(piece, _MONO, _MONO_LINE, family="monospace")

    def _table(self, table: Table) -> None:
        """Write a table, a narrow one in columns, its head again above each and on each sheet."""
        layout = Layout(table, _WITHIN)
        rows = list(layout.rows())
        self._keep(2 * _LINE + layout.height(layout.head) + sum(map(layout.height, rows[:2])))
        if table.caption:
            self._put(Paragraph(table.caption))
        left, top = _MARGIN, self.feet[-1]
        at = self._table_row(layout, layout.head, left, top, bold=True)
        lowest = at
        for row in rows:
            if at + layout.height(row) > _HIGH - _MARGIN:
                left += layout.width + 2 * _GAP
                if left + layout.width > _WIDE - _MARGIN:
                    self.feet[-1] = lowest
                    self._begin()
                    left, top, lowest = _MARGIN, self.feet[-1], 0.0
                at = self._table_row(layout, layout.head, left, top, bold=True)
            at = self._table_row(layout, row, left, at, bold=False)
            lowest = max(lowest, at)
        self.feet[-1] = lowest + 6

    def _table_row(
        self, layout: Layout, row: Cells, left: float, top: float, *, bold: bool
    ) -> float:
        """Write a row; return where it ends."""
        layout.draw(self.sheets[-1], row, left, top, bold=bold)
        return top + layout.height(row)

    def _row(self, drawings: Sequence[Drawing]) -> None:
        """Draw side by side, smaller where a whole sheet is too low."""
        self._keep(_heights(drawings))
        scale = _CELL / _UNITS
        room = _HIGH - _MARGIN - self.feet[-1] - _CAPTION
        top = self.feet[-1] + _CAPTION
        for column, one in enumerate(drawings):
            left = _MARGIN + column * (_CELL + _GAP)
            own = min(scale, room / one.height)
            self.sheets[-1].text(left, top - 3.5, one.title, _SIZE, color=LIGHT[INK])
            self.sheets[-1].draw(one, left, top, own)
        self.feet[-1] += min(_heights(drawings), room + _CAPTION)

    def _keep(self, height: float) -> None:
        """Begin a sheet unless so much room is left, or it is empty."""
        if self.feet[-1] + height > _HIGH - _MARGIN and self.feet[-1] > self._head:
            self._begin()

    def _write(self, text: str, size: float, line: float, **style: str) -> None:
        """Write a line at the left and go on below it."""
        colour = style.pop("color", LIGHT[INK])
        foot = self.feet[-1] + 0.8 * line
        self.sheets[-1].text(_MARGIN, foot, text, size, color=colour, **style)
        self.feet[-1] += line


def _least(block: Block) -> float:
    """Return about how much room the beginning of a block takes."""
    return _heights(block.drawings[:1]) if isinstance(block, Grid) else 3 * _LINE


def _heights(drawings: Sequence[Drawing]) -> float:
    """Return the height of a row of drawings with their titles."""
    return max(one.height for one in drawings) * _CELL / _UNITS + _CAPTION + 4
