"""A constant of a whole flight that is not as stated, and how likely that is.

A problem in which the constant c is free is likelier by

    (q0 - q) / 2 + ln det(C C0^-1) / 2

with q the cost at its minimum, q0 where c is as stated, C the covariance of c, C0 that before.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION
from fgnav.identification.likelihood.beside_phases import chance_of
from fgnav.identification.track.windows import EXCLUDED


class LastingError(NamedTuple):
    """What is off, (d,), its covariance, and what it gains; m in n, or rad.

    ``attitude_by``: derivative of the attitudes of keyframes by it, (n, 3, d), at ``t_s``, (n,).
    """

    kind: str
    off: FloatArray
    covariance: FloatArray
    t_s: FloatArray
    attitude_by: FloatArray
    nats: float  # of likelihood, all else as stated
    cost: float  # that it leaves
    R_nb: FloatArray = np.empty((0, 3, 3))  # attitudes of keyframes there
    from_s: float = -np.inf  # when it is off
    until_s: float = np.inf

    @classmethod
    def of(
        cls, part: FlightConstant, problem: SmoothingProblem, stated: float, solution: Solution
    ) -> "LastingError":
        """Return an error by the minimum of a problem in which it is the free constant ``part``.

        Parameters
        ----------
        part : FlightConstant
        problem : SmoothingProblem
            In which it is free.
        stated : float
            Cost where it is not.
        solution : Solution
        """
        columns = problem.constants.columns(part.name)
        covariance = solution.constant_covariance[0][columns, columns]
        spread = np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(part.covariance)[1]
        nats = (stated - solution.cost + spread) / 2
        off = solution.states.constants[columns] - problem.constants.mean[columns]
        cross = solution.constant_cross[:, ROTATION, columns]
        by = np.linalg.solve(covariance, cross.swapaxes(1, 2)).swapaxes(1, 2)
        R_nb, cost = solution.states.R_nb, solution.cost
        return cls(part.name, off, covariance, problem.t_s, by, float(nats), cost, R_nb)

    @property
    def attitude_rad2(self) -> FloatArray:
        """What it adds to the covariance of attitudes, G C G', (n, 3, 3)."""
        G = self.attitude_by
        return np.asarray(G @ self.covariance @ G.swapaxes(1, 2))

    def doubt(self, share: float) -> AttitudeDoubt:
        """Return the covariance of the body's axes that it adds to that of the states.

        By what remains of it, and by a turn's being another sensor's, of probability ``1 - share``.
        """
        G, remaining = self.attitude_by, self.attitude_rad2
        other = (1.0 - share) * (self.covariance + np.outer(self.off, self.off))
        if G.shape[2] < 3:  # no turn of a sensor: without it attitudes are as they were
            return AttitudeDoubt(self.t_s, remaining + G @ other @ G.swapaxes(1, 2))
        return AttitudeDoubt(self.t_s, remaining + other)


def least_of_use(problem: SmoothingProblem, before: float, left: int = 1) -> float:
    """Return the cost that a step is to lead below, that its error may leave no more than chance.

    As no cause does that leaves more, nor one that is as likely as the cause.

    Parameters
    ----------
    problem : SmoothingProblem
    before : float
        Cost where the step begins.
    left : int
        Steps, this one among them: none gains more than the first.
    """
    chance = chance_of(problem) + 2 * EXCLUDED
    return max(chance, before - (before - chance) / left)
