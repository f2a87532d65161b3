"""Intervals between keyframes without a gyroscope: residuals and derivatives, compiled.

Equations in ``gyro_free``. Everything works on rows of contiguous arrays, one interval at a time.
"""

from typing import NamedTuple

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.inertial.path_kernel import (
    Intervals,
    Path,
    empty_path,
    integrate,
    turn,
)
from fgnav.kernels.compiled import kernel

ROWS = 21  # rotation, position, velocity, accelerometer bias, rate and its two derivatives
# After them stand those of the array's time-correlated error, q: D is 21 + q.


class Rows(NamedTuple):
    """Poses and vectors of j keyframes; as ``States``."""

    R_nb: FloatArray  # (j, 3, 3)
    p_n_m: FloatArray  # (j, 3)
    v_n_mps: FloatArray  # (j, 3)
    aux: FloatArray  # (j, 12 + q)


class Filled(NamedTuple):
    """Output arrays for residuals and derivatives of j intervals, as ``LinearisedMotion``."""

    value: FloatArray  # (j, D, 1)
    before: FloatArray  # (j, D, D)
    after: FloatArray  # (j, D, D)
    by_mean: FloatArray  # (j, D, 3)


@kernel
def linearise(
    indices: IntArray, of: Intervals, before: Rows, after: Rows, mean: FloatArray, out: Filled
) -> None:
    """Fill whitened residuals of intervals, (j,), and their derivatives.

    Parameters
    ----------
    indices : ndarray of int, shape (j,)
    of : Intervals
    before, after : Rows
        States of the j intervals' ends.
    mean : ndarray, shape (3,)
        Mean rate, rad/s.
    out : Filled
    """
    path = empty_path()
    for row in range(len(indices)):
        k = indices[row]
        _clear(row, out)
        turn(before.R_nb[row], after.R_nb[row], path)
        integrate(of, k, before.aux[row], after.aux[row], path)
        _rotation_rows(of, k, row, before, after, mean, path, out)
        _process_rows(of, k, row, before, after, mean, out)
        _force_rows(of, k, row, before, after, path, out)
        _bias_rows(of.walk_white[k], row, before, after, out)
        _correlated_rows(of.correlated[k], of.correlated_white[k], row, before, after, out)
        _whiten(of, k, out.value[row])
        _whiten(of, k, out.before[row])
        _whiten(of, k, out.after[row])
        _whiten(of, k, out.by_mean[row])


@kernel
def predict(indices: IntArray, of: Intervals, before: Rows, mean: FloatArray, after: Rows) -> None:
    """Fill the states that intervals, (j,), lead to: the mean of the process, forces integrated."""
    path = empty_path()
    for row in range(len(indices)):
        k = indices[row]
        T, x, y = of.span_s[k], before.aux[row], after.aux[row]
        _predict_correlated(of.correlated[k], x, y)
        for i in range(3):
            y[i] = x[i]
            for p in range(3):
                y[3 + 3 * p + i] = mean[i] if p == 0 else 0.0
                for q in range(3):
                    deviation = x[3 + 3 * q + i] - (mean[i] if q == 0 else 0.0)
                    y[3 + 3 * p + i] += of.transition[k, i, p, q] * deviation
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            path.theta[i] = mean[i] * T
            path.theta[i] += T**2 / 12 * (x[3 + a] * y[3 + b] - x[3 + b] * y[3 + a])
            for q in range(3):
                path.theta[i] += of.turn[k, i, q] * (
                    x[3 + 3 * q + i] - (mean[i] if q == 0 else 0.0)
                )
        integrate(of, k, x, y, path)
        R = rot.product(before.R_nb[row], rot.exp(path.theta))
        g, v, earth = of.gravity_n_mps2[k], before.v_n_mps[row], of.earth_rate_n_radps
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            coriolis = earth[a] * v[b] - earth[b] * v[a]
            after.p_n_m[row, i] = before.p_n_m[row, i] + v[i] * T + (g[i] / 2 - coriolis) * T**2
            after.v_n_mps[row, i] = v[i] + (g[i] - 2 * coriolis) * T
            for j in range(3):
                after.R_nb[row, i, j] = R[i, j]
                after.v_n_mps[row, i] += before.R_nb[row, i, j] * path.gain[0, j]
                after.p_n_m[row, i] += before.R_nb[row, i, j] * path.gain[1, j]


@kernel
def _rotation_rows(
    of: Intervals,
    k: int,
    row: int,
    before: Rows,
    after: Rows,
    mean: FloatArray,
    path: Path,
    out: Filled,
) -> None:
    """Fill the rows of the rotation: turned less what the process expects."""
    T, x, y = of.span_s[k], before.aux[row], after.aux[row]
    H, value, E_0, E_1 = of.turn[k], out.value[row], out.before[row], out.after[row]
    bend, theta, J = T**2 / 12, path.theta, path.J
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        value[i, 0] = theta[i] - bend * (x[3 + a] * y[3 + b] - x[3 + b] * y[3 + a])
        value[i, 0] -= mean[i] * (T - H[i, 0])
        for q in range(3):
            value[i, 0] -= H[i, q] * x[3 + 3 * q + i]
            E_0[i, 12 + 3 * q + i] = -H[i, q]
        for j in range(3):
            E_0[i, j], E_1[i, j] = -J[j, i], J[i, j]
        E_0[i, 12 + a], E_0[i, 12 + b] = -bend * y[3 + b], bend * y[3 + a]
        E_1[i, 12 + a], E_1[i, 12 + b] = bend * x[3 + b], -bend * x[3 + a]
        out.by_mean[row, i, i] = H[i, 0] - T


@kernel
def _process_rows(
    of: Intervals, k: int, row: int, before: Rows, after: Rows, mean: FloatArray, out: Filled
) -> None:
    """Fill the rows of the rate and its derivatives: ``x_1 - F x_0 - (I - F) (m, 0, 0)``."""
    F, x, y = of.transition[k], before.aux[row], after.aux[row]
    for p in range(3):
        rate_sign = -1.0 if p == 0 else 0.0
        for i in range(3):
            at = 12 + 3 * p + i
            value = y[3 + 3 * p + i] + (rate_sign + F[i, p, 0]) * mean[i]
            for q in range(3):
                value -= F[i, p, q] * x[3 + 3 * q + i]
                out.before[row, at, 12 + 3 * q + i] = -F[i, p, q]
            out.after[row, at, at] = 1.0
            out.by_mean[row, at, i] = rate_sign + F[i, p, 0]
            out.value[row, at, 0] = value


@kernel
def _force_rows(
    of: Intervals,
    k: int,
    row: int,
    before: Rows,
    after: Rows,
    path: Path,
    out: Filled,
) -> None:
    """Fill the rows of position and velocity: gained less what the specific force leads to."""
    T, R, v = of.span_s[k], before.R_nb[row], before.v_n_mps[row]
    g, earth = of.gravity_n_mps2[k], of.earth_rate_n_radps
    gain, sums, J = path.gain, path.sums, path.J
    for half in range(2):  # velocity, then position
        first, at = 4 * half, 6 - 3 * half
        by_end = rot.product(sums[first + 2], path.C)
        for i in range(3):
            for j in range(3):
                by_end[i, j] += sums[first, i, j]
        _put(out.after[row], at, 0, R, rot.product(by_end, J), -1.0)
        _put(out.after[row], at, 12, R, rot.product(sums[first + 2], J), -1.0)
        _put(out.before[row], at, 12, R, sums[first + 1], -1.0)
        by_start = rot.product(by_end, rot.transposed(J))
        for i in range(3):
            a, b = (i + 1) % 3, (i + 2) % 3
            by_start[i, a] += -gain[half, b]
            by_start[i, b] += gain[half, a]
        _put(out.before[row], at, 0, R, by_start, 1.0)
        _put(out.before[row], at, 9, R, sums[first + 3], 1.0)
    for i in range(3):
        a, b = (i + 1) % 3, (i + 2) % 3
        coriolis = earth[a] * v[b] - earth[b] * v[a]
        p = after.p_n_m[row, i] - before.p_n_m[row, i] - v[i] * T - (g[i] / 2 - coriolis) * T**2
        dv = after.v_n_mps[row, i] - v[i] - (g[i] - 2 * coriolis) * T
        for j in range(3):
            p -= R[i, j] * gain[1, j]
            dv -= R[i, j] * gain[0, j]
            out.before[row, 3 + i, 3 + j] = -R[i, j]
            out.after[row, 3 + i, 3 + j] = after.R_nb[row, i, j]
        out.value[row, 3 + i, 0], out.value[row, 6 + i, 0] = p, dv
        out.before[row, 3 + i, 6 + i], out.before[row, 6 + i, 6 + i] = -T, -1.0
        out.before[row, 3 + i, 6 + b] = T**2 * earth[a]
        out.before[row, 3 + i, 6 + a] = -(T**2) * earth[b]
        out.before[row, 6 + i, 6 + b], out.before[row, 6 + i, 6 + a] = (
            2 * T * earth[a],
            -2 * T * earth[b],
        )
        out.after[row, 6 + i, 6 + i] = 1.0


@kernel
def _put(E: FloatArray, row: int, column: int, R: FloatArray, M: FloatArray, factor: float) -> None:
    """Set a block, (3, 3), to ``factor R M``."""
    for i in range(3):
        for j in range(3):
            total = R[i, 0] * M[0, j] + R[i, 1] * M[1, j] + R[i, 2] * M[2, j]
            E[row + i, column + j] = factor * total


@kernel
def _bias_rows(white: float, row: int, before: Rows, after: Rows, out: Filled) -> None:
    """Fill the rows of the random walk of the accelerometer's bias, whitened."""
    for i in range(9, 12):
        out.before[row, i, i], out.after[row, i, i] = -white, white
        out.value[row, i, 0] = white * (after.aux[row, i - 9] - before.aux[row, i - 9])


@kernel
def _predict_correlated(F: FloatArray, x: FloatArray, y: FloatArray) -> None:
    """Set the array's time-correlated error to ``F z_0``."""
    for i in range(len(F)):
        y[12 + i] = 0.0
        for j in range(len(F)):
            y[12 + i] += F[i, j] * x[12 + j]


@kernel
def _correlated_rows(
    F: FloatArray, white: FloatArray, row: int, before: Rows, after: Rows, out: Filled
) -> None:
    """Fill the rows of the array's time-correlated error, whitened: ``z_1 - F z_0``."""
    q = len(F)
    for i in range(q):
        total = 0.0
        for j in range(q):
            propagated = 0.0
            for m in range(i + 1):  # whitening is lower triangular
                propagated += white[i, m] * F[m, j]
            out.before[row, ROWS + i, ROWS + j] = -propagated
            out.after[row, ROWS + i, ROWS + j] = white[i, j]
            total += white[i, j] * after.aux[row, 12 + j] - propagated * before.aux[row, 12 + j]
        out.value[row, ROWS + i, 0] = total


@kernel
def _whiten(of: Intervals, k: int, E: FloatArray) -> None:
    """Whiten the rows of the process and of the specific force in place, (D, c)."""
    force = of.force_white[k]
    for i in range(3):
        W, weight = of.white[k, i], 1 / of.sigma_radps[k, i]
        for j in range(E.shape[1]):
            phi, w, a, b = E[i, j], E[12 + i, j], E[15 + i, j], E[18 + i, j]
            E[i, j] = weight * W[0, 0] * phi
            E[12 + i, j] = weight * (W[1, 0] * phi + W[1, 1] * w)
            E[15 + i, j] = weight * (W[2, 0] * phi + W[2, 1] * w + W[2, 2] * a)
            E[18 + i, j] = weight * (W[3, 0] * phi + W[3, 1] * w + W[3, 2] * a + W[3, 3] * b)
            E[3 + i, j] = force[2] * (E[3 + i, j] - force[1] * E[6 + i, j])
            E[6 + i, j] *= force[0]


@kernel
def _clear(row: int, out: Filled) -> None:
    """Set derivatives to zero."""
    for i in range(out.before.shape[1]):
        for j in range(out.before.shape[1]):
            out.before[row, i, j] = out.after[row, i, j] = 0.0
        for j in range(3):
            out.by_mean[row, i, j] = 0.0
