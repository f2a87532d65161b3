"""Gradients of a flight's minimum and its covariance, by residuals and covariances of factors.

At the minimum x of half the squared whitened residuals r, of Jacobian J, with ``H = J' J`` and
``P = H^-1``, a function L of x and P has, by the implicit function theorem, for any parameter,

    dL = l' d(J' r) - <M, d(J' J)>      M = P B P      l = -(H + E)^-1 (a - d<M, J' J>/dx)

where d acts with x held, ``a = dL/dx`` and ``B = dL/dP``. ``E v = (dJ/dx v)' r`` is the curvature
that Gauss-Newton neglects; it is found by differences of J, and the system is solved by conjugate
gradients with P for a preconditioner [1]_. P and M are those of the elimination, whose conditionals
``x_k = -A x_s`` and noise Q change with the information N of a keyframe and its separators by

    dQ = -Q N_kk Q        dA = Q (N_ks - N_kk A)        N_next = [-A' I] N [-A; I] + B_next

References
----------
.. [1] Nocedal & Wright, Numerical Optimization, 2nd edition, 2006, section 5.1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import gtsam
import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, NoSolutionError
from fgnav.graph.build import Layout
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import States
from fgnav.solve.elimination import Elimination

_STEP = 1e-5  # of differences, rad, m, m/s: about the cube root of rounding
_TOLERANCE = 1e-9  # of conjugate gradients, in the norm of P
_MOST = 60  # iterations; 4 to 12 where a flight is at its minimum


class Term(Protocol):
    """Rows of residuals, m groups of f, each of the same number of keyframes and the constants."""

    @property
    def keyframes(self) -> IntArray:
        """Of each group, (m, c), increasing."""
        ...

    def linearise(self, states: Sequence[States]) -> tuple[FloatArray, FloatArray]:
        """Return whitened residuals, (m, f), and Jacobians, (m, f, c D + b), at c states."""
        ...


@dataclass(frozen=True, eq=False, slots=True)
class _MotionTerm:
    motion: Motion
    keyframes: IntArray

    def linearise(self, states: Sequence[States]) -> tuple[FloatArray, FloatArray]:
        value, *blocks = self.motion.linearise(states[0], states[1], self.keyframes[:, 0])
        return value, np.concatenate(blocks, axis=2)


@dataclass(frozen=True, eq=False, slots=True)
class _SensorTerm:
    sensor: Sensor
    keyframes: IntArray

    def linearise(self, states: Sequence[States]) -> tuple[FloatArray, FloatArray]:
        value, *blocks = self.sensor.linearise(states[0], np.arange(len(self.keyframes)))
        return value, np.concatenate(blocks, axis=2)


def terms_of(problem: Problem) -> list[Term]:
    """Return motion and sensors of a problem as terms.

    Raises
    ------
    BadInputError
        If it has ambiguities, which change from keyframe to keyframe.
    """
    if problem.phase is not None:
        raise BadInputError(
            "training through the smoother: carrier phase of single antennas is not "
            "differentiated; take flights with fixes"
        )
    k = np.arange(len(problem.t_s) - 1)
    sensors = (_SensorTerm(one, one.row[:, None]) for one in problem.sensors)
    return [_MotionTerm(problem.motion, np.stack([k, k + 1], axis=1)), *sensors]


class _Joint(NamedTuple):
    """P and M of some columns of a flight's tangent."""

    columns: IntArray
    P: FloatArray
    M: FloatArray


class _Conditional(NamedTuple):
    """``x_k = -A x_s`` and noise Q; columns of x_k and x_s, those of x_k first."""

    columns: IntArray
    A: FloatArray
    Q: FloatArray

    def joint(self, above: _Joint, extra: IntArray, N: FloatArray) -> _Joint:
        """Return P and M of it, of its separators, and of columns beside them, which are above."""
        f = len(self.Q)
        others = self.columns[f:]
        others = np.concatenate([others, extra[~np.isin(extra, others)]])
        rows = np.ix_(*2 * (_places(above.columns, others),))
        P, M = above.P[rows], above.M[rows]
        A, dA = np.zeros((f, len(others))), np.zeros((f, len(others)))
        s = self.A.shape[1]
        A[:, :s], dA[:, :s] = self.A, self.Q @ (N[:f, f:] - N[:f, :f] @ self.A)
        AP, changed = A @ P, dA @ P - A @ M
        half = dA @ AP.T
        own = self.Q @ N[:f, :f] @ self.Q - half - half.T + A @ M @ A.T
        return _Joint(
            np.concatenate([self.columns[:f], others]),
            np.block([[self.Q + AP @ A.T, -AP], [-AP.T, P]]),
            np.block([[own, changed], [changed.T, M]]),
        )


@dataclass(frozen=True, eq=False, slots=True)
class Adjoint:
    """The derivatives l and M of a function of a flight's minimum, as terms see them."""

    n: int  # keyframes
    D: int  # dimensions of one's tangent
    step: FloatArray  # l, (n D + b,)
    joints: list[_Joint]  # of each keyframe and what its factors join it with

    def columns(self, keyframes: IntArray) -> IntArray:
        """Return where the tangents of a term's groups are in all, (m, c D + b)."""
        own = keyframes[:, :, None] * self.D + np.arange(self.D)
        constants = np.arange(self.n * self.D, len(self.step))
        shared = np.broadcast_to(constants, (len(keyframes), len(constants)))
        return np.concatenate([own.reshape(len(keyframes), -1), shared], axis=1)

    def derivatives(self, keyframes: IntArray) -> tuple[FloatArray, FloatArray]:
        """Return l and M of a term's groups, (m, c D + b) and (m, c D + b, c D + b).

        M is zero where no factor joins the group's keyframes.
        """
        columns = self.columns(keyframes)
        blocks = np.zeros((*columns.shape, columns.shape[1]))
        for i, (k, wanted) in enumerate(zip(keyframes[:, 0], columns, strict=True)):
            joint = self.joints[k]
            is_there = np.isin(wanted, joint.columns)
            places = _places(joint.columns, wanted[is_there])
            blocks[i][np.ix_(is_there, is_there)] = joint.M[np.ix_(places, places)]
        return self.step[columns], blocks

    def between_rows(self, term: Term, states: States) -> FloatArray:
        """Return ``r (J l)' - J M J'`` of each group of a term, (m, f, f).

        If the information of its rows is ``1 + dW``, dL is the sum of its products with dW.
        """
        r, J = term.linearise([states.at(rows) for rows in term.keyframes.T])
        step, M = self.derivatives(term.keyframes)
        moved = np.einsum("mfw,mw->mf", J, step)
        return np.asarray(r[:, :, None] * moved[:, None, :] - J @ M @ J.swapaxes(1, 2))


class PosteriorCovariance:
    """The covariance of a flight at its minimum, as the inverse of its information.

    Parameters
    ----------
    elimination : Elimination
        Of the factors linearised at the minimum, solved.
    layout : Layout
    states : States
        The minimum.
    """

    def __init__(self, elimination: Elimination, layout: Layout, states: States) -> None:
        self._states, self._layout = states, layout
        self._n, self._D, self._b = len(states.R_nb), layout.width, len(states.constants)
        begin, self._columns = 0, dict[int, IntArray]()
        sizes = (6, 3, layout.width - 9)
        of_keyframes = [
            (key, size)
            for k in range(self._n)
            for key, size in zip(layout.keyframe(k), sizes, strict=True)
        ]
        parts = zip(layout.constant_keys, layout.constants.parts, strict=True)
        for key, size in (*of_keyframes, *((key, part.size) for key, part in parts)):
            self._columns[key] = np.arange(begin, begin + size)
            begin += size
        self._size, self._net = begin, gtsam.GaussianBayesNet()
        self._conditionals = []
        for one in elimination.conditionals:
            self._net.push_back(one)
            columns = np.concatenate([self._columns[key] for key in one.keys()])  # noqa: SIM118
            inverse = np.linalg.inv(one.R())
            self._conditionals.append(_Conditional(columns, inverse @ one.S(), inverse @ inverse.T))

    def adjoint(
        self, a: FloatArray, B: FloatArray, terms: Sequence[Term], curved: Sequence[Term]
    ) -> Adjoint:
        """Return the adjoint of a function of the minimum and of keyframes' covariances.

        Parameters
        ----------
        a : ndarray, shape (n, D)
            Its derivative by the keyframes' tangents.
        B : ndarray, shape (n, D, D)
            That by their covariances, symmetric.
        terms : sequence of Term
            Whose change of Jacobians with the states counts in the covariance.
        curved : sequence of Term
            Whose curvature counts in the mean; of none both are Gauss-Newton's.

        Raises
        ------
        NoSolutionError
            If the states are at no minimum.
        """
        joints = self._joints(B)
        found = Adjoint(self._n, self._D, np.zeros(self._size), joints)
        right = np.concatenate([a.ravel(), np.zeros(self._b)])
        for term in terms:
            right -= self._slope(term, found)
        return Adjoint(self._n, self._D, -self._solved(right, curved, found.columns), joints)

    def times(self, a: FloatArray) -> FloatArray:
        """Return ``P a``, (n D + b,)."""
        given = gtsam.VectorValues()
        for key, columns in self._columns.items():
            given.insert(key, a[columns])
        solved = self._net.backSubstitute(self._net.backSubstituteTranspose(given))
        return np.asarray(solved.vector(list(self._columns)))

    def _joints(self, B: FloatArray) -> list[_Joint]:
        """Return P and ``P B P`` of keyframes and what joins them, B of each keyframe."""
        D, constants = self._D, np.arange(self._n * self._D, self._size)
        informations, message = [], np.zeros((0, 0))
        at: IntArray = np.zeros(0, np.int64)
        for k, (columns, A, _) in enumerate(self._conditionals):
            N = np.zeros((len(columns), len(columns)))
            if k < self._n:
                N[:D, :D] = B[k]
            places = _places(columns, at)
            N[np.ix_(places, places)] += message
            kept = np.vstack([-A, np.eye(A.shape[1])])
            message, at = kept.T @ N @ kept, columns[len(A) :]
            informations.append(N)
        above, joints = _Joint(at, np.zeros((0, 0)), np.zeros((0, 0))), []
        for k in range(len(self._conditionals) - 1, -1, -1):
            following = np.arange(k * D + D, min(k + 2, self._n) * D)
            extra = constants[:0] if k == self._n else np.concatenate([following, constants])
            above = self._conditionals[k].joint(above, extra, informations[k])
            joints.append(above)
        return joints[::-1][: self._n]

    def _slope(self, term: Term, found: Adjoint) -> FloatArray:
        """Return the derivative of ``<M, J' J>`` by the states, of one term."""
        at, D = self._states_of(term, self._states), self._D
        _, M = found.derivatives(term.keyframes)
        columns, slope = found.columns(term.keyframes), np.zeros(self._size)
        m, end = len(columns), len(at) * D
        _, J = term.linearise(at)
        JM = np.einsum("mfw,mwu->mfu", J, M, optimize=True)
        for column, step in zip(columns.T, _STEP * np.eye(columns.shape[1]), strict=True):
            parts = np.split(step[:end], len(at))
            moved = [
                one.moved(np.tile(part, (m, 1)), step[end:])
                for one, part in zip(at, parts, strict=True)
            ]
            change = term.linearise(moved)[1] - J
            np.add.at(slope, column, 2 / _STEP * np.einsum("mfw,mfw->m", change, JM))
        return slope

    def _solved(
        self, a: FloatArray, terms: Sequence[Term], columns: Callable[[IntArray], IntArray]
    ) -> FloatArray:
        """Return ``(H + E)^-1 a``, E of some terms."""
        x = self.times(a)
        if not (terms and a.any()):
            return x
        values = [(term, term.linearise(self._states_of(term, self._states))[0]) for term in terms]

        def curvature(v: FloatArray) -> FloatArray:
            total, h = np.zeros_like(v), _STEP / np.abs(v).max()
            for sign in (h, -h):
                steps, constants = np.split(sign * v, [self._n * self._D])
                moved = self._states.moved(steps.reshape(self._n, self._D), constants)
                for term, r in values:
                    J = term.linearise(self._states_of(term, moved))[1]
                    along = np.einsum("mfw,mf->mw", J, r) / (2 * sign)
                    np.add.at(total, columns(term.keyframes), along)
            return total

        # (1 + P E) x = P a, by conjugate gradients in the inner product of H: H p of each
        # direction is the sum of residuals that made it.
        left = -curvature(x)
        z = self.times(left)
        p, Hp, squares = z, left, float(left @ z)
        least = _TOLERANCE**2 * float(a @ x)
        for _ in range(_MOST):
            if squares <= least:
                return x
            Ap = Hp + curvature(p)
            bent = float(p @ Ap)
            if bent <= 0.0:
                break
            x = x + squares / bent * p
            left = left - squares / bent * Ap
            z = self.times(left)
            previous, squares = squares, float(left @ z)
            p, Hp = z + squares / previous * p, left + squares / previous * Hp
        raise NoSolutionError("state: the search ended at no minimum: nothing is learned there")

    @staticmethod
    def _states_of(term: Term, states: States) -> list[States]:
        return [states.at(rows) for rows in term.keyframes.T]


def _places(columns: IntArray, wanted: IntArray) -> IntArray:
    """Return where columns stand among others, in any order."""
    order = columns.argsort()
    return order[columns.searchsorted(wanted, sorter=order)]
