"""Innovations of a stream: of each keyframe as it was known when it came.

As ``graph.innovations.consistency`` has them of a record, which a stream keeps but the last of.
"""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.innovation.band import beyond_s
from fgnav.graph.innovation.phase_redundancy import ArcsSoFar
from fgnav.graph.innovations import innovations_of
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution


class InnovationsSoFar:
    """Normalised innovations squared of every kind of measurement, keyframe by keyframe."""

    def __init__(self) -> None:
        self.until_s = -np.inf  # the last keyframe
        self._tested_s = -np.inf
        self._arcs: ArcsSoFar | None = None
        self._rounding: dict[tuple[str, int], float] = {}
        self._of: dict[str, list[tuple[FloatArray, FloatArray, IntArray]]] = defaultdict(list)

    def take(self, problem: SmoothingProblem, row: int, solution: Solution) -> None:
        """Take in a keyframe, later than those before.

        Parameters
        ----------
        problem : SmoothingProblem
        row : int
        solution : Solution
            Of this keyframe alone.
        """
        self.until_s = float(problem.t_s[row])
        numbers: dict[str, int] = defaultdict(int)
        for one in problem.measurements:
            key = one.name, numbers[one.name]
            numbers[one.name] += 1
            which = np.flatnonzero(one.row == row)
            if len(which):
                before = {"rounding": self._rounding[key]} if key in self._rounding else {}
                rows = np.zeros(len(which), dtype=np.int64)
                part, self._rounding[key] = innovations_of(one, which, solution, rows, **before)
                self._add(one.name, part.squared[part.tested], part.freedom[part.tested])
        phase = problem.phase
        if phase is None:
            return
        for i in np.flatnonzero(phase.row == row).tolist():
            self._arcs = self._arcs or ArcsSoFar.before(phase)
            squared, freedom = self._arcs.take(phase, i)
            if freedom > 0:
                self._add(phase.name, np.array([squared]), np.array([freedom]))

    def beyond_s(self, until_s: float, since_s: float) -> Iterator[float]:
        """Yield when, from a time to another, a sensor contradicts the others; each but once."""
        if np.floor(until_s) <= self._tested_s:
            return
        self._tested_s = float(np.floor(until_s))
        for name, parts in self._of.items():
            t_s, squared, freedom = map(np.concatenate, zip(*parts, strict=True))
            self._of[name] = [(t_s, squared, freedom)]
            yield from beyond_s(t_s, squared, freedom, until_s, since_s)

    def _add(self, name: str, squared: FloatArray, freedom: IntArray) -> None:
        self._of[name].append((np.full(len(squared), self.until_s), squared, freedom))
