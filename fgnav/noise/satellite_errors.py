"""Errors of satellites, noise of codes and phases: most probable factors on the nominal.

What messages and models of the atmosphere leave in ranges to satellites is a state of each in the
graph (``graph.factors.antenna_phase``): nominal are its 1-sigma when a satellite appears, that of
its rate, and its random walk. Their marginal likelihood is that of a filter of these states alone,
the place of the antenna free at every epoch [1]_:

    ln L = -c / 2 - ln |R| - sum of n_i ln f_i

c the least sum of squares of all whitened rows, R the triangular root of their information, n_i
rows that say how large an error of one kind is, and f_i its standard deviation over the stated one.
Codes are those of a second apart by which ambiguities are known.

What all satellites share, and what repeats from one code to the next, is in no residual: the size
of errors and the noise of codes have the nominal for a floor. How errors move, and noise of phases,
may be less by one prior sigma.

References
----------
.. [1] Koch, Maximum likelihood estimate of variance components, Bulletin Geodesique 60, 1986.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from scipy.linalg import solve_triangular
from scipy.optimize import minimize_scalar

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock, PhaseRows
from fgnav.graph.types.on_demand import MANY, OnDemand
from fgnav.kernels.compiled import kernel

CODE = "code"
PHASE = "phase"
ERRORS = ("satellite error", "satellite error walk", "satellite error rate", CODE, PHASE)
_FLOORED = ("satellite error", CODE)
_SIGMA = np.log(3.0)  # of a factor's logarithm: orbits and atmospheres differ by so much
_SWEEPS = 2
_INSISTS = 2.0  # log-likelihood ratio of two sigmas: less leaves the nominal
_MOST = np.log(100.0)  # of a factor's logarithm: centimetres of metres, noise of phases and codes
_SUFFICIENT = (
    200  # blocks: walks of four satellites more than a place to 2.5 %, closer than is sought
)
_SETTLED = 0.1  # of it: 10 % of a standard deviation
_NOTHING = 1e-13  # of a diagonal: less than that is rounding
_NEVER = 1e100  # -ln L of what cannot be: a search takes differences of it


def satellite_error_factors(phase: AntennaPhase) -> dict[str, float]:
    """Return factors on errors of satellites and noise of codes and phases that are not 1."""
    errors = SatelliteErrors(phase)
    theta: FloatArray = np.zeros(len(ERRORS))
    for _ in range(_SWEEPS):
        before = theta
        for i in range(len(ERRORS)):
            theta = errors.climbed(theta, i)
        if np.abs(theta - before).max() < _SETTLED:
            break
    factors = {}
    for i, name in enumerate(ERRORS):
        nominal = np.where(np.arange(len(ERRORS)) == i, 0.0, theta)
        if errors.log_posterior(theta) > errors.log_posterior(nominal) + _INSISTS:
            factors[name] = float(np.exp(theta[i]))
    return factors


def with_errors(phase: AntennaPhase, factors: Mapping[str, float]) -> AntennaPhase:
    """Return phases whose errors of satellites and codes are as large as factors say."""
    weight = 1 / np.array([*(factors.get(name, 1.0) for name in ERRORS), 1.0])
    blocks = phase.blocks

    def weighted(j: int) -> ArcBlock:
        block = blocks[j]
        of_row = weight[_kinds(block)]
        before, after = of_row[:, None] * block.before, of_row[:, None] * block.after
        return block._replace(before=before, after=after, right=of_row * block.right)

    rows, louder = phase.rows, factors.get(PHASE, 1.0)

    def rescaled(i: int) -> PhaseRows:
        return PhaseRows._make(columns / louder for columns in rows[i])

    changed = replace(phase, blocks=OnDemand(len(blocks), weighted))
    return changed if louder == 1.0 else replace(changed, rows=OnDemand(len(rows), rescaled, MANY))


class SatelliteErrors:
    """Phases and codes of a flight by blocks, places eliminated.

    Parameters
    ----------
    phase : AntennaPhase

    Attributes
    ----------
    count : ndarray of int, shape (5,)
        Rows that say how large an error is, of each kind.
    """

    def __init__(self, phase: AntennaPhase) -> None:
        blocks = list(phase.blocks[:_SUFFICIENT])
        self._kinds = np.concatenate([_kinds(block) for block in blocks])
        self.count = np.bincount(self._kinds, minlength=len(ERRORS))[: len(ERRORS)]
        measured = [np.zeros((one.size + 1, one.size + 1)) for one in blocks]
        for i, block in enumerate(phase.block - phase.first_block):
            if block < len(blocks):
                rows = np.column_stack(phase.rows[i].without_place())
                measured[block] += rows.T @ rows
                self.count[-1] += len(rows)
        self._shapes = np.array([(*one.before.shape, one.size) for one in blocks])
        self._eliminated = sum(one.size for one in blocks[:-1])
        parts = ([getattr(one, name) for one in blocks] for name in ("before", "after", "right"))
        self._rows = [np.concatenate([one.ravel() for one in columns]) for columns in parts]
        self._measured = np.concatenate([one.ravel() for one in measured])

    def climbed(self, theta: FloatArray, i: int) -> FloatArray:
        """Return logarithms of factors, (5,), the i-th of them the most probable."""

        def at(x: float) -> FloatArray:
            moved = theta.copy()
            moved[i] = x
            return moved

        search = minimize_scalar(
            lambda x: min(-self.log_posterior(at(x)), _NEVER),
            bounds=(0.0 if ERRORS[i] in _FLOORED else -_SIGMA, _MOST),
            method="bounded",
            options={"xatol": _SETTLED},
        )
        return at(search.x)

    def log_posterior(self, theta: FloatArray) -> float:
        """Return the logarithm of the posterior density of theta, but for a constant."""
        return float(self.log_likelihood(theta) - (theta**2).sum() / (2 * _SIGMA**2))

    def log_likelihood(self, theta: FloatArray) -> float:
        """Return ln L of logarithms of factors, (5,), but for a constant."""
        weight = np.append(np.exp(-2 * theta), 1.0)
        diagonal = np.empty(self._eliminated)
        measured = weight[len(ERRORS) - 1] * self._measured
        rows = (*self._rows, measured)
        information = _filtered(self._shapes, weight[self._kinds], diagonal, *rows)
        if len(information) == 1:
            return -np.inf
        log_root = float(np.log(diagonal).sum())
        try:
            root = np.linalg.cholesky(information[:-1, :-1], upper=True)
        except np.linalg.LinAlgError:
            return -np.inf
        log_root += float(np.log(root.diagonal()).sum())
        along = solve_triangular(root, information[:-1, -1], trans="T")
        cost = float(information[-1, -1] - along @ along)
        return -cost / 2 - log_root - float(self.count @ theta)


@kernel
def _filtered(
    shapes: IntArray,
    weight: FloatArray,
    diagonal: FloatArray,
    before: FloatArray,
    after: FloatArray,
    right: FloatArray,
    measured: FloatArray,
) -> FloatArray:
    """Return the information of the last block, upper half; but for a cost empty where A is open.

    Parameters
    ----------
    shapes : ndarray of int, shape (k, 3)
        Of each block rows, columns of ``before`` and of ``after``.
    weight : ndarray
        Of the squares of each row.
    diagonal : ndarray
        Filled with that of R, but for the last block.
    before, after, right, measured : ndarray
        Theirs, one block after another; the information of what is measured in it.
    """
    information: FloatArray = np.zeros((1, 1))
    a = b = c = d = e = 0
    for q, old, new in shapes:
        size, m = len(information) - 1, new + 1
        rows = (
            before[a : a + q * old].reshape((q, old)),
            after[b : b + q * new].reshape((q, new)),
            right[c : c + q],
        )
        is_known, joint = _next_block(information, size, rows, weight[c : c + q])
        if not is_known:
            return np.zeros((1, 1))
        for i in range(size):
            diagonal[e + i] = joint[i, i]
        information = np.empty((m, m))
        for i in range(m):
            for j in range(m):
                information[i, j] = joint[size + i, size + j] + measured[d + i * m + j]
        a, b, c, d, e = a + q * old, b + q * new, c + q, d + m * m, e + size
    return information


@kernel
def _next_block(
    information: FloatArray,
    size: int,
    rows: tuple[FloatArray, FloatArray, FloatArray],
    weight: FloatArray,
) -> tuple[bool, FloatArray]:
    """Return True if a block's A is known, and the information of A and the next, A eliminated.

    Parameters
    ----------
    information : ndarray, shape (size + 1, size + 1)
        Of A and the right-hand side, upper half.
    size : int
        Dimensions of A; ``before`` may have no column at all: then nothing leads on from A.
    rows : tuple of ndarray, shapes (q, size or 0), (q, size'), (q,)
        ``before``, ``after`` and ``right`` of the next ``ArcBlock``.
    weight : ndarray, shape (q,)
        Of their squares.
    """
    before, after, right = rows
    new = after.shape[1]
    n = size + new + 1
    joint, row = np.zeros((n, n)), np.zeros(n)
    for i in range(size):
        for j in range(i, size):
            joint[i, j] = information[i, j]
        joint[i, n - 1] = information[i, size]
    joint[n - 1, n - 1] = information[size, size]
    for k in range(len(right)):
        for i in range(before.shape[1]):
            row[i] = -before[k, i]
        for i in range(new):
            row[size + i] = after[k, i]
        row[n - 1] = right[k]
        for i in range(n):
            scale = weight[k] * row[i]
            if scale != 0.0:
                for j in range(i, n):
                    joint[i, j] += scale * row[j]
    return _eliminate(joint, size), joint


@kernel
def _eliminate(joint: FloatArray, size: int) -> bool:
    """Turn the first rows into those of the Cholesky factor; return whether they have digits."""
    n, whole = len(joint), np.diag(joint).copy()
    for k in range(size):
        if not joint[k, k] > _NOTHING * whole[k]:
            return False
        scale = 1.0 / np.sqrt(joint[k, k])
        for j in range(k, n):
            joint[k, j] *= scale
        for i in range(k + 1, n):
            factor = joint[k, i]
            if factor != 0.0:
                for j in range(i, n):
                    joint[i, j] -= factor * joint[k, j]
    return True


def _kinds(block: ArcBlock) -> IntArray:
    """Find the error that each row of a block belongs to, (q,); their number: none."""
    size, s = block.size, block.satellites
    kinds = np.full(len(block.right), len(ERRORS))
    kinds[size:] = ERRORS.index(CODE)
    error, rate = slice(size - 2 * s, size - s), slice(size - s, size)
    goes_on = np.asarray(block.before.any(axis=1))
    kinds[error] = np.where(goes_on[error], 1, 0)
    kinds[rate] = np.where(goes_on[rate], len(ERRORS), 2)
    return kinds
