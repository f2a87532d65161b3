"""Noise, delays and clocks of a flight from the flight itself, and what contradicts the stated.

What a flight does not state is found by the marginal likelihood of its linearised chain with a
log-normal prior about usual figures. What it states is believed until the likelihood excludes it,
and half as much again or two thirds of it, too; then what is found takes its place, and a note says
so. The offset and the rate of the inertial unit's clock, and the delay of fix velocities, are
constants of the same chain: its solution is a Newton step of their likelihood.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.graph.correlation import correlated
from fgnav.graph.delayed import TimedMotion
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.motion import NoiseParts
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.identification.begin import ABOVE, WHITE, begins, widened
from fgnav.identification.likelihood.linear_chain import LinearChain, Score
from fgnav.identification.likelihood.search import Found, search
from fgnav.identification.likelihood.thinned import FIELDS, thinned
from fgnav.identification.seen_noise import greatest_noise
from fgnav.identification.stated import INSTRUMENTS, scalable, unstated
from fgnav.identification.tested_constants import (
    LEVER_ARM,
    SIGMAS,
    TURNS,
    TestedVector,
    Times,
    depending,
    times_of,
    vector_of,
)
from fgnav.identification.track.windows import EXCLUDED, FALSE_ALARM
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight

# Log-normal sigmas of what nobody stated: white noise of small units in motion is 1 to 40 times
# the figures of their data sheets (docs/model.md), walks are known by their order.
_WHITE_SIGMA, _WALK_SIGMA = np.log(5.0), np.log(10.0)
# Of what is stated while it is tested: as good as nothing.
_TEST_SIGMA = np.log(30.0)
# A standard deviation off by less leaves squared errors of 3 between 1.3 and 6.8.
_TOLERATED = np.log(1.5)
_DOUBTED = 2.5  # sigmas: one of eight components in ten flights
_DAMPED, _ITERATIONS = 30, 10  # steps to the minimum as stated, and of Gauss-Newton elsewhere
_ROUNDS = 20  # of noise at states, and states at noise
_ALIKE = 0.5  # correlation of neighbours whose errors are more of what stays than of noise
_NEAR = 0.01  # of the cost, what a step may promise of it where noise is judged: 1 % of a variance


_VECTORS = (LEVER_ARM, TURNS)
# Times as loud as stated an instrument begins that is in doubt: it tells next to nothing then.
_IN_DOUBT = 100.0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Identified:
    """What a flight says of its own noise and times.

    Attributes
    ----------
    names : tuple of str
        Components: ``graph.types.motion.INERTIAL_NOISES``, ``"position"``, ``"velocity"``.
    factor : ndarray, shape (c,)
        What is found over what the flight states or, failing that, is usual.
    sigma : ndarray, shape (c,)
        Of its logarithm.
    used : ndarray of bool, shape (c,)
        Which replace what the flight has: not stated, or contradicted.
    stated : ndarray of bool, shape (c,)
    greatest : ndarray, shape (c,)
        Factor that the unit's samples can hold; infinite of what is no white noise of the unit.
    times : Times
    arm, turn : TestedVector or None
        Lever arm and turn of the array; None where they were not tested. A turn is to be confirmed
        by a search with it taken back.
    likelihood : float
        Penalised, its logarithm.
    """

    names: tuple[str, ...]
    factor: FloatArray
    sigma: FloatArray
    used: BoolArray
    stated: BoolArray
    greatest: FloatArray
    times: Times
    arm: TestedVector | None
    turn: TestedVector | None
    likelihood: float

    @property
    def is_no_noise(self) -> BoolArray:
        """Return which of the unit's noises, (c,), are contradicted, and louder than any noise.

        That of what its samples can hold, as of what is stated: by the same test.
        """
        with np.errstate(divide="ignore"):
            beyond = np.log(self.factor / self.greatest)
        louder = (beyond > 0) & _contradicted(beyond, self.sigma)
        return np.asarray(self.used & self.stated & louder)

    @property
    def beyond_noise(self) -> dict[str, float]:
        """Factors of the unit's stated white noises that would be louder than any noise."""
        rows = np.flatnonzero(self.is_no_noise).tolist()
        return {self.names[i]: float(self.factor[i]) for i in rows}

    @property
    def is_turned(self) -> bool:
        """Whether the array and the inertial unit are turned against each other."""
        return self.turn is not None and self.turn.significant

    def scaled(self, by: dict[str, float]) -> "Identified":
        """Return the same with some noises times factors, of what is found, or else stated."""
        times = np.array([by.get(name, 1.0) for name in self.names])
        changed, found = times != 1.0, np.where(self.used, self.factor, 1.0)
        factor = np.where(changed, found * times, self.factor)
        return replace(self, factor=factor, used=self.used | changed)

    def on_time(self) -> "Identified":
        """Return the same with the unit's clock corrected by what it is off."""
        value = np.concatenate([[0.0, 0.0], self.times.value[2:]])
        return replace(self, times=replace(self.times, value=value, squares=0.0))

    @property
    def factors(self) -> dict[str, float]:
        """Factors of components that are replaced."""
        return {
            name: float(factor)
            for name, factor, used in zip(self.names, self.factor, self.used, strict=True)
            if used
        }


def identify(
    flight: Flight,
    problem: SmoothingProblem,
    timed: TimedMotion,
    extra: tuple[FlightConstant, ...],
    known: dict[str, float] | None = None,
) -> Identified:
    """Return what the flight says of its noise and times, linearised where its problem begins.

    Parameters
    ----------
    flight : Flight
    problem : SmoothingProblem
        Of the whole flight, with the noise as the flight has it.
    timed : TimedMotion
        At its keyframes.
    extra : tuple of FlightConstant
        Clock, delay and lever arm, those that the problem has not among its constants.
    known : dict of str to float, optional
        Factors of a search before, to begin with.

    Raises
    ------
    NoSolutionError
        If the chain has no solution, or ends at none.
    """
    small = thinned(problem, extra)
    there = timed.at(np.searchsorted(problem.t_s, small.t_s))
    components = scalable(flight)
    stated = {name: name not in unstated(flight) for name in (*FIELDS, *components)}
    small = depending(small, there, extra)
    small_flight = _Flight(small, small.motion.noise_parts(), components, _greatest(flight, small))
    as_stated = _as_stated(small_flight) if all(stated.values()) and not known else None
    if as_stated is not None and not (as_stated.is_noise_doubted or as_stated.is_off):
        return as_stated.told
    try:
        found = _searched(small_flight, stated, known or {})
    except NoSolutionError:
        if as_stated is None or (as_stated.is_noise_doubted and not as_stated.told.is_turned):
            raise
        return as_stated.told
    found = _unless_an_instrument(small_flight, stated, found)
    if as_stated is None:
        return found
    if found.likelihood <= as_stated.told.likelihood + EXCLUDED:
        return as_stated.told
    # Noise so loud that a turn no longer shows stands for it: whoever asks is to take it back.
    return found if found.is_turned else replace(found, turn=as_stated.told.turn)


class _AsStated(NamedTuple):
    """What a flight says with noise as stated, and whether that may be wrong, or times and arm."""

    told: Identified
    is_noise_doubted: bool
    is_off: bool


class _Flight(NamedTuple):
    """A thinned flight, and what of its noise is a component."""

    problem: SmoothingProblem
    parts: NoiseParts
    scalable: tuple[str, ...]
    greatest: dict[str, float]  # factors of the unit's white noise that its samples can hold

    def limits(self, names: tuple[str, ...]) -> FloatArray:
        """Return the greatest factors of components, (c,)."""
        return np.array([self.greatest.get(name, np.inf) for name in names])

    def descended(
        self, states: States, theta: FloatArray, most: int
    ) -> tuple[LinearChain, States, Score]:
        """Return the chain linearised near its minimum at noises theta, by Gauss-Newton.

        Where the cost rises the step is halved.
        """
        best: Score | None = None
        at, share = states, 1.0
        for _ in range(most):
            chain = LinearChain.of(self.problem, at, self.parts, self.scalable)
            score = chain.score(_padded(theta, chain), whole=False)
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


def _greatest(flight: Flight, problem: SmoothingProblem) -> dict[str, float]:
    """Return the factors on white noise that the unit's samples can hold between measurements."""
    if flight.imu is None or len(problem.t_s) < 2:
        return {}
    greatest = greatest_noise(flight.imu, float(np.median(np.diff(problem.t_s))))
    return {name: density / getattr(flight.imu, FIELDS[name]) for name, density in greatest.items()}


def _padded(theta: FloatArray, chain: LinearChain) -> FloatArray:
    """Return theta with zeros for components that it lacks."""
    return np.concatenate([theta, np.zeros(len(chain.names) - len(theta))])


def _as_stated(flight: _Flight) -> _AsStated | None:
    """Return what a flight says with noise as stated; None where that has no solution."""
    try:  # damped: without a gyroscope full steps may turn too far
        start = solve_batch(flight.problem, most=_DAMPED).states
        chain, states, _ = flight.descended(start, np.zeros(0), 2)
    except NoSolutionError:
        return None
    score = chain.score(np.zeros(len(chain.names)))
    if score is None:
        return None
    sigma = 1 / np.sqrt(np.diag(score.information) + _TEST_SIGMA**-2)
    theta = sigma**2 * score.gradient
    constants = states.constants + score.constant_steps
    times = times_of(flight.problem.constants, constants, score)
    arm, turn = (vector_of(n, flight.problem.constants, constants, score) for n in _VECTORS)
    # What is left of all measurements is chi-square: a bias beyond its sigma shows there alone.
    # One step is short of a factor far below one: whatever two sigmas speak against is searched.
    nothing = np.zeros(len(theta), dtype=np.bool_)
    doubted = (np.abs(theta) > _DOUBTED * sigma) & ~_quiet(chain, theta)
    doubted |= _with_correlation(chain, score, theta, nothing)[1]
    rows = sum(int(one.freedom.sum()) for one in flight.problem.measurements)
    misfits = score.cost - score.promised > chdtri(rows, FALSE_ALARM)
    told = Identified(
        names=chain.names,
        factor=np.ones(len(theta)),
        sigma=sigma,
        used=nothing,
        stated=~nothing,
        greatest=flight.limits(chain.names),
        times=times,
        arm=arm,
        turn=turn,
        likelihood=score.log_likelihood,
    )
    is_off = times.significant.any() or any(v is not None and v.significant for v in (arm, turn))
    return _AsStated(told, bool(misfits or doubted.any()), bool(is_off))


def _unless_an_instrument(
    flight: _Flight, stated: dict[str, bool], found: Identified
) -> Identified:
    """Return what is found, or where it makes the inertial unit's noise none, with a louder other.

    One instrument that contradicts the rest draws the search to a minimum where all rest is loud:
    from where it is loud itself, another is found.
    """
    if not found.is_no_noise.any():
        return found
    for one in flight.problem.measurements:
        if one.name in INSTRUMENTS:
            try:
                other = _searched(flight, stated, {one.name: _IN_DOUBT})
            except NoSolutionError:
                continue
            if not other.is_no_noise.any():
                return other
    return found


def _searched(flight: _Flight, stated: dict[str, bool], known: dict[str, float]) -> Identified:
    """Return the likeliest noises, begun ever louder until there are any.

    Linearised about what a faulty sensor draws the states to, a chain has no minimum.
    """
    *first, last = begins(flight.problem, known)
    for one in first:
        try:
            return _searched_from(flight, stated, *one)
        except NoSolutionError:
            continue
    return _searched_from(flight, stated, *last)


def _searched_from(
    flight: _Flight, stated: dict[str, bool], known: dict[str, float], louder: float
) -> Identified:
    """Return the likeliest noises: all free at first, then those that are not believed alone."""
    states, above = flight.problem.start, dict.fromkeys(WHITE, ABOVE * louder)
    if "gyroscope" not in flight.parts.names:
        begun = widened(flight.problem, known, louder)
        states, above = solve_batch(begun, most=_ITERATIONS).states, dict.fromkeys(WHITE, louder)
    sensors = [m.name for m in flight.problem.measurements if m.name in flight.scalable]
    names = (*flight.parts.names, *sensors)
    theta = np.log([known.get(n, above.get(n, 1.0)) for n in names])
    share, last = 1.0, np.zeros(0)
    for _ in range(_ROUNDS):
        chain, states, _ = flight.descended(states, theta, _ITERATIONS)
        is_stated = np.array([stated[name] for name in chain.names])
        before = _padded(theta, chain)
        found = _free(chain, before, is_stated)
        change = found.theta - before
        if np.abs(change)[: len(flight.parts.names)].max() < _TOLERATED:
            break
        if len(last) == len(change) and change @ last < 0.0:
            share /= 2  # noise and states undo each other's changes
        theta, last = before + share * change, change
    else:
        raise NoSolutionError("noise: it is another at every linearisation of the chain")
    found, theta, used = _kept(chain, found, is_stated)
    theta, used = _with_correlation(chain, found.score, theta, used)
    constants = states.constants + found.score.constant_steps
    arm, turn = (vector_of(n, flight.problem.constants, constants, found.score) for n in _VECTORS)
    return Identified(
        names=chain.names,
        factor=np.exp(theta),
        sigma=found.sigma,
        used=used,
        stated=is_stated,
        greatest=flight.limits(chain.names),
        times=times_of(flight.problem.constants, constants, found.score),
        arm=arm,
        turn=turn,
        likelihood=_penalised(chain, found, is_stated),
    )


def _penalised(chain: LinearChain, found: Found, is_stated: BoolArray) -> float:
    mean, sigma = _prior(is_stated, chain.names)
    return found.score.log_likelihood - float((((found.theta - mean) / sigma) ** 2).sum()) / 2


def _free(chain: LinearChain, begin: FloatArray, is_stated: BoolArray) -> Found:
    """Return the likeliest noises.

    Of positions that repeat, and of instruments, none that is less than stated.
    """
    prior, everything = _prior(is_stated, chain.names), np.ones(len(begin), dtype=np.bool_)
    position = is_stated & np.array([name == "position" for name in chain.names])
    held = position | is_stated & np.isin(chain.names, INSTRUMENTS)
    found = search(chain, begin, everything, prior, np.where(held, 0.0, -np.inf))
    repeats = found is not None and _err_alike(chain, found.score)
    if found is not None and (position & (found.theta == 0.0)).any() and not repeats:
        least = np.where(held & ~position, 0.0, -np.inf)
        found = search(chain, found.theta, everything, prior, least)
    if found is None:
        raise NoSolutionError("noise: the chain has no solution about which to identify it")
    return found


def _with_correlation(
    chain: LinearChain, score: Score, theta: FloatArray, used: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return theta and what is used, with instruments whose errors stay for many samples.

    White noise that is as loud at low frequencies has ``1 + 2 sum(rho)`` times the variance.
    """
    louder = theta.copy()
    for i in np.flatnonzero(np.isin(chain.names, INSTRUMENTS)):
        louder[i] += np.log(correlated(chain.residuals(chain.names[i], score))) / 2
    longer = (louder > theta) & (louder > _TOLERATED)
    return np.where(longer, louder, theta), used | longer


def _quiet(chain: LinearChain, theta: FloatArray) -> BoolArray:
    """Return which components are instruments that say less noise than stated."""
    return np.asarray((theta < 0) & np.isin(chain.names, INSTRUMENTS))


def _err_alike(chain: LinearChain, score: Score) -> bool:
    """Return whether positions agree better than stated because neighbours err alike.

    What stays with a receiver's positions for minutes is in their sigmas: that neighbours repeat to
    centimetres does not contradict metres.
    """
    if "position" not in chain.names:
        return False
    r = chain.residuals("position", score)
    return bool((r[1:] * r[:-1]).sum() > _ALIKE * (r**2).sum())


def _kept(
    chain: LinearChain, found: Found, is_stated: BoolArray
) -> tuple[Found, FloatArray, BoolArray]:
    """Return what is found with all as stated that is not contradicted, theta, and what is not.

    Of noises contradicted together each must be so beside the others alone.
    """
    theta, used = found.theta, ~is_stated | _contradicted(found.theta, found.sigma)
    while used.any() and not used.all():
        begin = np.where(used, theta, 0.0)
        again = search(chain, begin, used, _prior(is_stated, chain.names))
        if again is None:
            break
        still = used & (~is_stated | _contradicted(again.theta, again.sigma))
        if (still == used).all():
            return again, np.where(used, again.theta, theta), used
        used = still
    return found, theta, used


def _prior(is_stated: BoolArray, names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Return mean and sigma of theta: usual figures are where it is zero."""
    walk = np.array([name.endswith("bias") for name in names])
    sigma = np.where(is_stated, _TEST_SIGMA, np.where(walk, _WALK_SIGMA, _WHITE_SIGMA))
    return np.zeros(len(names)), sigma


def _contradicted(theta: FloatArray, sigma: FloatArray) -> BoolArray:
    return np.asarray((np.abs(theta) > _TOLERATED) & (np.abs(theta) > SIGMAS * sigma))
