"""A prepared flight through the solvers: by a window, by its newest state, at once."""

from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.gaps import LOST_S, time_from_attitude_s
from fgnav.frontend.prepared import PreparedFlight
from fgnav.graph.types.problem import Opening, SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.methods.smoothing.observability import TURN

if TYPE_CHECKING:
    from fgnav.graph.custom import OwnFactor
    from fgnav.solve.minima import Minimum

Solver: TypeAlias = Literal["gtsam", "chain"]

# Times what noise explains. Of wrong minima, spins lost or a body that was not nose first, costs
# were 1.6 to 2600 times that, of right ones 0.9 to 1.3.
_MISFIT = 1.5
_ROUGHLY = 20  # iterations about a heading that is but one of several


def by_window(
    prepared: PreparedFlight, own: "tuple[OwnFactor, ...]", solver: Solver, lag_s: float
) -> Solution:
    """Return each keyframe as known from the data up to ``lag_s`` after it."""
    problem, keep = prepared.windowed, False
    if not prepared.causal and is_known_late(prepared):
        problem, keep = _at_batch(prepared, own), True
    if solver == "chain":
        from fgnav.solve import chain  # noqa: PLC0415  # lazy: its kernels

        return chain.solve_fixed_lag(
            problem, lag_s, keep_linearisation=keep, opening=prepared.opening
        )
    from fgnav.solve.fixed_lag import solve_fixed_lag  # noqa: PLC0415  # lazy: gtsam

    return solve_fixed_lag(
        problem, lag_s, own=own, keep_linearisation=keep, opening=prepared.opening
    )


def by_newest(
    prepared: PreparedFlight, own: "tuple[OwnFactor, ...]", solver: Solver, lag_s: float
) -> Solution:
    """Return each keyframe as known from the data up to it."""
    if solver == "chain":
        from fgnav.solve import chain  # noqa: PLC0415  # lazy: its kernels

        return chain.solve_forward(prepared.windowed, lag_s, opening=prepared.opening)
    from fgnav.solve.fixed_lag import solve_forward  # noqa: PLC0415  # lazy: gtsam

    return solve_forward(prepared.windowed, lag_s, own=own, opening=prepared.opening)


def at_once(prepared: PreparedFlight, own: "tuple[OwnFactor, ...]", solver: Solver) -> Solution:
    """Return each keyframe as known from all data.

    Where the search starts from attitudes that assume something, it may end anywhere: then a
    minimum counts only where it explains what was measured.
    """
    solution = _at_once(prepared, own, solver)
    if not prepared.rough:
        return solution
    count = sum(int(part.freedom.sum()) for part in prepared.problem.measurements)
    lost = solution.cost > _MISFIT * count
    return replace(solution, converged=solution.converged and not lost)


def without_attitudes(prepared: PreparedFlight) -> bool:
    """Return whether neither an array nor a gyroscope measures how the body turns.

    Only later motion determines where to linearise a window: of 30 such flights of 30 s, its
    attitudes erred by 267 sigmas squared (median; 3 is right) where it did so itself, by 1.6 at the
    batch.
    """
    return prepared.integers is None and prepared.imu.w_b_radps is None


def is_known_late(prepared: PreparedFlight) -> bool:
    """Return whether only later motion determines where to linearise, without a gyroscope.

    Without attitudes none does before; between two of them it may have turned over: a window goes
    on as the body last turned, and a turn too many is a minimum of its own.
    """
    if prepared.imu.w_b_radps is not None:
        return False
    problem = prepared.problem
    away_s = time_from_attitude_s(problem.t_s, problem.attitude_known)
    return prepared.integers is None or bool((away_s > LOST_S).any())


def _open_throughout(prepared: PreparedFlight) -> Opening | None:
    """Return the opening of a heading that is never observable; None if it is."""
    opening = prepared.opening
    return opening if opening is not None and opening.until_s == np.inf else None


def _at_batch(prepared: PreparedFlight, own: "tuple[OwnFactor, ...]") -> SmoothingProblem:
    """Return the problem, its search started where the batch has the flight."""
    batch = at_once(prepared, own, "chain" if not own else "gtsam")
    if prepared.rough and not batch.converged:
        raise NoSolutionError(
            f"attitude: the {TURN} is left open: the batch, where windows are linearised, ends in "
            "no minimum that explains the measurements; gravity directions would determine it"
        )
    return replace(
        prepared.problem,
        start=batch.states,
        constants=prepared.problem.constants.started_at(batch.states.constants),
        attitude_known=np.ones_like(prepared.problem.attitude_known),
    )


def _at_once(prepared: PreparedFlight, own: "tuple[OwnFactor, ...]", solver: Solver) -> Solution:
    problem, opening = prepared.problem, _open_throughout(prepared)
    if opening is not None:
        return _about_headings(problem, opening, own, solver)
    if solver == "chain" or (without_attitudes(prepared) and not own):
        # Its descent crosses the curved valleys of such flights; GTSAM's stops in them.
        from fgnav.solve import chain  # noqa: PLC0415  # lazy: its kernels
        from fgnav.solve.minima import begins, minima, mixture  # noqa: PLC0415

        if without_attitudes(prepared):
            return chain.solve_batch(problem)
        return mixture(minima(problem, begins(problem, chain.solve_fixed_lag)))
    from fgnav.solve.batch import solve_batch  # noqa: PLC0415  # lazy: gtsam

    return solve_batch(problem, own=own)


def _about_headings(
    problem: SmoothingProblem, opening: Opening, own: "tuple[OwnFactor, ...]", solver: Solver
) -> Solution:
    """Return a flight over all headings, or from the likeliest if it is observable after all."""
    from fgnav.solve import chain  # noqa: PLC0415  # lazy: its kernels
    from fgnav.solve.headings import over_headings  # noqa: PLC0415  # lazy: the chain
    from fgnav.solve.minima import Minimum  # noqa: PLC0415

    def searched(conditioned: SmoothingProblem) -> "Minimum":
        if own:  # the chain knows none
            from fgnav.solve.batch import minimum  # noqa: PLC0415  # lazy: gtsam

            return minimum(conditioned, own)
        solution = chain.solve_batch(conditioned, most=_ROUGHLY)
        return Minimum(solution, chain.log_evidence(conditioned, solution.states))

    headings = over_headings(problem, opening, searched)
    begin, is_observable = headings.ends[0].solution, headings.is_observable
    likeliest = problem if is_observable else headings.problems[0]
    if solver == "chain":
        solution = chain.solve_batch(likeliest, begin=begin.states)
    else:
        from fgnav.solve.batch import minimum  # noqa: PLC0415  # lazy: gtsam

        solution = minimum(likeliest, own, begin.states).solution
    return solution if is_observable else headings.mixed(solution)
