"""Steps along the tangents of keyframes, compiled: a window takes some of each keyframe.

``States.moved`` states the same for any number of them.
"""

import numpy as np
from numba import njit

from fgnav.checks import FloatArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.types.states import States


def retracted(
    at: States, steps: FloatArray, constant_steps: FloatArray, *, by_pose3: bool = False
) -> States:
    """Return the states a step away, (n, D) along their tangents and (b,).

    ``by_pose3``: as ``gtsam.Pose3.retract`` moves, whose positions go by ``V(turn) dp`` instead of
    ``dp`` [1]_.

    References
    ----------
    .. [1] Barfoot, State Estimation for Robotics, 2nd edition, section 8.1.3.
    """
    own = _retracted(at.R_nb, at.p_n_m, at.v_n_mps, at.aux, steps, by_pose3)
    return States(*own, at.constants + constant_steps)


@njit(cache=True)
def _retracted(
    R_nb: FloatArray,
    p_n_m: FloatArray,
    v_n_mps: FloatArray,
    aux: FloatArray,
    steps: FloatArray,
    by_pose3: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    n = len(steps)
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    for k in range(n):
        turn, along = steps[k, :3], steps[k, 3:6].copy()
        if by_pose3:
            along = rot.times(rot.transposed(rot.right_jacobian(turn)), along)
        R[k] = rot.product(R_nb[k], rot.exp(turn))
        moved = rot.times(R_nb[k], along)
        for i in range(3):
            p[k, i] = p_n_m[k, i] + moved[i]
    return R, p, v_n_mps + steps[:, 6:9], aux + steps[:, 9:]
