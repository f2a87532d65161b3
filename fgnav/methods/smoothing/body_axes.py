"""The body's attitude where array and inertial unit are turned apart, and either may be the body's.

States are of the unit's axes u, the array's are ``R_na = R_nu Exp(c)``. A share s of the posterior
takes those for the body's that the flight was put right by, the rest the others, all of c away: the
covariance is that of both about the first, ``s P + (1 - s) (P' + c c')``, P and P' of the one's and
the other's axes.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.problem import BodyAxes
from fgnav.geometry.rotations import exp
from fgnav.graph.turned import ARRAY_TURN, UNIT_TURN
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION


def attitude_of_body(
    solution: Solution, constants: Constants, axes: BodyAxes
) -> tuple[FloatArray, FloatArray]:
    """Return the body's attitudes, (n, 3, 3), and their covariances in body axes, (n, 3, 3).

    Parameters
    ----------
    solution : Solution
        Its constants have the turn, whose mean is less by what was taken back before.
    constants : Constants
    axes : BodyAxes
    """
    own = constants.columns(UNIT_TURN if axes.of_array else ARRAY_TURN)
    R_nu, P_u = solution.states.R_nb, solution.covariance[:, ROTATION, ROTATION]
    values = solution.states.constants if solution.constants is None else solution.constants
    left = np.broadcast_to(values[..., own], (len(R_nu), 3))
    whole = left - constants.mean[own]
    cross = solution.constant_cross[:, ROTATION, own]
    # What is left of the turn is small: its axes are the unit's and the array's.
    P_a = P_u + cross + cross.swapaxes(1, 2) + solution.constant_covariance[:, own, own]
    apart = whole[:, :, None] * whole[:, None, :]
    chosen, other = (P_a, P_u) if axes.of_array else (P_u, P_a)
    P = axes.share * chosen + (1.0 - axes.share) * (other + apart)
    return (R_nu @ exp(left) if axes.of_array else R_nu), P
