"""Noise identified from the flight itself: what the measurements' own consistency asks for."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.estimate import Consistency
from fgnav.flight import Flight
from fgnav.integers.resolver import Resolver
from fgnav.methods.smoother import Batch

_SCALED = ("array phases", "position", "velocity")
_ROUNDS = 8
_SETTLED = 0.1  # from 1, of the factor on a variance: the noise is as told
_GATE = 0.01  # share of right measurements beyond it
_HONEST = (0.005, 0.02)  # shares beyond it that are near enough
_FEWEST = 30  # measurements of a kind that speak for it
_FARTHEST = 100.0  # a variance is changed by no more: beyond, it is not noise that is wrong
_DEAF = 0.2  # of what was asked for: less of a response is none
_TOLD = 0.05  # a standard deviation that changes by less is as stated


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TunedFlight:
    """A flight whose stated noise agrees with its residuals.

    Attributes
    ----------
    flight : Flight
    factors : dict of str to float
        Of standard deviations, by kind of measurement: ``"array phases"``, ``"position"``,
        ``"velocity"``.
    settled : bool
        Whether the search ended.
    """

    flight: Flight
    factors: dict[str, float]
    settled: bool

    @property
    def notes(self) -> tuple[str, ...]:
        """What was changed, one sentence each."""
        changed = {what: factor for what, factor in self.factors.items() if abs(factor - 1) > _TOLD}
        told = tuple(
            f"Tuned: noise of {what} is taken as {factor:.2g} times what the flight states."
            for what, factor in changed.items()
        )
        if not self.settled:
            return (*told, "Tuning did not settle: residuals still contradict the noise.")
        return told or ("Tuned: the noise is as the flight states.",)


def tuned(flight: Flight, resolver: Resolver) -> TunedFlight:
    """Return a flight with variances of phase, position (code) and velocity (Doppler) told by it.

    By variance components: the batch is solved, and each kind's variance multiplied by the mean of
    its normalised innovations squared, each held against the solution without it, until that is 1;
    or, where errors have heavy tails, until the 99 % gate turns away 1 %. Truth takes no part.
    Accelerometer and gyroscope keep their stated noise: positions and velocities between which they
    lead say too little of it.

    Parameters
    ----------
    flight : Flight
    resolver : Resolver
        Of the integers.

    Raises
    ------
    NoSolutionError
        If the batch has none.

    References
    ----------
    Foerstner, Ein Verfahren zur Schaetzung von Varianz- und Kovarianzkomponenten, 1979: redundancy
    by group; here every measurement's own, by deletion.
    """
    factors: dict[str, float] = {}
    before: dict[str, float] = {}
    deaf: set[str] = set()  # kinds on which the stated noise has no say
    batch, told = Batch(resolver=resolver), flight
    for _ in range(_ROUNDS):
        consistency = batch(told).consistency
        asked = {c.what: _asked(c) for c in consistency if c.what in _SCALED and c.count >= _FEWEST}
        if not asked:
            raise NoSolutionError(
                f"flight {flight.name}: tuning needs {_FEWEST} measurements of a kind or more"
            )
        heard = {k: v for k, v in before.items() if k in asked and abs(v - 1) >= _SETTLED}
        deaf |= {k for k, v in heard.items() if abs(asked[k] - v) < _DEAF * abs(v - 1)}
        before = asked
        asked = {what: factor for what, factor in asked.items() if what not in deaf}
        if deaf & factors.keys():
            factors = {what: factor for what, factor in factors.items() if what not in deaf}
            told = _louder(flight, factors)
        if all(abs(factor - 1) < _SETTLED for factor in asked.values()):
            return TunedFlight(flight=told, factors=factors, settled=True)
        for what, factor in asked.items():
            bound = (1 / np.sqrt(_FARTHEST), np.sqrt(_FARTHEST))
            factors[what] = float(np.clip(factors.get(what, 1.0) * np.sqrt(factor), *bound))
        told = _louder(flight, factors)
    return TunedFlight(flight=told, factors=factors, settled=False)


def _asked(told: Consistency) -> float:
    """Return the factor on the variance that mean and tail of the squares ask for."""
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: half a second

    if told.nis < 1 + _SETTLED and _HONEST[0] <= told.beyond_99 <= _HONEST[1]:
        return 1.0
    if told.beyond_99 <= _GATE:
        return told.nis
    freedom = told.freedom / told.count
    return max(told.nis, float(chdtri(freedom, _GATE) / chdtri(freedom, told.beyond_99)))


def _louder(flight: Flight, factors: dict[str, float]) -> Flight:
    """Return a flight with standard deviations multiplied by factors of their kinds."""
    phase, position, velocity = (factors.get(what, 1.0) for what in _SCALED)
    noise, fixes = flight.gnss_noise, flight.fixes
    if flight.observations is not None:
        noise = replace(
            noise,
            phase_m=noise.phase_m * phase,
            code_m=noise.code_m * position,
            doppler_mps=noise.doppler_mps * velocity,
        )
    elif fixes is not None:
        sigma = fixes.velocity_sigma_mps
        fixes = replace(
            fixes,
            position_sigma_m=fixes.position_sigma_m * position,
            velocity_sigma_mps=None if sigma is None else sigma * velocity,
        )
    return replace(flight, gnss_noise=noise, fixes=fixes)
