"""Evidence of an integer vector: its likelihood, integrated over all attitudes.

A single direction is integrated over the whole sphere. The integral is the density at 1 of the
squared length of a Gaussian vector, for which the saddlepoint approximation of second order is
within 2.5 % wherever it was compared with quadrature, mirror images and flat minima included [1]_.
Attitudes of two or three columns are integrated around their optimum (Laplace), with the curvature
that residuals add.

References
----------
.. [1] A. Kume, A. T. A. Wood, "Saddlepoint approximations for the Bingham and Fisher-Bingham
   normalising constants", Biometrika 92, 2005.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.integers.array.nearest import half_log_determinant, normal_matrix, tangent
from fgnav.integers.array.principal_axes import principal_axes
from fgnav.kernels.compiled import kernel

_STEPS = 60
_EXACT = 1e-9  # of the squared length
_FLATTEST = 0.1  # of the curvature without residuals: where less is left, Laplace's volume is none


@kernel
def log_likelihood(
    columns: FloatArray, information: FloatArray, M: FloatArray, distance: float
) -> float:
    """Return the logarithm of ``exp(-distance / 2)`` integrated over all attitudes.

    Powers of 2 pi that all candidates share are left out.

    Parameters
    ----------
    columns : ndarray, shape (3 r,)
        Where the distance is measured from.
    information : ndarray, shape (3 r, 3 r)
        Its metric.
    M : ndarray, shape (3 r,)
        The nearest orthonormal columns.
    distance : float
        Theirs, squared.
    """
    if len(columns) == 3:
        return _log_over_sphere(columns, information)
    return _log_curved_volume(M, columns, information) - 0.5 * distance


@kernel
def _log_over_sphere(column: FloatArray, information: FloatArray) -> float:
    """Return log of the integral over the sphere, by 2 pi.

    The squared length of ``N(column, information^-1)`` has the cumulant function
    ``K(t) = sum(-log(d) / 2 + t a^2 / d)`` with ``d = 1 - 2 t / value`` and a the column's share
    in each eigenvector; its saddlepoint is where ``K'(t) = 1``.
    """
    values, vectors = principal_axes(information)
    share = np.zeros(3)
    for i in range(3):
        for j in range(3):
            share[i] += vectors[j, i] * column[j]
        share[i] *= share[i]
    high = 0.5 * values[0]
    low = high - values[0]
    while _cumulants(low, values, share)[0] > 1.0:
        low -= high - low
    t = 0.5 * (low + high)
    K1, K2, K3, K4 = _cumulants(t, values, share)
    for _ in range(_STEPS):
        if abs(K1 - 1.0) < _EXACT:
            break
        if K1 > 1.0:
            high = t
        else:
            low = t
        t += 2.0 * K1 * (1.0 - np.sqrt(K1)) / K2  # Newton's on 1 / sqrt(K'), nearly straight in t
        if not low < t < high:
            t = 0.5 * (low + high)
        K1, K2, K3, K4 = _cumulants(t, values, share)
    logarithm: float = np.log(2.0) - t
    logarithm += K4 / (8.0 * K2 * K2) - 5.0 * K3 * K3 / (24.0 * K2 * K2 * K2)
    squared = K2
    for i in range(3):
        d = 1.0 - 2.0 * t / values[i]
        logarithm += t * share[i] / d
        squared *= d * values[i]
    logarithm -= 0.5 * np.log(squared)
    return logarithm


@kernel
def _cumulants(
    t: float, values: FloatArray, share: FloatArray
) -> tuple[float, float, float, float]:
    """Return the first four derivatives of K."""
    K1, K2, K3, K4 = 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        inverse = 1.0 / (values[i] - 2.0 * t)
        a = share[i] * (values[i] * inverse) ** 2
        K1 += inverse + a
        K2 += (2.0 * inverse + 4.0 * a) * inverse
        K3 += (8.0 * inverse + 24.0 * a) * inverse * inverse
        K4 += (48.0 * inverse + 192.0 * a) * inverse * inverse * inverse
    return K1, K2, K3, K4


@kernel
def _log_curved_volume(M: FloatArray, columns: FloatArray, information: FloatArray) -> float:
    """Return minus half the log determinant of the distance's curvature by turns of M."""
    H = normal_matrix(tangent(M), information)
    flattest = np.empty(3)
    for i in range(3):
        flattest[i] = _FLATTEST * H[i, i]
    for u in range(0, len(M), 3):
        _add_bend(M, columns, information, u, H)
    return half_log_determinant(H, flattest)


@kernel
def _add_bend(
    M: FloatArray, columns: FloatArray, information: FloatArray, u: int, H: FloatArray
) -> None:
    """Add what column u does to second order: ``w x (w x m)`` against the distance's gradient."""
    pull = np.zeros(3)
    along = 0.0
    for i in range(3):
        for j in range(len(M)):
            pull[i] += information[u + i, j] * (M[j] - columns[j])
        along += pull[i] * M[u + i]
    for i in range(3):
        for j in range(i, 3):
            H[i, j] += 0.5 * (M[u + i] * pull[j] + pull[i] * M[u + j])
        H[i, i] -= along
