"""A sliding window over the flight: each keyframe is taken as it leaves, and then forgotten."""

from collections.abc import Iterator
from typing import SupportsIndex, SupportsInt

import gtsam
import numpy as np
from gtsam.symbol_shorthand import B, L, V, X

from fgnav.checks import FloatArray
from fgnav.methods.smoother.graph import (
    Solution,
    as_bias,
    measured,
    motion,
    priors,
    start_pose,
)
from fgnav.methods.smoother.keyframes import Keyframes

# Keyframes leave in blocks: their marginals share work. One by one 37 times real time, in blocks of
# a second 63 times (10 Hz, lag 5 s).
_BLOCK_S = 1.0
# They enter in groups: nobody asks for the newest before the lag has passed.
_GROUP_S = 0.5
_ROUNDING_S = 1e-6  # of GTSAM's comparison of times
# A state is linearised anew when its estimate has moved further than this from where it was:
# rotations err by half the square, 0.01 degree; what enters linearly may stay.
_MOVED_RAD = 0.02
_MOVED_FAR = 1e3
_REPEATS = 5  # at most, while states are linearised anew: a rough start needs three


def solve_window(keyframes: Keyframes, lag_s: float) -> Solution:
    """Return each keyframe as known from the data up to at least ``lag_s`` after it.

    Parameters
    ----------
    keyframes : Keyframes
    lag_s : float
        Length of the window; a block of a second is added to it before keyframes leave.
    """
    taken = list(_slide(keyframes, lag_s))
    R_nb, p_n_m, v_n_mps, slot, pose_covariance, velocity_covariance, slot_covariance, moved_rad = (
        np.array(column) for column in zip(*taken, strict=True)
    )
    return Solution(
        R_nb=R_nb,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        slot=slot,
        pose_covariance=pose_covariance,
        velocity_covariance_m2ps2=velocity_covariance,
        slot_covariance=slot_covariance,
        converged=bool(moved_rad.max() < 2 * _MOVED_RAD),
    )


def _slide(keyframes: Keyframes, lag_s: float) -> Iterator[tuple[FloatArray | float, ...]]:
    """Yield the state of each keyframe, in order, when it leaves."""
    t_s = keyframes.t_s
    window = gtsam.IncrementalFixedLagSmoother(lag_s + _BLOCK_S, _parameters())
    oldest, known = 0, 0
    while known < len(t_s):
        group = range(known, int(np.searchsorted(t_s, t_s[known] + _GROUP_S - _ROUNDING_S)))
        if t_s[oldest] < t_s[group[-1]] - lag_s - _BLOCK_S + _ROUNDING_S:
            leaves = int(np.searchsorted(t_s, t_s[group[-1]] - lag_s + _ROUNDING_S))
            yield from _take(window, range(oldest, min(leaves, known)))
            oldest = min(leaves, known)
        _enter(window, keyframes, group)
        known = group[-1] + 1
    yield from _take(window, range(oldest, len(t_s)))


def _enter(window: gtsam.IncrementalFixedLagSmoother, keyframes: Keyframes, group: range) -> None:
    """Add some keyframes to the window, each started from the one before it."""
    graph, start = gtsam.NonlinearFactorGraph(), gtsam.Values()
    times: dict[SupportsInt | SupportsIndex, float] = {}
    first = group[0]
    if first == 0:
        slot = keyframes.slot[0]
        state = gtsam.NavState(start_pose(keyframes, 0), keyframes.v_n_mps[0])
        for factor in priors(keyframes):
            graph.add(factor)
        if keyframes.landmark_n_m is not None:
            start.insert(L(0), keyframes.landmark_n_m)
    else:
        slot = window.calculateEstimateConstantBias(B(first - 1)).vector()
        state = gtsam.NavState(
            window.calculateEstimatePose3(X(first - 1)),
            window.calculateEstimateVector(V(first - 1)),
        )
    for k in group:
        if k:
            factor = motion(keyframes, k - 1, slot)
            graph.add(factor)
            predicted = factor.preintegratedMeasurements().predict(state, as_bias(slot))
            state = _expected(keyframes, k, predicted)
        for factor in measured(keyframes, k):
            graph.add(factor)
        start.insert(X(k), state.pose())
        start.insert(V(k), state.velocity())
        start.insert(B(k), as_bias(slot))
        times |= dict.fromkeys((X(k), V(k), B(k)), float(keyframes.t_s[k]))
    window.update(graph, start, times)
    for _ in range(_REPEATS):
        if not window.getISAM2Result().getVariablesRelinearized():
            break
        window.update()


def _expected(keyframes: Keyframes, k: int, predicted: gtsam.NavState) -> gtsam.NavState:
    """Return the predicted state, with the array's own attitude where the keyframe has one."""
    if not keyframes.array.there[k]:
        return predicted
    attitude = gtsam.Rot3(keyframes.R_nb[k])
    return gtsam.NavState(attitude, predicted.position(), predicted.velocity())


def _take(
    window: gtsam.IncrementalFixedLagSmoother, keys: range
) -> Iterator[tuple[FloatArray | float, ...]]:
    """Yield states with marginals, and how far each rotation is from its linearisation."""
    linearised = window.getLinearizationPoint()
    for k in keys:
        pose = window.calculateEstimatePose3(X(k))
        moved = linearised.atPose3(X(k)).rotation().between(pose.rotation())
        yield (
            pose.rotation().matrix(),
            pose.translation(),
            window.calculateEstimateVector(V(k)),
            window.calculateEstimateConstantBias(B(k)).vector(),
            window.marginalCovariance(X(k)),
            window.marginalCovariance(V(k)),
            window.marginalCovariance(B(k)),
            float(np.linalg.norm(gtsam.Rot3.Logmap(moved))),
        )


def _parameters() -> gtsam.ISAM2Params:
    parameters = gtsam.ISAM2Params()
    parameters.setOptimizationParams(gtsam.ISAM2GaussNewtonParams())
    parameters.findUnusedFactorSlots = True  # else slots grow without end
    parameters.relinearizeSkip = 1
    thresholds = gtsam.ISAM2ThresholdMap()
    far = np.full(3, _MOVED_FAR)
    thresholds.insert(("x", np.concatenate([np.full(3, _MOVED_RAD), far])))
    thresholds.insert(("v", far))
    thresholds.insert(("b", np.concatenate([far, far])))
    thresholds.insert(("l", far))
    parameters.setRelinearizeThreshold(thresholds)
    return parameters
