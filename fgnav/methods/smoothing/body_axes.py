"""The body's attitude where array and inertial unit are turned apart, and either may be the body's.

States are of the unit's axes u, the array's are ``R_na = R_nu Exp(c)``. A share s of the posterior
takes those for the body's that the flight was put right by, the rest the others, all of c away: the
covariance is that of both about the first, ``s P + (1 - s) (P' + c c')``, P and P' of the one's and
the other's axes. Places on the body turn with its axes, so that c is not quite the same by the
other: by no more than it is tested to.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.prepared import BodyAxes
from fgnav.geometry.rotations import exp
from fgnav.graph.turned import ARRAY_TURN, MOUNTED_RAD, UNIT_TURN
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
        Its constants have the turn, what was taken back before not counted.
    constants : Constants
    axes : BodyAxes
    """
    name = UNIT_TURN if axes.of_array else ARRAY_TURN
    columns = constants.columns(name)
    (stated,) = (part.origin for part in constants.parts if part.name == name)
    R_nu, P_u = solution.states.R_nb, solution.covariance[:, ROTATION, ROTATION]
    values = solution.states.constants if solution.constants is None else solution.constants
    turn = np.broadcast_to(values[..., columns], (len(R_nu), 3))
    from_stated = turn - stated
    cross = solution.constant_cross[:, ROTATION, columns]
    # What is left of the turn is small: its axes are the unit's and the array's.
    P_a = P_u + cross + cross.swapaxes(1, 2) + solution.constant_covariance[:, columns, columns]
    apart = from_stated[:, :, None] * from_stated[:, None, :]
    chosen, other = (P_a, P_u) if axes.of_array else (P_u, P_a)
    other = other + apart + MOUNTED_RAD**2 * np.eye(3)
    P = axes.share * chosen + (1.0 - axes.share) * other
    return (R_nu @ exp(turn) if axes.of_array else R_nu), P
