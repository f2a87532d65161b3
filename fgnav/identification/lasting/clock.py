"""A clock of the inertial unit that is off, by the whole problem.

The thinned chain tests it beside the delay of velocities, and of both only the sum may show. With
velocities in time, or with phases, the whole problem tells offset and rate
(``likelihood.record_clock``), linearised anew where they lead. That velocities are late is another
cause, which is weighed as any.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from fgnav.checks import FloatArray
from fgnav.frontend.calibration_request import CalibrationRequest, calibration_requests, of_time
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.geometry.rotations import log, transpose
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting.error import least_of_use
from fgnav.identification.lasting.rivals import Rivals
from fgnav.identification.likelihood.changed_samples import minimum_below
from fgnav.identification.likelihood.record_clock import (
    RecordClock,
    attitude_doubt,
    clock_step,
    prior_squares,
    with_tags,
)
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.track.tags import tags_moved_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Flight

CLOCK = "clock"
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
    doubt: AttitudeDoubt | None = None
    rivals: Rivals | None = None
    kind: str = CLOCK

    @property
    def share(self) -> float:
        """Its probability."""
        return float(expit(self.nats - EXCLUDED))

    @property
    def is_likely(self) -> bool:
        """Whether it is taken for true."""
        return self.share > 0.5

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be said of it, where no request says so."""
        if not (self.is_exact and self.is_likely):
            return ()
        return (clock_sentence(self.moved, self.sigma, "corrected"),)

    @property
    def requests(self) -> tuple[CalibrationRequest, ...]:
        """What is to be estimated with the flight."""
        if self.is_exact or not self.is_likely:
            return ()
        (clock,) = calibration_requests(["clock"])
        return (replace(clock, moved=(float(self.moved[0]), float(self.moved[1]))),)

    def undone(self, flight: Flight) -> Flight:
        """Return a flight with tags in time, or in doubt by the second moment of both."""
        imu = flight.imu
        if imu is None or self.is_likely:
            return with_tags_moved(flight, self.moved, self.middle_s)
        if self.is_exact:  # attitudes are doubted
            return flight
        moved_s = tags_moved_s(imu, self.moved, self.middle_s) - imu.t_s
        squares_s2 = self.share * (np.mean(moved_s**2) + self.sigma[0] ** 2)
        doubt_s = float(np.hypot(imu.clock_offset_sigma_s or 0.0, np.sqrt(squares_s2)))
        return replace(flight, imu=replace(imu, clock_offset_sigma_s=doubt_s))

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
    (request,) = calibration_requests(["clock"])
    before = np.prod([part.covariance[0, 0] for part in of_time(request)])
    spread = np.linalg.slogdet(clock.covariance)[1] - np.log(before)
    nats = float((stated.cost - clock.cost + spread) / 2)
    is_exact = problem.phase is not None
    R_nb, doubt = solution.states.R_nb, None
    if is_exact and nats > EXCLUDED - LIKELY:
        doubt = attitude_doubt(at, middle_s, moved)
    off = ClockOff(moved, clock.sigma, middle_s, nats, clock.cost, is_exact, R_nb, doubt)
    return off if off.is_likely else off._replace(doubt=_of_both(off, stated.states.R_nb))


def _of_both(off: ClockOff, stated_nb: FloatArray) -> AttitudeDoubt | None:
    """Return what attitudes as stated are doubted for a clock that is not likely.

    The second moment of both, ``share (d d' + P)``, d from these to the clock's, (n, 3).
    """
    if off.doubt is None:
        return None
    apart = log(transpose(stated_nb) @ off.R_nb)
    squares = off.doubt.covariance_rad2 + apart[:, :, None] * apart[:, None]
    return off.doubt._replace(covariance_rad2=off.share * squares)


def clock_sentence(off: FloatArray, sigma: FloatArray, then: str) -> str:
    """Return what is to be said of a clock and its sigmas, s and ppm, (2,), and of what is done."""
    return (
        f"The inertial unit's clock disagrees with GNSS: {off[0]:+.4f} ± {sigma[0]:.4f} s in "
        f"the middle of its record, to be added to its tags, and {off[1]:+.0f} ± "
        f"{sigma[1]:.0f} ppm in rate; {then}."
    )
