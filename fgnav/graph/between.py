"""Any time within a flight as a keyframe: estimates between GNSS epochs, by the motion model.

A time that is asked for enters the graph as a keyframe that measures nothing. What comes out for
it is what inertial samples say from the keyframes on both sides, with the covariance of that.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.geometry.rotations import exp, log, transpose
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States

MOST_TIMES = 50_000  # a keyframe takes 93 kB (4 s with gyroscope at 4 kHz: 1.33 GB): 5 GB
_SAME_S = 1e-4  # a time this close to a keyframe is that keyframe


def regular_times(problem: Problem, rate_hz: float) -> FloatArray:
    """Return multiples of a rate's period within the keyframes, (m,)."""
    first = np.ceil(problem.t_s[0] * rate_hz - _SAME_S)
    last = np.floor(problem.t_s[-1] * rate_hz + _SAME_S)
    if last - first >= MOST_TIMES:
        raise BadInputError(
            f"rate_hz: {rate_hz:g} makes {last - first + 1:.6g} times of this flight, at most "
            f"{MOST_TIMES} are estimated at once"
        )
    return np.asarray(np.arange(first, last + 1) / rate_hz)


def with_times(problem: Problem, t_s: FloatArray) -> Problem:
    """Return a problem with times, (m,), as keyframes where none is there.

    Raises
    ------
    BadInputError
        If there are no times, they do not increase, or one lies outside the keyframes.
    """
    have, wanted = problem.t_s, np.asarray(t_s, dtype=float)
    if wanted.ndim != 1 or not len(wanted) or not (np.diff(wanted) > _SAME_S).all():
        raise BadInputError(f"t_s: must be one or more times, each {_SAME_S} s after the last")
    if not (wanted[0] >= have[0] - _SAME_S and wanted[-1] <= have[-1] + _SAME_S):
        raise BadInputError(
            f"t_s: must lie within the keyframes, {have[0]:.3f} to {have[-1]:.3f}, "
            f"got {wanted[0]:.3f} to {wanted[-1]:.3f}"
        )
    new = wanted[np.abs(wanted - have[nearest_keyframes(have, wanted)]) > _SAME_S]
    dense_s = np.union1d(have, new)
    row = np.searchsorted(dense_s, have)
    attitude_known = np.zeros(len(dense_s), dtype=np.bool_)
    attitude_known[row] = problem.attitude_known
    return replace(
        problem,
        t_s=dense_s,
        start=_interpolated(problem, dense_s),
        motion=problem.motion.at_times(dense_s),
        sensors=tuple(sensor.move(row[sensor.row]) for sensor in problem.sensors),
        attitude_known=attitude_known,
        phase=problem.phase and problem.phase.move(row[problem.phase.row]),
    )


def _interpolated(problem: Problem, t_s: FloatArray) -> States:
    """Return where the search starts at more keyframes; at those of the problem, where it did."""
    have, start = problem.t_s, problem.start
    before = np.searchsorted(have, t_s, side="right") - 1
    # The last is no end of an interval: what comes later would change its rounding.
    after = (before + 1).clip(max=len(have) - 1)
    span_s = np.where(after > before, have[after] - have[before], 1.0)
    share = ((t_s - have[before]) / span_s)[:, None]
    first, last = start.R_nb[before], start.R_nb[after]

    def between(values: FloatArray) -> FloatArray:
        return np.asarray((1 - share) * values[before] + share * values[after])

    return States(
        R_nb=np.asarray(first @ exp(share * log(transpose(first) @ last))),
        p_n_m=between(start.p_n_m),
        v_n_mps=between(start.v_n_mps),
        aux=between(start.aux),
        constants=start.constants,
    )


def nearest_keyframes(have_s: FloatArray, want_s: FloatArray) -> IntArray:
    """Return the keyframe nearest to each time, (m,)."""
    after = np.searchsorted(have_s, want_s).clip(1, len(have_s) - 1)
    return np.asarray(after - (want_s - have_s[after - 1] < have_s[after] - want_s))
