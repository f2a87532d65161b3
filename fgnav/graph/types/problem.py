"""A flight as a smoother takes it: where to start, motion, measurements, constants, prior."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import Parameter, Parameters
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.states import AUX, GYROSCOPE_AUX, RATE, States

if TYPE_CHECKING:
    from fgnav.graph.factors.antenna_phase import AntennaPhase

# 1-sigma before the first keyframe: next to nothing. Ten times less of the position, and rounding
# would leave it open where the first fix is some keyframes away.
ROTATION_PRIOR_RAD = np.pi
POSITION_PRIOR_M = 1e3
VELOCITY_PRIOR_MPS = 1e3


_RATE = slice(RATE.start - AUX, RATE.stop - AUX)  # columns of ``States.aux``


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AttitudePrior:
    """The attitude of the first keyframe before the flight, (3, 3), and its covariance, rad2.

    The covariance is of the body-axes tangent about it.
    """

    R_nb: FloatArray
    covariance_rad2: FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Problem:
    """All that a solver is given.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Keyframes.
    start : States
        Where the search starts, with the constants.
    motion : Motion
    sensors : tuple of Sensor
    constants : Parameters
    attitude_known : ndarray of bool, shape (n,)
        Keyframes whose ``start`` holds an attitude measured there; a window starts the others where
        the motion leads.
    rate_known : bool
        Whether there ``start`` has the body's rate, too, by attitudes up to there.
    attitude_prior : AttitudePrior or None
        None: next to nothing, about where the search starts.
    phase : AntennaPhase or None
        Phases with their ambiguities, which are variables beside the keyframes'.
    """

    t_s: FloatArray
    start: States
    motion: Motion
    sensors: tuple[Sensor, ...]
    constants: Parameters
    attitude_known: BoolArray
    attitude_prior: AttitudePrior | None = None
    phase: "AntennaPhase | None" = None
    rate_known: bool = False

    def begun(self, row: int, predicted: States) -> States:
        """Return where a window starts a keyframe that the motion has predicted."""
        if not self.attitude_known[row]:
            return predicted
        at, aux = slice(row, row + 1), predicted.aux
        if self.rate_known:
            aux = aux.copy()
            aux[:, _RATE] = self.start.aux[at, _RATE]
        return predicted._replace(R_nb=self.start.R_nb[at], aux=aux)

    @property
    def gyroscope(self) -> bool:
        """True if the motion is that of a gyroscope."""
        return self.motion.aux == GYROSCOPE_AUX

    @property
    def width(self) -> int:
        """Dimensions of one keyframe's tangent, D."""
        return self.start.width

    def with_constants(self, parts: tuple[Parameter, ...]) -> "Problem":
        """Append constants, for sensors and phases."""
        if not parts:
            return self
        constants = Parameters((*self.constants.parts, *parts))
        start = self.start._replace(
            constants=np.concatenate([self.start.constants, *(p.start for p in parts)])
        )
        return replace(
            self,
            constants=constants,
            start=start,
            sensors=tuple(sensor.bound(constants) for sensor in self.sensors),
            phase=self.phase and replace(self.phase, constants=constants),
        )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Opening:
    """Problem of the first keyframes of a filter, while the heading is unobservable.

    Attributes
    ----------
    problem : Problem
        Of the same keyframes.
    until_s : float
        The first keyframe of the other problem; infinite where there is none.
    heading_variance_rad2 : float
        ``problem`` holds one heading fixed, about which all else turns: what is not known of it.
    arm_b_m : ndarray, shape (3,)
        From the accelerometer to the antenna, whose position it leaves where it is.
    axis_n : ndarray, shape (1, 3) or (n, 3)
        About which the heading is open: down, or the specific force of each keyframe.
    aligned : Problem or None
        As it would be if the heading were known from the first keyframe on.
    """

    problem: Problem
    until_s: float
    heading_variance_rad2: float
    arm_b_m: FloatArray
    axis_n: FloatArray = field(default_factory=lambda: np.array([[0.0, 0.0, 1.0]]))
    aligned: Problem | None = None

    @property
    def keyframes(self) -> int:
        """Number of keyframes of the opening."""
        return int(np.searchsorted(self.problem.t_s, self.until_s))


def pose_prior(problem: Problem) -> tuple[FloatArray, FloatArray]:
    """Return the attitude of the first keyframe, (3, 3), and the covariance of pose and velocity.

    Before the flight, (9, 9), of the tangent; position is about where the search starts, velocity
    about zero.
    """
    P = np.diag(np.repeat([ROTATION_PRIOR_RAD, POSITION_PRIOR_M, VELOCITY_PRIOR_MPS], 3) ** 2)
    prior = problem.attitude_prior
    if prior is None:
        return problem.start.R_nb[0], P
    P[:3, :3] = prior.covariance_rad2
    return prior.R_nb, P
