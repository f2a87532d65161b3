"""Blocks of a report as HTML, every text escaped."""

from collections.abc import Iterable
from html import escape

from fgnav.evaluation.report.blocks import (
    Block,
    Folded,
    Grid,
    Paragraph,
    Part,
    Source,
    Table,
)
from fgnav.evaluation.report.html.svg import figure


def section(part: Part) -> str:
    """Return a section with a heading that links can name."""
    return f'<section id="{part.name}"><h2>{escape(part.title)}</h2>{_all(part.blocks)}</section>\n'


def _all(blocks: Iterable[Block]) -> str:
    return "".join(map(_block, blocks))


def _block(block: Block) -> str:
    match block:
        case Paragraph(text):
            return f"<p>{escape(text)}</p>"
        case Source(text):
            return f"<pre>{escape(text)}</pre>"
        case Table():
            return _table(block)
        case Grid(drawings):
            return f'<div class="grid">{"".join(map(figure, drawings))}</div>'
        case Folded(title, blocks):
            return f"<details><summary>{escape(title)}</summary>{_all(blocks)}</details>"


def _table(block: Table) -> str:
    """Return a table whose columns sort by a click or a key."""
    kinds = [' class="n"' if is_figure else "" for is_figure in block.figures()]
    lines = []
    for first, *rest in block.rows:
        cells = "".join(
            f"<td{kind}>{escape(cell)}</td>" for kind, cell in zip(kinds[1:], rest, strict=True)
        )
        lines.append(f'<tr><th scope="row">{escape(first)}</th>{cells}</tr>')
    titles = "".join(
        f'<th scope="col"{kind}><button type="button">{escape(head)}</button></th>'
        for kind, head in zip(kinds, block.heads, strict=True)
    )
    named = f"<caption>{escape(block.caption)}</caption>" if block.caption else ""
    return (
        f'<div class="wide" tabindex="0"><table>{named}<thead><tr>{titles}</tr></thead>'
        f"<tbody>{''.join(lines)}</tbody></table></div>"
    )
