"""What the likelihood sums over a chain: whitening by variance components, and their score.

Shapes as in ``solve.chain.kernel``: D state dimensions, b constants, W = D + b + 1, J = D + W.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.rotation_kernel import put
from fgnav.kernels.compiled import inner, kernel
from fgnav.solve.chain.back_kernel import forward_solve

CHUNK = 128  # intervals at once: 2 MB


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
        put(motion[k], out[k])
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
    squares, redundancy, information = out
    n, D, J = white.shape
    for begin in range(0, n, CHUNK):
        k, after = slice(begin, begin + CHUNK), slice(begin + 1, begin + CHUNK + 1)
        A, C, back = white[k, :, :-1], parts[k], np.linalg.inv(root[k])
        one, other = steps[0][:-1][k], steps[0][after]
        x = np.column_stack((one, other, np.broadcast_to(steps[1], (len(A), J - 1 - 2 * D))))
        M = np.eye(D) - A @ _joint(covariances, k, after) @ A.swapaxes(1, 2)
        r = (A @ x[:, :, None] - white[k, :, -1:]).swapaxes(1, 2) @ back
        # Of all components at once: tr(L^-1 C L^-T M) = tr(C X) with X = L^-T M L^-1.
        shares = C.reshape(len(C), -1, D) @ (back.swapaxes(1, 2) @ M @ back)
        shares = variance[:, None, None] * shares.reshape(C.shape)
        squares += variance * (r[:, None] @ C @ r.swapaxes(1, 2)[:, None]).sum(axis=(0, 2, 3))
        redundancy += np.einsum("kcii->c", shares)
        information += np.einsum("kcij,kdji->cd", shares, shares, optimize=True) / 2


def _joint(
    covariances: tuple[FloatArray, FloatArray, FloatArray, FloatArray], k: slice, after: slice
) -> FloatArray:
    """Return the covariances of neighbouring keyframes and the constants, (n, N, N)."""
    P, cross, shared, Q = covariances
    C, X, Y = cross[k], shared[:-1][k], shared[after]
    X_t, Y_t = X.swapaxes(1, 2), Y.swapaxes(1, 2)
    rows = [[P[:-1][k], C, X], [C.swapaxes(1, 2), P[after], Y]]
    return np.block([*rows, [X_t, Y_t, np.broadcast_to(Q, (len(C), *Q.shape))]])


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
    P, X, Q = covariances
    r = value + np.einsum("kmd,kd->km", state, steps[0][row]) + shared @ steps[1]
    by_state, by_shared = state.swapaxes(1, 2), shared.swapaxes(1, 2)
    crossed = state @ X[row] @ by_shared
    M = -(state @ P[row] @ by_state + crossed + crossed.swapaxes(1, 2) + shared @ Q @ by_shared)
    np.einsum("kmm->km", M)[...] += state.any(axis=2) | shared.any(axis=2)
    return float((r**2).sum()), float(np.einsum("kmm->", M)), float((M**2).sum()) / 2
