"""Several minima of one cost: which is likeliest, and the doubt that the others leave.

Across a span without attitudes a body may have turned otherwise, once more or not at all, and each
way is a minimum. Its share of the posterior is that of a Gaussian about it [1]_ (Laplace), H the
Hessian of half the cost:

    log p(minimum | data) = -cost / 2 - log det(H) / 2 + constant

What is stated is the likeliest minimum, with the second moments of all of them about it [2]_.

References
----------
.. [1] MacKay, Information Theory, Inference, and Learning Algorithms, 2003, chapter 27.
.. [2] Bar-Shalom, Li & Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
   section 1.4.16: moments of a Gaussian mixture.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.solve.gauss_newton import Minimum

_APART_SIGMAS = 1.0  # searches that end closer than this have the same minimum


def distinct(ends: Sequence[Minimum]) -> list[Minimum]:
    """Return ends of searches without those that have another's minimum, the likeliest first."""
    converged = [end for end in ends if end.solution.converged] or ends
    kept: list[Minimum] = []
    for end in sorted(converged, key=lambda minimum: -minimum.log_evidence):
        if all(_are_apart(end.solution, minimum.solution) for minimum in kept):
            kept.append(end)
    return kept


def mixture(ends: Sequence[Minimum]) -> Solution:
    """Return the first minimum, with the second moments of all about it."""
    best = ends[0].solution
    if len(ends) == 1:
        return best
    log_evidence = np.array([end.log_evidence for end in ends])
    weight = np.exp(log_evidence - log_evidence.max())
    weight /= weight.sum()
    parts = [_about(best.states, end.solution) for end in ends]
    covariance, cross, constant, constant_cross = (
        sum(w * minimum[i] for w, minimum in zip(weight, parts, strict=True)) for i in range(4)
    )
    return replace(
        best,
        covariance=covariance,
        cross=cross,
        constant_covariance=constant,
        constant_cross=constant_cross,
    )


def _about(states: States, solution: Solution) -> tuple[FloatArray, ...]:
    """Return second moments of a batch's solution about other states."""
    steps = states.steps_to(solution.states)
    moved = solution.states.constants - states.constants
    cross = np.zeros_like(solution.covariance)
    cross += 0.0 if solution.cross is None else solution.cross
    cross[:-1] += steps[:-1, :, None] * steps[1:, None, :]
    return (
        solution.covariance + steps[:, :, None] * steps[:, None, :],
        cross,
        solution.constant_covariance + np.outer(moved, moved),
        solution.constant_cross + steps[:, :, None] * moved,
    )


def _are_apart(solution: Solution, other: Solution) -> bool:
    """Return True if any rotation is further from the other's than the wider sigma."""
    turn = solution.states.steps_to(other.states)[:, :3]
    variance = np.maximum(
        *(np.einsum("nii->ni", s.covariance[:, :3, :3]) for s in (solution, other))
    )
    return bool((turn**2 > _APART_SIGMAS**2 * variance).any())
