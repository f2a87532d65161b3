"""Keyframes as they leave a window, and all of them as one solution."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States, joined
from fgnav.solve.marginals import Marginals
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
    known: Marginals,
    *,
    keep_linearisation: bool,
    updates: int,
) -> Departed:
    """Return m keyframes with their covariances; ``steps``, (m, D), lead to their states."""
    solution = Solution(
        states=states,
        covariance=known.covariance,
        cross=known.cross[:-1],
        constant_covariance=np.tile(known.constant, (len(t_s), 1, 1)),
        constant_cross=known.constant_cross,
        converged=keep_linearisation or not is_rough(steps, known.covariance),
        constants=np.tile(states.constants, (len(t_s), 1)),
        updates=updates,
    )
    return Departed(t_s=t_s.copy(), solution=solution, cross_next=known.cross[-1])


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
        constants=np.concatenate([one.constants for one in of if one.constants is not None]),
        updates=of[-1].updates,
    )
