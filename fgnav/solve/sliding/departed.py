"""Keyframes as they leave a window, and all of them as one solution."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import right_jacobian
from fgnav.geometry.rotations import exp, transpose
from fgnav.graph.types.problem import Opening, Problem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import POSITION, ROTATION, States, joined
from fgnav.solve.elimination import Marginals
from fgnav.solve.sliding.relinearisation import is_rough


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Departed:
    """Keyframes as they left the window, or some as they stand in it.

    Attributes
    ----------
    t_s : ndarray, shape (m,)
    solution : Solution
        Of these keyframes; ``updates`` counts the solver's so far.
    cross_next : ndarray, shape (D, D)
        Covariance of the last of them with the keyframe after it; zero if there is none.
    """

    t_s: FloatArray
    solution: Solution
    cross_next: FloatArray


def departed(
    t_s: FloatArray,
    states: States,
    steps: FloatArray,
    marginals: Marginals,
    *,
    keep_linearisation: bool,
    updates: int,
) -> Departed:
    """Return m keyframes with their covariances; ``steps``, (m, D), lead to their states."""
    if keep_linearisation:
        marginals = _at_estimates(marginals, steps)
    rough = is_rough(steps, marginals.covariance) & (not keep_linearisation)
    solution = Solution(
        states=states,
        covariance=marginals.covariance,
        cross=marginals.cross[:-1],
        constant_covariance=np.tile(marginals.constant, (len(t_s), 1, 1)),
        constant_cross=marginals.constant_cross,
        converged=not rough.any(),
        refused=rough,
        constants=np.tile(states.constants, (len(t_s), 1)),
        solver="gtsam.IncrementalFixedLagSmoother",
        updates=updates,
    )
    return Departed(t_s=t_s.copy(), solution=solution, cross_next=marginals.cross[-1])


def _at_estimates(marginals: Marginals, steps: FloatArray) -> Marginals:
    """Return covariances along the tangents of the estimates, not of where these are linearised.

    ``Exp(s + e) = Exp(s) Exp(J_r(s) e)``: a step of a radian turns the axes by as much. That of the
    keyframe after the last is not there: its axes are the last one's.
    """
    T = np.tile(np.eye(steps.shape[1]), (len(steps), 1, 1))
    T[:, ROTATION, ROTATION] = [right_jacobian(turn) for turn in steps[:, ROTATION]]
    T[:, POSITION, POSITION] = transpose(exp(steps[:, ROTATION]))
    after = transpose(np.concatenate([T[1:], T[-1:]]))
    return Marginals(
        T @ marginals.covariance @ transpose(T),
        T @ marginals.cross @ after,
        marginals.constant,
        T @ marginals.constant_cross,
    )


def opened(
    leaving: Callable[[Problem, int], list[Departed | None]],
    problem: Problem,
    opening: Opening | None,
) -> list[Departed]:
    """Collect the states that leave a window, first those of an opening, then of the problem.

    Parameters
    ----------
    leaving : callable
        What leaves with each of a problem's first keyframes, and at the end what is left.
    problem : Problem
    opening : Opening or None
    """
    if opening is None:
        return [part for part in leaving(problem, len(problem.t_s)) if part is not None]
    first = leaving(opening.problem, opening.keyframes)
    later = [] if opening.keyframes == len(problem.t_s) else leaving(problem, len(problem.t_s))
    turned = [part and with_open_heading(part, opening) for part in first]
    return [part for part in (*turned, *later[len(first) :]) if part is not None]


def with_open_heading(part: Departed, opening: Opening) -> Departed:
    """Return keyframes with what is not known of the heading that the opening holds fixed.

    The body may be turned about the vertical through its antenna.
    """
    solution, J = part.solution, np.zeros(part.solution.covariance.shape[:2])
    J[:, ROTATION] = solution.states.R_nb[:, 2]
    J[:, POSITION] = np.cross(opening.arm_b_m, J[:, ROTATION])
    variance_rad2 = opening.heading_variance_rad2
    open_rad2 = variance_rad2 * J[:, :, None] * J[:, None, :]
    inward = np.cross(J[:, POSITION], J[:, ROTATION])  # by 1 - cos of the turn: 1.5 if uniform
    second = min(0.75 * variance_rad2**2, 1.5)
    open_rad2[:, POSITION, POSITION] += second * inward[:, :, None] * inward[:, None, :]
    return replace(part, solution=replace(solution, covariance=solution.covariance + open_rad2))


def joined_solution(parts: list[Departed]) -> Solution:
    """Return keyframes that left one after another as one solution."""
    of = [part.solution for part in parts]
    cross = [c for p in parts for c in (p.solution.cross, p.cross_next[None]) if c is not None]
    return Solution(
        states=joined([one.states for one in of]),
        covariance=np.concatenate([one.covariance for one in of]),
        cross=np.concatenate(cross)[:-1],
        constant_covariance=np.concatenate([one.constant_covariance for one in of]),
        constant_cross=np.concatenate([one.constant_cross for one in of]),
        converged=all(one.converged for one in of),
        refused=np.concatenate([one.refused for one in of if one.refused is not None]),
        constants=np.concatenate([one.constants for one in of if one.constants is not None]),
        solver=of[-1].solver,
        updates=of[-1].updates,
    )
