"""The newest keyframes of a flight, linearised and eliminated beside GTSAM's window.

What leaves stays as forward information of the oldest keyframe that remains: marginalisation is
exact up to its linearisation, and the window does not grow.
"""

import gtsam
import numpy as np
from scipy.linalg import solve_triangular

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.geometry.rotations import skew, transpose
from fgnav.graph.build import Layout
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import AUX, POSITION, ROTATION, States
from fgnav.solve.chain import back_kernel
from fgnav.solve.chain.arcs import Border
from fgnav.solve.chain.arrays import WindowArrays
from fgnav.solve.chain.linear import Links, linearise
from fgnav.solve.marginals import Marginals
from fgnav.solve.sliding.relinearisation import has_gyroscope
from fgnav.solve.unary import add_unary

_LEAST_ROOM = 64  # keyframes
_ACCELEROMETER, _GYROSCOPE = slice(AUX, AUX + 3), slice(AUX + 3, AUX + 6)  # their biases


class LinearWindow:
    """Keyframes, numbered on from 0 as they come, each linearised somewhere.

    Attributes
    ----------
    constants : ndarray, shape (b,)
        Where constants are linearised, all along.
    end : ndarray, shape (D + b + a,)
        Steps of the newest keyframe, of the constants and of its arcs, once solved.
    oldest : int
        Number of the oldest keyframe.
    rows : WindowArrays
        Of the keyframes.
    """

    def __init__(self) -> None:
        self.constants, self.end, self.oldest = np.empty(0), np.empty(0), 0
        self._sources: list[tuple[SmoothingProblem, int]] = []
        self._memory = WindowArrays.empty(0, AUX, 0)
        self.rows = self._memory  # of the keyframes
        self._first = 0  # row of the oldest
        self._changed = np.zeros(0, dtype=np.bool_)  # since it was linearised
        self._end_covariance = np.empty((0, 0))
        self._unary: dict[int, list[gtsam.NonlinearFactor]] = {}  # factors of one's own
        self._border = Border(None)

    def __len__(self) -> int:
        """Return how many keyframes there are."""
        return len(self._sources)

    @property
    def states(self) -> States:
        """Where they are linearised."""
        return self.rows.states(self.constants)

    def append(self, problem: SmoothingProblem, row: int, at: States) -> None:
        """Take in a keyframe of a problem, linearised where a state is."""
        if not self._sources:
            self.constants = np.array(problem.start.constants)
            self._border = Border(problem.phase)
            self.end = np.zeros(problem.width + len(self.constants) + self._border.width)
        self._border.read(problem.phase)
        self._make_room(problem.width)
        here = self._first + len(self)
        self._memory.t_s[here] = problem.t_s[row]
        self._memory.place(slice(here, here + 1), at)
        self._sources.append((problem, row))
        self._border.append(row)
        self._changed = np.append(self._changed, True)
        self.rows = self._memory.between(self._first, here + 1)

    def add_unary(self, number: int, factor: gtsam.NonlinearFactor) -> None:
        """Take in a factor of one's own that touches one new keyframe, and constants, at most."""
        self._unary.setdefault(number, []).append(factor)

    def relinearise(self, which: IntArray, at: States) -> None:
        """Linearise some keyframes, (j,), counted from the oldest, at states.

        What has been marginalised is led on to where the oldest is then: it knows rotations and
        positions in ``n``, so their directions turn against the body as the body has turned. Kept
        in body axes, a level that is known later would tell a heading that is none. The same holds
        of biases, which it knows by what they did in ``n``.
        """
        if self.oldest and len(which) and which[0] == 0:
            self._lead_marginal(at.at(slice(0, 1)))
        self.rows.place(which, at)
        self._changed[which] = True
        self._changed[which[which < len(self) - 1] + 1] = True
        self._changed[0] &= not self.oldest

    def _lead_marginal(self, to: States) -> None:
        """Lead the forward information of the oldest keyframe to where it is linearised next."""
        at, forward = self.states.at(slice(0, 1)), self.rows.forward[0]
        step, turn = at.steps_to(to)[0], transpose(at.R_nb)[0] @ to.R_nb[0]
        moved = np.eye(len(forward))
        moved[ROTATION, ROTATION] = moved[POSITION, POSITION] = turn
        moved[: len(step), -1] = -step
        problem, row = self._sources[0]
        force_b_mps2 = -transpose(to.R_nb)[0] @ problem.motion.gravity_n_mps2[row]  # at rest
        _lead_bias(moved, step, turn, _ACCELEROMETER, (at, to), force_b_mps2)
        if has_gyroscope(step[None]):
            _lead_bias(moved, step, turn, _GYROSCOPE, (at, to), np.zeros(3))
        forward[:] = np.triu(moved.T @ (np.triu(forward) + np.triu(forward, 1).T) @ moved)

    def arcs_size(self, row: int) -> int:
        """Return how many dimensions the arcs of a keyframe have, counted from the oldest."""
        return self._border.size(row)

    @property
    def row_of_arcs(self) -> int:
        """Number of the keyframe whose arcs ``marginal`` is of: the next, if others begin there."""
        return int(self._border.leads_on)

    def marginal(self) -> tuple[FloatArray, FloatArray]:
        """Return what is known of the oldest keyframe by then: whitened rows and right-hand side.

        Of its state, the constants and the arcs of ``row_of_arcs``.

        Raises
        ------
        NoSolutionError
            If squares have not digits enough.
        """
        forward = self.rows.forward[0]
        size = len(self.rows.root[0]) + len(self.constants) + self.arcs_size(self.row_of_arcs)
        try:
            R = np.linalg.cholesky(forward[:size, :size], upper=True)
        except np.linalg.LinAlgError as error:
            raise NoSolutionError("window: what has left it is known to too few digits") from error
        return R, solve_triangular(R, forward[:size, -1], trans="T")

    def solve(self) -> None:
        """Linearise what has changed, and carry information on from there to the newest.

        Raises
        ------
        NoSolutionError
            If the data leave a state open, or squares have not digits enough; GTSAM names it.
        """
        if not self._changed.any():
            return
        rows = self.rows
        changed = np.flatnonzero(self._changed)
        self._linearise(rows, changed)
        first = max(int(changed[0]) - 1, 0)
        if first == 0 and not self.oldest:
            rows.forward[0] = rows.node[0]
            self._border.begin(rows.forward[0])
        if not (
            self._eliminated(rows, first, by_rows=False) or self._eliminated(rows, 0, by_rows=True)
        ):
            raise NoSolutionError("window: the data leave a state open")
        self._changed[:] = False

    def marginals(self, begin: int, end: int) -> Marginals:
        """Return covariances of keyframes begin to end - 1, counted from the oldest."""
        rows, D, b = self.rows, len(self.rows.root[0]), len(self.constants)
        n, m = len(self) - begin, end - begin
        out = np.empty((n, D, D)), np.zeros((n, D, D)), np.empty((n, D, b))
        self._border.marginals(begin, rows.gain, rows.root, self._end_covariance, out)
        constant = self._end_covariance[D : D + b, D : D + b].copy()
        covariance, cross, shared = out if m == n else (one[:m].copy() for one in out)
        return Marginals(covariance, cross, constant, shared)

    def forget(self, count: int) -> None:
        """Take the oldest keyframes out; what they tell of the next one stays."""
        for number in range(self.oldest, self.oldest + count):
            self._unary.pop(number, None)
        del self._sources[:count]
        if self._sources:
            problem, row = self._sources[0]
            problem.motion.release(row)
        self._border.forget(count)
        self._changed = self._changed[count:]
        self._first, self.oldest = self._first + count, self.oldest + count
        self.rows = self.rows.between(count, len(self.rows.t_s))

    def _make_room(self, width: int) -> None:
        """When the memory is full or too narrow, move what is there to the front of another one."""
        constants, arcs = len(self.constants), self._border.width
        wider = width + constants + arcs - len(self.end)
        if not wider and self._first + len(self) < len(self._memory.t_s):
            return
        memory = WindowArrays.empty(max(_LEAST_ROOM, 2 * len(self)), width, constants, arcs)
        if len(self):
            memory.take(self.rows, wider)
        self.end = np.append(self.end, np.zeros(wider))
        self._memory, self._first = memory, 0

    def _linearise(self, rows: WindowArrays, changed: IntArray) -> None:
        """Fill what enters with some keyframes; those of one problem together."""
        states, links = rows.states(self.constants), Links(rows.motion, rows.node)
        begin = 0
        while begin < len(changed):
            problem, end = self._sources[changed[begin]][0], begin + 1
            while end < len(changed) and self._sources[changed[end]][0] is problem:
                end += 1
            of = changed[begin:end]
            linearise(
                problem,
                np.array([self._sources[k][1] for k in of]),
                states.at(of),
                states.at(of[of > 0] - 1),
                links,
                of,
            )
            begin = end
        numbers = (changed + self.oldest).tolist() if self._unary else []
        if own := {number: self._unary[number] for number in numbers if number in self._unary}:
            of_rows = {number: number - self.oldest for number in own}
            add_unary(own, Layout.of(self._sources[-1][0]), of_rows, states, links.node)

    def _eliminated(self, rows: WindowArrays, first: int, *, by_rows: bool) -> bool:
        """Solve for the newest keyframe and the constants; return whether all are determined."""
        rows = rows.between(0, len(self))
        parts = (rows.motion, rows.node, rows.forward, rows.root, rows.gain)
        if self._border.eliminate(parts, first, by_rows=by_rows) >= 0:
            return False
        self._end_covariance = np.empty((len(self.end), len(self.end)))
        least = back_kernel.newest(rows.forward[-1], self._end_covariance, self.end)
        return bool(np.isfinite(least))


def _lead_bias(
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
    moved[bias, ROTATION] = skew((before - after)[None])[0] @ turn
    moved[bias, -1] = before - after - np.cross(before, step[ROTATION])
