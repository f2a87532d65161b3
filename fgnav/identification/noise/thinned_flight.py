"""A thinned flight whose chain is linearised near its minimum at noises, and what that says."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.sensors.rest import AT_REST, Rest
from fgnav.graph.delayed import CLOCK_RATE
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.motion import NoiseParts
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.clock_determinant import ClockDeterminant, on_time
from fgnav.identification.likelihood.linear_chain import AtRest, LinearChain, Score
from fgnav.identification.likelihood.thinned import APART_S, FIELDS, thinned
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.seen_noise import greatest_noise
from fgnav.identification.noise.stated import scalable, unstated
from fgnav.identification.tested_constants import LEVER_ARM, TURNS, depending, times_of, vector_of
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.types.flight import Flight, Imu

_ITERATIONS = 10
_NEAR = 0.01  # of the cost, what a step may promise of it where noise is judged: 1 % of a variance


class ThinnedFlight(NamedTuple):
    """A thinned flight, and what of its noise is a component."""

    problem: SmoothingProblem
    parts: NoiseParts
    scalable: tuple[str, ...]
    unstated: tuple[str, ...]
    imu: Imu | None
    greatest: dict[str, float]  # factors of the unit's white noise that its samples can hold
    since_s: FloatArray  # (n,), from the time at which the clock's offset holds
    at_rest: AtRest | None = None

    @classmethod
    def of(
        cls,
        flight: Flight,
        prepared: PreparedFlight,
        extra: tuple[FlightConstant, ...],
        apart_s: float = APART_S,
    ) -> "ThinnedFlight":
        """Return a flight by its problem, with the noise as the flight has it.

        ``extra``: clock, delay and lever arm, those that the problem has not among its constants;
        ``apart_s`` as of ``thinned``.
        """
        small = thinned(prepared.problem, extra, apart_s)
        at_keyframes = prepared.timed.at(np.searchsorted(prepared.problem.t_s, small.t_s))
        small = depending(small, at_keyframes, extra)
        rest = None if flight.observations is not None else prepared.rest
        parts = small.motion.noise_parts()
        return cls(
            problem=small,
            parts=parts if rest is None else _with_rest(parts, rest.share(small.t_s)),
            scalable=scalable(flight),
            unstated=unstated(flight),
            imu=flight.imu,
            greatest=_greatest(flight.imu, small),
            since_s=at_keyframes.since_s,
            at_rest=None if rest is None else _at_rest(small, rest),
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Components of its chain: of the motion, then of measurements, each with those at rest."""
        at_rest = () if self.at_rest is None else self.at_rest.names
        measured: tuple[str, ...] = ()
        for one in self.problem.measurements:
            if one.name in self.scalable:
                measured += (one.name, one.name + AT_REST) if one.name in at_rest else (one.name,)
        return (*self.parts.names, *measured)

    def logarithms(self, factors: dict[str, float]) -> FloatArray:
        """Return theta, (c,), of factors by components; 0 of all others."""
        return np.asarray(np.log([factors.get(name, 1.0) for name in self.names]))

    @property
    def is_stated(self) -> BoolArray:
        """Which of them the flight states, (c,)."""
        return ~np.isin([name.removesuffix(AT_REST) for name in self.names], self.unstated)

    def likelihood_at(self, factors: dict[str, float]) -> float:
        """Return the logarithm of its likelihood at factors on its noise.

        Raises
        ------
        NoSolutionError
            If the chain has no minimum there.
        """
        theta = self.logarithms(factors)
        return self.descended(self.problem.start, theta, _ITERATIONS)[2].log_likelihood

    def score_at(self, factors: dict[str, float]) -> Score | None:
        """Return likelihood and cost at factors on its noise; None where there is no minimum."""
        try:
            return self.descended(self.problem.start, self.logarithms(factors), _ITERATIONS)[2]
        except NoSolutionError:
            return None

    def is_misfit(self, score: Score) -> bool:
        """Return whether what is left of all measurements is beyond chance."""
        rows = sum(int(one.freedom.sum()) for one in self.problem.measurements)
        return bool(score.cost - score.promised > chdtri(rows, FALSE_ALARM))

    def descended(
        self, states: States, theta: FloatArray, most: int
    ) -> tuple[LinearChain, States, Score]:
        """Return the chain linearised near its minimum at noises theta, by Gauss-Newton.

        Where the cost rises the step is halved.
        """
        best: Score | None = None
        at, share = states, 1.0
        for _ in range(most):
            chain = LinearChain.of(self.problem, at, self.parts, self.scalable, self.at_rest)
            score = chain.score(theta, whole=False)
            if score is not None and score.promised < _NEAR * score.cost:
                return chain, at, score
            if score is not None and (best is None or score.cost < best.cost):
                best, states, share = score, at, 1.0
            else:
                share /= 3
            if best is None:
                break
            at = states.moved(share * best.steps, share * best.constant_steps)
        raise NoSolutionError("noise: the chain has no minimum about which to identify it")

    def identified(
        self,
        states: States,
        score: Score,
        noise: tuple[FloatArray, FloatArray, BoolArray],
        likelihood: float,
    ) -> Identified:
        """Return what the flight says where its chain is linearised.

        Parameters
        ----------
        states : States
        score : Score
        noise : tuple of ndarray, shapes (c,), (c,), (c,)
            Factors, sigmas of their logarithms, and which factors are used.
        likelihood : float
            Penalised, its logarithm.
        """
        constants = self.problem.constants
        value: FloatArray = states.constants + score.constant_steps
        factor, sigma, used = noise
        bent = self._bent_clock(states, np.where(used, factor, 1.0))
        if bent is not None:
            value = bent.value
            score = score._replace(constant_covariance=bent.covariance)
        determinant = None if bent is None else bent.determinant
        return Identified(
            names=self.names,
            factor=factor,
            sigma=sigma,
            used=used,
            stated=self.is_stated,
            greatest=np.array([self.greatest.get(name, np.inf) for name in self.names]),
            times=replace(times_of(constants, value, score), determinant=determinant),
            arm=vector_of(LEVER_ARM, constants, value, score),
            turn=vector_of(TURNS, constants, value, score),
            likelihood=likelihood,
        )

    def _bent_clock(self, states: States, factor: FloatArray) -> "_BentClock | None":
        """Return the constants by a chain linearised at tags as they are; None of no bent clock.

        ``factor``: on noises, (c,).
        """
        constants = self.problem.constants
        if constants.column(CLOCK_RATE) < 0:
            return None
        at = states._replace(constants=on_time(constants, states.constants))
        chain = LinearChain.of(self.problem, at, self.parts, self.scalable, self.at_rest)
        score = chain.score(np.log(factor))
        if score is None or score.covariances is None:
            return None
        determinant = ClockDeterminant.of(
            self.problem, at, score.covariances, self.since_s, self._factors(factor)
        )
        P = score.constant_covariance
        if not determinant.bends(constants, P):
            return None
        value = at.constants + score.constant_steps
        return _BentClock(determinant, *determinant.corrected(constants, value, P))

    def _factors(self, factor: FloatArray) -> tuple[FloatArray, ...]:
        """Return factors on the sigmas of each kind of measurement, (k,), by those of noises."""
        of, at_rest = dict(zip(self.names, factor.tolist(), strict=True)), self.at_rest
        factors = []
        for one in self.problem.measurements:
            resting = np.zeros(len(one.row), dtype=np.bool_)
            if at_rest is not None and one.name in at_rest.names:
                resting = at_rest.row[one.row]
            moving = of.get(one.name, 1.0)
            factors.append(np.where(resting, of.get(one.name + AT_REST, moving), moving))
        return tuple(factors)


class _BentClock(NamedTuple):
    """Constants, (b,), their covariance, (b, b), and what they are corrected by."""

    determinant: ClockDeterminant
    value: FloatArray
    covariance: FloatArray


def _greatest(imu: Imu | None, problem: SmoothingProblem) -> dict[str, float]:
    """Return the factors on white noise that the unit's samples can hold between measurements."""
    if imu is None or len(problem.t_s) < 2:
        return {}
    greatest = greatest_noise(imu, float(np.median(np.diff(problem.t_s))))
    return {name: density / getattr(imu, FIELDS[name]) for name, density in greatest.items()}


def _at_rest(problem: SmoothingProblem, rest: Rest) -> AtRest:
    """Return which measurements of fixes a thinned flight has at rest."""
    row = rest.contains(problem.t_s)
    names = [one.name for one in problem.measurements if row[one.row].any()]
    return AtRest(row, tuple(name for name in names if name in ("position", "velocity")))


def _with_rest(parts: NoiseParts, share: FloatArray) -> NoiseParts:
    """Return the parts of a motion with white noise at rest as parts of their own.

    ``share``: of each interval, (n - 1,), that is at rest.
    """
    if not share.any():
        return parts
    white = [parts.names.index(name) for name in WHITE if name in parts.names]
    share = share[:, None, None, None]
    moving, resting = parts.parts.copy(), parts.parts[:, white] * share
    moving[:, white] *= 1.0 - share
    return NoiseParts(
        (*parts.names, *(parts.names[i] + AT_REST for i in white)),
        np.concatenate([moving, resting], axis=1),
        parts.rest,
    )
