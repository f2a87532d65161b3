"""Gradients of a flight's minimum and its covariance, by residuals and covariances of factors.

At the minimum x of half the squared whitened residuals r, of Jacobian J, with ``H = J' J`` and
``P = H^-1``, a function L of x and P has, by the implicit function theorem, for any parameter,

    dL = l' d(J' r) - <M, d(J' J)>      M = P B P      l = -(H + E)^-1 (a - d<M, J' J>/dx)

where d acts with x held, ``a = dL/dx`` and ``B = dL/dP``. ``E = (dJ/dx)' r`` is the curvature that
Gauss-Newton neglects: without it gradients of means are wrong by up to a tenth. dJ/dx is found by
differences, and the system is solved by conjugate gradients with P for a preconditioner [1]_. P
and M are those of the elimination, whose conditionals
``x_k = -A x_s`` and noise Q change with the information N of a keyframe and its separators by

    dQ = -Q N_kk Q        dA = Q (N_ks - N_kk A)        N_next = [-A' I] N [-A; I] + B_next

References
----------
.. [1] Nocedal & Wright, Numerical Optimization, 2nd edition, 2006, section 5.1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import gtsam
import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, NoSolutionError
from fgnav.graph.build import Layout
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import AUX, States
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
class _PriorTerm:
    """Prior of the first keyframe's biases, or of its rate."""

    motion: Motion
    keyframes: IntArray

    def linearise(self, states: Sequence[States]) -> tuple[FloatArray, FloatArray]:
        first = states[0]
        mean, rows = self.motion.prior(len(first.constants))
        value = rows @ np.concatenate([first.aux[0] - mean, first.constants])
        return value[None], np.pad(rows, ((0, 0), (AUX, 0)))[None]


@dataclass(frozen=True, eq=False, slots=True)
class _SensorTerm:
    sensor: Sensor
    keyframes: IntArray

    def linearise(self, states: Sequence[States]) -> tuple[FloatArray, FloatArray]:
        value, *blocks = self.sensor.linearise(states[0], np.arange(len(self.keyframes)))
        return value, np.concatenate(blocks, axis=2)


def terms_of(problem: Problem) -> list[Term]:
    """Return motion, its prior and sensors of a problem as terms.

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
    k, motion = np.arange(len(problem.t_s) - 1), problem.motion
    return [
        _MotionTerm(motion, np.stack([k, k + 1], axis=1)),
        _PriorTerm(motion, np.zeros((1, 1), np.int64)),
        *(_SensorTerm(sensor, sensor.row[:, None]) for sensor in problem.sensors),
    ]


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

    def change(self, before: Term, after: Term, states: States) -> float:
        """Return by how much ``r' J l - <M, J' J>`` differs between two terms, with x held.

        By products of differences and means: of large weights the sums are rounding.
        """
        (r, J), (s, K) = (term.linearise(states_of(term, states)) for term in (before, after))
        step, M = self.derivatives(before.keyframes)
        dr, dJ, r, J = s - r, K - J, (r + s) / 2, (J + K) / 2
        moved = np.einsum("mf,mfw->mw", dr, J) + np.einsum("mf,mfw->mw", r, dJ)
        return float((moved * step).sum() - 2 * ((J @ M) * dJ).sum())


def states_of(term: Term, states: States) -> list[States]:
    """Return the states of a term's groups, keyframe by keyframe."""
    return [states.at(rows) for rows in term.keyframes.T]


class _Curvature(NamedTuple):
    """Second derivatives of the residuals of a term's groups, contracted."""

    columns: IntArray  # (m, w)
    E: FloatArray  # ``(dJ/dx)' r``, (m, w, w)
    slope: FloatArray  # ``d<M, J' J>/dx``, (m, w)

    def summed(self, values: FloatArray, size: int) -> FloatArray:
        """Return values of the groups' columns, (m, w), added up by column."""
        return np.asarray(np.bincount(self.columns.ravel(), values.ravel(), size), np.float64)


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
        for conditional in elimination.conditionals:
            self._net.push_back(conditional)
            columns = np.concatenate([self._columns[key] for key in conditional.keys()])  # noqa: SIM118
            inverse = np.linalg.inv(conditional.R())
            self._conditionals.append(
                _Conditional(columns, inverse @ conditional.S(), inverse @ inverse.T)
            )

    def adjoint(self, a: FloatArray, B: FloatArray, curved: Sequence[Term]) -> Adjoint:
        """Return the adjoint of a function of the minimum and of keyframes' covariances.

        Parameters
        ----------
        a : ndarray, shape (n, D)
            Its derivative by the keyframes' tangents.
        B : ndarray, shape (n, D, D)
            That by their covariances, symmetric.
        curved : sequence of Term
            Whose Jacobians change with the states; of none mean and covariance are Gauss-Newton's.

        Raises
        ------
        NoSolutionError
            If the states are at no minimum.
        """
        joints = self._joints(B)
        found = Adjoint(self._n, self._D, np.zeros(self._size), joints)
        right = np.concatenate([a.ravel(), np.zeros(self._b)])
        curvatures = [self._curvature(term, found) for term in curved]
        for curvature in curvatures:
            right -= curvature.summed(curvature.slope, self._size)
        return Adjoint(self._n, self._D, -self._solved(right, curvatures), joints)

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
            indices = _places(columns, at)
            N[np.ix_(indices, indices)] += message
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

    def _curvature(self, term: Term, found: Adjoint) -> _Curvature:
        """Compute the curvature of a term by differences of its Jacobians."""
        at, D = states_of(term, self._states), self._D
        columns, (_, M) = found.columns(term.keyframes), found.derivatives(term.keyframes)
        (m, w), end = columns.shape, len(at) * D
        r, J = term.linearise(at)
        slope, E, JM = np.empty((m, w)), np.empty((m, w, w)), J @ M
        for i, step in enumerate(_STEP * np.eye(w)):
            moved = [
                states.moved(np.tile(offset, (m, 1)), step[end:])
                for states, offset in zip(at, np.split(step[:end], len(at)), strict=True)
            ]
            change = (term.linearise(moved)[1] - J) / _STEP
            slope[:, i] = 2 * np.einsum("mfw,mfw->m", change, JM)
            E[:, :, i] = np.einsum("mfw,mf->mw", change, r)
        # Its antisymmetric part is that of tangents, and at a minimum none in the sum of all terms.
        return _Curvature(columns, (E + E.swapaxes(1, 2)) / 2, slope)

    def _solved(self, a: FloatArray, curvatures: Sequence[_Curvature]) -> FloatArray:
        """Return ``(H + E)^-1 a``."""
        x = self.times(a)

        def curvature(v: FloatArray) -> FloatArray:
            products = (
                term.summed(np.einsum("mwu,mu->mw", term.E, v[term.columns]), len(v))
                for term in curvatures
            )
            return sum(products, np.zeros_like(v))

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


def _places(columns: IntArray, wanted: IntArray) -> IntArray:
    """Return where columns stand among others, in any order."""
    order = columns.argsort()
    return order[columns.searchsorted(wanted, sorter=order)]
