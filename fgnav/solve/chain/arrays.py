"""What a sliding window keeps of its keyframes."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.types.states import AUX, States


class WindowArrays(NamedTuple):
    """A row for each keyframe; see ``kernel``."""

    t_s: FloatArray
    R_nb: FloatArray  # where they are linearised, as the next three
    p_n_m: FloatArray
    v_n_mps: FloatArray
    aux: FloatArray
    motion: FloatArray
    node: FloatArray
    forward: FloatArray
    root: FloatArray
    gain: FloatArray

    @classmethod
    def empty(cls, n: int, width: int, constants: int, beside: int = 0) -> "WindowArrays":
        """Return room for n keyframes with nothing in it."""
        D, W = width, width + constants + beside + 1
        shapes = (
            (),
            (3, 3),
            (3,),
            (3,),
            (D - AUX,),
            (D, 2 * D + constants + 1),
            (W, W),
            (W, W),
            (D, D),
            (D, W),
        )
        return cls._make(np.zeros((n, *shape)) for shape in shapes)

    def between(self, first: int, end: int) -> "WindowArrays":
        """Return some of the rows, the same memory."""
        return WindowArrays._make(part[first:end] for part in self)

    def take(self, rows: "WindowArrays", wider: int) -> None:
        """Begin with other rows, whose border lacks some variables: they are independent units."""
        n, W = len(rows.t_s), rows.node.shape[1]
        kept = np.r_[0 : W - 1, W - 1 + wider]
        for name, new, old in zip(self._fields, self, rows, strict=True):
            if wider and name in ("node", "forward"):
                new[:n, kept[:, None], kept] = old
            elif wider and name == "gain":
                new[:n, :, kept] = old
            else:
                new[:n] = old
        unused = np.arange(wider) + self.forward.shape[1] - 1 - wider
        self.forward[:n, unused, unused] = 1.0

    def states(self, constants: FloatArray) -> States:
        """Return where keyframes are linearised, the same memory."""
        return States(self.R_nb, self.p_n_m, self.v_n_mps, self.aux, constants)

    def place(self, rows: IntArray | slice, states: States) -> None:
        """Set where some keyframes are linearised."""
        for mine, its in zip(self[1:5], states[:4], strict=True):
            mine[rows] = its
