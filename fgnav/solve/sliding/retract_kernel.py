"""Steps along the tangents of keyframes, compiled: a window takes some of each keyframe.

``States.moved`` states the same for any number of them.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry import rotation_kernel as rot
from fgnav.graph.types.states import States
from fgnav.kernels.compiled import kernel


def retracted(at: States, steps: FloatArray, constant_steps: FloatArray) -> States:
    """Return the states a step away, (n, D) along their tangents and (b,)."""
    R, p = _retracted(at.R_nb, at.p_n_m, steps)
    v, aux = at.v_n_mps + steps[:, 6:9], at.aux + steps[:, 9:]
    return States(R, p, v, aux, at.constants + constant_steps)


@kernel
def _retracted(
    R_nb: FloatArray, p_n_m: FloatArray, steps: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return rotations and positions a step away, (n, 3, 3) and (n, 3)."""
    n = len(steps)
    R, p = np.empty((n, 3, 3)), np.empty((n, 3))
    for k in range(n):
        rot.put(rot.product(R_nb[k], rot.exp(steps[k, :3])), R[k])
        moved = rot.times(R_nb[k], steps[k, 3:6])
        for i in range(3):
            p[k, i] = p_n_m[k, i] + moved[i]
    return R, p
