"""The whole flight at once: Gauss-Newton, and Levenberg-Marquardt where that does not end well."""

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from fgnav.methods.smoother.graph import (
    Solution,
    as_bias,
    measured,
    motion,
    priors,
    start_pose,
)
from fgnav.methods.smoother.keyframes import Keyframes

_ITERATIONS = 50
_RELATIVE_COST = 1e-8  # a smaller change ends the search
_STEP_SIGMAS = 0.01  # a Newton step below this share of every sigma: it is a minimum


def solve_batch(keyframes: Keyframes) -> Solution:
    """Return the minimum of the whole graph with its marginal covariances."""
    graph, start = _graph(keyframes), _start(keyframes)
    parameters = gtsam.GaussNewtonParams()
    parameters.setRelativeErrorTol(_RELATIVE_COST)
    parameters.setMaxIterations(_ITERATIONS)
    values = gtsam.GaussNewtonOptimizer(graph, start, parameters).optimize()
    solution = _read(keyframes, graph, values)
    if solution.converged:
        return solution
    damped = gtsam.LevenbergMarquardtParams()
    damped.setRelativeErrorTol(_RELATIVE_COST)
    damped.setMaxIterations(_ITERATIONS)
    values = gtsam.LevenbergMarquardtOptimizer(graph, start, damped).optimize()
    return _read(keyframes, graph, values)


def _graph(keyframes: Keyframes) -> gtsam.NonlinearFactorGraph:
    graph = gtsam.NonlinearFactorGraph()
    for factor in priors(keyframes):
        graph.add(factor)
    for k in range(len(keyframes.t_s)):
        for factor in measured(keyframes, k):
            graph.add(factor)
        if k:
            graph.add(motion(keyframes, k - 1, keyframes.slot[k - 1]))
    return graph


def _start(keyframes: Keyframes) -> gtsam.Values:
    start = gtsam.Values()
    for k in range(len(keyframes.t_s)):
        start.insert(X(k), start_pose(keyframes, k))
        start.insert(V(k), keyframes.v_n_mps[k])
        start.insert(B(k), as_bias(keyframes.slot[k]))
    if keyframes.landmark_n_m is not None:
        start.insert(L(0), keyframes.landmark_n_m)
    return start


def _read(
    keyframes: Keyframes, graph: gtsam.NonlinearFactorGraph, values: gtsam.Values
) -> Solution:
    """Take states and marginals out, and test by one more Newton step that it is a minimum."""
    marginals = gtsam.Marginals(graph, values)
    keys = range(len(keyframes.t_s))
    pose_covariance = np.array([marginals.marginalCovariance(X(k)) for k in keys])
    step = graph.linearize(values).optimize()
    steps = np.array([step.at(X(k)) for k in keys])
    sigmas = np.sqrt(np.einsum("nii->ni", pose_covariance))
    poses = [values.atPose3(X(k)) for k in keys]
    return Solution(
        R_nb=np.array([pose.rotation().matrix() for pose in poses]),
        p_n_m=np.array([pose.translation() for pose in poses]),
        v_n_mps=np.array([values.atVector(V(k)) for k in keys]),
        slot=np.array([values.atConstantBias(B(k)).vector() for k in keys]),
        pose_covariance=pose_covariance,
        velocity_covariance_m2ps2=np.array([marginals.marginalCovariance(V(k)) for k in keys]),
        slot_covariance=np.array([marginals.marginalCovariance(B(k)) for k in keys]),
        converged=bool((np.abs(steps) < _STEP_SIGMAS * sigmas).all()),
    )
