"""A sheet of paper and what is drawn on it, by matplotlib; places in points from the upper left."""

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.patheffects import withStroke
from matplotlib.text import Text as Label
from matplotlib.transforms import Affine2D, Bbox, Transform, TransformedBbox

from fgnav.evaluation.report.drawing import shapes
from fgnav.evaluation.report.palette import CARD, DIM, GROUND, LIGHT, dashes

_POINTS = 72.0  # of an inch
_NARROW = 0.92  # matplotlib's own letters are wider than those of a page on a screen
_SHADE = 0.15  # opacity of a band
_EDGE = 0.6  # width of its dashed edge
_HALO = 3.0  # width of what keeps lines off a text


class Sheet:
    """One page.

    Parameters
    ----------
    width, height : float
        Points.
    """

    def __init__(self, width: float, height: float) -> None:
        self._width = width
        self._top = Affine2D()
        self.figure = Figure(facecolor=LIGHT[GROUND])
        self.cut(height)

    def cut(self, height: float) -> None:
        """Have the sheet end so far from its top."""
        self.figure.set_size_inches(self._width / _POINTS, height / _POINTS)
        self._top.clear().translate(0.0, height / _POINTS)

    def text(self, x: float, y: float, text: str, size: float, **style: Any) -> None:  # noqa: ANN401  # matplotlib's
        """Write a line whose foot stands at a place."""
        own = self._places(x, y, 1.0)
        self._add(
            Label(0.0, 0.0, text, fontsize=size, parse_math=False, transform=own, **style), None
        )

    def line(self, x: float, y: float, length: float, mark: str, width: float) -> None:
        """Draw a horizontal line in the colour and the dashes of a mark."""
        stroke = shapes.Stroke(mark=mark, x=np.array([0.0, length]), y=np.zeros(2), width=width)
        self._stroke(stroke, 1.0, self._places(x, y, 1.0), None)

    def draw(self, drawing: shapes.Drawing, left: float, top: float, scale: float) -> None:
        """Draw with the upper left corner at a place, a unit so many points long."""
        for shape in drawing.shapes:
            self._shape(shape, (left, top), scale, None)

    def _places(self, left: float, top: float, scale: float) -> Transform:
        """Return what takes places of a drawing to those of the sheet."""
        to_inches = Affine2D().scale(scale / _POINTS, -scale / _POINTS)
        to_inches.translate(left / _POINTS, -top / _POINTS)
        return to_inches + self._top + self.figure.dpi_scale_trans

    def _add(self, artist: Any, clip: TransformedBbox | None) -> None:  # noqa: ANN401  # any artist
        self.figure.add_artist(artist, clip=False)
        if clip is not None:
            artist.set_clip_box(clip)

    def _shape(
        self,
        shape: shapes.Shape,
        at: tuple[float, float],
        scale: float,
        clip: TransformedBbox | None,
    ) -> None:
        places = self._places(*at, scale)
        match shape:
            case shapes.Stroke():
                self._stroke(shape, scale, places, clip)
            case shapes.Dots():
                line = Line2D(
                    shape.x,
                    shape.y,
                    color=LIGHT[shape.mark],
                    ls="none",
                    marker="o",
                    ms=shape.size * scale,
                    mew=0,
                    transform=places,
                )
                self._add(line, clip)
            case shapes.Area():
                self._area(shape, scale, places, clip)
            case shapes.Text():
                halo = withStroke(linewidth=_HALO * scale, foreground=LIGHT[CARD])
                align = {"start": "left", "middle": "center", "end": "right"}[shape.anchor]
                label = Label(
                    shape.x,
                    shape.y,
                    shape.text,
                    fontsize=_NARROW * shapes.LETTER * scale,
                    color=LIGHT[DIM],
                    ha=align,
                    rotation=90 * shape.upright,
                    rotation_mode="anchor",
                    parse_math=False,
                    path_effects=[halo],
                    transform=places,
                )
                self._add(label, clip)
            case shapes.Frame():
                left, top = at[0] + scale * shape.left, at[1] + scale * shape.top
                inside = self._clip(left, top, scale * shape.width, scale * shape.height)
                for one in shape.shapes:
                    self._shape(one, (left, top), scale, inside)

    def _clip(self, left: float, top: float, width: float, height: float) -> TransformedBbox:
        box = np.array([left, -top - height, left + width, -top]) / _POINTS
        places = self._top + self.figure.dpi_scale_trans
        return TransformedBbox(Bbox.from_extents(*box.tolist()), places)

    def _stroke(
        self, shape: shapes.Stroke, scale: float, places: Transform, clip: TransformedBbox | None
    ) -> None:
        width, lengths = shape.width * scale, dashes(shape.mark)
        pattern = None if lengths is None else tuple(scale * v / width for v in lengths)
        line = Line2D(
            shape.x,
            shape.y,
            color=LIGHT[shape.mark],
            lw=width,
            ls="-" if pattern is None or shape.butt else (0, pattern),
            solid_capstyle="butt" if shape.butt else "round",
            solid_joinstyle="round",
            transform=places,
        )
        self._add(line, clip)

    def _area(
        self, shape: shapes.Area, scale: float, places: Transform, clip: TransformedBbox | None
    ) -> None:
        if not shape.outlines:
            return
        outline = Outline.make_compound_path(
            *(
                Outline(np.stack([np.append(x, x[0]), np.append(y, y[0])], axis=1), closed=True)
                for x, y in shape.outlines
            )
        )
        colour = LIGHT[shape.mark]
        self._add(
            PathPatch(
                outline,
                facecolor=(colour, 1.0 if shape.solid else _SHADE),
                edgecolor="none" if shape.solid else colour,
                lw=_EDGE * scale,
                ls=(0, (3.0, 3.0)),
                transform=places,
            ),
            clip,
        )
