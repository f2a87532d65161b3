"""What a drawing is made of, whoever renders it: strokes, dots, areas and text.

Places are counted from the left and from the top, in units of which a letter is eleven high. A mark
names who a shape belongs to; renderers know its colour (``report.palette``).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fgnav.checks import FloatArray

GRID, RULE, TRUTH, INK, OWN = "g", "r", "truth", "ink", "own"
LETTER = 11.0  # height of text
_FAR = 1e4  # renderers compute in single precision: what lies further out is cut

Outline = tuple[FloatArray, FloatArray]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Stroke:
    """A line through points (n,), broken at each NaN; ``butt`` ends it square."""

    mark: str
    x: FloatArray
    y: FloatArray
    width: float = 1.0
    name: str = ""
    butt: bool = False


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Dots:
    """Round dots at points (n,)."""

    mark: str
    x: FloatArray
    y: FloatArray
    size: float = 2.2
    name: str = ""


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Area:
    """What closed outlines hold: in full colour, or shaded with a dashed edge."""

    mark: str
    outlines: Sequence[Outline]
    solid: bool = False
    name: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Text:
    """A text whose foot stands at a place; ``upright`` ones read from below."""

    x: float
    y: float
    text: str
    anchor: Literal["start", "middle", "end"] = "middle"
    upright: bool = False


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Frame:
    """A part of a drawing with places of its own, which cuts off what leaves it."""

    left: float
    top: float
    width: float
    height: float
    shapes: "Sequence[Shape]"


Shape = Stroke | Dots | Area | Text | Frame


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Drawing:
    """A picture with its title."""

    title: str
    width: float
    height: float
    shapes: Sequence[Shape]


def straight(mark: str, start: tuple[float, float], end: tuple[float, float]) -> Stroke:
    """Return a line from one place to another."""
    x, y = np.array([start, end]).T
    return Stroke(mark=mark, x=x, y=y)


def square(mark: str, left: float, top: float, side: float = 10.0) -> Area:
    """Return a square in full colour, as keys have it."""
    x = left + side * np.array([0.0, 1.0, 1.0, 0.0])
    y = top + side * np.array([0.0, 0.0, 1.0, 1.0])
    return Area(mark=mark, outlines=[(x, y)], solid=True)


def circle(mark: str, middle: tuple[float, float], radius: float) -> Stroke:
    """Return a circle, as a line of 72 pieces."""
    angle_rad = np.linspace(0.0, 2 * np.pi, 73)
    x, y = middle[0] + radius * np.cos(angle_rad), middle[1] + radius * np.sin(angle_rad)
    return Stroke(mark=mark, x=x, y=y)


def within_reach(values: FloatArray) -> FloatArray:
    """Return places cut to what renderers can hold."""
    return np.asarray(values.clip(-_FAR, _FAR))
