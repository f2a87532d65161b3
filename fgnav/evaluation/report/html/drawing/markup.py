"""Pieces of the page: sections, figures and tables, every text escaped."""

from collections.abc import Iterable, Sequence
from html import escape

NONE = "–"


def section(name: str, title: str, *parts: str) -> str:
    """Return a section with a heading that links can name; nothing where it has no content."""
    content = "".join(parts)
    if not content:
        return ""
    return f'<section id="{name}"><h2>{escape(title)}</h2>{content}</section>\n'


def grid(figures: Iterable[str]) -> str:
    """Return figures side by side, as many as the width of the screen takes."""
    content = "".join(figures)
    return f'<div class="grid">{content}</div>' if content else ""


def folded(title: str, content: str) -> str:
    """Return content that opens on demand; nothing where there is none."""
    if not content:
        return ""
    return f"<details><summary>{escape(title)}</summary>{content}</details>"


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], caption: str = "") -> str:
    """Return a table whose columns sort by a click or a key; nothing where it has no row.

    Parameters
    ----------
    heads : sequence of str
    rows : iterable of sequence of str
        Cells that are numbers are aligned to the right.
    caption : str
    """
    lines = []
    for row in rows:
        first, *rest = row
        cells = "".join(f"<td{_kind(cell)}>{escape(cell)}</td>" for cell in rest)
        lines.append(f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>')
    if not lines:
        return ""
    titles = "".join(
        f'<th scope="col"><button type="button">{escape(head)}</button></th>' for head in heads
    )
    named = f"<caption>{escape(caption)}</caption>" if caption else ""
    return (
        f'<div class="wide" tabindex="0"><table>{named}<thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )


def number(value: float | None, digits: int = 3) -> str:
    """Return a figure with fixed decimals, or in four digits where these show little."""
    if value is None or value != value:  # NaN
        return NONE
    return f"{value:.{digits}f}" if 0.01 <= abs(value) < 1000 or value == 0 else f"{value:.4g}"


def _kind(cell: str) -> str:
    """Return the class of a cell that holds a number."""
    return ' class="n"' if cell[:1] in "0123456789-−–+" else ""
