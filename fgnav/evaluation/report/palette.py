"""The colour of each mark, on light and on dark ground: the same in every format of a report."""

from collections.abc import Sequence

from fgnav.evaluation.report.drawing.shapes import GRID, INK, OWN, RULE, TRUTH

# Okabe and Ito's set, told apart by the colour-blind; black last, and in place of its yellow, which
# white paper swallows, the red that is furthest from the others in CIELAB to any kind of eye.
COLOURS = ("#E69F00", "#56B4E9", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#000000", "#E1004B")
_STRENGTHS = ("#3a5a9b", "#5d6f96", "#7f8287", "#a39a73", "#c8b54f", "#e8d12c")  # weak to strong

GROUND, DIM, CARD, LINK = "ground", "dim", "card", "link"  # of text and what it stands on

LIGHT = {
    GROUND: "#fff",
    CARD: "#f6f6f6",
    INK: "#1a1a1a",
    TRUTH: "#1a1a1a",
    DIM: "#5a5a5a",
    RULE: "#5a5a5a",
    GRID: "#e2e2e2",
    LINK: "#0060a0",
    OWN: "#0060a0",
    "fixed": "#c9d3da",
    "refused": "#8a97a0",
    "float": "#46515a",
    "predicted": "#46515a",
    "wrong": "#c00020",
    "absent": "#c00020",
    **{f"c{k}": colour for k, colour in enumerate(_STRENGTHS)},
    **{f"m{k}": colour for k, colour in enumerate(2 * COLOURS)},
}
DARK = LIGHT | {
    GROUND: "#15181c",
    CARD: "#1f242a",
    INK: "#ececec",
    TRUTH: "#ececec",
    DIM: "#b0b0b0",
    RULE: "#b0b0b0",
    GRID: "#33383f",
    LINK: "#7cc4ff",
    OWN: "#7cc4ff",
    "fixed": "#3c4650",
    "refused": "#7d8a94",
    "float": "#c4d0d9",
    "predicted": "#c4d0d9",
    "wrong": "#ff5a6e",
    "absent": "#ff5a6e",
    "m2": "#6f7dff",
    "m6": "#fff",
    "m10": "#6f7dff",
    "m14": "#fff",
}
_DASHES = {RULE: (4.0, 3.0), TRUTH: (5.0, 3.0)} | dict.fromkeys(
    (f"m{len(COLOURS) + k}" for k in range(len(COLOURS))), (7.0, 3.0)
)


def method_marks(names: Sequence[str]) -> dict[str, str]:
    """Return the mark that gives each method its colour, everywhere in a report.

    Methods beyond the number of colours have them again, dashed.
    """
    return {name: f"m{k % (2 * len(COLOURS))}" for k, name in enumerate(names)}


def dashes(mark: str) -> tuple[float, float] | None:
    """Return lengths of dash and gap of a mark's strokes; None where they are whole."""
    return _DASHES.get(mark)
