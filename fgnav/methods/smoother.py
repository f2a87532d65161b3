"""The smoother as a method, asked in three ways: a window, its newest state, a whole flight.

All three estimate the same factor graph (docs/model.md). GTSAM solves it; ``solver="chain"`` solves
it by block elimination in compiled code.
"""

from dataclasses import dataclass, field, fields, replace
from functools import partial
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal
from warnings import warn

import numpy as np

from fgnav.checks import BadInputError, FloatArray, positive
from fgnav.frontend.calibration_request import calibration_requests
from fgnav.frontend.position.by_observations import LastObservations
from fgnav.frontend.prepared import PreparedFlight, by_integers
from fgnav.frontend.problem import build_problem
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.between import regular_times, with_times
from fgnav.graph.innovations import consistency
from fgnav.graph.types.solution import Solution
from fgnav.gravity import GravityEstimator
from fgnav.identification.contradictions import without_contradictions
from fgnav.integers.resolvers.registry import default_resolver
from fgnav.kernels.one_thread import in_one_thread
from fgnav.methods.smoothing.estimates import estimate_of
from fgnav.methods.smoothing.joined import joined_estimates
from fgnav.methods.smoothing.own_sources import FactorSource, own_factors
from fgnav.methods.smoothing.so_far import CausalMethod, consistent_so_far
from fgnav.methods.smoothing.solving import (
    Solver,
    at_once,
    by_newest,
    by_window,
    without_attitudes,
)
from fgnav.optional_gtsam import ABSENT, HAS_GTSAM
from fgnav.process.hyperparameters import RatePrior
from fgnav.solve.sliding.relinearisation import BLOCK_S
from fgnav.types.estimate import Consistency, Estimate
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver

if TYPE_CHECKING:
    from fgnav.graph.custom import OwnFactor

__all__ = ["Batch", "Forward", "GtsamBatch", "Smoother"]

_MOVED = {
    "ObservationStream": "observation_stream",
    **dict.fromkeys(("Direction", "Measured", "Measurements", "Stream", "StreamSetUp"), "stream"),
}


def __getattr__(name: str) -> Any:  # noqa: ANN401
    """Return what has moved to the modules of streams, for one version."""
    if name not in _MOVED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    place = f"fgnav.methods.{_MOVED[name]}"
    warn(f"{__name__}.{name} is now {place}.{name}", DeprecationWarning, stacklevel=2)
    return getattr(import_module(place), name)


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoother:
    """A sliding window over array phases, accelerometer, code, Doppler and line of sight.

    Keyframes are the GNSS epochs. Each is taken as it leaves the window, known from the data up to
    ``lag_s`` after it, and the second that the window is updated with.

    Attributes
    ----------
    resolver : Resolver
        Of the integers.
    gravity : GravityEstimator or None
        Source of gravity directions in body axes.
    estimate : tuple of str
        What to estimate with the flight, such as ``("landmark", "antenna:a4")``; see
        ``frontend.calibration_request``.
    factors : tuple
        Sources of factors of one's own: callables ``(flight, timeline)`` that yield GTSAM factors,
        names of installed ones (entry points ``fgnav.factors``), or manifests of networks
        (``neural``); see ``graph.custom``.
    solver : {"gtsam", "chain"}
        GTSAM's incremental fixed-lag smoother and Levenberg-Marquardt, or the compiled chain, which
        is the default where GTSAM is not installed.
    rate_prior : RatePrior or None
        Of flights without a gyroscope; None: identified by the evidence of the array's attitudes.
    sub_steps : int or None
        Integration steps per inertial sample; None: one, or two with a gyroscope.
    false_alarm : float
        Share of right epochs that the chi-square test of the array may turn away.
    causal : bool
        Whether everything, hyperparameters and integers included, comes from data up to each
        keyframe's lag; else what holds for the flight comes from all of it.
    noise : {"identified", "stated"}
        Whether noise that the flight does not state, or that contradicts it, is identified from the
        flight, with clock and delay (``identification``); by causal methods from its past.
    lag_s : float
        Length of the window.
    name : str

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Smoother(lag_s=2.0, noise="stated")(flight)
    >>> estimate.method, len(estimate.t_s) == len(flight.observations.t_s)
    ('smoother', True)
    """

    resolver: Resolver = field(default_factory=default_resolver)
    gravity: GravityEstimator | None = None
    estimate: tuple[str, ...] = ()
    factors: tuple[FactorSource | str, ...] = ()
    solver: Solver = "gtsam" if HAS_GTSAM else "chain"
    rate_prior: RatePrior | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    causal: bool = False
    noise: Literal["identified", "stated"] = "identified"
    lag_s: float = 5.0
    name: str = "smoother"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        positive(f"{self.name} lag_s", self.lag_s)
        positive(f"{self.name} false_alarm", self.false_alarm)
        calibration_requests(self.estimate)
        if self.sub_steps is not None and self.sub_steps < 1:
            raise BadInputError(f"{self.name} sub_steps: must be 1 or more, got {self.sub_steps}")
        if self.solver not in ("gtsam", "chain"):
            raise BadInputError(f"{self.name} solver: must be gtsam or chain, got {self.solver!r}")
        if self.solver == "gtsam" and not HAS_GTSAM:
            raise BadInputError(f"{self.name} solver: {ABSENT}")
        if self.noise not in ("identified", "stated"):
            raise BadInputError(
                f"{self.name} noise: must be identified or stated, got {self.noise!r}"
            )
        if self.solver == "chain" and self.factors:
            raise BadInputError(
                f"{self.name} solver: chain takes no factors of one's own; use solver gtsam"
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
        if not prepared.stretches:
            return without_contradictions(flight, self._at(flight, prepared, t_s), None)
        parts = [
            self._at(one.flight, one.prepared, t_s[within])
            for one in prepared.stretches
            if (within := one.answers(t_s)).any()
        ]
        return joined_estimates(parts, len(t_s), len(t_s))

    def _at(self, flight: Flight, prepared: PreparedFlight, t_s: FloatArray) -> Estimate:
        problem, rows = with_times(prepared.problem, t_s)
        opening = prepared.opening
        if opening is not None:
            opening = replace(opening, problem=with_times(opening.problem, t_s)[0])
        in_motion = prepared.in_motion
        if in_motion is not None:
            in_motion = with_times(in_motion, t_s)[0]
        dense = replace(
            prepared,
            problem=problem,
            in_motion=in_motion,
            windowed=with_times(prepared.windowed, t_s)[0],
            opening=opening,
        )
        return self._estimated(flight, dense, rows)

    @property
    def preparation(self) -> ProblemSettings:
        """What decides the smoothing problem: methods that agree in it may share one."""
        return ProblemSettings(
            resolver=self.resolver,
            gravity=self.gravity,
            calibration=calibration_requests(self.estimate),
            rate_prior=self.rate_prior,
            sub_steps=self.sub_steps,
            false_alarm=self.false_alarm,
            causal=self.causal,
            noise=self.noise,
        )

    @in_one_thread
    def prepare(self, flight: Flight, since_s: float = -np.inf) -> PreparedFlight:
        """Return the smoothing problem of a flight.

        ``since_s``: when estimates of a causal method begin that has judged its record up to then.
        """
        if self.causal:
            return self._prepared_so_far(flight, since_s)
        return self._prepared(flight, self.preparation)

    def _prepared(self, flight: Flight, settings: ProblemSettings) -> PreparedFlight:
        """Return the smoothing problem of a whole flight."""
        notes: tuple[str, ...] = ()
        build = partial(build_problem, last=LastObservations())
        if settings.noise == "stated":
            prepared = build(flight, settings)
        else:
            from fgnav.identification.apply import (  # noqa: PLC0415  # lazy: the chain
                by_records,
                with_identified_noise,
            )

            flight, settings, notes = by_records(flight, settings)
            prepared = build(flight, settings)
            prepared = with_identified_noise(flight, settings, prepared, build)
        if without_attitudes(prepared) and self.rate_prior is None:
            from fgnav.methods.smoothing.rate_identification import (  # noqa: PLC0415  # lazy: the chain
                identified_by_evidence,
            )

            prepared = identified_by_evidence(prepared)
        return replace(prepared, notes=(*prepared.notes, *notes))

    def _prepared_so_far(self, flight: Flight, since_s: float) -> PreparedFlight:
        """Return the smoothing problem of a causal method, in stretches as its past has them."""
        settings = self.preparation
        prepared = build_problem(flight, settings)
        if settings.noise == "identified":
            from fgnav.identification.from_past import stretches  # noqa: PLC0415  # lazy: the chain

            ahead_s = self.lag_s + 2 * BLOCK_S
            spans = stretches(
                flight,
                settings,
                prepared,
                ahead_s,
                partial(build_problem, last=LastObservations()),
                since_s,
            )
            prepared = replace(prepared, stretches=spans)
        return replace(prepared, stretches=by_integers(flight, prepared, self._waits_s))

    @in_one_thread
    def estimate_prepared(self, flight: Flight, prepared: PreparedFlight) -> Estimate:
        """Estimate a flight whose problem is built."""
        # Factors of one's own cannot be left out of a flight: what they contradict is noted.
        if self.causal:
            method = self.so_far if not flight.networks else self.so_far._replace(whole=None)
            return consistent_so_far(flight, prepared, method)
        is_tried = self.noise == "identified" and not (self.factors or flight.networks)
        again = partial(self._once, causes_anywhere=prepared.has_cause) if is_tried else None
        return without_contradictions(flight, self._estimated(flight, prepared), again)

    @property
    def so_far(self) -> CausalMethod:
        """The method as it judges a record that goes on, if it is causal."""
        is_tried = self.noise == "identified" and not self.factors
        once = self._of_whole_flights._once if is_tried else None
        return CausalMethod(self.prepare, self._estimated, once, self._waits_s)

    @property
    def _waits_s(self) -> float:
        """How much of what comes later a causal estimate takes part of."""
        return self.lag_s

    @property
    def _of_whole_flights(self) -> "Batch":
        """The method without openings, whose innovations are those of a bad linearisation, too."""
        settings = {one.name: getattr(self, one.name) for one in fields(Smoother)}
        return Batch(**settings | {"causal": False, "lag_s": Batch().lag_s, "name": self.name})

    def _once(self, flight: Flight, *, causes_anywhere: bool = True) -> Estimate:
        settings = replace(self.preparation, causes_anywhere=causes_anywhere)
        return self._estimated(flight, self._prepared(flight, settings))

    def _estimated(
        self, flight: Flight, prepared: PreparedFlight, rows: np.ndarray | None = None
    ) -> Estimate:
        prepared, sourced = own_factors(self.factors, flight, prepared)
        own = sourced.factors
        if own and self.solver == "chain":
            raise BadInputError(
                f"flight {flight.name}: key network: solver chain takes no networks; use solver "
                "gtsam, or leave them out"
            )
        if own:
            from fgnav.methods.smoothing.own_heading import with_own_heading  # noqa: PLC0415  # lazy: gtsam

            prepared = with_own_heading(prepared, own)
        solution = self._solve(prepared, own)
        tests = (
            *consistency(prepared.problem, solution),
            *_own_tests(own, prepared, solution),
            *prepared.tests,
        )
        estimate = estimate_of(self.name, prepared, solution, tests, rows)
        return replace(
            estimate,
            losses=(*estimate.losses, *sourced.losses),
            notes=(*estimate.notes, *sourced.notes),
        )

    def _solve(self, prepared: PreparedFlight, own: "tuple[OwnFactor, ...]") -> Solution:
        return by_window(prepared, own, self.solver, self.lag_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forward(Smoother):
    """The window's newest state: what a filter knows as the flight goes on, and no more.

    Attributes are those of ``Smoother``; states ``lag_s`` back are still relinearised.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Forward(noise="stated")(flight)
    >>> estimate.method, estimate.converged
    ('forward', True)
    """

    causal: bool = True
    lag_s: float = 1.0
    name: str = "forward"

    @property
    def _waits_s(self) -> float:
        return 0.0

    def _solve(self, prepared: PreparedFlight, own: "tuple[OwnFactor, ...]") -> Solution:
        return by_newest(prepared, own, self.solver, self.lag_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch(Smoother):
    """The whole flight at once: the accuracy that the sliding window is held against.

    Attributes are those of ``Smoother``; ``lag_s`` is that of the window in which it begins.

    Examples
    --------
    >>> import fgnav
    >>> flight = fgnav.load_flight("demo/flight")
    >>> estimate = fgnav.Batch(noise="stated")(flight)
    >>> estimate.method, estimate.converged
    ('batch', True)
    """

    lag_s: float = 2.0
    name: str = "batch"

    def _solve(self, prepared: PreparedFlight, own: "tuple[OwnFactor, ...]") -> Solution:
        return at_once(prepared, own, self.solver)


@dataclass(frozen=True, slots=True, kw_only=True)
class GtsamBatch(Batch):
    """Another name of ``Batch``, for one version."""

    name: str = "gtsam"


def _own_tests(
    own: "tuple[OwnFactor, ...]", prepared: PreparedFlight, solution: Solution
) -> tuple[Consistency, ...]:
    if not own:
        return ()
    from fgnav.graph.build import Layout  # noqa: PLC0415  # lazy: gtsam
    from fgnav.graph.innovations import own_consistency  # noqa: PLC0415

    problem = prepared.problem
    return own_consistency(own, Layout.of(problem), problem.t_s, solution)
