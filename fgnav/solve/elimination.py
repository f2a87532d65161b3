"""Linearised factors of a flight eliminated by GTSAM's QR, keyframe by keyframe from the oldest.

What enters with keyframe k, and the message of those before it, become

    R x_k + S x_s = d        and a message about the separators x_s: later keyframes and constants.

Backwards from the newest [1]_, section 3, constants carried along:

    P_ks = -R^-1 S P_ss        P_kk = R^-1 R^-T - P_ks S' R^-T

The same marginals by ``ISAM2.jointMarginalCovariance`` take 15 ms a keyframe in a flight of 200: it
seeks the way to the constants anew for each.

References
----------
.. [1] Kaess, Dellaert: Covariance recovery from a square root information matrix for data
   association, Robotics and Autonomous Systems 57, 2009.
"""

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph import keys
from fgnav.graph.build import Layout
from fgnav.graph.factors.antenna_phase import AntennaPhase
from fgnav.solve.elimination_kernel import descended
from fgnav.solve.failures import open_constant, open_state
from fgnav.solve.marginals import Marginals

# A pivot below this leaves a state open: sigma 1e6 m or rad, where the weakest prior has 1e3.
# Rounding beside carrier phase (1e4 per metre) makes pivots of 1e-11 out of nothing.
_LEAST_PIVOT = 1e-6


class _Eliminated(NamedTuple):
    """What elimination of a keyframe leaves."""

    variables: list[int]  # its own, then separators
    R: FloatArray
    S: FloatArray
    d: FloatArray


class _Joint(NamedTuple):
    """Joint covariance of some variables, and where each of them begins in it."""

    place: dict[int, int]
    P: FloatArray


class Elimination:
    """A flight's factors where they are linearised, and what is known by them.

    Parameters
    ----------
    layout : Layout
    t_s : callable
        Time of a keyframe, for errors.
    factors : iterable of gtsam.NonlinearFactor
    values : gtsam.Values
        Of all variables.
    last : int
        The newest keyframe; the oldest is 0.
    phase : AntennaPhase, optional
        Whose arcs are variables, too: each is eliminated with the last keyframe that has it.
    """

    def __init__(
        self,
        layout: Layout,
        t_s: Callable[[int], float],
        factors: Iterable[gtsam.NonlinearFactor],
        values: gtsam.Values,
        last: int,
        phase: AntennaPhase | None = None,
    ) -> None:
        self._layout, self._t_s, self._last = layout, t_s, last
        self._constants = layout.constant_keys
        ends = {} if phase is None else phase.ending(last)
        self._arcs = {keys.arcs(j): k for k, of in ends.items() for j in of}
        self._keyframes = {
            k: (*layout.keyframe(k), *map(keys.arcs, ends.get(k, ()))) for k in range(last + 1)
        }
        sizes = (part.size for part in layout.constants.parts)
        self._size = dict(zip(self._constants, sizes, strict=True))
        for own in self._keyframes.values():
            self._size.update(zip(own[:3], (6, 3, layout.width - 9), strict=True))
        if phase is not None:
            self._size.update({keys.arcs(j): one.size for j, one in enumerate(phase.blocks)})
        self._eliminated: list[_Eliminated] = []
        self._solve(self._linearised(factors, values))

    @property
    def promised(self) -> float:
        """Return by how much the step lowers the sum of squares, if all were linear."""
        return float(sum(one.d @ one.d for one in self._ends))

    @property
    def log_root(self) -> float:
        """Return the log determinant of the square root of the information of all variables."""
        return float(sum(np.log(np.abs(one.R.diagonal())).sum() for one in self._ends))

    @property
    def _ends(self) -> list[_Eliminated]:
        return [*self._eliminated, *([self._of_constants] if self._of_constants else [])]

    def step(self) -> tuple[FloatArray, FloatArray, dict[int, FloatArray]]:
        """Return the Newton step of keyframes, (m, D), of the constants, (b,), and of arcs by key.

        Raises
        ------
        NoSolutionError
            If a variable is not determined, by name.
        """
        constants = self._of_constants
        x = np.linalg.solve(constants.R, constants.d) if constants else np.empty(0)
        at = self._places(self._constants)
        steps = {key: x[at[key] : at[key] + self._size[key]] for key in self._constants}
        for k in range(self._last, -1, -1):
            one, own = self._eliminated[k], self._keyframes[k]
            self._check(own, one.R)
            beside = [steps[key] for key in one.variables[len(own) :]]
            right = one.d - one.S @ np.concatenate(beside) if beside else one.d
            moves = np.linalg.solve(one.R, right)
            for key, begin in self._places(own).items():
                steps[key] = moves[begin : begin + self._size[key]]
        keyframes = self._keyframes.values()
        moved = np.array([np.concatenate([steps[key] for key in own[:3]]) for own in keyframes])
        return moved, x, {key: steps[key] for key in self._arcs}

    def marginals(self) -> Marginals:
        """Return covariances of all keyframes, and of each with the next.

        Raises
        ------
        NoSolutionError
            If a variable is not determined, by name: QR does not fail of it.
        """
        D, b, n = self._layout.width, self._layout.constants.width, self._last + 1
        joint = self._root()
        out = Marginals(np.empty((n, D, D)), np.zeros((n, D, D)), joint.P, np.empty((n, D, b)))
        for k in range(self._last, -1, -1):
            joint = self._descend(k, joint)
            out.covariance[k] = joint.P[:D, :D]  # a keyframe's own come first
            if k < self._last:
                out.cross[k] = joint.P[:D, self._rows(joint, self._keyframes[k + 1][:3])]
            if b:
                out.constant_cross[k] = joint.P[:D, self._rows(joint, self._constants)]
        return out

    def _linearised(
        self, factors: Iterable[gtsam.NonlinearFactor], values: gtsam.Values
    ) -> list[list[gtsam.GaussianFactor]]:
        """Return linear factors by the first keyframe that each touches; 0 of constants alone."""
        entering: list[list[gtsam.GaussianFactor]] = [[] for _ in self._keyframes]
        for factor in factors:
            involved = [key for key in factor.keys() if key not in self._constants]  # noqa: SIM118
            touched = [self._arcs.get(key, keys.index(key)) for key in involved]
            linear = factor.linearize(values)
            if linear is not None:  # a factor that is not active is none
                entering[min(touched, default=0)].append(linear)
        return entering

    def _solve(self, entering: list[list[gtsam.GaussianFactor]]) -> None:
        """Eliminate keyframe after keyframe, then the constants."""
        message: gtsam.JacobianFactor | None = None
        for k, own in self._keyframes.items():
            graph = gtsam.GaussianFactorGraph()
            for linear in entering[k]:
                graph.push_back(linear)
            entering[k] = []
            eliminated, message = _eliminate(graph, message, own)
            self._eliminated.append(eliminated)
        self._of_constants: _Eliminated | None = None
        if self._constants:
            graph = gtsam.GaussianFactorGraph()
            self._of_constants, _ = _eliminate(graph, message, self._constants)
            self._check(self._constants, self._of_constants.R)

    def _root(self) -> _Joint:
        """Return the covariance of the constants."""
        one = self._of_constants
        inverse = np.linalg.inv(one.R) if one else np.empty((0, 0))
        return _Joint(self._places(self._constants), inverse @ inverse.T)

    def _descend(self, k: int, after: _Joint) -> _Joint:
        """Return the joint covariance of a keyframe, its separators, the next and the constants."""
        one, own = self._eliminated[k], self._keyframes[k]
        self._check(own, one.R)
        carried = (*self._keyframes.get(k + 1, ()), *self._constants)
        variables = list(one.variables)
        variables += [key for key in carried if key not in variables]
        rows = self._rows(after, variables[len(own) :])
        return _Joint(
            self._places(variables), descended(one.R, np.ascontiguousarray(one.S), after.P, rows)
        )

    def _rows(self, joint: _Joint, variables: Sequence[int]) -> IntArray:
        """Return where variables stand in a covariance."""
        rows: list[int] = []
        for key in variables:
            begin = joint.place[key]
            rows += range(begin, begin + self._size[key])
        return np.array(rows, dtype=np.int64)

    def _places(self, variables: Sequence[int]) -> dict[int, int]:
        places, begin = {}, 0
        for key in variables:
            places[key] = begin
            begin += self._size[key]
        return places

    def _check(self, variables: Sequence[int], R: FloatArray) -> None:
        """Raise if a pivot leaves a variable open."""
        pivots = np.abs(R.diagonal())
        weak = int(pivots.argmin())
        if pivots[weak] > _LEAST_PIVOT:
            return
        if variables[0] in self._constants:
            raise open_constant(weak, self._layout.constants)
        k = keys.index(variables[0])
        raise open_state(weak, self._layout.width, self._t_s(k))


def _eliminate(
    graph: gtsam.GaussianFactorGraph,
    message: gtsam.JacobianFactor | None,
    variables: Sequence[int],
) -> tuple[_Eliminated, gtsam.JacobianFactor | None]:
    """Return variables eliminated from factors and a message, and the message about the others."""
    ordering = gtsam.Ordering()
    for key in variables:
        ordering.push_back(key)
    if message is not None:
        graph.push_back(message)
    conditional, after = gtsam.EliminateQR(graph, ordering)
    # Copies: R, S and d are views of the conditional, and do not keep it alive.
    R, S, d = (np.array(part) for part in (conditional.R(), conditional.S(), conditional.d()))
    return _Eliminated(conditional.keys(), R, S, d), after
