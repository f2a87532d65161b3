"""States carried a little in time, with their derivatives, compiled; equations in ``delayed``.

A window linearises one measurement at a time: what stands here would take most of it in numpy.
"""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.types.states import DERIVATIVE_SCALE_S, States
from fgnav.kernels.compiled import kernel


@kernel
def carried(
    at: States,
    later_s: FloatArray,
    indices: IntArray,
    forces_b: tuple[FloatArray, FloatArray],
    measured_b_radps: FloatArray,
    slope_b_radps2: FloatArray,
    gravity_n_mps2: FloatArray,
    earth_rate_n_radps: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return attitudes, positions, velocities, ``aux`` of j states later, and derivatives.

    Parameters
    ----------
    at : States
    later_s : ndarray, shape (j,)
    indices : ndarray of int, shape (j,)
        Rows of what follows.
    forces_b : tuple of ndarray, shapes (k, 3)
        Before and after each keyframe.
    measured_b_radps : ndarray, shape (k, 3)
        By the gyroscope; (0, 3) without one: the state's.
    slope_b_radps2 : ndarray, shape (k, 3)
        How its rates change; (0, 3) without one.
    gravity_n_mps2 : ndarray, shape (k, 3)
    earth_rate_n_radps : ndarray, shape (3,)

    Returns
    -------
    tuple of ndarray
        Shapes (j, 3, 3), (j, 3), (j, 3), (j, D - 9); by states (j, D, D), by time (j, D).
    """
    n, D = len(later_s), 9 + at.aux.shape[1]
    R_later, p, v = np.empty((n, 3, 3)), np.empty((n, 3)), np.empty((n, 3))
    aux = at.aux.copy()
    Phi, rate = np.zeros((n, D, D)), np.zeros((n, D))
    measured = len(measured_b_radps) > 0
    for k in range(n):
        s, R, row = later_s[k], at.R_nb[k], indices[k]
        force = forces_b[0][row] if s < 0 else forces_b[1][row]
        earth_b = rot.times(rot.transposed(R), earth_rate_n_radps)
        f, w = np.empty(3), np.empty(3)
        for i in range(3):
            f[i] = force[i] - at.aux[k, i]
            w[i] = measured_b_radps[row, i] - at.aux[k, 3 + i] - earth_b[i] if measured else 0.0
            if not measured:
                w[i] = at.aux[k, 3 + i]
        a = rot.times(R, f)
        turn = rot.exp(rot.scaled(w, s))
        J = rot.right_jacobian(rot.scaled(w, s))
        later, by_force = rot.product(R, turn), rot.product(R, rot.skew(f))
        back = rot.transposed(later)
        turning, to_later = rot.product(J, rot.skew(earth_b)), rot.product(back, R)
        by_rotation = rot.product(back, by_force)
        for i in range(D):
            Phi[k, i, i] = 1.0
        for i in range(3):
            a[i] += gravity_n_mps2[row, i]
            p[k, i] = at.p_n_m[k, i] + s * at.v_n_mps[k, i] + s * s / 2 * a[i]
            v[k, i] = at.v_n_mps[k, i] + s * a[i]
            rate[k, i], rate[k, 6 + i] = w[i], a[i]
            if measured:
                rate[k, 12 + i] = -slope_b_radps2[row, i]
            else:
                rate[k, 12 + i] = at.aux[k, 6 + i] / DERIVATIVE_SCALE_S
                Phi[k, 12 + i, 15 + i] = s / DERIVATIVE_SCALE_S
            aux[k, 3 + i] += s * rate[k, 12 + i]
            for j in range(3):
                R_later[k, i, j] = later[i, j]
                Phi[k, i, j] = turn[j, i] - (s * turning[i, j] if measured else 0.0)
                Phi[k, i, 12 + j] = -s * J[i, j] if measured else s * J[i, j]
                Phi[k, 3 + i, j] = -s * s / 2 * by_rotation[i, j]
                Phi[k, 3 + i, 3 + j] = to_later[i, j]
                Phi[k, 3 + i, 6 + j] = s * back[i, j]
                Phi[k, 3 + i, 9 + j] = -s * s / 2 * to_later[i, j]
                Phi[k, 6 + i, j] = -s * by_force[i, j]
                Phi[k, 6 + i, 9 + j] = -s * R[i, j]
        v_b = rot.times(back, v[k])
        for i in range(3):
            rate[k, 3 + i] = v_b[i]
    return R_later, p, v, aux, Phi, rate
