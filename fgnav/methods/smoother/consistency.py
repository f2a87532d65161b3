"""Whether measurements and solution agree as well as both say they do: NIS per kind."""

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray
from fgnav.estimate import Consistency
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.residuals import Residuals, residuals
from fgnav.methods.smoother.solution import Solution

_GATE = 0.01  # share of right measurements beyond it
# A measurement that holds this share of what is known of its own residual tests nothing.
_UNTESTED = 1e-6


def consistency(keyframes: Keyframes, solution: Solution) -> tuple[Consistency, ...]:
    """Return the normalised innovation squared of every kind of measurement.

    Each measurement is held against what the solution would be without it: of a filter's states
    that is the innovation, of smoothed ones the deletion residual [1]_. A whitened residual r of
    Jacobian J at a solution of covariance P has the covariance ``S = I - J P J'``, and
    ``r' S^-1 r`` has the chi-square distribution either way.

    References
    ----------
    .. [1] Cook, Weisberg: Residuals and Influence in Regression, 1982, section 2.2.
    """
    return tuple(_judged(part, *nis(part, solution)) for part in residuals(keyframes, solution))


def nis(part: Residuals, solution: Solution) -> tuple[FloatArray, BoolArray]:
    """Return normalised innovations squared, (k,), and which of them test anything.

    Parameters
    ----------
    part : Residuals
    solution : Solution
    """
    P, r = _covariance(part, solution), part.value
    J = part.jacobian[:, :, : P.shape[1]]
    rest = np.zeros(len(r))
    if r.shape[1] > 3:  # S^-1 = I + J (P^-1 - J'J)^-1 J', a few dimensions for nine or more
        seen = np.flatnonzero(J.any(axis=(0, 1)))
        known, J = np.linalg.inv(P[:, seen[:, None], seen]), J[:, :, seen]
        S, most = known - J.swapaxes(1, 2) @ J, np.linalg.eigvalsh(known)[:, -1]
        rest, r = np.einsum("km,km->k", r, r), np.einsum("kmi,km->ki", J, r)
    else:
        S, most = np.eye(r.shape[1]) - J @ P @ J.swapaxes(1, 2), np.ones(len(r))
    tested = np.linalg.eigvalsh(S)[:, 0] > _UNTESTED * most
    S[~tested] = np.eye(S.shape[1])
    return rest + np.einsum("ki,ki->k", r, np.linalg.solve(S, r[:, :, None])[:, :, 0]), tested


def _covariance(part: Residuals, solution: Solution) -> FloatArray:
    """Return the covariance of rotation, position, velocity and what is shared, (k, 9 + b, ..).

    Without what is shared where the solution says nothing of it: it is taken as known.
    """
    own, shared = solution.covariance[part.row, :9, :9], solution.shared
    if shared is None or part.jacobian.shape[2] == own.shape[2]:
        return own
    shared = shared[part.row]
    cross = shared.cross[:, :9]
    return np.block([[own, cross], [cross.swapaxes(1, 2), shared.covariance]])


def _judged(part: Residuals, squared: FloatArray, tested: BoolArray) -> Consistency:
    squared, freedom = squared[tested], part.freedom[tested]
    beyond = squared > chdtri(freedom, _GATE)
    return Consistency(
        what=part.what,
        count=len(squared),
        freedom=int(freedom.sum()),
        nis=float(squared.sum() / max(freedom.sum(), 1)),
        beyond_99=float(beyond.mean()) if len(beyond) else 0.0,
    )
