"""The likeliest span of an error of the inertial unit, by a whole problem."""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.span_constants import Error, finer, likeliest_span
from fgnav.identification.likelihood.span_offsets import LEAST_S, Offset
from fgnav.identification.spans.errors import (
    ANY_BIAS,
    ANY_MIX,
    ANY_SHARE,
    DRIFT,
    MIX,
    NUMBERS,
    without,
)
from fgnav.types.flight import Imu


def likeliest(
    problem: SmoothingProblem, at: States, error: tuple[str, str], edges: IntArray
) -> Offset | None:
    """Return a span between edges of blocks, of a second at least; None without a minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    at : States
        About which it is linear.
    error : tuple of str
        Sensor and shape.
    edges : ndarray of int, shape (m + 1,)
        Keyframes.
    """
    sensor, shape = error
    any_ = ANY_BIAS[sensor] if shape in ("offset", DRIFT) else ANY_SHARE
    any_ = ANY_MIX if shape == MIX else any_
    any_ /= float(np.ptp(problem.t_s)) if shape == DRIFT else 1.0

    def less(by: FloatArray, imu: Imu) -> Imu:
        return without(imu, sensor, shape, by)

    made = Error(sensor, shape, any_, less, NUMBERS.get(shape, 3))
    return likeliest_span(problem, at, made, edges, LEAST_S)


def finer_span(problem: SmoothingProblem, at: States, one: Offset, edges: IntArray) -> Offset:
    """Return an offset whose span is sought between keyframes, a block about where it was."""
    if one.shape == DRIFT:
        return one
    return likeliest(problem, at, (one.sensor, one.shape), finer(edges, one)) or one
