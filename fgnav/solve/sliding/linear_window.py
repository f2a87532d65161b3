"""The newest keyframes of a flight, linearised where GTSAM's window has them, and eliminated.

What leaves stays as a message about the oldest keyframe that remains: marginalisation is exact up
to its linearisation, and the window does not grow.
"""

from collections.abc import Sequence

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotations import skew, transpose
from fgnav.graph import keys
from fgnav.graph.build import (
    Layout,
    insert_constants,
    insert_keyframe,
    insert_variables,
)
from fgnav.graph.linear_factor import linear_factor
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import AUX, POSITION, ROTATION, States, joined
from fgnav.solve.elimination import Elimination
from fgnav.solve.linear import linearise
from fgnav.solve.marginals import Marginals
from fgnav.solve.sliding.relinearisation import has_gyroscope

_ACCELEROMETER, _GYROSCOPE = slice(AUX, AUX + 3), slice(AUX + 3, AUX + 6)  # their biases


class LinearWindow:
    """Keyframes, numbered on from 0 as they come, each linearised somewhere.

    Attributes
    ----------
    states : States
        Where they are linearised; constants stay where they are all along.
    t_s : list of float
        Of all keyframes so far.
    """

    states: States

    def __init__(self) -> None:
        self.t_s: list[float] = []
        self._sources: list[tuple[Problem, int]] = []
        self._here: list[list[gtsam.GaussianFactor]] = []  # of each keyframe alone
        self._links: list[list[gtsam.GaussianFactor]] = []  # to each keyframe from the one before
        self._block: list[int] = []  # of arcs at each keyframe
        self._custom: list[tuple[tuple[int, ...], gtsam.NonlinearFactor]] = []
        self._changed: set[int] = set()  # numbers of keyframes to be linearised
        self._arc_size: dict[int, int] = {}  # by block
        self._eliminated: Elimination

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self._sources)

    @property
    def oldest(self) -> int:
        """Number of the oldest keyframe."""
        return self._eliminated.oldest if self._sources else 0

    @property
    def layout(self) -> Layout:
        """Variables of the newest keyframe's problem."""
        return Layout.of(self._sources[-1][0])

    def append(self, problem: Problem, row: int, at: States, block: int) -> None:
        """Take in a keyframe of a problem, linearised where a state is.

        ``block`` is that of its arcs; negative before any.
        """
        number = len(self.t_s)
        self.t_s.append(float(problem.t_s[row]))
        if number == 0:
            self._eliminated = Elimination(Layout.of(problem), self.t_s.__getitem__)
            self.states = at._replace(constants=problem.start.constants).copied()
        else:
            self.states = joined([self.states, at._replace(constants=self.states.constants)])
        self._sources.append((problem, row))
        self._here.append([])
        self._links.append([])
        self._block.append(block)
        if problem.phase is not None and block >= problem.phase.first_block:
            self._arc_size[block] = problem.phase.blocks[block - problem.phase.first_block].size
        self._eliminated.append(())
        self._changed.add(number)

    def add_custom(self, numbers: Sequence[int], factor: gtsam.NonlinearFactor) -> None:
        """Take in a custom factor that touches some keyframes, and constants."""
        self._custom.append((tuple(numbers), factor))
        self._changed.add(min(numbers))

    def relinearise(self, which: IntArray, at: States) -> None:
        """Linearise some keyframes, (j,), counted from the oldest, at states.

        What has been marginalised is led on to where the oldest is then: it knows rotations and
        positions in ``n``, so their directions turn against the body as the body has turned. Kept
        in body axes, a level that is known later would tell a heading that is none. The same holds
        of biases, which it knows by what they did in ``n``.
        """
        if self.oldest and len(which) and which[0] == 0:
            self._eliminated.message = self._transformed_message(at.at(slice(0, 1)))
        for mine, new in zip(self.states[:4], at[:4], strict=True):
            mine[which] = new
        self._changed.update((which + self.oldest).tolist())

    def solve(self) -> None:
        """Linearise what has changed, and eliminate from there to the newest."""
        if not self._changed:
            return
        for numbers, _ in self._custom:
            if self._changed.intersection(numbers):
                self._changed.add(min(numbers))
        changed = np.array(sorted(self._changed)) - self.oldest
        after = np.union1d(changed, changed[changed < len(self) - 1] + 1)
        self._linearise(np.asarray(after))
        first = max(int(changed[0]) - 1, 0)
        for i in range(first, len(self)):
            self._eliminated.change(i, *self._entering(i))
        self._changed.clear()
        self._eliminated.solve()

    def marginals(self, begin: int, end: int) -> Marginals:
        """Return covariances of keyframes begin to end - 1, counted from the oldest.

        Raises
        ------
        NoSolutionError
            Naming the state that the data leave open.
        """
        return self._eliminated.marginals(begin, end)

    def forget(self, count: int) -> None:
        """Take the oldest keyframes out; what they tell of the next one stays."""
        for of in (self._sources, self._here, self._links, self._block):
            del of[:count]
        self._eliminated.forget(count)
        self.states = self.states.at(slice(count, None))
        self._custom = [one for one in self._custom if min(one[0]) >= self.oldest]
        problem, row = self._sources[0]
        problem.motion.release(row)

    def marginal(self) -> gtsam.NonlinearFactor:
        """Return the information about the oldest keyframe from the marginalized ones."""
        message, point = self._eliminated.message, gtsam.Values()
        insert_keyframe(point, self.layout, self.oldest, self.states)
        insert_constants(point, self.layout, self.states.constants)
        for key, size in self._arcs(0):
            point.insert(key, np.zeros(size))
        return gtsam.LinearContainerFactor(message, point)

    def arcs_size(self, row: int) -> int:
        """Return the dimensions of the arcs of a keyframe, counted from the oldest."""
        return self._arc_size[self._block[row]]

    def _arcs(self, i: int) -> list[tuple[int, int]]:
        """Return key and size of the arcs of a keyframe."""
        block = self._block[i]
        return [] if block < 0 else [(keys.arcs(block), self.arcs_size(i))]

    def _linearise(self, which: IntArray) -> None:
        """Linearise keyframes and the motion to them; those of one problem together."""
        begin, oldest = 0, self.oldest
        while begin < len(which):
            problem, end = self._sources[which[begin]][0], begin + 1
            while end < len(which) and self._sources[which[end]][0] is problem:
                end += 1
            of = which[begin:end]
            rows = np.array([self._sources[i][1] for i in of])
            led = of[of > 0]
            linear = linearise(
                problem,
                rows,
                self.states.at(of),
                self.states.at(led - 1),
                numbers=of + oldest,
                begins=oldest == 0,
            )
            for i, here in zip(of.tolist(), linear.unary_factors(), strict=True):
                self._here[i], self._links[i] = [*here], self._transition(i)
            for i, link in zip(led.tolist(), linear.motion_factors(), strict=True):
                self._links[i].append(link)
            begin = end

    def _transition(self, i: int) -> list[gtsam.GaussianFactor]:
        """Return the transition to the arcs of a keyframe, where they begin there."""
        phase, block = self._sources[i][0].phase, self._block[i]
        before = self._block[i - 1] if i else (block if self.oldest else -1)
        return [] if phase is None or block == before else [phase.transition(block)]

    def _entering(self, i: int) -> tuple[list[gtsam.GaussianFactor], Sequence[tuple[int, int]]]:
        """Return all whose oldest keyframe it is, and the arcs that end with it."""
        factors = [*self._here[i]]
        if i == 0 and self.oldest == 0:
            factors += self._links[0]
        if i + 1 < len(self):
            factors += self._links[i + 1]
        number = self.oldest + i
        factors += [
            linear
            for numbers, factor in self._custom
            if min(numbers) == number and (linear := self._linear(numbers, factor)) is not None
        ]
        ends = i + 1 == len(self) or self._block[i + 1] > self._block[i]
        return factors, self._arcs(i) if ends else ()

    def _linear(
        self, numbers: Sequence[int], factor: gtsam.NonlinearFactor
    ) -> gtsam.GaussianFactor | None:
        values, rows = gtsam.Values(), {k: k - self.oldest for k in numbers}
        insert_variables(values, self.layout, factor.keys(), self.states, rows)
        return factor.linearize(values)  # None of one that is not active

    def _transformed_message(self, to: States) -> gtsam.JacobianFactor:
        """Return the message to the oldest keyframe, led to where that is linearised next."""
        message = self._eliminated.message
        at, D = self.states.at(slice(0, 1)), self.states.width
        step, turn = at.steps_to(to)[0], transpose(at.R_nb)[0] @ to.R_nb[0]
        moved = np.eye(D + 1)  # of steps and minus one
        moved[ROTATION, ROTATION] = moved[POSITION, POSITION] = turn
        moved[:D, -1] = -step
        problem, row = self._sources[0]
        force_b_mps2 = -transpose(to.R_nb)[0] @ problem.motion.gravity_n_mps2[row]  # at rest
        _transform_bias(moved, step, turn, _ACCELEROMETER, (at, to), force_b_mps2)
        if has_gyroscope(step[None]):
            _transform_bias(moved, step, turn, _GYROSCOPE, (at, to), np.zeros(3))
        A, right = message.jacobian()
        begin, terms, of_state = 0, [], {}
        sizes = dict(zip(self.layout.keyframe(self.oldest), (6, 3, D - AUX), strict=True))
        first = dict(zip(sizes, (0, 6, AUX), strict=True))
        rows = np.zeros((len(right), D + 1))
        rows[:, -1] = right
        for key in message.keys():  # noqa: SIM118  # not a dict
            width = self._eliminated.size(key)
            block = A[:, begin : begin + width]
            begin += width
            if key in sizes:
                rows[:, first[key] : first[key] + width] = block
            else:
                terms.append((key, block))
        rows = rows @ moved
        for key, width in sizes.items():
            of_state[key] = rows[:, first[key] : first[key] + width]
        return linear_factor([*of_state.items(), *terms], rows[:, -1])


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
