"""A filter of ambiguities alone, the place of every epoch free, their constraints, and slips.

A slip that no receiver flags shows in the innovation of an epoch's phases before the update: rows
without the place of the antenna are known to millimetres. It is detected, identified and adapted
[1]_: the arc whose shift explains most of it is the one, if that is by half a cycle or more, and
what is left is noise. A new arc begins there.

References
----------
.. [1] P. J. G. Teunissen, "Quality control in integrated navigation systems", IEEE Aerospace and
   Electronic Systems Magazine 5, 1990.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_triangular

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import ArcBlock

_FALSE_ALARM = 1e-4  # of the test of an epoch's innovation
_STEP_CYCLES = 0.5  # half of one, where the sign of the carrier is not resolved
_UNTESTABLE = 1e-9  # of what another arc's shift shows by
_SIGMA_M = 1e-3  # of a constraint: what stays of echoes and phase centres, of each arc


class ArcNames(NamedTuple):
    """The arcs of a block, the first dimensions of its A."""

    arc: IntArray  # (c,)
    group: IntArray  # (c,), carriers
    wavelength_m: FloatArray  # (c,)
    offset_m: FloatArray  # (c,), taken off their phases
    link: tuple[str, ...]  # length c

    @property
    def differences(self) -> FloatArray:
        """Arcs against the oldest of their carrier, (d, c)."""
        rows = []
        for group in np.unique(self.group):
            members = np.flatnonzero(self.group == group)
            oldest = members[self.arc[members].argmin()]
            for other in members[members != oldest]:
                row = np.zeros(len(self.arc))
                row[other], row[oldest] = 1.0, -1.0
                rows.append(row)
        return np.array(rows).reshape(-1, len(self.arc))

    @property
    def cycles(self) -> FloatArray:
        """The same in cycles per metre, (d, c)."""
        return self.differences / self.wavelength_m


class Constraint(NamedTuple):
    """Integer combinations of ambiguities: ``cycles @ n`` is ``right``, but for a millimetre."""

    block: int  # in which they were fixed
    arc: IntArray  # (c,)
    cycles: FloatArray  # (k, c), cycles per metre
    right: FloatArray  # (k,)
    combination: IntArray  # (k, c), of arcs in cycles
    success: float

    @property
    def used(self) -> BoolArray:
        """Arcs that take part, (c,)."""
        return np.asarray(self.combination.any(axis=0))

    @property
    def whitened(self) -> tuple[FloatArray, FloatArray]:
        """Rows, (k, c), and right-hand sides of unit variance, each arc having its own error."""
        root = np.linalg.cholesky(_SIGMA_M**2 * self.cycles @ self.cycles.T)
        return np.linalg.solve(root, self.cycles), np.linalg.solve(root, self.right)


class Ambiguities(NamedTuple):
    """Ambiguities A of a block, in information form."""

    information: FloatArray = np.empty((0, 0))
    vector: FloatArray = np.empty(0)

    def propagated(self, block: ArcBlock) -> "Ambiguities":
        """Propagate the ambiguities to the next block."""
        B, A, right = block.before, block.after, block.right
        after, also = A.T @ A, A.T @ right
        if B.shape[1]:
            cross = -B.T @ A
            gain = np.linalg.solve(
                self.information + B.T @ B, np.c_[cross, self.vector - B.T @ right]
            )
            after, also = after - cross.T @ gain[:, :-1], also - cross.T @ gain[:, -1]
        return Ambiguities((after + after.T) / 2, also)

    def measured(self, H: FloatArray, z: FloatArray) -> "Ambiguities":
        """Update the ambiguities by rows ``H A = z`` of unit variance."""
        return Ambiguities(self.information + H.T @ H, self.vector + H.T @ z)

    def constrained(self, one: Constraint) -> "Ambiguities":
        """Update the ambiguities by a constraint on this block's arcs."""
        rows, right = one.whitened
        H = np.zeros((len(right), len(self.vector)))
        H[:, : len(one.arc)] = rows
        return self.measured(H, right)

    def solved(self) -> tuple[FloatArray, FloatArray]:
        """Return A and its covariance."""
        P = np.linalg.inv(self.information)
        return P @ self.vector, P

    def combined(self, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return combinations of ambiguities, rows (k, c), and their covariance.

        By the triangular root, scaled: what all have in common is 1e10 times as uncertain.
        """
        scale = 1 / np.sqrt(np.diag(self.information))
        root = np.linalg.cholesky(scale[:, None] * self.information * scale)
        right = np.zeros((len(scale), len(rows) + 1))
        right[: rows.shape[1], :-1] = (rows * scale[: rows.shape[1]]).T
        right[:, -1] = self.vector * scale
        whitened = solve_triangular(root, right, lower=True)
        return whitened[:, :-1].T @ whitened[:, -1], whitened[:, :-1].T @ whitened[:, :-1]


class Slip(NamedTuple):
    """A phase that jumped."""

    arc: int  # of its block's
    cycles: float


def slips(state: Ambiguities, H: FloatArray, z: FloatArray, names: ArcNames) -> tuple[Slip, ...]:
    """Return the slips that an epoch's innovation shows; none where they do not explain it."""
    if not len(z):
        return ()
    A, P = state.solved()
    r, S = z - H @ A, np.eye(len(z)) + H @ P @ H.T
    weighted = np.linalg.solve(S, np.c_[r, H[:, : len(names.arc)] * names.wavelength_m])
    if r @ weighted[:, 0] <= largest(len(z)):
        return ()
    shift, W = H[:, : len(names.arc)] * names.wavelength_m, weighted[:, 1:]
    chosen: list[int] = []
    while len(chosen) < len(z) - 1:
        left = _explained_by(shift, W, r, chosen)
        a = int(left.argmax())
        chosen.append(a)
        normal = shift[:, chosen].T @ W[:, chosen]
        cycles = np.linalg.solve(normal, W[:, chosen].T @ r)
        if np.abs(cycles).min() < _STEP_CYCLES / 2:
            return ()
        remainder = r @ weighted[:, 0] - cycles @ (W[:, chosen].T @ r)
        if remainder <= largest(len(z) - len(chosen)):
            return tuple(map(Slip, chosen, cycles.tolist()))
    return ()


def _explained_by(shift: FloatArray, W: FloatArray, r: FloatArray, chosen: list[int]) -> FloatArray:
    """Return by how much each arc's shift lowers the cost, (c,), beside those chosen."""
    normal, pull = shift.T @ W, W.T @ r
    if chosen:
        gain = np.linalg.solve(normal[np.ix_(chosen, chosen)], normal[chosen])
        pull = pull - gain.T @ pull[chosen]
        normal = normal - normal[:, chosen] @ gain
    squares = np.diag(normal)
    testable = squares > _UNTESTABLE * np.diag(shift.T @ W).max()  # a new arc shows no slip
    return np.where(testable, pull**2 / np.where(testable, squares, 1.0), 0.0)


def largest(freedom: int) -> float:
    """Return the sum of squares that noise exceeds next to never."""
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: keeps the command line quick

    return float(chdtri(freedom, _FALSE_ALARM))
