"""A third-order autoregression over one interval, for inner loops: transition, integral, noise.

Everything follows from its response to an impulse of the third derivative, h(t), with the poles
``-k`` and ``-z +- i w``: the divided difference of ``exp(p t)`` at the three. With ``d = z - k``::

    h(t) = exp(-z t) g(t)        g(t) = (exp(d t) - cos w t - d sin(w t) / w) / (d^2 + w^2)

Where poles are close, ``g`` is summed as a series; where all are slow against t, so is ``h``.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import product, put, transposed
from fgnav.kernels.compiled import kernel

DERIVATIVE_SCALE_S = 0.1  # T0: that of the states' tangent, makes rate and derivatives alike
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(10)
_PANEL = 4.0  # ten nodes are exact to 1e-12 over this much of time times the fastest pole
_FORGOTTEN = 40.0  # exp(-40) u^4 is below double precision: only the integral still grows
SAME_S = 1e-9  # durations closer than this are one
# Intervals that a filter remembers: its epochs', and two spans between blocks of a long flight.
RECENT = 4
_SERIES, _TERMS = 1.0, 24  # of what is at most one: 1 / 24! is below double precision


@kernel
def coefficients(poles_per_s: FloatArray) -> tuple[float, float, float, float]:
    """Return c0, c1, c2 of ``(D^3 + c2 D^2 + c1 D + c0) x = noise``, and q.

    q is the noise's density for which x has unit variance.
    """
    k, z, w = poles_per_s[0], poles_per_s[1], poles_per_s[2]
    pair = z * z + w * w
    c0, c1, c2 = k * pair, pair + 2 * z * k, 2 * z + k
    return c0, c1, c2, 2 * c0 * (c1 * c2 - c0) / c2


@kernel
def stationary(poles_per_s: FloatArray) -> tuple[float, float]:
    """Return the variances of the first two scaled derivatives; that of x is one."""
    c0, c1, c2, _ = coefficients(poles_per_s)
    first = c0 / c2 * DERIVATIVE_SCALE_S**2
    return first, first * c1 * DERIVATIVE_SCALE_S**2


@kernel
def transition(T_s: float, poles_per_s: FloatArray) -> FloatArray:
    """Return F, (3, 3), of the scaled state."""
    c0, c1, c2, _ = coefficients(poles_per_s)
    h, h1, h2, _ = _response(T_s, poles_per_s)
    T0 = DERIVATIVE_SCALE_S
    F = np.empty((3, 3))
    F[0, 0], F[0, 1], F[0, 2] = h2 + c2 * h1 + c1 * h, (h1 + c2 * h) / T0, h / T0**2
    F[1, 0], F[1, 1], F[1, 2] = -c0 * h * T0, h2 + c2 * h1, h1 / T0
    F[2, 0], F[2, 1], F[2, 2] = -c0 * h1 * T0**2, -(c1 * h1 + c0 * h) * T0, h2
    return F


@kernel
def integral(T_s: float, poles_per_s: FloatArray) -> FloatArray:
    """Return H, (3,), s: the integral of F's first row over the interval."""
    _, c1, c2, _ = coefficients(poles_per_s)
    h, h1, _, integral_s = _response(T_s, poles_per_s)
    H = np.empty(3)
    H[0] = h1 + c2 * h + c1 * integral_s
    H[1] = (h + c2 * integral_s) / DERIVATIVE_SCALE_S
    H[2] = integral_s / DERIVATIVE_SCALE_S**2
    return H


@kernel
def noise_factor(T_s: float, poles_per_s: FloatArray) -> FloatArray:
    """Return the lower Cholesky factor of the noise of (phi, w, T0 a, T0^2 j), (4, 4).

    For unit variance: Gauss-Legendre quadrature of the impulse response's square, whose root is
    taken by orthogonalising its rows; the covariance itself is never formed.
    """
    c0, _, _, q = coefficients(poles_per_s)
    k, z, w = poles_per_s[0], poles_per_s[1], poles_per_s[2]
    end = min(T_s, _FORGOTTEN / min(k, z))
    panels = max(1, int(np.ceil(end * max(k, z, w) / _PANEL)))
    m, half = len(_NODES), end / panels / 2
    A = np.zeros((panels * m + 1, 4))
    for panel in range(panels):
        for i in range(m):
            root = np.sqrt(q * half * _WEIGHTS[i])
            h, h1, h2, integral_s = _response(half * (2 * panel + 1 + _NODES[i]), poles_per_s)
            node = panel * m + i
            A[node, 0], A[node, 1] = root * integral_s, root * h
            A[node, 2] = root * h1 * DERIVATIVE_SCALE_S
            A[node, 3] = root * h2 * DERIVATIVE_SCALE_S**2
    A[panels * m, 0] = np.sqrt(q * (T_s - end)) / c0
    L = np.zeros((4, 4))
    _orthogonalise(A, L)
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
    T_s: FloatArray, poles_per_s: FloatArray, F: FloatArray, H: FloatArray, W: FloatArray
) -> None:
    """Write transition (k, 3, 3), integral (k, 3) and whitening rows (k, 4, 4) of intervals."""
    for k in range(len(T_s)):
        turned_s = integral(T_s[k], poles_per_s[k])
        for i in range(3):  # an array assigned whole compiles numpy's text of unequal shapes: 3 s
            H[k, i] = turned_s[i]
        put(transition(T_s[k], poles_per_s[k]), F[k])
        put(whitening(noise_factor(T_s[k], poles_per_s[k])), W[k])


@kernel
def of_axes(
    T_s: float, poles_per_s: FloatArray, F: FloatArray, H: FloatArray, Q: FloatArray
) -> None:
    """Write transition, integral and noise covariance of the axes, (3, ...), with poles, (3, 3)."""
    for axis in range(3):
        alike = axis > 0
        for i in range(3):
            alike = alike and poles_per_s[axis, i] == poles_per_s[axis - 1, i]
        if alike:
            put(F[axis - 1], F[axis])
            put(Q[axis - 1], Q[axis])
            for i in range(3):
                H[axis, i] = H[axis - 1, i]
        else:
            poles = poles_per_s[axis]
            put(transition(T_s, poles), F[axis])
            L, turned_s = noise_factor(T_s, poles), integral(T_s, poles)
            put(product(L, transposed(L)), Q[axis])
            for i in range(3):
                H[axis, i] = turned_s[i]


@kernel
def like(T_s: float, poles_per_s: FloatArray, spans_s: FloatArray, poles: FloatArray) -> int:
    """Find an interval, of r with poles (r, 3, 3), that equals another one, or -1."""
    for i in range(len(spans_s)):
        alike = abs(spans_s[i] - T_s) <= SAME_S
        for axis in range(3):
            for j in range(3):
                alike = alike and poles[i, axis, j] == poles_per_s[axis, j]
        if alike:
            return i
    return -1


@kernel
def _response(t_s: float, poles_per_s: FloatArray) -> tuple[float, float, float, float]:
    """Return h, its two derivatives, and its integral since zero."""
    k, z, w = poles_per_s[0], poles_per_s[1], poles_per_s[2]
    c0, c1, c2, _ = coefficients(poles_per_s)
    if max(k, z, w) * t_s <= _SERIES:
        return _series(t_s, c0, c1, c2)
    d = z - k
    slow, fast = np.exp(-k * t_s), np.exp(-z * t_s)
    if max(abs(d), w) * t_s <= _SERIES:
        g, g1, g2, _ = _series(t_s, -d * w * w, w * w, -d)
        g, g1, g2 = fast * g, fast * g1, fast * g2
        h, h1, h2 = g, g1 - z * g, g2 - 2 * z * g1 + z * z * g
    else:
        cosine, sine = np.cos(w * t_s), np.sin(w * t_s) / w if w > 0 else t_s
        b, b1 = fast * (cosine + d * sine), fast * (d * cosine - w * w * sine)
        b2 = -w * w * b
        square = d * d + w * w
        h = (slow - b) / square
        h1 = (-k * slow - b1 + z * b) / square
        h2 = (k * k * slow - b2 + 2 * z * b1 - z * z * b) / square
    return h, h1, h2, (1 - h2 - c2 * h1 - c1 * h) / c0


@kernel
def _series(t_s: float, c0: float, c1: float, c2: float) -> tuple[float, float, float, float]:
    """Compute the transition by the Taylor series of ``(D^3 + c2 D^2 + c1 D + c0) x = 0``."""
    before, last, now = 0.0, 0.0, 1.0  # derivatives n - 2, n - 1 and n at zero, from n = 2
    p2, p1, p, p_1 = 1.0, t_s, t_s**2 / 2, t_s**3 / 6  # t^m / m! of m = n - 2 to n + 1
    h, h1, h2, integral_s = 0.0, 0.0, 0.0, 0.0
    for n in range(2, 2 + _TERMS):
        h, h1, h2, integral_s = h + now * p, h1 + now * p1, h2 + now * p2, integral_s + now * p_1
        before, last, now = last, now, -c2 * now - c1 * last - c0 * before
        p2, p1, p, p_1 = p1, p, p_1, p_1 * t_s / (n + 2)
    return h, h1, h2, integral_s


@kernel
def _orthogonalise(A: FloatArray, L: FloatArray) -> None:
    """Write L, lower, with ``L L' = A' A``; modified Gram-Schmidt, which spoils A."""
    m, n = A.shape
    for j in range(n):
        total = 0.0
        for k in range(m):
            total += A[k, j] ** 2
        length = np.sqrt(total)
        L[j, j] = length
        for i in range(j + 1, n):
            total = 0.0
            for k in range(m):
                total += A[k, j] * A[k, i]
            L[i, j] = total / length
            for k in range(m):
                A[k, i] -= total / (length * length) * A[k, j]
