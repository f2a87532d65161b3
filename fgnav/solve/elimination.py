"""Linear factors eliminated by GTSAM's QR, keyframe by keyframe from the oldest.

What enters with keyframe k, and the message of those before it, become

    R x_k + S x_s = d        and a message about the separators x_s: later keyframes and constants.

Backwards from the newest [1]_, section 3, constants carried along:

    P_ks = -R^-1 S P_ss        P_kk = R^-1 R^-T - P_ks S' R^-T

``ISAM2.jointMarginalCovariance`` seeks the way from each keyframe to the constants anew: 10 ms
beside carrier phases, where this takes 0.2.

References
----------
.. [1] Kaess, Dellaert: Covariance recovery from a square root information matrix for data
   association, Robotics and Autonomous Systems 57, 2009.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import gtsam
import numpy as np
from scipy.linalg.lapack import dtrtri

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.build import Layout
from fgnav.graph.types.states import AUX
from fgnav.solve.failures import open_constant, open_state

# A pivot below this leaves a state open: sigma 1e6 m or rad, where the weakest prior has 1e3.
# Rounding beside carrier phase (1e4 per metre) makes pivots of 1e-11 out of nothing.
_LEAST_PIVOT = 1e-6


class Marginals(NamedTuple):
    """Covariances of m neighbouring keyframes, D dimensions each, and b constants."""

    covariance: FloatArray  # (m, D, D)
    cross: FloatArray  # (m, D, D), of each with the next; zero after the newest
    constant: FloatArray  # (b, b)
    constant_cross: FloatArray  # (m, D, b)


class _Joint(NamedTuple):
    """Joint covariance of some variables, and where each of them begins in it."""

    place: dict[int, int]
    P: FloatArray


class Elimination:
    """Linear factors of successive keyframes, and what is known by them.

    Parameters
    ----------
    layout : Layout
    t_s : callable
        Time of a keyframe by its number, for errors.

    Attributes
    ----------
    oldest : int
        Number of the oldest keyframe.
    """

    def __init__(self, layout: Layout, t_s: Callable[[int], float]) -> None:
        self.oldest = 0
        self._layout, self._t_s = layout, t_s
        self._constants = layout.constant_keys
        sizes = (parameter.size for parameter in layout.constants.parts)
        self._size = dict(zip(self._constants, sizes, strict=True))
        self._arcs: list[tuple[int, ...]] = []  # that end with each keyframe
        self._factors: list[Sequence[gtsam.GaussianFactor]] = []
        # As far as they are eliminated; a message more, to the next keyframe.
        self._ends: list[gtsam.GaussianConditional] = []
        self._messages: list[gtsam.JacobianFactor | None] = [None]
        self._root: gtsam.GaussianConditional | None = None

    def __len__(self) -> int:
        """Return the number of keyframes."""
        return len(self._factors)

    def append(
        self, factors: Sequence[gtsam.GaussianFactor], arcs: Sequence[tuple[int, int]] = ()
    ) -> None:
        """Take in a keyframe.

        Parameters
        ----------
        factors : sequence of gtsam.GaussianFactor
            All whose oldest keyframe it is.
        arcs : sequence of (int, int)
            Key and size of ambiguities that end with it.
        """
        frontal = self._layout.keyframe(self.oldest + len(self))
        self._size.update(zip(frontal, (6, 3, self._layout.width - AUX), strict=True))
        self._factors.append(())
        self._arcs.append(())
        self.change(len(self) - 1, factors, arcs)

    def change(
        self,
        i: int,
        factors: Sequence[gtsam.GaussianFactor],
        arcs: Sequence[tuple[int, int]] = (),
    ) -> None:
        """Replace what enters with a keyframe, counted from the oldest."""
        self._size.update(arcs)
        self._factors[i], self._arcs[i] = factors, tuple(key for key, _ in arcs)
        self._undo(i)

    def forget(self, count: int) -> None:
        """Take the oldest keyframes out; what they tell of those that remain stays."""
        for i in range(count):
            for key in self._variables(i):
                del self._size[key]
        del self._factors[:count], self._arcs[:count], self._ends[:count], self._messages[:count]
        self.oldest += count

    def size(self, key: int) -> int:
        """Return the dimensions of a variable."""
        return self._size[key]

    @property
    def message(self) -> gtsam.JacobianFactor:
        """Information about the oldest keyframe from the marginalized ones."""
        message = self._messages[0]
        if message is None:
            raise ValueError("elimination: no keyframe was taken out")
        return message

    @message.setter
    def message(self, factor: gtsam.JacobianFactor) -> None:
        self._messages[0] = factor
        self._undo(0)

    def solve(self) -> None:
        """Eliminate all keyframes that are not yet, then the constants.

        Raises
        ------
        NoSolutionError
            If a variable is in no factor, by name.
        """
        for i in range(len(self._ends), len(self)):
            frontal = self._variables(i)
            try:
                end, message = _eliminate(self._factors[i], self._messages[i], frontal)
            except RuntimeError as error:  # a variable that is in no factor
                raise self._unconstrained(i) from error
            self._ends.append(end)
            self._messages.append(message)
        if self._constants and self._root is None:
            self._root, _ = _eliminate((), self._messages[-1], self._constants)

    @property
    def conditionals(self) -> list[gtsam.GaussianConditional]:
        """Return those of keyframes from the oldest on, then that of the constants, if any."""
        return self._ends if self._root is None else [*self._ends, self._root]

    @property
    def predicted_decrease(self) -> float:
        """Return by how much the step lowers the sum of squares, if all were linear."""
        return float(sum(conditional.d() @ conditional.d() for conditional in self.conditionals))

    @property
    def log_root(self) -> float:
        """Return the log determinant of the square root of the information of all variables."""
        return float(
            sum(
                np.log(np.abs(conditional.R().diagonal())).sum()
                for conditional in self.conditionals
            )
        )

    def step(self) -> tuple[FloatArray, FloatArray, dict[int, FloatArray]]:
        """Return the Newton step of keyframes, (m, D), of the constants, (b,), and of arcs by key.

        Raises
        ------
        NoSolutionError
            If a variable is not determined, by name.
        """
        self._check()
        net = gtsam.GaussianBayesNet()
        for conditional in self.conditionals:
            net.push_back(conditional)
        steps = net.optimize()
        of_keyframes = range(self.oldest, self.oldest + len(self))
        frontal = [key for k in of_keyframes for key in self._layout.keyframe(k)]
        moved: FloatArray = steps.vector(frontal).reshape(len(self), self._layout.width)
        constants: FloatArray = steps.vector(self._constants)
        arcs: dict[int, FloatArray] = {key: steps.at(key) for of in self._arcs for key in of}
        return moved, constants, arcs

    def marginals(self, begin: int = 0, end: int | None = None) -> Marginals:
        """Return covariances of some keyframes, counted from the oldest, and of each with the next.

        Raises
        ------
        NoSolutionError
            If a variable is not determined, by name.
        """
        end = len(self) if end is None else end
        m, D, b = end - begin, self._layout.width, self._layout.constants.width
        covariance, cross = np.empty((m, D, D)), np.zeros((m, D, D))
        shared = np.empty((m, D, b))
        self._check()
        joint = self._covariance_of_constants()
        constant = joint.P
        for i in range(len(self) - 1, begin - 1, -1):
            joint = self._descend(i, joint)
            if i >= end:
                continue
            covariance[i - begin] = joint.P[:D, :D]  # a keyframe's variables come first
            if i + 1 < len(self):
                later = self._rows(joint, self._variables(i + 1)[:3])
                cross[i - begin] = joint.P[:D, later]
            if b:
                shared[i - begin] = joint.P[:D, self._rows(joint, self._constants)]
        return Marginals(covariance, cross, constant, shared)

    def _undo(self, i: int) -> None:
        del self._ends[i:], self._messages[i + 1 :]
        self._root = None

    def _variables(self, i: int) -> tuple[int, ...]:
        """List the variables that are eliminated with a keyframe."""
        return (*self._layout.keyframe(self.oldest + i), *self._arcs[i])

    def _covariance_of_constants(self) -> _Joint:
        root = self._root
        inverse = np.linalg.inv(root.R()) if root else np.empty((0, 0))
        return _Joint(self._places(self._constants), inverse @ inverse.T)

    def _descend(self, i: int, after: _Joint) -> _Joint:
        """Return the joint covariance of a keyframe, its separators, the next and the constants."""
        conditional, frontal = self._ends[i], self._variables(i)
        carried = self._constants
        if i + 1 < len(self):
            carried = [*self._variables(i + 1), *self._constants]
        variables = list(conditional.keys())
        variables += [key for key in carried if key not in variables]
        rows = self._rows(after, variables[len(frontal) :])
        inverse, S = dtrtri(conditional.R())[0], conditional.S()
        others, gain = after.P[rows[:, None], rows], inverse @ S
        cross = -gain @ others[: S.shape[1]]
        frontal = inverse @ inverse.T - cross[:, : S.shape[1]] @ gain.T
        return _Joint(self._places(variables), np.block([[frontal, cross], [cross.T, others]]))

    def _rows(self, joint: _Joint, variables: Sequence[int]) -> IntArray:
        """Return where variables stand in a covariance."""
        rows: list[int] = []
        for key in variables:
            begin = joint.place[key]
            rows += range(begin, begin + self._size[key])
        return np.array(rows, dtype=np.int64)

    def _places(self, variables: Sequence[int]) -> dict[int, int]:
        columns, begin = {}, 0
        for key in variables:
            columns[key] = begin
            begin += self._size[key]
        return columns

    def _check(self) -> None:
        """Raise if a pivot leaves a variable open."""
        for i, conditional in enumerate(self.conditionals):
            pivots = np.abs(conditional.R().diagonal())
            weak = int(pivots.argmin())
            if not pivots[weak] > _LEAST_PIVOT:
                raise self._open(i, weak)

    def _open(self, i: int, column: int) -> NoSolutionError:
        if i == len(self):
            return open_constant(column, self._layout.constants)
        return open_state(column, self._layout.width, self._t_s(self.oldest + i))

    def _unconstrained(self, i: int) -> NoSolutionError:
        """Return the error of the first variable of a keyframe that no factor touches."""
        entering = (*self._factors[i], self._messages[i])
        touched = {key for factor in entering if factor is not None for key in factor.keys()}  # noqa: SIM118
        column = 0
        for key in self._variables(i):
            if key not in touched:
                break
            column += self._size[key]
        return self._open(i, column)


def _eliminate(
    factors: Sequence[gtsam.GaussianFactor],
    message: gtsam.JacobianFactor | None,
    variables: Sequence[int],
) -> tuple[gtsam.GaussianConditional, gtsam.JacobianFactor | None]:
    """Return variables eliminated from factors and a message, and the message about the others."""
    graph, ordering = gtsam.GaussianFactorGraph(), gtsam.Ordering()
    for factor in factors:
        graph.push_back(factor)
    if message is not None:
        graph.push_back(message)
    for key in variables:
        ordering.push_back(key)
    eliminated: tuple[gtsam.GaussianConditional, gtsam.JacobianFactor | None]
    eliminated = gtsam.EliminateQR(graph, ordering)
    return eliminated
