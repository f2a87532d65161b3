"""Flights to train on: their problem, built once, and where its minimum was last."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import BadInputError, NoSolutionError
from fgnav.evaluation.reference import covered, truth_at
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.custom import NamedFactor
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.methods.smoother import Batch
from fgnav.methods.smoothing.custom_heading import with_custom_heading
from fgnav.methods.smoothing.custom_sources import custom_factors
from fgnav.methods.smoothing.solving import at_once
from fgnav.solve.batch import minimum
from fgnav.types.flight import Flight, Truth
from fgnav_models.learn.hyperparameters import Hyperparameters

# An attitude that far from the truth is a minimum of its own, or an open one: the same half radian
# beyond which solvers do not linearise. What the posterior says there means nothing.
_FAR_RAD = 0.5


@dataclass(eq=False, slots=True, kw_only=True)
class TrainingFlight:
    """A flight, its smoothing problem, and where its minimum was found last.

    Attributes
    ----------
    flight : Flight
    truth : Truth
    prepared : PreparedFlight
    hyperparameters : Hyperparameters
        Of its problem.
    fixed : tuple of NamedFactor
        Custom factors of the method, which are not trained.
    states : States or None
        The last minimum, where the next search begins.
    """

    flight: Flight
    truth: Truth
    prepared: PreparedFlight
    hyperparameters: Hyperparameters
    fixed: tuple[NamedFactor, ...] = ()
    states: States | None = field(default=None, repr=False)

    def minimum(self, problem: Problem, custom: Sequence[NamedFactor]) -> States:
        """Return the minimum of a problem and custom factors, and begin there the next time.

        Raises
        ------
        NoSolutionError
            If the search ends in none, or half a radian and more from the truth.
        """
        begin, self.states = self.states, None
        if begin is None or len(begin.constants) != problem.constants.width:
            asked = problem.constants.parts[len(self.prepared.problem.constants.parts) :]
            prepared = self.prepared.changed(lambda problem: problem.with_constants(asked))
            prepared = with_custom_heading(prepared, tuple(custom))
            begin = at_once(prepared, tuple(custom)).states
        solution = minimum(problem, custom, begin).solution
        is_known = covered(self.truth, problem.t_s)
        R_nb = truth_at(self.truth, problem.t_s[is_known]).R_nb
        turn_rad = log(transpose(solution.states.R_nb[is_known]) @ R_nb)
        far_rad = float(np.linalg.norm(turn_rad, axis=1).max(initial=0.0))
        if not solution.converged or far_rad > _FAR_RAD:
            raise NoSolutionError(
                f"flight {self.flight.name}: "
                f"{'its minimum is' if solution.converged else 'no minimum was found;'} "
                f"{np.degrees(far_rad):.0f} degrees from the truth: nothing is learned there"
            )
        self.states = solution.states
        return solution.states


def training_flight(flight: Flight, method: Batch, *, without: str = "") -> TrainingFlight:
    """Return a flight to train on.

    Parameters
    ----------
    flight : Flight
        With truth, of the accelerometer.
    method : Batch
        How its problem is built; factors of its own stay as they are.
    without : str
        Name of a measurement that the networks replace, such as ``"gravity"``.

    Raises
    ------
    BadInputError
        If it has no truth, or that of another point.
    """
    truth = flight.truth
    if truth is None:
        raise BadInputError(f"flight {flight.name}: training needs its truth")
    if flight.imu is not None and flight.imu.position_b_m.any():
        raise BadInputError(
            f"flight {flight.name}: key imu.position_b_m: positions and velocities are those of "
            "the accelerometer; put the body's origin there"
        )
    prepared, sourced = custom_factors(method.factors or (), flight, method.prepare(flight))

    def replaced(problem: Problem) -> Problem:
        left = (sensor for sensor in problem.sensors if sensor.name != without)
        return replace(problem, sensors=tuple(left))

    prepared = prepared.changed(replaced)
    return TrainingFlight(
        flight=flight,
        truth=truth,
        prepared=prepared,
        hyperparameters=Hyperparameters.of(prepared.problem),
        fixed=sourced.factors,
    )
