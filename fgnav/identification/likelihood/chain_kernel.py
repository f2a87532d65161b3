"""Compiled loops of the likelihood: whitening by variance components, and their score.

Shapes as in ``solve.chain.kernel``: D state dimensions, b constants, W = D + b + 1, J = D + W.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.kernels.compiled import inner, kernel
from fgnav.solve.chain.back_kernel import forward_solve


@kernel
def whiten(
    motion: FloatArray,
    parts: FloatArray,
    rest: FloatArray,
    variance: FloatArray,
    out: FloatArray,
    root: FloatArray,
) -> float:
    """Whiten the rows of each interval by ``rest + sum of variance * parts``.

    Parameters
    ----------
    motion : ndarray, shape (n, D, J)
        Rows and minus their residuals.
    parts : ndarray, shape (n, c, D, D)
        Covariances of the rows per unit of each component's variance.
    rest : ndarray, shape (n, D, D)
    variance : ndarray, shape (c,)
    out : ndarray, shape (n, D, J)
        Filled.
    root : ndarray, shape (n, D, D)
        Filled with lower Cholesky factors.

    Returns
    -------
    float
        Sum of the log determinants of the covariances; NaN if one is not positive.
    """
    total = 0.0
    for k in range(len(motion)):
        total += _cholesky(rest[k], parts[k], variance, root[k])
        out[k] = motion[k]
        forward_solve(root[k], out[k])
    return total


@inner
def _cholesky(rest: FloatArray, parts: FloatArray, variance: FloatArray, L: FloatArray) -> float:
    """Fill the factor of one covariance; return its log determinant."""
    total = 0.0
    for i in range(len(L)):
        for j in range(i + 1):
            entry = rest[i, j]
            for c in range(len(variance)):
                entry += variance[c] * parts[c, i, j]
            for m in range(j):
                entry -= L[i, m] * L[j, m]
            if i == j and not entry > 0.0:
                return np.nan
            if i == j:
                L[i, i] = np.sqrt(entry)
                total += 2 * np.log(L[i, i])
            else:
                L[i, j], L[j, i] = entry / L[j, j], 0.0
    return total


@inner
def _solved(L: FloatArray, A: FloatArray) -> FloatArray:
    """Return ``L^-1 A L^-T`` of a symmetric A."""
    X = A.copy()
    for _ in range(2):
        forward_solve(L, X)
        X = X.T.copy()
    return X


@kernel
def motion_score(
    white: FloatArray,
    root: FloatArray,
    parts: FloatArray,
    variance: FloatArray,
    steps: tuple[FloatArray, FloatArray],
    covariances: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    out: tuple[FloatArray, FloatArray, FloatArray],
) -> None:
    """Add each component's share of squares, redundancy and information over all intervals.

    Parameters
    ----------
    white, root, parts, variance
        See ``whiten``; row k leads from keyframe k to k + 1.
    steps : tuple of ndarray, shapes (n + 1, D), (b,)
        Smoothed steps of states and constants.
    covariances : tuple of ndarray
        Of states (n + 1, D, D), of each with the next (n, D, D), with the constants (n + 1, D, b),
        and of the constants (b, b).
    out : tuple of ndarray, shapes (c,), (c,), (c, c)
        Squares ``v r' C r``, redundancy ``v tr(C M)`` and information ``v_c v_d tr(C_c M C_d M) /
        2`` of single intervals are added, ``M = I - J P J'``.
    """
    n, D, J = white.shape
    b, C = J - 2 * D - 1, len(variance)
    squares, redundancy, information = out
    N = 2 * D + b
    joint, x = np.empty((N, N)), np.empty(N)
    for k in range(n):
        x[:D], x[D : 2 * D], x[2 * D :] = steps[0][k], steps[0][k + 1], steps[1]
        _fill(joint, covariances, k)
        A = np.ascontiguousarray(white[k, :, :N])
        r = A @ x - white[k, :, N]
        M = np.eye(D) - A @ (joint @ A.T)
        shares = np.empty((C, D, D))
        for c in range(C):
            S = _solved(root[k], parts[k, c])
            squares[c] += variance[c] * (r @ (S @ r))
            shares[c] = variance[c] * (S @ M)
            redundancy[c] += np.trace(shares[c])
        for c in range(C):
            for d in range(C):
                information[c, d] += (shares[c] * shares[d].T).sum() / 2


@inner
def _fill(
    joint: FloatArray,
    covariances: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    k: int,
) -> None:
    """Fill the covariance of keyframes k and k + 1 and the constants."""
    P, cross, shared, own = covariances
    D = P.shape[1]
    joint[:D, :D], joint[D : 2 * D, D : 2 * D] = P[k], P[k + 1]
    joint[:D, D : 2 * D], joint[D : 2 * D, :D] = cross[k], cross[k].T
    joint[:D, 2 * D :], joint[2 * D :, :D] = shared[k], shared[k].T
    joint[D : 2 * D, 2 * D :], joint[2 * D :, D : 2 * D] = shared[k + 1], shared[k + 1].T
    joint[2 * D :, 2 * D :] = own


@kernel
def measurement_score(
    value: FloatArray,
    state: FloatArray,
    shared: FloatArray,
    row: IntArray,
    steps: tuple[FloatArray, FloatArray],
    covariances: tuple[FloatArray, FloatArray, FloatArray],
) -> tuple[float, float, float]:
    """Return squares ``r'r``, redundancy ``tr(M)`` and information ``tr(M M) / 2`` of a sensor.

    Parameters
    ----------
    value, state, shared
        Of k whitened measurements; see ``Linearised``.
    row : ndarray of int, shape (k,)
        Their keyframes.
    steps : tuple of ndarray, shapes (n, D), (b,)
    covariances : tuple of ndarray, shapes (n, D, D), (n, D, b), (b, b)
    """
    k, m, D = state.shape
    b, P = shared.shape[2], covariances
    squares, redundancy, information = 0.0, 0.0, 0.0
    joint, x = np.empty((D + b, D + b)), np.empty(D + b)
    A = np.empty((m, D + b))
    for i in range(k):
        at = row[i]
        x[:D], x[D:] = steps[0][at], steps[1]
        joint[:D, :D], joint[:D, D:] = P[0][at], P[1][at]
        joint[D:, :D], joint[D:, D:] = P[1][at].T, P[2]
        A[:, :D], A[:, D:] = state[i], shared[i]
        r = A @ x + value[i]
        M = -A @ (joint @ A.T)
        for j in range(m):
            if A[j].any():
                M[j, j] += 1.0
        squares += r @ r
        redundancy += np.trace(M)
        information += (M * M).sum() / 2
    return squares, redundancy, information
