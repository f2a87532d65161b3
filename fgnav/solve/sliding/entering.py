"""Factors and values that enter GTSAM's window with each keyframe.

What GTSAM has marginalised stays linear where it was, and no variable that it speaks of is ever
linearised anew. Where the oldest keyframe must be, the window begins again: its prior is the
marginal that ``LinearWindow.relinearise`` has led there.
"""

from typing import NamedTuple

import gtsam
import numpy as np

from fgnav.graph import keys
from fgnav.graph.build import (
    KeyframeMeasurements,
    Layout,
    constant_priors,
    insert_constants,
    insert_keyframe,
    keyframe_priors,
)
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.solve.sliding.incremental import IncrementalSmoother
from fgnav.solve.sliding.linear_window import LinearWindow


class _Keyframe(NamedTuple):
    """Factors and values of a keyframe."""

    before: list[gtsam.NonlinearFactor]  # of what led to it, or was known before
    factors: list[gtsam.NonlinearFactor]
    block: int  # of its arcs; negative before any
    begins: gtsam.NonlinearFactor | None  # what leads to its arcs, where they begin


class Entering:
    """Factors and values for the next update, and all factors of keyframes in the window.

    Attributes
    ----------
    graph : gtsam.NonlinearFactorGraph
    values : gtsam.Values
    layout : Layout
        Of the last keyframe's problem.
    block : int
        Newest of arcs; negative before any.
    """

    layout: Layout

    def __init__(self) -> None:
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        self._keyframes: list[_Keyframe] = []
        self._zero = gtsam.Values()  # biases of them all, zero
        self.block = -1
        self._problem: Problem | None = None
        self._measured: KeyframeMeasurements

    def read(self, problem: Problem) -> None:
        """Take what comes next from a problem."""
        if problem is not self._problem:
            self._problem, self.layout = problem, Layout.of(problem)
            self._measured = KeyframeMeasurements(problem)

    def keyframe(
        self,
        problem: Problem,
        row: int,
        states: tuple[States, States | None],
        smoother: IncrementalSmoother,
        k: int,
    ) -> None:
        """Take in keyframe k, row ``row`` of a problem.

        Parameters
        ----------
        problem : Problem
        row : int
        states : tuple of States and States or None
            Where it stands, and where the one before, about which motion is preintegrated; None
            before any.
        smoother : IncrementalSmoother
            Is told of arcs that begin.
        k : int
        """
        at, before = states
        if before is None:
            insert_constants(self.values, self.layout, problem.constants.start)
            known = (*keyframe_priors(problem, k), *constant_priors(problem.constants))
        else:
            known = problem.motion.factors(row - 1, k - 1, k, before)
        insert_keyframe(self.values, self.layout, k, at)
        if self.layout.gyroscope:
            self._zero.insert(self.layout.keyframe(k)[2], gtsam.imuBias.ConstantBias())
        phases, begins = self._phases(problem, row, smoother, k)
        measured = [*self._measured.factors(row, k), *phases]
        self._keyframes.append(_Keyframe([*known], measured, self.block, begins))
        self._add(self._keyframes[-1])

    def custom(self, factor: gtsam.NonlinearFactor, row: int | None) -> None:
        """Take in a custom factor, of one keyframe counted from the oldest, or of several."""
        self.graph.add(factor)
        if row is not None:
            self._keyframes[row].factors.append(factor)

    def taken(self) -> None:
        """Begin the next update."""
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()

    def forget(self, count: int, oldest: int) -> None:
        """Take the oldest keyframes out, numbers from ``oldest`` on."""
        del self._keyframes[:count]
        for k in range(oldest, oldest + count) if self.layout.gyroscope else ():
            self._zero.erase(self.layout.keyframe(k)[2])

    def restarted(self, linear: LinearWindow) -> IncrementalSmoother:
        """Let all that is in the window enter again, about where it is linearised by now."""
        layout, entered = self.layout, list(self._keyframes)
        if linear.oldest:
            entered[0] = entered[0]._replace(before=[linear.marginal()], begins=None)
        self.taken()
        self.values = self._at_biases(linear)
        smoother = IncrementalSmoother(layout, linear.oldest)
        insert_constants(self.values, layout, linear.states.constants)
        block = -1
        for row, one in enumerate(entered):
            k = linear.oldest + row
            insert_keyframe(self.values, layout, k, linear.states, row, biased=layout.gyroscope)
            if one.block != block:
                block = one.block
                self._begin(block, linear.arcs_size(row), smoother, k)
            self._add(one)
        return smoother

    def _at_biases(self, linear: LinearWindow) -> gtsam.Values:
        """Return biases of all keyframes, by a step from zero: to insert one takes 37 us."""
        if not self.layout.gyroscope:
            return gtsam.Values()
        steps = gtsam.VectorValues()
        for row, aux in enumerate(linear.states.aux[: len(self._keyframes)]):
            steps.insert(self.layout.keyframe(linear.oldest + row)[2], aux)
        return self._zero.retract(steps)

    def _add(self, one: _Keyframe) -> None:
        begins = () if one.begins is None else (one.begins,)
        for factor in (*one.before, *one.factors, *begins):
            self.graph.add(factor)

    def _phases(
        self, problem: Problem, row: int, smoother: IncrementalSmoother, k: int
    ) -> tuple[list[gtsam.NonlinearFactor], gtsam.NonlinearFactor | None]:
        """Return the phases of a keyframe, and what leads to arcs that begin there."""
        phase, begins = problem.phase, None
        if phase is None:
            return [], None
        i = int(np.searchsorted(phase.row, row))
        if i == len(phase.row) or phase.row[i] != row:
            return [], None
        block = int(phase.block[i])
        if block > self.block:
            self.block = block
            self._begin(block, phase.blocks[block - phase.first_block].size, smoother, k)
            begins = phase.transition_factor(block)
        return [phase.factor(i, k)], begins

    def _begin(self, block: int, size: int, smoother: IncrementalSmoother, k: int) -> None:
        self.values.insert(keys.arcs(block), np.zeros(size))
        smoother.enter_arcs(keys.arcs(block), size, k)
