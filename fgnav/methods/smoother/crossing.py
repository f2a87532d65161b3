"""One gap: the way across it that follows from how the body moves beside it, and how that errs.

Rates follow from both sides by an autoregression, and lead from the attitude before to the one
after. How far off that is shows in pretended gaps, where the way is known.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.methods.smoother.autoregression import interpolated
from fgnav.rotations import accumulated, exp, log, transpose

STEP_S = 0.1
# Of the autoregression: its last four seconds. With two, sines of 20 degrees once in 6.3 s are
# foretold four times worse across 5 s; with six, twice better, but it takes longer stretches.
_ORDER = 40
_ROUNDS = 4  # until foretold rates lead to the attitude after the gap
_PLACES, _FEWEST = 12, 5  # pretended gaps of a length
_SHORTEN, _SHORTEST_S = np.sqrt(2), 1.0  # from one length to the next, and the last


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Around:
    """Rates and attitudes around a gap at equal steps.

    Attributes
    ----------
    t_s : ndarray, shape (m,)
    w_b_radps, R_nb : ndarray, shape (m, 3), (m, 3, 3)
    known : ndarray of bool, shape (m,)
        Where attitudes on both sides tell the rate.
    first, last : int
        The gap, with its edges.
    edge : int
        Steps beside a gap where rates are not known, either.
    """

    t_s: FloatArray
    w_b_radps: FloatArray
    R_nb: FloatArray
    known: BoolArray
    first: int
    last: int
    edge: int

    @property
    def step_s(self) -> float:
        """Length of a step."""
        return float(self.t_s[1] - self.t_s[0])

    def way(self, first: int, last: int, known: BoolArray) -> tuple[FloatArray, FloatArray] | None:
        """Return rates, (k, 3), and attitudes, (k, 3, 3), from a known attitude to another.

        What foretold rates miss the second one by is spread over them.
        """
        w_b_radps = interpolated(self.w_b_radps, known, first, last, _ORDER)
        if w_b_radps is None:
            return None
        share = np.linspace(0, 1, last - first + 1)[:, None]
        spread_per_s = 6 * share * (1 - share) / ((last - first) * self.step_s)
        for _ in range(_ROUNDS):
            R_nb = _turned(self.R_nb[first], w_b_radps, self.step_s)
            missed_n = R_nb[-1] @ log(transpose(R_nb[-1:]) @ self.R_nb[last, None])[0]
            w_b_radps = w_b_radps + spread_per_s * (transpose(R_nb) @ missed_n)
        return w_b_radps, _turned(self.R_nb[first], w_b_radps, self.step_s)

    def density(self) -> FloatArray | None:
        """Return the intensity of a walk, (3,), that errs half-way as the way at most does.

        In pretended gaps of the gap's length, or of a shorter one that asks for more; in proportion
        more of one that is longer than any there is room for. None if too little is known for any.
        """
        asked, edges, longest = [], 2 * self.edge, 0
        steps = self.last - self.first - edges
        while steps * self.step_s >= _SHORTEST_S:
            found = [self._square(k, k + steps + edges) for k in self._pretended(steps + edges)]
            squares = [square for square in found if square is not None]
            if len(squares) >= _FEWEST:
                longest = max(longest, steps + edges)
                asked.append(192 * np.mean(squares, axis=0) / ((steps + edges) * self.step_s) ** 3)
            steps = int(steps / _SHORTEN)
        if not asked:
            return None
        return np.asarray(np.max(asked, axis=0) * (self.last - self.first) / longest)

    def _pretended(self, steps: int) -> IntArray:
        """Return where pretended gaps begin that have what it takes known on both sides."""
        length = steps + 1 + 2 * _ORDER
        if length > len(self.known):
            return np.zeros(0, dtype=np.int64)
        begin = np.flatnonzero(sliding_window_view(self.known, length).all(axis=1)) + _ORDER
        return begin[:: max(len(begin) // _PLACES, 1)]

    def _square(self, first: int, last: int) -> FloatArray | None:
        """Return the square of the largest error in a pretended gap, (3,)."""
        known = self.known.copy()
        known[first : last + 1] = False
        way = self.way(first, last, known)
        if way is None:
            return None
        error = log(transpose(way[1]) @ self.R_nb[first : last + 1])
        return np.asarray((error**2).max(axis=0))


def _turned(R_nb: FloatArray, w_b_radps: FloatArray, step_s: float) -> FloatArray:
    """Return the attitudes, (k, 3, 3), that rates, (k, 3), lead to from the first."""
    return R_nb @ accumulated(exp(step_s * (w_b_radps[1:] + w_b_radps[:-1]) / 2))
