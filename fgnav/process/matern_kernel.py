"""The Matern-5/2 process over one interval, for inner loops: transition, integral, noise.

All is worked out in ``u = k T`` with ``k = sqrt(5) / length`` for the state
``(w, a / k, j / k^2)``, where no parameter is left, then scaled to ``(w, T0 a, T0^2 j)``.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.kernels.compiled import inlined, inner, kernel

DERIVATIVE_SCALE_S = 0.1  # T0: that of the states' tangent, makes rate and derivatives alike
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_PANEL = 4.0  # ten nodes are exact to 1e-12 over this much of u
_FORGOTTEN = 40.0  # exp(-40) u^4 is below double precision: only the integral still grows


@kernel
def rate_constant(length_s: float) -> float:
    """Return ``k = sqrt(5) / length``, 1/s."""
    return float(np.sqrt(5.0) / length_s)


@kernel
def transition(T_s: float, length_s: float) -> FloatArray:
    """Return F, (3, 3): ``exp(-u) (I + N u + N^2 u^2 / 2)``, of the scaled state."""
    k = rate_constant(length_s)
    u, c = k * T_s, k * DERIVATIVE_SCALE_S
    q = u * u / 2
    F = np.empty((3, 3))
    F[0, 0], F[0, 1], F[0, 2] = 1 + u + q, (u + 2 * q) / c, q / (c * c)
    F[1, 0], F[1, 1], F[1, 2] = -q * c, 1 + u - 2 * q, (u - q) / c
    F[2, 0], F[2, 1], F[2, 2] = (q - u) * c * c, (2 * q - 3 * u) * c, 1 - 2 * u + q
    decay = np.exp(-u)
    for i in range(3):
        for j in range(3):
            F[i, j] *= decay
    return F


@kernel
def integral(T_s: float, length_s: float) -> FloatArray:
    """Return H, (3,), s: the integral of F's first row over the interval."""
    k = rate_constant(length_s)
    u, c = k * T_s, k * DERIVATIVE_SCALE_S
    decay, third = np.exp(-u), _gamma3(u)
    second = third + decay * u * u / 2  # regularised incomplete gamma functions of u
    first = second + decay * u
    H = np.empty(3)
    H[0] = (first + second + third) / k
    H[1] = (second + 2 * third) / (k * c)
    H[2] = third / (k * c * c)
    return H


@kernel
def noise_factor(T_s: float, length_s: float) -> FloatArray:
    """Return the lower Cholesky factor of the noise of (phi, w, T0 a, T0^2 j), (4, 4).

    For unit variance: Gauss-Legendre quadrature of the impulse response's square, whose root is
    taken by orthogonalising its rows; the covariance itself is never formed.
    """
    k = rate_constant(length_s)
    u, c = k * T_s, k * DERIVATIVE_SCALE_S
    A = _responses(u)
    L = np.zeros((4, 4))
    _orthogonalise(A, L)
    for j in range(4):
        L[0, j] /= k
        L[2, j] *= c
        L[3, j] *= c * c
    return L


@kernel
def whitening(L: FloatArray) -> FloatArray:
    """Return the inverse of a lower-triangular matrix, (n, n), by forward substitution."""
    n = L.shape[0]
    W = np.zeros((n, n))
    for j in range(n):
        W[j, j] = 1 / L[j, j]
        for i in range(j + 1, n):
            total = 0.0
            for m in range(j, i):
                total += L[i, m] * W[m, j]
            W[i, j] = -total / L[i, i]
    return W


@kernel
def intervals_into(
    T_s: FloatArray, length_s: FloatArray, F: FloatArray, H: FloatArray, W: FloatArray
) -> None:
    """Write transition (k, 3, 3), integral (k, 3) and whitening rows (k, 4, 4) of intervals."""
    for k in range(len(T_s)):
        own_F, own_H = transition(T_s[k], length_s[k]), integral(T_s[k], length_s[k])
        own_W = whitening(noise_factor(T_s[k], length_s[k]))
        for i in range(3):
            H[k, i] = own_H[i]
            for j in range(3):
                F[k, i, j] = own_F[i, j]
        for i in range(4):
            for j in range(4):
                W[k, i, j] = own_W[i, j]


@inner
def _gamma3(s: float) -> float:
    """Return ``1 - exp(-s) (1 + s + s^2 / 2)`` to full relative precision, s >= 0."""
    if s > 2.0:
        return float(1 - np.exp(-s) * (1 + s + s * s / 2))
    term, total = s * s * s / 6, 0.0
    for n in range(4, 28):
        total += term
        term *= s / n
    return float(np.exp(-s) * total)


@inlined
def _responses(u: float) -> FloatArray:
    """Return weighted impulse responses of (k phi, w, a / k, j / k^2), one row a node, (m, 4)."""
    end = min(u, _FORGOTTEN)
    panels = max(1, int(np.ceil(end / _PANEL)))
    m, half = len(_NODES), end / panels / 2
    A = np.zeros((panels * m + 1, 4))
    for panel in range(panels):
        for i in range(m):
            s = half * (2 * panel + 1 + _NODES[i])
            root = np.sqrt(16.0 / 3.0 * half * _WEIGHTS[i])  # q = 16 / 3 k^5 for unit variance
            decay = root * np.exp(-s)
            row = panel * m + i
            A[row, 0] = root * _gamma3(s)
            A[row, 1] = decay * s * s / 2
            A[row, 2] = decay * (s - s * s / 2)
            A[row, 3] = decay * (1 - 2 * s + s * s / 2)
    A[panels * m, 0] = np.sqrt(16.0 / 3.0 * (u - end))
    return A


@inlined
def _orthogonalise(A: FloatArray, L: FloatArray) -> None:
    """Write L, lower, with ``L L' = A' A``; modified Gram-Schmidt, which spoils A."""
    m, n = A.shape
    for j in range(n):
        total = 0.0
        for row in range(m):
            total += A[row, j] ** 2
        length = np.sqrt(total)
        L[j, j] = length
        for i in range(j + 1, n):
            total = 0.0
            for row in range(m):
                total += A[row, j] * A[row, i]
            L[i, j] = total / length
            for row in range(m):
                A[row, i] -= total / (length * length) * A[row, j]
