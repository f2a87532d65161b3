"""Blocks of a report as lines of text: on a terminal, in a file, on a sheet."""

from collections.abc import Iterable, Sequence
from textwrap import wrap

from fgnav.evaluation.report.parts import Block, Folded, Paragraph, Table

_LINE = 110  # letters of a line of prose
_NAME, _CELL = 24, 64  # letters of a row's name and of another cell; longer ones are broken


def text_lines(blocks: Iterable[Block], width: int) -> list[str]:
    """Return all that is text in blocks; tables follow an empty line."""
    lines: list[str] = []
    prose = min(width, _LINE)
    for block in blocks:
        match block:
            case Paragraph(text) if "\n" in text:
                for line in text.splitlines():
                    lines += wrap(line, width, drop_whitespace=False) or [""]
            case Paragraph(text):
                lines += wrap(text, prose, subsequent_indent="  ", break_long_words=False)
            case Table():
                lines += [""] if lines else []
                lines += [*wrap(block.caption, prose), *table_lines(block, width)]
            case Folded(title, inner):
                lines += ["", title, *text_lines(inner, width)]
    return lines


def table_lines(table: Table, width: int) -> list[str]:
    """Return aligned lines, the columns in as many bands as the width asks for.

    Each band begins with the names of the rows; units stand below the headings.
    """
    numeric = table.numeric()
    heads = [list(head.partition(", ")[::2]) for head in table.heads]
    above = [list(row) for row in zip(*heads, strict=True)]
    above = above if any(above[1]) else above[:1]
    body = [line for row in table.rows for line in _broken(row)]
    wide = [max(map(len, column)) for column in zip(*above, *body, strict=True)]
    bands, free = [[0]], width - wide[0]
    for column in range(1, len(wide)):
        free -= wide[column] + 1
        if free < 0 and len(bands[-1]) > 1:
            bands.append([0])
            free = width - wide[0] - wide[column] - 1
        bands[-1].append(column)
    lines = []
    for band in bands:
        shown = [
            " ".join(row[k].rjust(wide[k]) if numeric[k] else row[k].ljust(wide[k]) for k in band)
            for row in (*above, *body)
        ]
        rule = "─" * len(shown[0])
        lines += [*shown[: len(above)], rule, *shown[len(above) :], ""]
    return [line.rstrip() for line in lines[:-1]]


def _broken(row: Sequence[str]) -> list[list[str]]:
    """Return the lines of a row whose long cells are broken."""
    limits = [_NAME, *[_CELL] * (len(row) - 1)]
    cells = [
        wrap(cell, most, break_long_words=False, break_on_hyphens=False)
        for cell, most in zip(row, limits, strict=True)
    ]
    lines = max(1, *map(len, cells))
    return [[cell[k] if k < len(cell) else "" for cell in cells] for k in range(lines)]
