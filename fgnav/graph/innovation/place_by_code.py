"""Test the position by phase and code of a first epoch against the solution.

Errors of satellites hold all along a flight, so that whatever else measures place well pulls all
phases with it: residuals of single epochs do not show that it pulls too far. With the arcs
eliminated from the rows of the first epoch (``factors.antenna_phase``) by an orthogonal matrix,

    U place - y = 0 + white noise of variance 1

is what GNSS alone says there. It is part of the solution, so that ``r = U place - y`` at the
solution's place, of covariance P, has the covariance ``S = I - U P U'``, as of any innovation.
"""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import skew
from fgnav.graph.factors.antenna_phase import AntennaPhase
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION

NAME = "place by code"
# Of the variance in S: where GNSS tells more than half of what is known, approximations of the
# solution's covariance tell as much of the residual as the rest of the measurements does.
_TESTED = 0.5


def place_innovation(
    phase: AntennaPhase, solution: Solution
) -> tuple[str, list[float], list[int]] | None:
    """Compute the distance of the solution from the code position: name, square, dimensions.

    None where that tests nothing.

    Parameters
    ----------
    phase : AntennaPhase
    solution : Solution
        Of all keyframes.
    """
    U, y = _of_first_epoch(phase)
    k, arm_b_m = int(phase.row[0]), phase.arm_b_m[0]
    states = solution.states
    lever = phase.constants.columns(LEVER_ARM)
    if lever.stop:
        arm_b_m = arm_b_m + states.constants[lever]
    R_nb = states.R_nb[k]
    J = np.zeros((3, states.width))
    J[:, ROTATION], J[:, POSITION] = -R_nb @ skew(arm_b_m), R_nb
    r = U @ (states.p_n_m[k] + R_nb @ arm_b_m) - y
    variance, axes = np.linalg.eigh(np.eye(3) - U @ J @ solution.covariance[k] @ J.T @ U.T)
    tested = variance > _TESTED
    freedom = int(tested.sum())
    if not freedom:
        return None
    squared = float(((axes.T @ r)[tested] ** 2 / variance[tested]).sum())
    return NAME, [squared], [freedom]


def _of_first_epoch(phase: AntennaPhase) -> tuple[FloatArray, FloatArray]:
    """Return the rows of the antenna's place, U (3, 3), and their right-hand side, (3,)."""
    G, H, z = phase.rows[0]
    block = phase.blocks[phase.block[0]]
    size = block.size
    rows = np.zeros((len(z) + len(block.right) + 3, size + 4))
    rows[: len(z), :size], rows[: len(z), size:-1], rows[: len(z), -1] = H, G, z
    own = slice(len(z), len(z) + len(block.right))
    rows[own, :size], rows[own, -1] = block.after, block.right
    root: FloatArray = np.linalg.qr(rows)[1]
    position = slice(size, size + 3)
    return root[position, position], root[position, -1]
