"""Estimate noise, clock, latency and lever arm of a flight from the flight itself.

One marginal likelihood serves flights with and without phases. Its hyperparameters are the noises
of ``components`` and the errors of satellites; clock, latency and lever arm are constants of the
same problem. Timestamps are moved by the estimated clock until the estimate no longer changes.

References
----------
Groves: Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd edition,
2013, sections 14.3 and 17.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from fgnav.assembly.calibration_request import CalibrationRequest, calibration_requests
from fgnav.assembly.prepared import Build, PreparedFlight
from fgnav.assembly.settings import ProblemSettings
from fgnav.checks import FloatArray
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.types.problem import Problem
from fgnav.noise.calibration import (
    CLOCK,
    LATENCY,
    Calibrated,
    calibrated,
    with_latency_and_lever_arm,
)
from fgnav.noise.clock import ClockCorrection, middle_of_record_s, with_clock
from fgnav.noise.components import AT_REST, NoiseComponents, Standstill
from fgnav.noise.decimation import decimated
from fgnav.noise.nominal import scalable, unstated, with_factors, with_standstill
from fgnav.noise.posterior import NoisePosterior, Prior, correlated_noise, noise_posterior
from fgnav.noise.satellite_errors import satellite_error_factors, with_errors
from fgnav.process.hyperparameters import IntervalPriors
from fgnav.types.flight import Flight

_PASSES = 6  # of moved timestamps: each leaves a third or less of what is left
_STEEPEST = 2.0  # times a step: more is noise of the secant
_SETTLED_SIGMAS = 0.3
_UNCHANGED = 0.03  # of the logarithm of a standard deviation


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Hyperparameters:
    """Noise and time parameters estimated from a flight."""

    # On nominal standard deviations, by component; those that are as stated are left out.
    factors: Mapping[str, float] = field(default_factory=dict)
    sigmas: Mapping[str, float] = field(default_factory=dict)  # 1-sigma of their logarithms
    # Logarithms of the factors of all components, at which another search may begin.
    theta: Mapping[str, float] = field(default_factory=dict)
    # Factors on errors of satellites and on noise of codes.
    satellites: Mapping[str, float] = field(default_factory=dict)
    # What is added to the inertial unit's timestamps.
    clock: ClockCorrection = field(default_factory=ClockCorrection)
    middle_s: float = 0.0  # when the clock has that offset
    calibrated: tuple[Calibrated, ...] = ()  # clock, latency and lever arm

    @property
    def is_nominal(self) -> bool:
        """True if noise and times are nominal."""
        return not (self.factors or self.satellites or self.clock or self.significant)

    @property
    def significant(self) -> tuple[Calibrated, ...]:
        """Parameters of set-up that are not zero."""
        return tuple(one for one in self.calibrated if one.is_significant)

    def applied(self, flight: Flight) -> Flight:
        """Return a flight with this noise and these times."""
        return with_factors(self.clock.applied(flight, self.middle_s), self.factors)

    def settings(self, settings: ProblemSettings) -> ProblemSettings:
        """Return settings that estimate what is not zero, and have the noise at standstill."""
        requests = (*settings.calibration, *self._requests(settings))
        if self.clock:
            # Where a record goes on a problem states the offset at zero, not mid-record.
            clock = self.clock.at(-self.middle_s) if settings.causal else self.clock
            moved = float(clock.offset_s), float(clock.rate_ppm)
            requests = tuple(
                replace(one, moved=moved) if one.kind == CLOCK else one for one in requests
            )
        return replace(with_standstill(settings, self.factors), calibration=requests)

    def prepared(self, flight: Flight, settings: ProblemSettings, build: Build) -> PreparedFlight:
        """Return the problem of a flight with this noise and these times."""
        prepared = build(self.applied(flight), self.settings(settings))

        def rescaled(problem: Problem) -> Problem:
            phase = problem.phase and with_errors(problem.phase, self.satellites)
            return replace(problem, phase=phase)

        return prepared.changed(rescaled) if self.satellites else prepared

    def _requests(self, settings: ProblemSettings) -> tuple[CalibrationRequest, ...]:
        requested = [one.kind for one in settings.calibration]
        result = {one.kind: one for one in self.significant if one.kind not in requested}
        requests = calibration_requests(list(result))
        return tuple(
            replace(one, start=float(result[LATENCY].value[0])) if one.kind == LATENCY else one
            for one in requests
        )


def identified(
    flight: Flight, settings: ProblemSettings, build: Build
) -> tuple[Hyperparameters, PreparedFlight]:
    """Estimate noise, clock and latency of a flight, and build its problem with them.

    Parameters
    ----------
    flight : Flight
    settings : ProblemSettings
        Not causal.
    build : callable
        From a flight and settings to its problem.

    Raises
    ------
    NoSolutionError
        If the flight has no problem.
    """
    exact = with_exact_timestamps(flight)
    result, last = hyperparameters(exact, settings, build)
    if not result.is_nominal:
        motion, priors = last.problem.motion, None
        if isinstance(motion, GyroFree):  # it turns alike whatever its noise
            priors = IntervalPriors(motion.t_s, motion.poles_per_s, motion.variance_rad2ps2)
        alike = replace(settings, interval_priors=priors)
        return result, result.prepared(flight, alike, build)
    return result, last if exact is flight else build(flight, settings)


def with_exact_timestamps(flight: Flight) -> Flight:
    """Return a flight whose unit's clock is in no doubt: it is free while it is identified."""
    imu = flight.imu
    if imu is None or not imu.clock_offset_sigma_s:
        return flight
    return replace(flight, imu=replace(imu, clock_offset_sigma_s=0.0))


def hyperparameters(
    flight: Flight,
    settings: ProblemSettings,
    build: Build,
    prepared: PreparedFlight | None = None,
    begin: Hyperparameters | None = None,
) -> tuple[Hyperparameters, PreparedFlight]:
    """Estimate the hyperparameters of a flight, and return its last problem with nominal noise.

    Parameters
    ----------
    flight : Flight
        With exact timestamps.
    settings : ProblemSettings
        Not causal.
    build : callable
    prepared : PreparedFlight, optional
        The flight's problem, if it is built already.
    begin : Hyperparameters, optional
        Where the search begins: what an earlier part of the flight has determined.

    Raises
    ------
    NoSolutionError
        If there is no minimum about which to identify anything.
    """
    middle_s = 0.0 if flight.imu is None else middle_of_record_s(flight.imu)
    result = begin or Hyperparameters()
    clock = result.clock.at(middle_s - result.middle_s)
    if prepared is None or clock:
        prepared = build(clock.applied(flight, middle_s), settings)
    last: tuple[FloatArray, FloatArray] | None = None
    for _ in range(_PASSES):
        if not _shows_noise(prepared):
            return Hyperparameters(), prepared
        at = clock.applied(flight, middle_s)
        phase = prepared.problem.phase  # against a base errors of satellites are other ones
        satellites: Mapping[str, float] = {}
        if phase is not None and flight.base is None:
            satellites = satellite_error_factors(phase)
        theta, is_first = result.theta, last is None
        posterior = _posterior(at, settings, prepared, satellites, theta, is_first=is_first)
        now = calibrated(posterior.problem.constants, posterior.solution)
        first = {one.kind: one for one in result.calibrated}
        result = replace(
            _hyperparameters(posterior),
            satellites=satellites,
            clock=clock,
            middle_s=middle_s,
            calibrated=tuple(
                one._replace(alone=first.get(one.kind, one).alone)  # before timestamps were moved
                for one in now
            ),
        )
        step = next((one for one in now if one.kind == CLOCK), None)
        is_wrong = any(one.is_significant for one in now if one.kind in (CLOCK, LATENCY))
        if step is None or not (clock or is_wrong):
            break
        if (np.abs(step.value) < _SETTLED_SIGMAS * step.sigma).all():
            break
        last = step.value, _by_secant(step.value, last)
        clock = ClockCorrection._make(np.add(clock, last[1]).tolist())
        prepared = build(clock.applied(flight, middle_s), settings)
    moved = tuple(
        one._replace(value=one.value + np.array(clock), is_significant=True)
        if one.kind == CLOCK and clock
        else one
        for one in result.calibrated
    )
    return replace(result, clock=clock, calibrated=moved), prepared


def _by_secant(step: FloatArray, last: tuple[FloatArray, FloatArray] | None) -> FloatArray:
    """Return by how much to move timestamps where the data ask for ``step``.

    ``last`` are the step asked for before and the move that was made: of the step remains what
    averaging over the derivative's step has left.
    """
    if last is None:
        return step
    before, move = last
    taken = before - step
    factor = np.divide(move, taken, out=np.ones_like(step), where=taken != 0.0)
    return np.asarray(step * factor.clip(1 / _STEEPEST, _STEEPEST))


def _shows_noise(prepared: PreparedFlight) -> bool:
    """Return True unless nothing determines the heading, or how the body turns between vectors.

    Without an array and a gyroscope the prior of the rate is identified in place of noise.
    """
    opening = prepared.opening
    is_open = opening is not None and opening.until_s == np.inf
    return not is_open and (prepared.integers is not None or prepared.imu.w_b_radps is not None)


def _posterior(
    flight: Flight,
    settings: ProblemSettings,
    prepared: PreparedFlight,
    satellites: Mapping[str, float],
    begin: Mapping[str, float],
    *,
    is_first: bool,
) -> NoisePosterior:
    """Return the most probable noise of a problem; the search begins at theta by component."""
    problem, keyframes = decimated(prepared)
    if problem.phase is not None and satellites:
        problem = replace(problem, phase=with_errors(problem.phase, satellites))
    requested = [one.kind for one in settings.calibration]
    fixes = flight.fixes if flight.observations is None else ()
    has_velocities = any(one.v_n_mps is not None for one in fixes)
    wanted = (LATENCY, LEVER_ARM) if has_velocities else (LEVER_ARM,)
    kinds = tuple(one for one in wanted if one not in requested)
    problem = with_latency_and_lever_arm(problem, prepared.timed.at(keyframes), kinds)
    if flight.imu is not None and flight.imu.w_b_radps is not None:
        problem = with_clock(problem)
    standstill = None
    if prepared.standing is not None and fixes:
        stands = prepared.standing
        standstill = Standstill(stands.contains(problem.t_s), stands.share(problem.t_s))
    components = NoiseComponents.of(problem, scalable(flight), standstill)
    names = [name.removesuffix(AT_REST) for name in components.names]
    prior = Prior.of(components.names, ~np.isin(names, unstated(flight)))
    theta = np.array([begin.get(name, 0.0) for name in components.names])
    return noise_posterior(components, prior, theta, several=is_first)


def _hyperparameters(posterior: NoisePosterior) -> Hyperparameters:
    """Return factors on noises that the data move by more than their sigma."""
    theta = correlated_noise(posterior)
    moved = np.abs(theta) > np.maximum(_UNCHANGED, posterior.sigma)
    names = posterior.components.names
    return Hyperparameters(
        theta=dict(zip(names, posterior.theta.tolist(), strict=True)),
        factors={names[i]: float(np.exp(theta[i])) for i in np.flatnonzero(moved)},
        sigmas={names[i]: float(posterior.sigma[i]) for i in np.flatnonzero(moved)},
    )
