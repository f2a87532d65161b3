"""How a chain's solution answers to right-hand sides of every keyframe; names as in ``kernel``.

Of keyframe k and the constants, V = D + b dimensions, elimination leaves the next keyframe

    (x_k, c) = E_k (x_k+1, c) + what later data do not change        E_k = [-gain_k; 0 I]

and with S_k the covariance of (x_k, c) by all data, P the covariance of all, a right-hand side a
and an information B of keyframes alone, independent of each other,

    f_k+1 = E_k' f_k + a_k+1                      l_k = E_k (S_k+1 a_k+1 + l_k+1)
    F_k+1 = E_k' F_k E_k + B_k+1                  R_k = E_k (S_k+1 B_k+1 S_k+1 + R_k+1) E_k'
    (P a)_k,c = S_k f_k + l_k                     (P B P)_kc,kc = S_k F_k S_k + R_k

f carries what enters up to k to (x_k, c), l and R bring back what enters later: a covariance B of
right-hand sides makes the covariance P B P of solutions, which is linear in B, positive or not.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import inner, kernel


@kernel
def adjoint(
    gain: FloatArray,
    covariance: FloatArray,
    shared: FloatArray,
    constant: FloatArray,
    a: FloatArray,
    B: FloatArray,
    f: FloatArray,
    F: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return P a and the blocks of P B P of each keyframe and the constants, (n, V), (n, V, V).

    Parameters
    ----------
    gain : ndarray, shape (n - 1, D, W)
        As ``kernel.eliminate`` leaves it.
    covariance, shared, constant : ndarray, shapes (n, D, D), (n, D, b), (b, b)
        As ``back_kernel.marginals`` leaves them: P's blocks.
    a : ndarray, shape (n, D)
    B : ndarray, shape (n, D, D)
        Symmetric.
    f, F : ndarray, shapes (n, V), (n, V, V)
        Memory, zeros.
    """
    n, D, b = shared.shape
    V = D + b
    _carry(gain, a, B, f, F)
    half = np.empty((V, V))
    S, R, later = np.empty((V, V)), np.zeros((V, V)), np.zeros(V)
    solved, blocks = np.empty((n, V)), np.empty((n, V, V))
    for k in range(n - 1, -1, -1):
        _fill(covariance[k], shared[k], constant, S)
        _product(S, F[k], half)
        for i in range(V):
            total = later[i]
            for j in range(V):
                total += S[i, j] * f[k, j]
            solved[k, i] = total
            for j in range(i + 1):
                total = R[i, j]
                for m in range(V):
                    total += half[i, m] * S[j, m]
                blocks[k, i, j] = blocks[k, j, i] = total
        if k:
            _brought_back(gain[k - 1], S, a[k], B[k], later, R)
    return solved, blocks


@inner
def _carry(gain: FloatArray, a: FloatArray, B: FloatArray, f: FloatArray, F: FloatArray) -> None:
    """Fill f and F of all keyframes."""
    n, D = a.shape
    half = np.empty((D, f.shape[1]))
    for k in range(n):
        if k:
            _led(gain[k - 1], f[k - 1], F[k - 1], half, f[k], F[k])
        for i in range(D):
            f[k, i] += a[k, i]
            for j in range(D):
                F[k, i, j] += B[k, i, j]


@inner
def _led(
    G: FloatArray, f: FloatArray, F: FloatArray, half: FloatArray, g: FloatArray, out: FloatArray
) -> None:
    """Set ``g`` to E' f and ``out`` to E' F E."""
    D, V = half.shape
    _product(F[:D, :D], G, half)
    for i in range(D):
        for j in range(D, V):
            half[i, j] -= F[i, j]
    out[:] = 0.0
    g[:] = 0.0
    for k in range(D):
        for i in range(V):
            scale, row = G[k, i], out[i]
            g[i] -= scale * f[k]
            for j in range(V):
                row[j] += scale * half[k, j]
    for i in range(D, V):
        g[i] += f[i]
        row = out[i]
        for k in range(D):
            scale = F[i, k]
            for j in range(V):
                row[j] -= scale * G[k, j]
        for j in range(D, V):
            row[j] += F[i, j]


@inner
def _brought_back(
    G: FloatArray, S: FloatArray, a: FloatArray, B: FloatArray, later: FloatArray, R: FloatArray
) -> None:
    """Turn l and R of a keyframe, in place, into those of the one before."""
    D, V = len(a), len(S)
    wide, half = np.empty((D, V)), np.empty((D, V))
    _product(B, S[:D], wide)
    for k in range(D):
        for i in range(V):
            scale, row = S[k, i], R[i]
            later[i] += scale * a[k]
            for j in range(V):
                row[j] += scale * wide[k, j]
    _product(G[:, :V], R, half)
    moved = np.zeros(D)
    for i in range(D):
        for j in range(V):
            moved[i] -= G[i, j] * later[j]
        for j in range(i + 1):
            total = 0.0
            for m in range(V):
                total += half[i, m] * G[j, m]
            R[i, j] = R[j, i] = total
        for j in range(D, V):
            R[i, j] = R[j, i] = -half[i, j]
    later[:D] = moved


@inner
def _product(A: FloatArray, B: FloatArray, out: FloatArray) -> None:
    """Set ``out`` to A times the first columns of B."""
    for i in range(len(out)):
        row = out[i]
        row[:] = 0.0
        for k in range(A.shape[1]):
            scale, other = A[i, k], B[k]
            if scale != 0.0:
                for j in range(len(row)):
                    row[j] += scale * other[j]


@inner
def _fill(P: FloatArray, shared: FloatArray, constant: FloatArray, S: FloatArray) -> None:
    """Set S to the covariance of a state and the constants."""
    D, b = shared.shape
    for i in range(D):
        for j in range(D):
            S[i, j] = P[i, j]
        for j in range(b):
            S[i, D + j] = S[D + j, i] = shared[i, j]
    for i in range(b):
        for j in range(b):
            S[D + i, D + j] = constant[i, j]
