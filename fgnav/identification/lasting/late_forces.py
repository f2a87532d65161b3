"""Specific forces that are late: a low pass of the accelerometer.

It delays forces alone, which no clock of the whole unit and no delay of velocities stands for: they
point where the body pointed before. Of samples x that follow ``x_k = x_k-1 + (u_k - x_k-1) / (1 + d
/ T)``, T apart, u is ``x_k + d (x_k - x_k-1) / T``: to first order the forces a time d later,
whatever delays them. In d the rows of the motion are linear.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.error import LastingError
from fgnav.identification.likelihood.changed_samples import (
    ChangedBy,
    promised,
    solved_with_changes,
)
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Imu

LATE_FORCES = "late forces"
# 1-sigma, s: low passes of small units delay by up to 19 ms (InvenSense MPU-6000, register map 4.2,
# DLPF_CFG).
_DELAY_S = 0.02
_STEP_S = 0.01  # of a difference quotient


def late_forces(problem: SmoothingProblem, stated: Solution) -> Iterator[LastingError]:
    """Yield by how much forces are late as a problem tells it, if a step from the stated says so.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    """
    error = _late(problem, stated, _DELAY_S)
    if error is not None and error.off[0] > _DELAY_S:  # as little is known as it is large
        error = _late(problem, stated, float(error.off[0]))
    if error is not None and error.off[0] > 0.0:  # no filter foresees
        yield error


def taken_early(imu: Imu, by_s: float) -> Imu:
    """Return a unit whose forces are those ahead of a first-order low pass of so much delay."""
    slope = np.diff(imu.f_b_mps2, axis=0, prepend=imu.f_b_mps2[:1]) / np.median(np.diff(imu.t_s))
    return replace(imu, f_b_mps2=imu.f_b_mps2 + by_s * slope)


def sentence(error: LastingError) -> str:
    """Return what is to be said of it."""
    return (
        f"The accelerometer's forces are late, as behind a low pass: by {error.off[0]:.4f} ± "
        f"{np.sqrt(error.covariance[0, 0]):.4f} s; they are taken as early as that."
    )


def _late(problem: SmoothingProblem, stated: Solution, sigma_s: float) -> LastingError | None:
    part = flight_constant(LATE_FORCES, ("delay",), "s", sigma_s, reported=False)
    how = ChangedBy((part,), (_step,), np.array([_STEP_S]))
    if promised(problem, stated.states, how)[0] < EXCLUDED - LIKELY:
        return None
    solution = solved_with_changes(problem, how)
    if solution is None:
        return None
    return LastingError.of(part, problem.with_constants((part,)), stated.cost, solution)


def _step(imu: Imu) -> Imu:
    return taken_early(imu, _STEP_S)
