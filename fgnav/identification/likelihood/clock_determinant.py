"""What the determinant of the states says of a clock, which the joint minimum does not know.

A measurement of GNSS is carried from its keyframe by a time s (``graph.delayed``), over which its
velocity has errors: the greater s, on either side, the more states can bend to fit, and the less is
left of the residuals. With states integrated out the likelihood is that of the joint minimum times
``det(H)^-1/2`` [1]_, H the information of the states. By whitened Jacobians A of the measurements,
their derivatives A' and A'' by s, and smoothed covariances P of all states

    added = d2(ln det H)/ds2 / 2 = tr(A' P A'T + A P A''T) - tr(C C + B D)
    B = A P AT      C = A' P AT      D = A' P A'T

about s = 0, where its first derivative is zero: smoothing has no direction of time. The joint
minimum's curvature is too great in turn, as the slope of residuals by s is that of smoothed states
with their errors, of covariance P. Its expectation exceeds the clock's information by

    excess = tr(D) - tr(B D)

A search with the information ``added`` about zero ends where the likelihood is greatest. Of one
step from tags as they are the gradient is right, and ``information - excess`` the curvature. The
estimate scatters by all of the joint minimum's information, the excess too (``FlightConstant``).

References
----------
.. [1] Tierney, Kadane: Accurate approximations for posterior moments and marginal densities,
   Journal of the American Statistical Association 81, 1986.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.delayed import CLOCK_OFFSET, CLOCK_RATE
from fgnav.graph.delayed_kernel import PPM
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.linear_chain import Covariances

NAMES = CLOCK_OFFSET, CLOCK_RATE
_STEP_S = 1e-3  # of difference quotients: motions change in more, rounding is far less
# Share of the clock's information below which it is left out: a tenth moves a minimum by a tenth of
# the tags' error at most, which steps take back, and its sigma by a twentieth.
_BENT = 0.1
_FAINT = 1e-3  # of what keyframes so far apart add, where the sum ends


class ClockDeterminant(NamedTuple):
    """What the determinant says of offset and rate, (2,) each, 1/s2 and 1/ppm2."""

    added: FloatArray
    excess: FloatArray

    @classmethod
    def of(
        cls,
        problem: SmoothingProblem,
        states: States,
        covariances: Covariances,
        since_s: FloatArray,
        factors: tuple[FloatArray, ...],
    ) -> "ClockDeterminant":
        """Return what it says at tags as they are.

        Parameters
        ----------
        problem : SmoothingProblem
            With a clock among its constants.
        states : States
            At its minimum, the clock's offset and rate zero.
        covariances : Covariances
            There.
        since_s : ndarray, shape (n,)
            From the time at which the clock's offset holds.
        factors : tuple of ndarray, shapes (k,)
            On the standard deviations of each kind of measurement.
        """
        offset = problem.constants.column(CLOCK_OFFSET)
        n, D = covariances.diagonal.shape[:2]
        kinds = []
        for one, factor in zip(problem.measurements, factors, strict=True):
            ends = _jacobians(one, states.at(one.row), offset) / factor[:, None, None]
            rows = np.zeros((3, n, ends.shape[2], D))
            rows[:, one.row] = ends
            if rows[1].any():  # else no clock matters to it
                kinds.append(rows)
        if not kinds:
            return cls(np.zeros(2), np.zeros(2))
        added, excess = _by_keyframe(np.concatenate(kinds, axis=2), covariances)
        weights = np.stack([np.ones(n), (PPM * since_s) ** 2])
        return cls((weights @ added).clip(0), (weights @ excess).clip(0))

    def bends(self, constants: Constants, covariance: FloatArray) -> bool:
        """Return whether it is more than a part of what a chain has of the clock.

        ``covariance``: of the constants, (b, b), by the chain.
        """
        shares = []
        for name, added in zip(NAMES, self.added.tolist(), strict=True):
            i = constants.column(name)
            part = next(one for one in constants.parts if one.name == name)
            shares.append(added * covariance[i, i] / (1.0 - part.added * covariance[i, i]))
        return bool(max(shares) > _BENT)

    def corrected(
        self, constants: Constants, value: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the clock's scoring step among those of all constants, (b,), and (b, b).

        Of a chain linearised at tags as they are: from there the gradient is right.
        """
        for name, excess in zip(NAMES, self.excess.tolist(), strict=True):
            i = constants.column(name)
            part = next(one for one in constants.parts if one.name == name)
            solved = 1 / covariance[i, i]
            before = 1 / float(part.covariance[0, 0])
            left = float(replace(part, excess=excess).information(solved))
            of_flight = max(solved - before, np.finfo(np.float64).tiny)  # of rounding alone: none
            share = max(1.0 - excess / of_flight, 0.0)
            gain = covariance[:, i] * solved
            value = value + gain * value[i] * (share * solved / left - 1.0)
            covariance = covariance + np.outer(gain, gain) * (1 / left - 1 / solved)
        return value, covariance


def on_time(constants: Constants, value: FloatArray) -> FloatArray:
    """Return constants, (b,), with a clock as tags are."""
    value = value.copy()
    value[[constants.column(name) for name in NAMES]] = 0.0
    return value


def _jacobians(one: Measurement, at: States, column: int) -> FloatArray:
    """Return a measurement's Jacobians and their first two derivatives by s, (3, k, m, D)."""
    which, unit = np.arange(len(one.row)), np.eye(len(at.constants))[column]

    def by(s: float) -> FloatArray:  # the offset is minus s
        return one.linearise(at._replace(constants=at.constants - s * unit), which).state

    before, now, after = by(-_STEP_S), by(0.0), by(_STEP_S)
    curved = (after - 2 * now + before) / _STEP_S**2
    return np.stack([now, (after - before) / (2 * _STEP_S), curved])


def _by_keyframe(rows: FloatArray, covariances: Covariances) -> tuple[FloatArray, FloatArray]:
    """Return each keyframe's share, (n,), of what determinants tell, and of the excess.

    Parameters
    ----------
    rows : ndarray, shape (3, n, m, D)
        Of all measurements: Jacobians and their derivatives.
    covariances : Covariances
    """
    A, slope, curved = rows
    P, cross = covariances.given_constants
    lead = np.linalg.solve(P[1:], cross.swapaxes(1, 2)).swapaxes(1, 2)  # from the next to this
    n = len(P)
    alone = np.einsum("kmd,kde,kme->k", slope, P, slope, optimize=True)
    added = alone + np.einsum("kmd,kde,kme->k", A, P, curved, optimize=True)
    excess, apart = alone.copy(), P
    for lag in range(n):
        if lag:
            apart = lead[: n - lag] @ apart[1:]  # of each with the one so much later
        of, to = slice(0, n - lag), slice(lag, n)
        both = np.stack([A[of], slope[of]]) @ apart
        later = np.stack([A[to], slope[to]]).swapaxes(2, 3)
        (B, BC), (C, D) = (one @ later for one in both)
        crossed = np.einsum("kij,kij->k", C, BC)
        twice = np.einsum("kij,kij->k", B, D)
        times = 2.0 if lag else 1.0
        added[of] -= times * (crossed + twice)
        excess[of] -= times * twice
        if np.abs(crossed).sum() + np.abs(twice).sum() < _FAINT * alone.sum() / n:
            break
    return added, excess
