"""The whole flight as GTSAM's own graph, solved by GTSAM: what our chain solver is held against.

``factor_graph`` is where a researcher adds factors of their own.
"""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.methods.smoother.chain import STATE
from fgnav.methods.smoother.constants import LANDMARK
from fgnav.methods.smoother.graph import State, link, motion, priors
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.solution import SharedSolution, Solution

_ITERATIONS = 50
_RELATIVE_COST = 1e-8  # a smaller change ends the search
_STEP_SIGMAS = 0.01  # a Newton step below this share of every sigma: it is a minimum


def factor_graph(keyframes: Keyframes) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Return all factors of a flight and where to start: X pose, V velocity, B slot, L(0) landmark.

    Parameters
    ----------
    keyframes : Keyframes
    """
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    for k in range(len(keyframes.t_s)):
        before = (motion(keyframes, k, keyframes.slot[k - 1], k),) if k else priors(keyframes)
        graph.push_back(link(keyframes, k, before))
        State.start(keyframes, k).insert(start, k)
    if keyframes.landmark_n_m is not None:
        start.insert(L(0), keyframes.landmark_n_m + keyframes.shared[LANDMARK].start)
    return graph, start


def solve_by_gtsam(keyframes: Keyframes) -> Solution:
    """Return the minimum by Levenberg and Marquardt, with GTSAM's marginals.

    Raises
    ------
    NoSolutionError
        If the factors leave a state open, or GTSAM has none for a constant: an instrument's own
        angles, places of antennas, a barometer's offset, hard iron.
    """
    ours = [one.name for one in keyframes.constants if one.place != LANDMARK]
    if ours:
        raise NoSolutionError(
            f"{ours[0]}: gtsam has factors for the landmark alone of what holds for a flight; "
            "use batch"
        )
    graph, start = factor_graph(keyframes)
    parameters = gtsam.LevenbergMarquardtParams()
    parameters.setRelativeErrorTol(_RELATIVE_COST)
    parameters.setMaxIterations(_ITERATIONS)
    try:
        found = gtsam.LevenbergMarquardtOptimizer(graph, start, parameters).optimize()
        marginals = gtsam.Marginals(graph, found)
        step = graph.linearize(found).optimize()
    except RuntimeError as error:  # an indeterminate linear system
        reason = str(error).strip().splitlines()[0]
        raise NoSolutionError(f"state: the factors leave one open ({reason})") from None
    keys = range(len(keyframes.t_s))
    # A surveyed landmark is as good as known, and joint covariances with it take GTSAM long.
    is_asked = any(one.place == LANDMARK for one in keyframes.constants)
    landmark = [L(0)] if is_asked else []
    joint = np.array([_joint(marginals, k, landmark) for k in keys])
    covariance = joint[:, :STATE, :STATE]
    sigma = np.sqrt(np.einsum("nii->ni", covariance[:, :6, :6]))
    steps = np.array([step.at(X(k)) for k in keys])
    poses = [found.atPose3(X(k)) for k in keys]
    return Solution(
        R_nb=np.array([pose.rotation().matrix() for pose in poses]),
        p_n_m=np.array([pose.translation() for pose in poses]),
        v_n_mps=np.array([found.atVector(V(k)) for k in keys]),
        slot=np.array([found.atConstantBias(B(k)).vector() for k in keys]),
        covariance=covariance,
        cross=None,
        converged=bool((np.abs(steps) < _STEP_SIGMAS * sigma).all()),
        shared=SharedSolution(
            value=found.atPoint3(L(0)),
            covariance=joint[:, STATE:, STATE:],
            cross=joint[:, :STATE, STATE:],
        )
        if landmark
        else None,
    )


def _joint(marginals: gtsam.Marginals, k: int, shared: list[int]) -> FloatArray:
    """Return the joint covariance of a keyframe, (15 + b, ..): pose, velocity, slot, shared."""
    symbols = [X(k), V(k), B(k), *shared]
    joint = marginals.jointMarginalCovariance(symbols)
    return np.asarray(np.block([[joint.at(one, other) for other in symbols] for one in symbols]))
