"""A prepared flight through the solvers: by a window, by its newest state, at once."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.gaps import LOST_S, time_from_attitude_s
from fgnav.assembly.heading_open import FIXED_RAD
from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry.interpolation import interpolate
from fgnav.graph.custom import NamedFactor
from fgnav.graph.types.problem import (
    ROTATION_PRIOR_RAD,
    AttitudePrior,
    Opening,
    Problem,
)
from fgnav.graph.types.solution import Solution
from fgnav.methods.smoothing.observability import TURN
from fgnav.solve.batch import minimum, solve_batch
from fgnav.solve.fixed_lag import solve_fixed_lag
from fgnav.solve.gauss_newton import Minimum
from fgnav.solve.headings import over_headings
from fgnav.types.estimate import open_angle_variance_rad2

# Times what noise explains. Of wrong minima, spins lost or a body that was not nose first, costs
# were 1.6 to 2600 times that, of right ones 0.9 to 1.3.
_MISFIT = 1.5
_ROUGHLY = 20  # iterations about a heading that is but one of several


def by_window(prepared: PreparedFlight, custom: tuple[NamedFactor, ...], lag_s: float) -> Solution:
    """Return each keyframe as known from the data up to ``lag_s`` after it."""
    problem, keep, added = prepared.problem, False, None
    if not prepared.causal and is_known_late(prepared):
        problem, added = _at_batch(prepared, custom)
        keep = True
    solution = solve_fixed_lag(
        problem, lag_s, custom=custom, keep_linearisation=keep, opening=prepared.opening
    )
    if added is None:
        return solution
    return replace(solution, covariance=solution.covariance + added)


def at_once(prepared: PreparedFlight, custom: tuple[NamedFactor, ...]) -> Solution:
    """Return each keyframe as known from all data."""
    return _ended(prepared, custom).solution


def without_attitudes(prepared: PreparedFlight) -> bool:
    """Return True if neither an array nor a gyroscope measures the body's rotation.

    Only later motion determines where to linearise a window: of 30 such flights of 30 s, its
    attitudes erred by 267 sigmas squared (median; 3 is right) where it did so itself, by 1.6 at the
    batch.
    """
    return prepared.integers is None and prepared.imu.w_b_radps is None


def is_known_late(prepared: PreparedFlight) -> bool:
    """Return True if only later motion determines the linearisation point, without a gyroscope.

    A window extrapolates the last rotation. Between attitudes that are far apart, the body may have
    made another full turn, and a wrong number of turns is a local minimum.
    """
    if prepared.imu.w_b_radps is not None:
        return False
    problem = prepared.problem
    away_s = time_from_attitude_s(problem.t_s, problem.attitude_known)
    return prepared.integers is None or bool((away_s > LOST_S).any())


class _End(NamedTuple):
    """Result of a batch: solution, problem, and covariance added by other headings."""

    solution: Solution
    problem: Problem
    added: FloatArray | None = None  # (n, D, D)


def _at_batch(
    prepared: PreparedFlight, custom: tuple[NamedFactor, ...]
) -> tuple[Problem, FloatArray | None]:
    """Return the problem, started where the batch has the flight, and what other headings add."""
    end = _ended(prepared, custom)
    if without_attitudes(prepared) and not end.solution.converged:
        raise NoSolutionError(
            f"attitude: the {TURN} is left open: the batch, where windows are linearised, ends in "
            "no minimum that explains the measurements; gravity directions would determine it"
        )
    states = end.solution.states
    problem = replace(
        end.problem,
        start=states,
        attitude_known=np.ones_like(end.problem.attitude_known),
    )
    return problem, end.added


def _ended(prepared: PreparedFlight, custom: tuple[NamedFactor, ...]) -> _End:
    """Return the end of a batch; its minimum counts only where it explains the measurements.

    That is asked where nothing measures attitudes: there the search may end anywhere.
    """
    problem, opening = prepared.problem, _open(prepared)
    if opening is not None:
        end = _about_headings(problem, opening, custom)
    elif without_attitudes(prepared):
        end = _End(minimum(problem, custom).solution, problem)
    else:
        end = _End(solve_batch(problem, custom=custom), problem)
    if not without_attitudes(prepared):
        return end
    measured = (*problem.sensors, *(() if problem.phase is None else (problem.phase,)))
    count = sum(int(measurement.freedom.sum()) for measurement in measured)
    lost = end.solution.cost > _MISFIT * count
    return end._replace(
        solution=replace(end.solution, converged=end.solution.converged and not lost)
    )


def _open(prepared: PreparedFlight) -> Opening | None:
    """Return the opening of a heading search; None if the flight determines its heading."""
    opening = prepared.opening
    if opening is not None:
        return opening if opening.until_s == np.inf else None
    if not (prepared.rough and without_attitudes(prepared)):
        return None
    problem, imu = prepared.problem, prepared.imu
    R_nb = problem.start.R_nb
    force_b = interpolate(problem.t_s, imu.t_s, imu.f_b_mps2)
    force_b /= np.linalg.norm(force_b, axis=1, keepdims=True).clip(1e-9)
    across = np.eye(3) - np.outer(force_b[0], force_b[0])
    covariance_rad2 = ROTATION_PRIOR_RAD**2 * across + FIXED_RAD**2 * (np.eye(3) - across)
    held = AttitudePrior(R_nb=R_nb[0], covariance_rad2=covariance_rad2)
    return Opening(
        problem=replace(problem, attitude_prior=held),
        until_s=np.inf,
        heading_variance_rad2=open_angle_variance_rad2(),
        arm_b_m=np.zeros(3),
        axis_n=np.einsum("nij,nj->ni", R_nb, force_b),
    )


def _about_headings(problem: Problem, opening: Opening, custom: tuple[NamedFactor, ...]) -> _End:
    """Return a flight over all headings, or from the likeliest if it is observable after all."""

    def searched(conditioned: Problem) -> Minimum:
        return minimum(conditioned, custom, most=_ROUGHLY)

    headings = over_headings(problem, opening, searched)
    begin, is_observable = headings.ends[0].solution, headings.is_observable
    likeliest = problem if is_observable else headings.problems[0]
    solution = minimum(likeliest, custom, begin.states).solution
    if is_observable:
        return _End(solution, likeliest)
    mixed = headings.mixed(solution)
    return _End(mixed, likeliest, mixed.covariance - solution.covariance)
