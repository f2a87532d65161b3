"""A heading that nothing tells: all headings of the circle, each held in turn.

Where accelerations are small the cost is all but level about the vertical, or about the specific
force of a body without gyroscope and array, and a search ends anywhere along it. There J'J is no
curvature of the cost: noise of the specific force, squared, looks like information, as in filters
linearised at wrong headings [1]_. So the heading is integrated by quadrature: the rest of the
flight is estimated about each of a few headings of the first keyframe, held fixed, and each counts
by its evidence.

References
----------
.. [1] Huang, Mourikis & Roumeliotis, Observability-based rules for designing consistent EKF SLAM
   estimators, International Journal of Robotics Research 29(5), 2010.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.geometry.rotations import exp, wrap
from fgnav.graph.types.problem import AttitudePrior, Opening, Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import ROTATION
from fgnav.solve.gauss_newton import Minimum
from fgnav.solve.minima import mixture
from fgnav.types.estimate import open_angle_variance_rad2

# The cost has the period of a turn and next to no higher harmonics than the second: eight integrate
# it, as a trapezoidal rule does periodic functions.
_COUNT = 8
_APART_RAD = 2 * np.pi / _COUNT


class Headings(NamedTuple):
    """The flight about each heading, the likeliest first."""

    problems: tuple[Problem, ...]
    ends: tuple[Minimum, ...]

    @property
    def is_observable(self) -> bool:
        """Return True if the flight determines the heading to half the spacing of the trials."""
        first = self.ends[0].solution.states
        turn = [end.solution.states.steps_to(first)[0, ROTATION] for end in self.ends]
        log_evidence = np.array([end.log_evidence for end in self.ends])
        weight = np.exp(log_evidence - log_evidence.max())
        variance_rad2 = weight @ (np.array(turn) ** 2).sum(axis=1) / weight.sum()
        return bool(variance_rad2 < (_APART_RAD / 2) ** 2)

    def mixed(self, likeliest: Solution) -> Solution:
        """Return a solution of the first problem with the doubt that all others leave."""
        best = self.ends[0]._replace(solution=likeliest)
        return mixture([best, *self.ends[1:]])


def over_headings(
    problem: Problem,
    opening: Opening,
    search: Callable[[Problem], Minimum],
) -> Headings:
    """Return a flight's minima about headings all round.

    Parameters
    ----------
    problem : Problem
    opening : Opening
        The first attitude with one heading held, and the arm of the antenna that stays in place.
    search : callable
        The minimum of a problem, from its start.

    Raises
    ------
    NoSolutionError
        If the data leave a state open, by name.
    """
    turns_rad = [k * _APART_RAD for k in range(_COUNT)]
    held = [_conditioned(problem, opening, turn_rad) for turn_rad in turns_rad]
    ends = [search(solution) for solution in held]
    ends = [
        end._replace(log_evidence=end.log_evidence + _log_prior(opening, turn_rad))
        for end, turn_rad in zip(ends, turns_rad, strict=True)
    ]
    order = sorted(range(_COUNT), key=lambda k: -ends[k].log_evidence)
    return Headings(tuple(held[k] for k in order), tuple(ends[k] for k in order))


def _log_prior(opening: Opening, turn_rad: float) -> float:
    """Compute the log prior of a heading at an angle from the nominal one."""
    variance_rad2 = opening.heading_variance_rad2
    is_open = variance_rad2 >= open_angle_variance_rad2()
    return 0.0 if is_open else -(float(wrap(np.array(turn_rad))) ** 2) / (2 * variance_rad2)


def _conditioned(problem: Problem, opening: Opening, turn_rad: float) -> Problem:
    """Return a problem conditional on the opening's heading turned by an angle."""
    turns = exp(turn_rad * opening.axis_n)
    start, prior = opening.problem.start, opening.problem.attitude_prior
    R_nb = turns @ start.R_nb
    p_n_m = start.p_n_m + (start.R_nb - R_nb) @ opening.arm_b_m
    if prior is not None:
        prior = AttitudePrior(R_nb=turns[0] @ prior.R_nb, covariance_rad2=prior.covariance_rad2)
    return replace(problem, start=start._replace(R_nb=R_nb, p_n_m=p_n_m), attitude_prior=prior)
