"""The smoother as a method, asked in three ways: a window, its newest state, a whole flight.

All three estimate the same factor graph (docs/theory/factor_graph.md), which GTSAM solves.
"""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from fgnav.assembly.calibration_request import calibration_requests
from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.prepared import Build, PreparedFlight
from fgnav.assembly.problem import build_problem
from fgnav.assembly.settings import ProblemSettings
from fgnav.checks import BadInputError, FloatArray, NoSolutionError, positive
from fgnav.diagnostics.corrections import corrected_set_up
from fgnav.graph.between import nearest_keyframes, regular_times, with_times
from fgnav.graph.build import Layout
from fgnav.graph.custom import NamedFactor
from fgnav.graph.innovations import InnovationSeries, custom_innovations, innovation_series
from fgnav.graph.types.solution import Solution
from fgnav.gravity import GravityEstimator
from fgnav.integers.resolvers.registry import default_resolver
from fgnav.integrity.exclusion import without_contradictions
from fgnav.integrity.imu_recording import with_noise_of_record
from fgnav.integrity.specific_force import force_innovations
from fgnav.integrity.verdict import judge
from fgnav.kernels.one_thread import in_one_thread
from fgnav.messages import note
from fgnav.methods.causal import Stretch, stretches
from fgnav.methods.smoothing.concatenation import among, concatenate_estimates
from fgnav.methods.smoothing.custom_heading import with_custom_heading
from fgnav.methods.smoothing.custom_sources import FactorSource, custom_factors
from fgnav.methods.smoothing.default_networks import default_networks
from fgnav.methods.smoothing.estimates import estimate_of
from fgnav.methods.smoothing.graph_summary import graph_summary
from fgnav.methods.smoothing.rate_identification import identified_by_evidence
from fgnav.methods.smoothing.solving import at_once, by_window, without_attitudes
from fgnav.noise.identify import identified
from fgnav.noise.report import implausible, noise_notes
from fgnav.process.hyperparameters import RatePrior
from fgnav.solve.fixed_lag import solve_forward
from fgnav.solve.sliding.relinearisation import BLOCK_S
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver

__all__ = ["Batch", "Forward", "Smoother"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoother:
    """A sliding window over array phases, accelerometer, code, Doppler and line of sight.

    Keyframes are the GNSS epochs, and times between them where intervals are long. Each is
    estimated as it leaves the window, from data up to ``lag_s`` after it and to the end of the
    second that the window is updated with.

    Attributes
    ----------
    resolver : Resolver
        Of the integers.
    gravity : GravityEstimator or None
        Source of gravity directions in body axes.
    calibrate : tuple of str
        What to estimate with the flight, such as ``("landmark", "antenna:a4")``; see
        ``assembly.calibration_request``.
    factors : tuple or None
        Sources of custom factors: callables ``(flight, timeline)`` that yield GTSAM factors, names
        of installed ones (entry points ``fgnav.factors``), or manifests of networks (``neural``);
        see ``graph.custom``. None: the gravity network, where neither a gyroscope nor an array
        measures the attitude (``smoothing.default_networks``).
    rate_prior : RatePrior or None
        Of flights without a gyroscope; None: identified by the evidence of the array's attitudes.
    sub_steps : int or None
        Integration steps per inertial sample; None: one, or two with a gyroscope.
    false_alarm : float
        Share of right epochs that the chi-square test of the array may turn away.
    causal : bool
        Whether everything, hyperparameters and integers included, comes from data up to each
        keyframe's lag; else what holds for the flight comes from all of it.
    noise : {"estimated", "nominal"}
        Whether noise, clock and latency are estimated from the flight (``noise``), by causal
        methods from its past; else they are as the flight states them.
    lag_s : float
        Length of the window.
    name : str

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Smoother(lag_s=2.0, noise="nominal")(flight)
    >>> estimate.method, len(estimate.t_s) == len(flight.observations.t_s)
    ('smoother', True)
    """

    resolver: Resolver = field(default_factory=default_resolver)
    gravity: GravityEstimator | None = None
    calibrate: tuple[str, ...] = ()
    factors: tuple[FactorSource | str, ...] | None = None
    rate_prior: RatePrior | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    causal: bool = False
    noise: Literal["estimated", "nominal"] = "estimated"
    lag_s: float = 5.0
    name: str = "smoother"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        positive(f"{self.name} lag_s", self.lag_s)
        positive(f"{self.name} false_alarm", self.false_alarm)
        calibration_requests(self.calibrate)
        if self.sub_steps is not None and self.sub_steps < 1:
            raise BadInputError(f"{self.name} sub_steps: must be 1 or more, got {self.sub_steps}")
        if self.noise not in ("estimated", "nominal"):
            raise BadInputError(
                f"{self.name} noise: must be identified or stated, got {self.noise!r}"
            )

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe.

        Raises
        ------
        NoSolutionError
            Naming the part of the flight that is missing.
        """
        return self.estimate_prepared(flight, self.prepare(flight))

    @in_one_thread
    def at(
        self, flight: Flight, t_s: FloatArray | None = None, *, rate_hz: float | None = None
    ) -> Estimate:
        """Estimate at any times, (m,), within the flight, or at multiples of a rate's period.

        These become keyframes without GNSS.

        Raises
        ------
        BadInputError
            If a time lies outside the keyframes, or neither or both are given.
        NoSolutionError
            Naming the part of the flight that is missing.
        """
        if (t_s is None) == (rate_hz is None):
            raise BadInputError("at: takes either times t_s or rate_hz")
        prepared = self.prepare(flight)
        if rate_hz is not None:
            t_s = regular_times(prepared.problem, rate_hz)
        t_s = np.asarray(t_s)
        stretches = self._stretches(flight, prepared)
        if len(stretches) == 1:
            return self._at(flight, prepared, t_s)
        parts = [
            self._at(stretch.flight, stretch.prepared, t_s[within])
            for stretch in stretches
            if (within := stretch.answers(t_s)).any()
        ]
        return concatenate_estimates(parts, len(t_s), len(t_s))

    def _at(self, flight: Flight, prepared: PreparedFlight, t_s: FloatArray) -> Estimate:
        dense = prepared.changed(lambda problem: with_times(problem, t_s))
        return self._estimated(flight, dense, nearest_keyframes(dense.problem.t_s, t_s))

    @property
    def preparation(self) -> ProblemSettings:
        """Settings of the smoothing problem: methods with equal ones may share it."""
        return ProblemSettings(
            resolver=self.resolver,
            gravity=self.gravity,
            calibration=calibration_requests(self.calibrate),
            rate_prior=self.rate_prior,
            sub_steps=self.sub_steps,
            false_alarm=self.false_alarm,
            causal=self.causal,
            noise=self.noise,
        )

    @in_one_thread
    def prepare(self, flight: Flight) -> PreparedFlight:
        """Return the smoothing problem of a flight; of causal methods with nominal noise."""
        return build_problem(flight, self.preparation) if self.causal else self._prepared(flight)

    def _prepared(self, flight: Flight) -> PreparedFlight:
        """Return the smoothing problem of a whole flight."""
        settings = self.preparation
        build = partial(build_problem, last=LastObservations())
        flight, notes = corrected_set_up(flight)
        make = build if self.noise == "nominal" else partial(_identified, build=build)
        prepared = make(flight, settings)
        prepared = replace(prepared, notes=(*prepared.notes, *notes))
        if without_attitudes(prepared) and self.rate_prior is None:
            prepared = identified_by_evidence(prepared)
        return prepared

    def _stretches(self, flight: Flight, prepared: PreparedFlight) -> tuple[Stretch, ...]:
        """Divide the flight into intervals of the same hyperparameters."""
        if not (self.causal and self.noise == "estimated"):
            return (Stretch(-np.inf, np.inf, flight, prepared),)
        ahead_s = self.lag_s + 2 * BLOCK_S
        build = partial(build_problem, last=LastObservations())
        return stretches(flight, self.preparation, prepared, ahead_s, build)

    @in_one_thread
    def estimate_prepared(self, flight: Flight, prepared: PreparedFlight) -> Estimate:
        """Estimate a flight whose problem is built."""
        if self.causal:
            return self._estimated_so_far(flight, prepared)
        estimate = self._estimated(flight, prepared)
        if self.noise == "nominal" or self.factors or flight.networks:
            return estimate
        return without_contradictions(
            flight,
            estimate,
            lambda remaining: self._estimated(remaining, self._prepared(remaining)),
        )

    def _estimated_so_far(self, flight: Flight, prepared: PreparedFlight) -> Estimate:
        """Estimate each stretch of a flight by what was known when it began."""
        stretches = self._stretches(flight, prepared)
        if len(stretches) == 1:
            return self._estimated(flight, stretches[0].prepared)
        parts, due = [], 0
        for stretch in stretches:
            t_s = stretch.prepared.problem.t_s
            due += int(((t_s >= stretch.from_s) & (t_s < stretch.until_s)).sum())
            estimate = self._estimated(stretch.flight, stretch.prepared)
            parts.append(among(estimate, stretch.from_s, stretch.until_s))
        return concatenate_estimates(parts, max(part.n_epochs for part in parts), due)

    def _estimated(
        self, flight: Flight, prepared: PreparedFlight, rows: np.ndarray | None = None
    ) -> Estimate:
        if self.factors is not None or self.gravity is not None:
            return self._with_factors(self.factors or (), flight, prepared, rows)
        networks, notes = default_networks(flight)
        if networks:
            try:
                estimate = self._with_factors(networks, flight, prepared, rows)
            except NoSolutionError:
                if self.causal:
                    raise
            else:
                if estimate.converged or self.causal:
                    return estimate
            notes = (note("W404"),)
        estimate = self._with_factors((), flight, prepared, rows)
        return replace(estimate, notes=(*estimate.notes, *notes))

    def _with_factors(
        self,
        sources: tuple[FactorSource | str, ...],
        flight: Flight,
        prepared: PreparedFlight,
        rows: np.ndarray | None,
    ) -> Estimate:
        prepared, sourced = custom_factors(sources, flight, prepared)
        custom = sourced.factors
        prepared = with_custom_heading(prepared, custom)
        problem, solution = prepared.problem, self._solve(prepared, custom)
        series = (
            *innovation_series(problem, solution),
            *custom_innovations(custom, Layout.of(problem), problem.t_s, solution),
            *_force_series(flight, prepared),
        )
        estimate = estimate_of(self.name, prepared, solution, rows)
        span_s = float(problem.t_s[0]), float(problem.t_s[-1])
        return replace(
            estimate,
            consistency=tuple(innovations.summary for innovations in series),
            verdicts=judge(series, prepared.implausible, span_s),
            graph=graph_summary(problem, sourced, solution, prepared.integers),
            unused=(*estimate.unused, *sourced.unused),
            notes=(*estimate.notes, *sourced.notes),
        )

    def _solve(self, prepared: PreparedFlight, custom: tuple[NamedFactor, ...]) -> Solution:
        return by_window(prepared, custom, self.lag_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forward(Smoother):
    """The window's newest state: what a filter knows as the flight goes on, and no more.

    Attributes are those of ``Smoother``; states ``lag_s`` back are still relinearised.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Forward(noise="nominal")(flight)
    >>> estimate.method, estimate.converged
    ('forward', True)
    """

    causal: bool = True
    lag_s: float = 1.0
    name: str = "forward"

    def _solve(self, prepared: PreparedFlight, custom: tuple[NamedFactor, ...]) -> Solution:
        opening = prepared.opening
        return solve_forward(prepared.problem, self.lag_s, custom=custom, opening=opening)


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch(Smoother):
    """The whole flight at once: the accuracy that the sliding window is held against.

    Attributes are those of ``Smoother``; ``lag_s`` is that of the window in which it begins.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Batch(noise="nominal")(flight)
    >>> estimate.method, estimate.converged
    ('batch', True)
    """

    lag_s: float = 2.0
    name: str = "batch"

    def _solve(self, prepared: PreparedFlight, custom: tuple[NamedFactor, ...]) -> Solution:
        return at_once(prepared, custom)


def _force_series(flight: Flight, prepared: PreparedFlight) -> tuple[InnovationSeries, ...]:
    """Return innovations of the accelerometer where nothing determines the heading."""
    opening = prepared.opening
    if opening is None or opening.until_s < np.inf:
        return ()
    found = force_innovations(flight)
    return () if found is None else (found,)


def _identified(flight: Flight, settings: ProblemSettings, build: Build) -> PreparedFlight:
    """Return the problem of a flight with noise and times that it determines."""
    notes: tuple[str, ...] = ()
    if flight.imu is not None:
        imu, notes = with_noise_of_record(flight.imu)
        flight = replace(flight, imu=imu)
    try:
        result, prepared = identified(flight, settings, build)
    except NoSolutionError as error:
        prepared = build(flight, settings)
        nominal = note("W302", error=error)
        return replace(prepared, notes=(*prepared.notes, *notes, nominal))
    return replace(
        prepared,
        implausible=implausible(flight, result),
        notes=(*prepared.notes, *notes, *noise_notes(flight, result)),
    )
