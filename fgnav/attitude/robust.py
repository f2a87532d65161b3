"""Attitudes that wrong integers cannot pull away: a redescending weight for every link."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.rotation_kernel import exp, inverse, product, put, scaled, times
from fgnav.kernels.compiled import inner, kernel
from fgnav.types.differences import DoubleDifferences

# Where residuals begin to lose their say, in wavelengths, from wide to narrow: from the start of
# one wrong link in five, which is ten degrees off, the narrow weights alone find a wrong minimum.
_SCALES = np.array([2.0, 1.0, 0.5, 0.25, 0.125])
_STEPS = 4  # at each scale
_LONGEST_RAD = 0.5  # of a step
_RIDGE = 1e-9  # of the largest information: an open direction is not searched


def robust_attitudes(
    differences: DoubleDifferences,
    ranges_m: FloatArray,
    R_nb_start: FloatArray,
    wanted: BoolArray,
    *,
    causal: bool = False,
) -> FloatArray:
    """Return attitudes, (n, 3, 3), that most double differences of an epoch agree on.

    Gauss-Newton on Geman and McClure's cost, its scale drawn in step by step [1]_, from the epoch's
    own start and from its neighbours' attitudes; the lower cost counts. Correlations are left out:
    an integer that is wrong is sixty sigmas off, whatever its neighbours do.

    Parameters
    ----------
    ranges_m : ndarray, shape (n, b, m)
        ``fixed_ranges_m``, with whatever integers.
    R_nb_start : ndarray, shape (n, 3, 3)
    wanted : ndarray of bool, shape (n,)
        Epochs to search; the others keep their start, and lend it to their neighbours.
    causal : bool
        Whether only the epoch before lends its attitude, not the one after.

    References
    ----------
    .. [1] Yang, Antonante, Tzoumas, Carlone: Graduated Non-Convexity for Robust Spatial Perception,
       IEEE RA-L 5(2), 2020, section IV.
    """
    of_reference = differences.reference[:, differences.group].clip(0)
    variance_m2 = differences.phase_variance_m2
    R_nb = R_nb_start.copy()
    e_n = differences.e_n
    _search(
        np.where(differences.is_reference[:, None, :], np.nan, ranges_m),
        np.ascontiguousarray(np.take_along_axis(e_n, of_reference[..., None], axis=1) - e_n),
        1.0 / (variance_m2 + np.take_along_axis(variance_m2, of_reference, axis=1)),
        np.ascontiguousarray(differences.wavelength_m),
        np.ascontiguousarray(differences.baselines_b_m),
        wanted,
        R_nb,
        2 if causal else 3,
    )
    return R_nb


# Plain loops: numba compiles them in a fraction of the time that array expressions take.
@kernel
def _search(
    ranges_m: FloatArray,
    directions_n: FloatArray,
    weight: FloatArray,
    wavelength_m: FloatArray,
    baselines_b_m: FloatArray,
    wanted: BoolArray,
    R_nb: FloatArray,
    sweeps: int,
) -> None:
    """Search each epoch from its own start, then from the one before it, then the one after."""
    n = len(ranges_m)
    lowest = np.full(n, np.inf)
    trial = np.zeros((3, 3))
    for sweep in range(sweeps):
        for i in range(n):
            k = n - 1 - i if sweep == 2 else i
            other = k - 1 if sweep == 1 else k + 1 if sweep == 2 else k
            if not wanted[k] or other < 0 or other >= n:
                continue
            trial[:] = R_nb[other]
            cost = _descend(
                ranges_m[k], directions_n[k], weight[k], wavelength_m, baselines_b_m, trial
            )
            if cost < lowest[k]:
                lowest[k] = cost
                R_nb[k] = trial


@inner
def _descend(
    ranges_m: FloatArray,
    D: FloatArray,
    weight: FloatArray,
    wavelength_m: FloatArray,
    baselines_b_m: FloatArray,
    R: FloatArray,
) -> float:
    """Turn an attitude to the minimum of one epoch, in place; return the cost at the last scale."""
    b, m = ranges_m.shape
    A, g = np.zeros((3, 3)), np.zeros(3)
    d, J = np.zeros(3), np.zeros(3)
    cost = 0.0
    for scale in _SCALES:
        for _ in range(_STEPS):
            A[:], g[:], cost = 0.0, 0.0, 0.0
            for j in range(m):
                for c in range(3):
                    d[c] = R[0, c] * D[j, 0] + R[1, c] * D[j, 1] + R[2, c] * D[j, 2]
                for i in range(b):
                    if np.isnan(ranges_m[i, j]):
                        continue
                    _cross(baselines_b_m[i], d, J)
                    r = ranges_m[i, j]
                    for c in range(3):
                        r -= d[c] * baselines_b_m[i, c]
                    square = (r / (scale * wavelength_m[j])) ** 2
                    cost += square / (1.0 + square)
                    w = weight[j] / (1.0 + square) ** 2
                    for c in range(3):
                        g[c] += w * r * J[c]
                        for e in range(3):
                            A[c, e] += w * J[c] * J[e]
            _turn(R, A, g)
    return cost


@inner
def _cross(a: FloatArray, b: FloatArray, out: FloatArray) -> None:
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@inner
def _turn(R: FloatArray, A: FloatArray, g: FloatArray) -> None:
    """Turn R, in place, by the body tangent that solves ``A step = g``, half a radian at most."""
    ridge = _RIDGE * (A[0, 0] + A[1, 1] + A[2, 2])
    if ridge == 0.0:
        return
    for c in range(3):
        A[c, c] += ridge
    step = times(inverse(A)[0], g)
    angle = np.sqrt(step[0] ** 2 + step[1] ** 2 + step[2] ** 2)
    put(product(R, exp(scaled(step, _LONGEST_RAD / max(angle, _LONGEST_RAD)))), R)
