"""The whole flight at once: Gauss-Newton over the chain, damped where that does not descend."""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.chain import Chain
from fgnav.methods.smoother.graph import Solution, border
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.link_kernel import States, linearise, move
from fgnav.methods.smoother.links import (
    empty_motions,
    integrate,
    prior_of,
    samples_of,
    senses_of,
    states_of,
)

_ITERATIONS = 50
_STEP_SIGMAS = 0.01  # a next Newton step below this share of every sigma: it is a minimum
_RELATIVE_COST = 1e-6  # a smaller change of cost is the end of the descent, minimum or not
_DAMPING, _FIERCEST = 1e-6, 1e4  # first and last resort of Levenberg and Marquardt
# Motion is preintegrated anew where the slot has moved so far that turns come out differently: the
# correction to first order errs by half the square.
TURNED_RAD = 0.002
_REPEATS = 3


def solve_batch(keyframes: Keyframes) -> Solution:
    """Return the minimum of the whole graph with its covariances."""
    search = _Search(keyframes)
    solution = search.descend()
    for _ in range(_REPEATS):
        if not solution.converged or not search.preintegrated_anew(solution):
            break
        again = search.descend()
        if not again.converged:
            break
        solution = again
    return solution


class _Search:
    """Descent of one flight's cost, linearised at ``states``."""

    def __init__(self, keyframes: Keyframes) -> None:
        self._n, self._samples = len(keyframes.t_s), samples_of(keyframes)
        self._rows = np.arange(self._n)
        self._motions = empty_motions(self._n)
        self._integrate(self._rows[1:], keyframes.slot)
        self._chain = Chain.empty(self._n, border(keyframes))
        self._states, self._senses = states_of(keyframes), senses_of(keyframes)
        self._prior = prior_of(keyframes)

    def descend(self) -> Solution:
        """Go to a minimum; return it with its covariances.

        What a step promises, its squared length in the information's own measure, bounds its
        length in sigmas of any state. Near a minimum Newton's promises fall with their square, so
        the ratio of the last two tells the next, which then need not be computed.
        """
        damping, cost, promised = 0.0, self._linearised(), np.inf
        for _ in range(_ITERATIONS):
            previous, (step, least) = promised, self._step(damping)
            promised = cost - least
            ratio = min(promised / previous, 1.0) if np.isfinite(previous) else 1.0
            if damping == 0.0 and promised * ratio < _STEP_SIGMAS**2:
                return self._solution(step)
            before, last = self._states, cost
            self._states = self._moved(step)
            cost = self._linearised()
            if cost <= last * (1 + _RELATIVE_COST):
                damping = damping / 10 if damping > _DAMPING else 0.0
                if last - cost < _RELATIVE_COST * last:
                    break
            else:
                damping = max(10 * damping, _DAMPING)
                if damping > _FIERCEST:
                    break
                self._states, promised = before, np.inf
                cost = self._linearised()
        return self._solution(self._step(0.0)[0], tested=False)

    def preintegrated_anew(self, solution: Solution) -> bool:
        """Preintegrate about a solution's slots where that matters; return whether it did."""
        change = (solution.slot[:-1] - self._motions.about[1:])[:, 3:]
        turned_rad = self._motions.span_s[1:] * np.linalg.norm(change, axis=1)
        matters = np.flatnonzero(turned_rad > TURNED_RAD) + 1
        if len(matters):
            self._integrate(matters, solution.slot)
        return bool(len(matters))

    def _integrate(self, rows: IntArray, slot: FloatArray) -> None:
        integrate(self._motions, rows, self._samples, rows, slot[rows - 1])

    def _linearised(self) -> float:
        """Fill the chain at the states; return twice the cost."""
        link, parts = self._chain.link, (self._motions, self._senses, self._prior)
        return float(linearise(link, self._states, *parts, self._rows, 0))

    def _step(self, damping: float) -> tuple[FloatArray, float]:
        self._chain.begin(0)
        self._chain.eliminate(0, self._n - 1, damping)
        return self._chain.step(0, self._n - 1)

    def _moved(self, step: FloatArray) -> States:
        moved = States(*(part.copy() for part in self._states))
        move(self._states, step, 0, moved, 0, wholly=True)
        if self._chain.border:
            moved.landmark_n_m[:] += step[0, -self._chain.border :]
        return moved

    def _solution(self, step: FloatArray, *, tested: bool = True) -> Solution:
        """Take the last step; where it is not known to be small, test it."""
        marginals, states = self._chain.marginals(0, self._n - 1), self._moved(step)
        sigma = np.sqrt(np.einsum("nii->ni", marginals.covariance[:, :6, :6]))
        small = bool((np.abs(step[:, :6]) < _STEP_SIGMAS * sigma).all())
        return Solution(
            R_nb=states.R_nb,
            p_n_m=states.p_n_m,
            v_n_mps=states.v_n_mps,
            slot=states.slot,
            covariance=marginals.covariance,
            cross=marginals.cross,
            converged=tested or small,
        )
