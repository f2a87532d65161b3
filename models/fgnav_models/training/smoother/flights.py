"""Flights to train on: linearised where the batch has them, without what the network measures."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, NoSolutionError
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.types.states import ROTATION, VELOCITY, States
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.methods.smoother import Batch
from fgnav.methods.smoothing.custom_sources import custom_factors
from fgnav.methods.smoothing.solving import at_once
from fgnav.solve.adjoint import Judged, LinearisedFlight
from fgnav.types.flight import Flight

# An attitude that far from the truth is a minimum of its own, or an open one: the same half radian
# beyond which solvers do not linearise. What the linearised posterior says there means nothing.
_FAR_RAD = 0.5
_SAME_S = 1e-6


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TrainingFlight:
    """A flight linearised once."""

    name: str
    t_s: FloatArray  # (n,); its keyframes
    # where it is linearised; a network's residuals and Jacobians are to be taken there
    states: States
    linearised: LinearisedFlight
    judged: Judged  # the truth

    def rows(self, t_s: FloatArray) -> IntArray:
        """Return the keyframes at times, (k,); -1 where there is none."""
        row = np.searchsorted(self.t_s, t_s - _SAME_S).clip(0, len(self.t_s) - 1)
        return np.where(np.abs(self.t_s[row] - t_s) < _SAME_S, row, -1)


def training_flight(
    flight: Flight, method: Batch, *, without: str = "", velocity: bool = True
) -> TrainingFlight:
    """Return a flight whose truth is to be likely.

    Parameters
    ----------
    flight : Flight
        With truth; of the accelerometer, where velocities are judged.
    method : Batch
        By whose estimate it is linearised, factors of its own included, which are left out then:
        the network's answers are to replace them.
    without : str
        Name of a measurement that they replace, too, such as ``"gravity"``.
    velocity : bool
        Whether velocities are judged beside attitudes.

    Raises
    ------
    BadInputError
        If it has no truth, or that of another point.
    NoSolutionError
        If the estimate has not converged, or is half a radian and more from the truth.
    """
    truth = flight.truth
    if truth is None:
        raise BadInputError(f"flight {flight.name}: training needs its truth")
    if velocity and flight.imu is not None and flight.imu.position_b_m.any():
        raise BadInputError(
            f"flight {flight.name}: key imu.position_b_m: velocities are judged at the "
            "accelerometer; put the body's origin there, or judge attitudes alone"
        )
    prepared, sourced = custom_factors(method.factors or (), flight, method.prepare(flight))
    solution = at_once(prepared, sourced.factors)
    states, t_s = solution.states, prepared.problem.t_s
    R_nb, covered = attitude_at(truth, t_s)
    row = np.flatnonzero(covered)
    turn_rad = log(transpose(states.R_nb[row]) @ R_nb[row])
    far_rad = float(np.linalg.norm(turn_rad, axis=1).max(initial=0.0))
    if not solution.converged or far_rad > _FAR_RAD:
        raise NoSolutionError(
            f"flight {flight.name}: ends in no minimum, or in one {np.degrees(far_rad):.0f} "
            "degrees from the truth: nothing is learned there"
        )
    faster_mps = interpolate(t_s[row], truth.t_s, truth.v_n_mps) - states.v_n_mps[row]
    of = np.arange(states.width)
    which, step = [of[ROTATION]], [turn_rad]
    if velocity:
        which, step = [*which, of[VELOCITY]], [*step, faster_mps]
    problem = prepared.problem
    left = tuple(one for one in problem.sensors if one.name != without)
    return TrainingFlight(
        name=flight.name,
        t_s=t_s,
        states=states,
        linearised=LinearisedFlight.at(replace(problem, sensors=left), states),
        judged=Judged(row, np.concatenate(which), np.concatenate(step, axis=1)),
    )
