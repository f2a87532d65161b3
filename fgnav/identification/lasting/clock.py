"""A clock of the inertial unit that is off, by the whole problem.

The thinned chain tests it beside the delay of velocities, and of both only the sum may show. With
velocities in time, or with phases, the whole problem tells offset and rate
(``likelihood.record_clock``), linearised anew where they lead. That velocities are late is another
cause, which is weighed as any.

Of an offset o not even the order of magnitude is known beforehand: ln |o| is as likely anywhere
from a millisecond to a second, and o as likely anywhere below.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests, of_time
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.averaging import Rivals
from fgnav.identification.lasting.error import least_of_use
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.record_clock import (
    RecordClock,
    clock_step,
    doubted_attitudes,
    prior_squares,
    with_tags,
)
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.track.tags import tags_moved_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Flight

CLOCK = "clock"
_LEAST_S, _MOST_S = 1e-3, 1.0
_STEPS = 8  # at most: of two seconds each leaves a third or less of what is left


class ClockOff(NamedTuple):
    """By what tags are to be moved, s and ppm, (2,), its sigmas, and what it gains."""

    moved: FloatArray
    sigma: FloatArray
    middle_s: float
    nats: float
    cost: float
    is_exact: bool  # tags, beside phases of arcs: it is corrected, and not estimated
    R_nb: FloatArray  # attitudes of keyframes with these tags
    attitude_rad2: FloatArray  # that is added to their covariance, (n, 3, 3)
    t_s: FloatArray  # of keyframes
    rivals: Rivals | None = None
    kind: str = CLOCK

    @property
    def is_likely(self) -> bool:
        """Whether it is taken for true."""
        return self.nats > EXCLUDED

    @property
    def doubt(self) -> AttitudeDoubt | None:
        """What is doubted of attitudes where it is not estimated."""
        return AttitudeDoubt(self.t_s, self.attitude_rad2) if self.is_exact else None

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be said of it, where no request says so."""
        if not self.is_exact:
            return ()
        return (clock_sentence(self.moved, self.sigma, "corrected"),)

    @property
    def requests(self) -> tuple[CalibrationRequest, ...]:
        """What is to be estimated with the flight."""
        if self.is_exact:
            return ()
        (clock,) = calibration_requests(["clock"])
        return (replace(clock, moved=(float(self.moved[0]), float(self.moved[1]))),)

    def undone(self, flight: Flight) -> Flight:
        """Return a flight with tags in time."""
        return with_tags_moved(flight, self.moved, self.middle_s)

    def in_doubt(self, problem: SmoothingProblem) -> SmoothingProblem:
        """Return the same problem: what is left of it is estimated."""
        return problem


def clock_off(problem: SmoothingProblem, stated: Solution, middle_s: float) -> ClockOff | None:
    """Return the clock; None where it is estimated, or there is no minimum.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum.
    middle_s : float
        For which its offset is stated.
    """
    motion, at, solution = problem.motion, problem, stated
    moved: FloatArray = np.zeros(2)
    cost = stated.cost
    if not isinstance(motion, GyroFree | Inertial):
        return None
    likeliest: tuple[RecordClock, FloatArray, SmoothingProblem, Solution] | None = None
    for left in range(_STEPS, 0, -1):
        clock = clock_step(at, solution, middle_s, moved)
        if clock is None:
            break
        moved = moved + clock.value
        t_s = tags_moved_s(motion.imu, moved, middle_s)
        if not (np.diff(t_s) > 0.0).all():
            break
        at = with_tags(problem, t_s)
        again = minimum_below(at, least_of_use(problem, cost, left))
        if again is None:
            break
        solution, cost = again, again.cost + prior_squares(moved)
        if likeliest is not None and cost >= likeliest[0].cost:
            break
        likeliest = clock._replace(cost=cost), moved, at, solution
        if clock.squares <= 1.0 or (stated.cost - cost) / 2 < EXCLUDED - LIKELY:
            break
    if likeliest is None or likeliest[0].cost > least_of_use(problem, stated.cost):
        return None
    clock, moved, at, solution = likeliest
    nats = (stated.cost - clock.cost) / 2 + _spread_nats(moved, clock.covariance)
    P = doubted_attitudes(at, middle_s, moved) if nats > 0.0 else np.zeros((1, 3, 3))
    if P is None:
        return None
    return ClockOff(
        moved=moved,
        sigma=clock.sigma,
        middle_s=middle_s,
        nats=nats,
        cost=clock.cost,
        is_exact=problem.phase is not None,
        R_nb=solution.states.R_nb,
        attitude_rad2=P,
        t_s=problem.t_s,
    )


def _spread_nats(moved: FloatArray, covariance: FloatArray) -> float:
    """Return ln of the share of a clock's prior that is near it, for the density that its cost has.

    Parameters
    ----------
    moved : ndarray, shape (2,)
    covariance : ndarray, shape (2, 2)
    """
    (request,) = calibration_requests(["clock"])
    offset_s2, rate_ppm2 = (float(part.covariance[0, 0]) for part in of_time(request))
    orders = 1.0 + np.log(_MOST_S / _LEAST_S)
    density_per_s = 0.5 / (orders * max(abs(float(moved[0])), _LEAST_S))
    normal = moved[0] ** 2 / offset_s2  # in the cost
    spread = np.linalg.slogdet(covariance)[1] + np.log(2 * np.pi / rate_ppm2)
    return float((spread + normal) / 2 + np.log(density_per_s))


def clock_sentence(off: FloatArray, sigma: FloatArray, then: str) -> str:
    """Return what is to be said of a clock and its sigmas, s and ppm, (2,), and of what is done."""
    return (
        f"The inertial unit's clock disagrees with GNSS: {off[0]:+.4f} ± {sigma[0]:.4f} s in "
        f"the middle of its record, to be added to its tags, and {off[1]:+.0f} ± "
        f"{sigma[1]:.0f} ppm in rate; {then}."
    )
