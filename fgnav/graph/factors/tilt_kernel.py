"""Unit vectors seen by an instrument that is turned a little in the body: two angles unknown."""

from typing import TypeAlias

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.kernels.compiled import kernel

# A plain integer would be a type of its own to numba, and the kernel compiled for each.
ABOUT_X, ABOUT_Y = np.int64(0), np.int64(1)  # first of the two neighbouring axes of the angles
Axis: TypeAlias = int | np.int64


@kernel
def tilt(constants: FloatArray, column: int, axis: Axis) -> FloatArray:
    """Return minus the rotation vector t by which an instrument is turned in the body, (3,).

    It sees ``Exp(-t) u_b`` of a vector u_b; two elements of t, from ``axis`` on, are constants from
    ``column`` on. Zero where the column is -1.
    """
    out = np.zeros(3)
    if column >= 0:
        out[axis], out[axis + 1] = -constants[column], -constants[column + 1]
    return out


@kernel
def fill(
    value: FloatArray,
    state: FloatArray,
    shared: FloatArray,
    across: FloatArray,
    u_b: FloatArray,
    minus_tilt: FloatArray,
    column: int,
    axis: Axis,
) -> None:
    """Fill the residual ``across u_b``, (2,), its derivative by the turn of the body and by t.

    Parameters
    ----------
    value, state, shared : ndarray, shape (2,), (2, D), (2, b)
    across : ndarray, shape (2, 3)
        Whitening rows times ``Exp(-t)``.
    u_b : ndarray, shape (3,)
    minus_tilt, column, axis
        As in ``tilt``.
    """
    by_turn = rot.product(across, rot.skew(u_b))
    for m in range(2):
        for c in range(3):
            value[m] += across[m, c] * u_b[c]
            state[m, c] = by_turn[m, c]
    if column >= 0:
        by_tilt = rot.product(by_turn, rot.right_jacobian(minus_tilt))
        for m in range(2):
            for c in range(2):
                shared[m, column + c] = by_tilt[m, axis + c]
