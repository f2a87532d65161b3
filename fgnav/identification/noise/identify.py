"""Noise, delays and clocks of a flight from the flight itself, and what contradicts the stated.

What a flight does not state is found by the marginal likelihood of its linearised chain with a
log-normal prior about usual figures. What it states is believed until the likelihood excludes it,
and half as much again or two thirds of it, too; then the identified noise takes its place, and a
note says so. The offset and the rate of the inertial unit's clock, and the delay of fix velocities,
are constants of the same chain: its solution is a Newton step of their likelihood.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.sensors.rest import AT_REST
from fgnav.identification.likelihood.thinned import FIELDS
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.noise_search import (
    ITERATIONS,
    TEST_SIGMA,
    louder_by_correlation,
    searched,
)
from fgnav.identification.noise.stated import INSTRUMENTS
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch

_DOUBTED = 2.5  # sigmas: one of eight components in ten flights
_DAMPED = 30  # steps to the minimum as stated
# Times as loud as stated an instrument begins that is in doubt: it tells next to nothing then.
_IN_DOUBT = 100.0


def identify(flight: ThinnedFlight, factors: dict[str, float] | None = None) -> Identified:
    """Return what the flight says of its noise and times, linearised where its problem begins.

    Parameters
    ----------
    flight : ThinnedFlight
    factors : dict of str to float, optional
        Of an earlier search, to begin with.

    Raises
    ------
    NoSolutionError
        If the chain has no solution, or ends at none.
    """
    stated = None if flight.unstated or factors else _as_stated(flight)
    if stated is not None and not (stated.is_noise_doubted or stated.is_off):
        return stated.identified
    try:
        free = searched(flight, factors or {})
    except NoSolutionError:
        if stated is None or not stated.stands_alone:
            raise
        return replace(stated.identified, has_no_minimum=True)
    free = _unless_a_bias(flight, _unless_an_instrument(flight, free))
    if stated is None:
        return free
    if free.likelihood <= stated.identified.likelihood + EXCLUDED:
        return stated.identified
    # Noise so loud that a turn no longer shows stands for it: the caller is to take it back.
    return free if free.is_turned else replace(free, turn=stated.identified.turn)


def as_stated(flight: ThinnedFlight) -> Identified:
    """Return what a flight says where noise is as stated, which has no other minimum.

    Raises
    ------
    NoSolutionError
        If there is none either.
    """
    stated = _as_stated(flight)
    if stated is None or not stated.stands_alone:
        raise NoSolutionError("noise: the chain has no minimum about which to identify it")
    return stated.identified


class _AsStated(NamedTuple):
    """What a flight says with noise as stated, and whether that may be wrong, or times and arm."""

    identified: Identified
    is_noise_doubted: bool
    is_off: bool

    @property
    def stands_alone(self) -> bool:
        """Whether it counts where no other noise has a minimum."""
        return not self.is_noise_doubted or self.identified.is_turned


def _as_stated(flight: ThinnedFlight) -> _AsStated | None:
    """Return what a flight says with noise as stated; None where that has no solution."""
    zero = np.zeros(len(flight.names))
    try:  # damped: without a gyroscope full steps may turn too far
        start = solve_batch(flight.problem, most=_DAMPED).states
        chain, states, _ = flight.descended(start, zero, ITERATIONS)
    except NoSolutionError:
        return None
    score = chain.score(zero)
    if score is None:
        return None
    sigma = 1 / np.sqrt(np.diag(score.information) + TEST_SIGMA**-2)
    theta = sigma**2 * score.gradient
    is_used = np.zeros(len(theta), dtype=np.bool_)
    # What remains of all measurements is chi-square: a bias beyond its sigma shows there alone.
    # One step is short of a factor far below one: whatever two sigmas speak against is searched.
    is_quiet = (theta < 0) & np.isin(chain.names, INSTRUMENTS)  # instruments count if louder
    is_doubted = (np.abs(theta) > _DOUBTED * sigma) & ~is_quiet
    is_doubted |= louder_by_correlation(chain, score, theta, is_used)[1]
    identified = flight.identified(
        states, score, (np.ones(len(theta)), sigma, is_used), score.log_likelihood
    )
    vectors = (identified.arm, identified.turn)
    is_off = identified.times.significant.any() or any(v and v.significant for v in vectors)
    return _AsStated(identified, flight.is_misfit(score) or bool(is_doubted.any()), bool(is_off))


def _unless_a_bias(flight: ThinnedFlight, identified: Identified) -> Identified:
    """Return what is identified, or where the unit's noise contradicts, with a bias that walks.

    Noise puts velocities off by ``N sqrt(T)`` in a time T, a walk by ``q sqrt(T^3 / 3)``: a search
    that begins with the noise loud ends where a drift is noise. What is beyond any noise, or comes
    with another instrument's noise, may be that one's fault, which a walk would follow as well.
    """
    contradicted = {name.removesuffix(AT_REST) for name in identified.contradicted}
    if identified.exceeds_noise.any() or not FIELDS.keys() >= contradicted:
        return identified
    duration_s, likeliest = np.ptp(flight.problem.t_s), identified
    for sensor in WHITE:
        noise, walk = (getattr(flight.imu, FIELDS[one], None) for one in (sensor, f"{sensor} bias"))
        if sensor not in identified.contradicted or not (noise and walk):
            continue
        factor = identified.contradicted[sensor] * noise / walk * np.sqrt(3.0) / duration_s
        begin = dict.fromkeys(WHITE, 1.0) | {f"{sensor} bias": float(factor)}
        try:
            other = searched(flight, begin)
        except NoSolutionError:
            continue
        if other.likelihood > likeliest.likelihood + EXCLUDED:
            likeliest = other
    return likeliest


def _unless_an_instrument(flight: ThinnedFlight, identified: Identified) -> Identified:
    """Return what is identified, or where the unit's noise is beyond any, with a louder instrument.

    One instrument that contradicts the rest draws the search to a minimum where all rest is loud:
    a search that begins with that instrument loud ends at another.
    """
    if not identified.exceeds_noise.any():
        return identified
    for one in flight.problem.measurements:
        if one.name in INSTRUMENTS:
            try:
                other = searched(flight, {one.name: _IN_DOUBT})
            except NoSolutionError:
                continue
            if not other.exceeds_noise.any():
                return other
    return identified
