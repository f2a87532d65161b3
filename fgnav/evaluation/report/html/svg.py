"""Drawings as SVG inside a page: marks are classes, whose colours the page knows, light or dark."""

from html import escape

import numpy as np

from fgnav.checks import FloatArray
from fgnav.evaluation.report.drawing import shapes


def figure(drawing: shapes.Drawing) -> str:
    """Return a drawing with its title, also for those who do not see it."""
    title = escape(drawing.title)
    content = "".join(map(_shape, drawing.shapes))
    return (
        f"<figure><figcaption>{title}</figcaption>"
        f'<svg viewBox="0 0 {drawing.width:g} {drawing.height:g}" '
        f'role="img" aria-label="{title}">{content}</svg></figure>'
    )


def _shape(shape: shapes.Shape) -> str:
    match shape:
        case shapes.Stroke(mark=mark) if mark in (shapes.GRID, shapes.RULE):
            return f'<path class="{mark}" d="{_path(shape.x, shape.y)}"/>'
        case shapes.Stroke():
            kind = "l cell" if shape.butt else "l"
            width = f'stroke-width="{shape.width:.3g}"'
            path = _path(shape.x, shape.y)
            return _named(f'<path class="{kind} {shape.mark}" {width} d="{path}"', shape.name)
        case shapes.Dots():
            width = f'stroke-width="{shape.size:.3g}"'
            path = _dots(shape.x, shape.y)
            return _named(f'<path class="l {shape.mark}" {width} d="{path}"', shape.name)
        case shapes.Area():
            path = "".join(f"{_path(x, y)}Z" for x, y in shape.outlines)
            kind = "fill" if shape.solid else "b"
            return _named(f'<path class="{kind} {shape.mark}" d="{path}"', shape.name)
        case shapes.Text():
            return _text(shape)
        case shapes.Frame():
            # An inner drawing cuts off what leaves it.
            return (
                f'<svg x="{shape.left:g}" y="{shape.top:g}" width="{shape.width:g}" '
                f'height="{shape.height:g}">{"".join(map(_shape, shape.shapes))}</svg>'
            )


def _named(opening: str, name: str) -> str:
    return f"{opening}><title>{escape(name)}</title></path>" if name else f"{opening}/>"


def _text(text: shapes.Text) -> str:
    x, y = f"{text.x:.5g}", f"{text.y:.5g}"
    place = f'transform="translate({x} {y}) rotate(-90)"' if text.upright else f'x="{x}" y="{y}"'
    anchor = "" if text.anchor == "start" else f' text-anchor="{text.anchor}"'
    return f"<text {place}{anchor}>{escape(text.text)}</text>"


def _path(x: FloatArray, y: FloatArray) -> str:
    """Return the path through points, with a new start after each NaN."""
    is_finite = np.isfinite(x) & np.isfinite(y)
    is_start = is_finite & ~np.concatenate([[False], is_finite[:-1]])
    letters = np.where(is_start, "M", "L")[is_finite].tolist()
    places = np.stack([x, y], axis=1)[is_finite].tolist()
    return "".join(
        f"{letter}{a:.1f} {b:.1f}" for letter, (a, b) in zip(letters, places, strict=True)
    )


def _dots(x: FloatArray, y: FloatArray) -> str:
    """Return the path of round dots at points."""
    is_finite = np.isfinite(x) & np.isfinite(y)
    places = np.stack([x, y], axis=1)[is_finite].tolist()
    return "".join(f"M{a:.1f} {b:.1f}h0" for a, b in places)
