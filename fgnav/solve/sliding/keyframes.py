"""Keyframes of a window: their factors, linearised where GTSAM's smoother has them, and eliminated.

The same factors are in the smoother, whose tree of conditionals no caller can read: covariances
and what begins a smoother anew are of these. What leaves stays as a message about the oldest
keyframe that remains: marginalisation is exact up to its linearisation.
"""

from collections.abc import Sequence

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import skew, transpose
from fgnav.graph import keys
from fgnav.graph.build import (
    Layout,
    constant_priors,
    insert_constants,
    insert_keyframe,
    keyframe_priors,
    keyframe_states,
    sensor_factors,
)
from fgnav.graph.linear_factor import linear_factor
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import AUX, POSITION, ROTATION, States
from fgnav.solve.elimination import Elimination, Marginals
from fgnav.solve.sliding.incremental import IncrementalSmoother

_ACCELEROMETER, _GYROSCOPE = slice(AUX, AUX + 3), slice(AUX + 3, AUX + 6)  # their biases
_PARTS = slice(0, 6), slice(6, AUX), slice(AUX, None)  # of a keyframe's variables in its tangent


class Keyframes:
    """Keyframes of a window, numbered on from 0 as they come; i counts from the oldest.

    Attributes
    ----------
    layout : Layout
    t_s : list of float
        Of all keyframes so far.
    graph, values : gtsam.NonlinearFactorGraph, gtsam.Values
        For the smoother's next update.
    """

    layout: Layout

    def __init__(self) -> None:
        self.t_s: list[float] = []
        self.next_update()
        self._point = gtsam.Values()  # where all variables are linearised
        self._gravity_n_mps2: list[FloatArray] = []
        # By the oldest keyframe of each factor; of the linear ones those that are up to date.
        self._factors: list[list[gtsam.NonlinearFactor]] = []
        self._linear: list[list[gtsam.GaussianFactor | None]] = []
        self._last: list[int] = []  # number of the newest keyframe that these factors touch
        self._arcs: list[tuple[int, int] | None] = []  # key and size of those at each keyframe
        self._block = -1  # of the newest arcs
        self._eliminated: Elimination

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self._factors)

    @property
    def oldest(self) -> int:
        """Number of the oldest keyframe."""
        return self._eliminated.oldest if self._factors else 0

    def next_update(self) -> None:
        """Begin to collect what the smoother's next update takes."""
        self.graph, self.values = gtsam.NonlinearFactorGraph(), gtsam.Values()

    def append(
        self, problem: Problem, row: int, at: States, before: States | None
    ) -> tuple[int, int] | None:
        """Take in row ``row`` of a problem; return key and size of arcs that begin there, if any.

        Parameters
        ----------
        problem : Problem
        row : int
        at : States
            Where the keyframe is linearised.
        before : States or None
            Where the one before is, about which motion is preintegrated; None before any.
        """
        k, values = len(self.t_s), gtsam.Values()
        if before is None:
            self.layout = Layout.of(problem)
            self._eliminated = Elimination(self.layout, self.t_s.__getitem__)
            insert_constants(values, self.layout, problem.start.constants)
        insert_keyframe(values, self.layout, k, at)
        self.t_s.append(float(problem.t_s[row]))
        self._gravity_n_mps2.append(problem.motion.gravity_n_mps2[row])
        self._factors.append([])
        self._linear.append([])
        self._last.append(k)
        self._arcs.append(self._arcs[-1] if self._arcs else None)
        self._eliminated.append(())
        begun = self._phases(problem, row, k, values)
        self.values.insert(values)
        self._point.insert(values)
        if before is None:
            for prior in (*keyframe_priors(problem), *constant_priors(problem.constants)):
                self.add(prior, (k,))
        else:
            for moved in problem.motion.factors(row - 1, k - 1, k, before):
                self.add(moved, (k - 1, k))
            problem.motion.release(row)
        for measured in sensor_factors(problem, row, k):
            self.add(measured, (k,))
        return begun

    def add(self, factor: gtsam.NonlinearFactor, numbers: Sequence[int]) -> None:
        """Take in a factor of some keyframes, increasing, and constants."""
        i = numbers[0] - self.oldest
        self.graph.add(factor)
        self._factors[i].append(factor)
        self._last[i] = max(self._last[i], numbers[-1])

    def states(self, numbers: Sequence[int]) -> States:
        """Return where keyframes and constants are linearised."""
        return keyframe_states(self._point, self.layout, numbers)

    def relinearise(self, rows: IntArray, steps: FloatArray) -> None:
        """Linearise some keyframes, (j,), counted from the oldest, steps away, (j, D).

        What has been marginalised is led on to where the oldest is then: it knows rotations and
        positions in ``n``, so their directions turn against the body as the body has turned. Kept
        in body axes, a level that is known later would tell a heading that is none. The same holds
        of biases, which it knows by what they did in ``n``. Without a gyroscope the oldest stays.
        """
        moved, is_oldest = gtsam.VectorValues(), self.oldest > 0 and rows[0] == 0
        before = self.states([self.oldest])
        for i, step in zip(rows.tolist(), steps, strict=True):
            for key, part in zip(self.layout.keyframe(self.oldest + i), _PARTS, strict=True):
                moved.insert(key, step[part])
        self._point = self._point.retract(moved)
        if is_oldest:
            self._eliminated.message = self._transformed_message(before)
        changed = np.zeros(len(self), dtype=np.bool_)
        changed[rows] = True
        for i, last in enumerate(self._last):
            if changed[i : last + 1 - self.oldest].any():
                self._linear[i] = []

    def solve(self) -> None:
        """Linearise what has changed, and eliminate from there to the newest."""
        graph, counts = gtsam.NonlinearFactorGraph(), list[tuple[int, int]]()
        for i, (factors, done) in enumerate(zip(self._factors, self._linear, strict=True)):
            new = factors[len(done) :]
            for factor in new:
                graph.add(factor)
            if new:
                counts.append((i, len(new)))
        if not counts:
            return
        linear, begin = graph.linearize(self._point), 0
        for i, count in counts:
            self._linear[i] += [linear.at(j) for j in range(begin, begin + count)]
            begin += count
        for i in range(counts[0][0], len(self)):
            is_last = i + 1 == len(self) or self._arcs[i + 1] != self._arcs[i]
            arcs = self._arcs[i]
            active = [factor for factor in self._linear[i] if factor is not None]
            self._eliminated.change(i, active, (arcs,) if is_last and arcs else ())
        self._eliminated.solve()

    def marginals(self, begin: int, end: int) -> Marginals:
        """Return covariances of keyframes begin to end - 1, counted from the oldest.

        Raises
        ------
        NoSolutionError
            Naming the state that the data leave open.
        """
        self.solve()
        return self._eliminated.marginals(begin, end)

    def forget(self, count: int) -> None:
        """Take the oldest keyframes out; what they tell of the next one stays."""
        self.solve()
        gone = {key for i in range(count) for key in self.layout.keyframe(self.oldest + i)}
        gone |= {arcs[0] for arcs in self._arcs[:count] if arcs and arcs != self._arcs[count]}
        for key in gone:
            self._point.erase(key)
        for of in (self._gravity_n_mps2, self._factors, self._linear, self._last, self._arcs):
            del of[:count]
        self._eliminated.forget(count)

    def restarted(self) -> IncrementalSmoother:
        """Let all that is in the window enter again, about where it is linearised by now.

        What GTSAM has marginalised stays linear where it was, and no variable that it speaks of is
        ever linearised anew. So where the oldest keyframe must be, the window begins again: its
        prior is the message that ``relinearise`` has led there.
        """
        self.next_update()
        smoother = IncrementalSmoother(self.layout, self.oldest)
        self.values = gtsam.Values(self._point)
        if self.oldest:
            self.graph.add(gtsam.LinearContainerFactor(self._eliminated.message, self._point))
        before = None
        for i, factors in enumerate(self._factors):
            arcs = self._arcs[i]
            if arcs and arcs != before:
                smoother.enter_arcs(*arcs, self.oldest + i)
            before = arcs
            for factor in factors:
                self.graph.add(factor)
        return smoother

    def _phases(
        self, problem: Problem, row: int, k: int, values: gtsam.Values
    ) -> tuple[int, int] | None:
        """Take in the phases of a keyframe; return key and size of arcs that begin, if any."""
        phase = problem.phase
        if phase is None:
            return None
        i = int(phase.row.searchsorted(row))
        if i == len(phase.row) or phase.row[i] != row:
            return None
        block, begun = int(phase.block[i]), None
        if block > self._block:
            self._block = block
            begun = keys.arcs(block), phase.blocks[block - phase.first_block].size
            self._arcs[-1] = begun
            values.insert(begun[0], np.zeros(begun[1]))
            self.add(phase.transition_factor(block), (max(k - 1, 0), k))
        self.add(phase.factor(i, k), (k,))
        return begun

    def _transformed_message(self, before: States) -> gtsam.JacobianFactor:
        """Return the message to the oldest keyframe, led from where that was linearised."""
        message, after = self._eliminated.message, self.states([self.oldest])
        D, step = self.layout.width, before.steps_to(after)[0]
        turn = transpose(before.R_nb)[0] @ after.R_nb[0]
        moved = np.eye(D + 1)  # of steps and minus one
        moved[ROTATION, ROTATION] = moved[POSITION, POSITION] = turn
        moved[:D, -1] = -step
        force_b_mps2 = -transpose(after.R_nb)[0] @ self._gravity_n_mps2[0]  # at rest
        states = before, after
        _transform_bias(moved, step, turn, _ACCELEROMETER, states, force_b_mps2)
        _transform_bias(moved, step, turn, _GYROSCOPE, states, np.zeros(3))
        A, right = message.jacobian()
        variables = self.layout.keyframe(self.oldest)
        rows, others, begin = np.zeros((len(right), D + 1)), list[tuple[int, FloatArray]](), 0
        rows[:, -1] = right
        for key in message.keys():  # noqa: SIM118  # not a dict
            block = A[:, begin : begin + self._eliminated.size(key)]
            begin += block.shape[1]
            if key in variables:
                rows[:, :D][:, _PARTS[variables.index(key)]] = block
            else:
                others.append((key, block))
        rows = rows @ moved
        of_state = [
            (key, rows[:, :D][:, part]) for key, part in zip(variables, _PARTS, strict=True)
        ]
        return linear_factor([*of_state, *others], rows[:, -1])


def _transform_bias(
    moved: FloatArray,
    step: FloatArray,
    turn: FloatArray,
    bias: slice,
    states: tuple[States, States],
    measured_b: FloatArray,
) -> None:
    """Lead what is known of a bias b to where the oldest keyframe is linearised next.

    Measured is ``R (m - b)``, m what the sensor reads, in axes that do not turn: linear in itself,
    and in rotation and bias together of second order, ``turn x b``, which adds up for as long as
    the bias lasts. Of c = b - m the step ``turn c' - c + c x turn`` makes the rows, linear in
    rotation and bias, say what they say of ``R c`` (Barrau and Bonnabel, The Geometry of Navigation
    Problems, IEEE TAC 68(2), 2023: biases in the axes of the group).
    """
    of = slice(bias.start - AUX, bias.stop - AUX)
    before, after = (state.aux[0, of] - measured_b for state in states)
    after = turn @ after
    moved[bias, bias] = turn
    moved[bias, ROTATION] = skew(before - after) @ turn
    moved[bias, -1] = before - after - np.cross(before, step[ROTATION])
