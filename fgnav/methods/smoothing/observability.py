"""List weakly observable states: those known hardly better than by their prior."""

import numpy as np

from fgnav.attitude.array import axis_name
from fgnav.checks import FloatArray
from fgnav.graph.types.problem import POSITION_PRIOR_M, VELOCITY_PRIOR_MPS, Problem
from fgnav.graph.types.solution import Solution

_OPEN = 0.5  # of the sigma before the flight: a state that keeps more of it is left open
_OPEN_RAD = np.radians(15.0)  # beyond, no residual is linear in an angle: sin x = x to 1.2 % below
_MOST = 0.5  # of keyframes: a state must be open at that share of them
_UPRIGHT = np.cos(np.radians(20.0))  # an axis this close to the vertical has heading's name
_AXES = ("x", "y", "z")
TURN = "turn about the specific force"  # what attitudes of one vector each leave open


def undetermined(problem: Problem, solution: Solution) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the states that most keyframes leave open, by name, and the weakly observable biases.

    A direction of a state is open where its sigma is more than half of what it was before the
    flight; of a rotation, where it is more than 15 degrees.

    Returns
    -------
    names : tuple of str
        As in ``Estimate.unobservable``: ``"heading"``, ``"position"``.
    weak : tuple of str
        Bias components that the flight determines poorly.
    """
    P = solution.covariance
    names = []
    values, vectors = np.linalg.eigh(P[:, :3, :3])
    is_open = values[:, -1] > _OPEN_RAD**2
    if is_open.mean() > _MOST:
        axis_b = vectors[is_open, :, -1]
        axis_n = np.einsum("nij,nj->ni", solution.states.R_nb[is_open], axis_b)
        names.append(_rotation(axis_b, axis_n))
    if _share(P[:, 3:6, 3:6], POSITION_PRIOR_M) > _MOST:
        names.append("position")
    if _share(P[:, 6:9, 6:9], VELOCITY_PRIOR_MPS) > _MOST:
        names.append("velocity")
    gyroscope = problem.gyroscope
    width = 6 if gyroscope else 3  # without one, derivatives of the rate have a prior, not a bias
    rows = problem.motion.prior(problem.constants.width)[1]
    before = np.sqrt(np.diag(np.linalg.inv(rows[:, : len(rows)].T @ rows[:, : len(rows)])))[:width]
    now = np.median(np.sqrt(np.einsum("nii->ni", P[:, 9 : 9 + width, 9 : 9 + width])), axis=0)
    kept = now / before
    kinds = ("accelerometer bias", "gyroscope bias")[: width // 3]
    weak = tuple(
        f"{kind} about {axis}_b" if k else f"{kind} along {axis}_b"
        for k, kind in enumerate(kinds)
        for axis, share in zip(_AXES, kept[3 * k : 3 * k + 3], strict=True)
        if share > _OPEN
    )
    return tuple(names), weak


def _share(covariance: FloatArray, before: float) -> float:
    """Return the share of keyframes whose worst direction is open."""
    worst = np.linalg.eigvalsh(covariance)[:, -1]
    return float((worst > (_OPEN * before) ** 2).mean())


def _rotation(axis_b: FloatArray, axis_n: FloatArray) -> str:
    """Return the name of the rotation about an axis, (n, 3), in whichever frame it stands still."""
    if np.median(np.abs(axis_n[:, 2])) > _UPRIGHT:
        return "heading"
    return axis_name(axis_b)
