"""The whole flight at once: Gauss-Newton over the chain, held back where that does not descend."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.methods.smoother.chain import STATE, Chain, Marginals, OpenStateError
from fgnav.methods.smoother.constants import width
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.link_kernel import linearise, move
from fgnav.methods.smoother.link_types import States
from fgnav.methods.smoother.links import (
    empty_motions,
    integrate,
    prior_of,
    samples_of,
    senses_of,
    states_of,
)
from fgnav.methods.smoother.solution import SharedSolution, Solution

_ITERATIONS = 100
_STEP_SIGMAS = 0.01  # a next Newton step below this share of every sigma: it is a minimum
_NEAR = 1.0  # a promise below it is Newton's
_MISSED = 0.1  # of a promise that is not kept: the step left the curve of the path
_KEPT = 0.5  # of a promise: less, and the step was too long
_HOLD, _FIRMEST = 0.1, 1e8  # 1/rad2, first and last resort of Levenberg and Marquardt
_FAST = 1e14  # of what is not to move at all
_ROTATION, _TURNING = np.arange(3), np.array([0, 1, 2, 12, 13, 14])  # of a state; its rate, too
# Motion is preintegrated anew where the slot has moved so far that turns come out differently: the
# correction to first order errs by half the square.
TURNED_RAD = 0.002
# Of a first step: what turns on a little after it is then not done a third time, and all links and
# the chain with it.
_FIRST_TURNED_RAD = TURNED_RAD / 2
_TRUSTED_RAD = 0.5  # a first step that changes turns by more is not
_REPEATS = 3


def solve_batch(keyframes: Keyframes) -> Solution:
    """Return the minimum of the whole graph with its covariances."""
    search = _Search(keyframes)
    search.begin()
    converged = search.descend()
    for _ in range(_REPEATS):
        if not converged:
            break
        before, anew = search.place, search.preintegrated_anew()
        if not len(anew):
            break
        converged = search.descend(anew)
        if not converged:  # a minimum of motions integrated about other slots is none
            search.go_back(before)
    return search.solution(converged=converged)


class _Place(NamedTuple):
    """Where a search stands: linearised at states, motions integrated about slots."""

    states: States
    about: FloatArray


class _Search:
    """Descent of one flight's cost, linearised at ``states``."""

    def __init__(self, keyframes: Keyframes) -> None:
        self._n, self._samples = len(keyframes.t_s), samples_of(keyframes)
        self._rows = np.arange(self._n)
        self._motions = empty_motions(self._n)
        self._integrate(self._rows[1:], keyframes.slot)
        self._chain = Chain.empty(self._n, width(keyframes.shared))
        self._states, self._senses = states_of(keyframes), senses_of(keyframes)
        self._prior = prior_of(keyframes)
        self._steps: FloatArray = np.zeros((0, STATE))  # the last, not taken yet
        self._promised = np.inf  # by the one before

    @property
    def place(self) -> _Place:
        """Where it stands; it goes on elsewhere."""
        return _Place(self._states, self._motions.about.copy())

    def begin(self) -> None:
        """Take a first step, and preintegrate about the slots there if all in all that gains.

        Slots start as rough as differences of single attitudes are; this way one descent does.
        """
        start, cost = self.place, self._linearised(self._rows)
        self._steps, least = self._step()
        if not self._turned_rad().max() < _TRUSTED_RAD:
            return
        self.preintegrated_anew(_FIRST_TURNED_RAD)
        self._states = self._moved()
        if self._linearised(self._rows) < cost:
            self._promised = cost - least
        else:
            self.go_back(start)

    def descend(self, rows: IntArray | None = None) -> bool:
        """Go to a minimum; return whether it is known to be one.

        What a step promises, its squared length in the information's own measure, bounds its
        length in sigmas of any state. Near a minimum Newton's promises fall with their square, so
        the ratio of the last two tells the next, which then need not be computed. Where a step does
        not keep its promise it is rotations that went too far: they are held by a spring, whose
        information grows until the cost falls.

        Parameters
        ----------
        rows : ndarray of int, optional
            Links that are not linearised where the search stands.
        """
        hold, cost, promised = 0.0, self._linearised(rows), self._promised
        for _ in range(_ITERATIONS):
            self._held(hold, _ROTATION)
            previous, (self._steps, least) = promised, self._step()
            promised = cost - least
            near = 0.0 < promised < min(previous, _NEAR)
            ratio = promised / previous if near else 1.0
            if hold == 0.0 and promised * ratio < _STEP_SIGMAS**2:
                self._promised = previous
                return True
            before, last = self._states, cost
            cost = self._gone(cost, promised)
            if cost <= last:
                hold = hold / 10 if hold > _HOLD else 0.0
                continue
            self._states, promised = before, np.inf
            cost = self._linearised(self._rows)
            hold = max(10 * hold, _HOLD)
            if hold > _FIRMEST:
                break
        self._steps, _ = self._step()
        sigma = np.sqrt(np.einsum("nii->ni", self._marginals().covariance[:, :6, :6]))
        return bool((np.abs(self._steps[:, :6]) < _STEP_SIGMAS * sigma).all())

    def _gone(self, cost: float, promised: float) -> float:
        """Take the step; return the cost there.

        Where it gains less than half of what it promised it was too long, and the parabola through
        both costs tells how much: Newton's own curvature is that of residuals which do not bend,
        and along the valley of a heading that is known to twenty degrees it is half of the true
        one. Full steps would cross that valley to and fro.
        """
        before, steps = self._states, self._steps
        whole = self._followed(cost - (1 - _MISSED) * promised)
        if whole <= cost - _KEPT * promised:
            return whole
        there, self._states = self._states, before
        self._steps = steps * promised / (whole - cost + 2 * promised)
        part = self._followed(-np.inf)
        if part < whole:
            return part
        self._states = there
        return self._linearised(self._rows)

    def _followed(self, expected: float) -> float:
        """Take the step; return the cost there.

        If that is above what is expected, velocities, positions and biases follow the rotations: of
        these given, they are a linear problem. It is the curve of a path whose attitudes turn that
        a step along its tangent leaves.
        """
        self._states = self._moved()
        cost = self._linearised(self._rows)
        if cost <= expected:
            return cost
        self._held(_FAST, _TURNING)
        self._steps, _ = self._step()
        self._states = self._moved()
        return self._linearised(self._rows)

    def _held(self, information: float, parts: IntArray) -> None:
        """Add information, 1/rad2 or s2/rad2, that parts of every state stay where they are."""
        if information:
            at = STATE + parts
            self._chain.link[:, at, at] += information

    def preintegrated_anew(self, turned_rad: float = TURNED_RAD) -> IntArray:
        """Preintegrate about the last step's slots where that matters; return where."""
        matters = np.flatnonzero(self._turned_rad() > turned_rad) + 1
        self._integrate(matters, self._moved().slot)
        return matters

    def _turned_rad(self) -> FloatArray:
        """Return by how much turns differ about the last step's slots, (n - 1,)."""
        change = (self._moved().slot[:-1] - self._motions.about[1:])[:, 3:]
        return np.asarray(self._motions.span_s[1:] * np.linalg.norm(change, axis=1))

    def go_back(self, place: _Place) -> None:
        """Go to where the search was, and take the step from there."""
        rows = np.flatnonzero((place.about != self._motions.about).any(axis=1))
        self._states, self._promised = place.states, np.inf
        integrate(self._motions, rows, self._samples, rows, place.about[rows])
        self._linearised(self._rows)
        self._steps, _ = self._step()

    def _integrate(self, rows: IntArray, slot: FloatArray) -> None:
        integrate(self._motions, rows, self._samples, rows, slot[rows - 1])

    def _linearised(self, rows: IntArray | None) -> float:
        """Linearise some links where the search stands; return twice the cost of all."""
        link, parts = self._chain.link, (self._motions, self._senses, self._prior)
        if rows is not None:
            linearise(link, self._states, *parts, rows, 0)
        return self._cost()

    def _cost(self) -> float:
        return float(self._chain.link[:, -1, -1].sum())

    def _step(self) -> tuple[FloatArray, float]:
        self._chain.begin(0)
        try:
            self._chain.eliminate(0, self._n - 1)
            return self._chain.step(0, self._n - 1)
        except OpenStateError as error:
            raise error.at(float(self._samples.t_s[error.row])) from error

    def _moved(self) -> States:
        """Return the states that the last step leads to."""
        moved = self._states.copied()
        move(self._states, self._steps, 0, moved, 0, wholly=True)
        moved.constants[:] += self._steps[0, STATE:]
        return moved

    def _marginals(self) -> Marginals:
        return self._chain.marginals(0, self._n - 1)

    def solution(self, *, converged: bool) -> Solution:
        """Return what the last step leads to, with its covariances."""
        marginals, states = self._marginals(), self._moved()
        return Solution(
            R_nb=states.R_nb,
            p_n_m=states.p_n_m,
            v_n_mps=states.v_n_mps,
            slot=states.slot,
            covariance=marginals.covariance,
            cross=marginals.cross,
            converged=converged,
            cost=self._cost(),
            shared=SharedSolution(
                value=states.constants,
                covariance=np.broadcast_to(marginals.border, (self._n, *marginals.border.shape)),
                cross=marginals.beside,
            ),
        )
