"""The smoother as a method: a sliding window, its newest state, or the whole flight at once."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from math import ceil

import numpy as np

from fgnav.checks import BadInputError, FloatArray, positive
from fgnav.estimate import Estimate
from fgnav.flight import Flight
from fgnav.gravity import GravityEstimator
from fgnav.integers.lambda_ import Lambda
from fgnav.integers.resolver import Resolver
from fgnav.methods.smoother import blind
from fgnav.methods.smoother.ahead import foretelling
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.calibration import calibrated
from fgnav.methods.smoother.collect import Collected, Settings, collect
from fgnav.methods.smoother.constants import asked
from fgnav.methods.smoother.estimates import estimate_of
from fgnav.methods.smoother.gaps import LONGEST_STEP_S
from fgnav.methods.smoother.interpolation import with_times
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.solution import Solution
from fgnav.methods.smoother.swings import crossed
from fgnav.methods.smoother.window import solve_forward, solve_window

# Integration steps between keyframes a tenth of a second apart; the lag of GTSAM's steps shows in
# proportion to the square of that time. Against 100 steps, 20 cost 0.3 % of the RMS error in roll
# and 0.6 % in pitch, 50 cost 0.1 % (sine of 20 degrees, six flights).
_STEPS, _SPAN_S = 20, 0.1
_MOST = 5  # and that is fine enough


@dataclass(frozen=True, slots=True, kw_only=True)
class Smoother:
    """A sliding window over array phases, accelerometer, code, Doppler and line of sight.

    Keyframes are the GNSS epochs. Each is taken as it leaves the window, known from the data up to
    ``lag_s`` after it.

    Attributes
    ----------
    resolver : Resolver
        Of the integers.
    lag_s : float
        Length of the window.
    gravity : GravityEstimator or None
        Source of gravity directions in body axes.
    angular_acceleration_density : float or None
        Intensity of white angular acceleration, (rad/s2)2/Hz, for flights without a gyroscope;
        None: told from the array's own attitudes.
    sub_steps : int or None
        Integration steps per accelerometer sample; None: as many as the keyframes' spacing asks.
    false_alarm : float
        Share of right epochs that the chi-square test of the array may turn away.
    estimate : tuple of str
        What to estimate with the flight, such as ``("landmark", "antenna:a4")``; see
        ``constants.asked``. The window's constants are linearised where the batch has them.
    name : str
    """

    resolver: Resolver = field(default_factory=Lambda)
    lag_s: float = 5.0
    gravity: GravityEstimator | None = None
    angular_acceleration_density: float | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    estimate: tuple[str, ...] = ()
    name: str = "smoother"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        positive(f"{self.name} lag_s", self.lag_s)
        _check(self)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe.

        Raises
        ------
        NoSolutionError
            Naming the part of the flight that is missing.
        """
        return _estimate(self, flight, partial(solve_window, lag_s=self.lag_s))

    def at(self, flight: Flight, t_s: FloatArray | float) -> Estimate:
        """Estimate at any times, (m,), within the flight: these become keyframes without GNSS.

        A number is a rate, Hz: as many times a second, from the first keyframe to the last.

        Raises
        ------
        BadInputError
            If a time lies outside the keyframes.
        NoSolutionError
            Naming the part of the flight that is missing.
        """
        return _estimate(self, flight, partial(solve_window, lag_s=self.lag_s), t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Forward:
    """The sliding window's newest state: what a filter would know as the flight goes on.

    Attributes
    ----------
    resolver, gravity, angular_acceleration_density, sub_steps, false_alarm, estimate, name
        As in ``Smoother``.
    lag_s : float
        States this far back are still linearised anew.
    """

    resolver: Resolver = field(default_factory=Lambda)
    lag_s: float = 1.0
    gravity: GravityEstimator | None = None
    angular_acceleration_density: float | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    estimate: tuple[str, ...] = ()
    name: str = "forward"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        positive(f"{self.name} lag_s", self.lag_s)
        _check(self)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, partial(solve_forward, lag_s=self.lag_s))

    def at(self, flight: Flight, t_s: FloatArray | float) -> Estimate:
        """Estimate at any times, as ``Smoother`` does."""
        return _estimate(self, flight, partial(solve_forward, lag_s=self.lag_s), t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """The whole flight at once: the accuracy that the sliding window is held against.

    Attributes
    ----------
    resolver, gravity, angular_acceleration_density, sub_steps, false_alarm, estimate, name
        As in ``Smoother``.
    """

    resolver: Resolver = field(default_factory=Lambda)
    gravity: GravityEstimator | None = None
    angular_acceleration_density: float | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    estimate: tuple[str, ...] = ()
    name: str = "batch"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        _check(self)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, solve_batch)

    def at(self, flight: Flight, t_s: FloatArray | float) -> Estimate:
        """Estimate at any times, as ``Smoother`` does."""
        return _estimate(self, flight, solve_batch, t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class GtsamBatch(Batch):
    """The same graph, solved by GTSAM itself: slower, and the place for factors of one's own."""

    name: str = "gtsam"

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, _by_gtsam())

    def at(self, flight: Flight, t_s: FloatArray | float) -> Estimate:
        """Estimate at any times, as ``Smoother`` does."""
        return _estimate(self, flight, _by_gtsam(), t_s)


def _by_gtsam() -> Callable[[Keyframes], Solution]:
    from fgnav.methods.smoother.by_gtsam import solve_by_gtsam  # noqa: PLC0415  # lazy: gtsam

    return solve_by_gtsam


def _check(method: Smoother | Forward | Batch) -> None:
    positive(f"{method.name} false_alarm", method.false_alarm)
    asked(method.estimate)
    if method.sub_steps is not None and method.sub_steps < 1:
        raise BadInputError(f"{method.name} sub_steps: must be 1 or more, got {method.sub_steps}")
    if method.angular_acceleration_density is not None:
        positive(f"{method.name} angular_acceleration_density", method.angular_acceleration_density)


def _estimate(
    method: Smoother | Forward | Batch,
    flight: Flight,
    solve: Callable[[Keyframes], Solution],
    at_s: FloatArray | float | None = None,
) -> Estimate:
    collected, rows, ahead = collected_for(method, flight), None, isinstance(method, Forward)
    if method.angular_acceleration_density is None:
        collected = blind.quickened(collected, ahead=ahead)
    if isinstance(method, Batch):
        solve = blind.fitting(collected, solve)
    else:
        collected, solve = blind.linearised(collected, solve, ahead=ahead)
        solve = blind.naming(method.name, collected, solve)
    found = None
    if not isinstance(method, Forward) and method.angular_acceleration_density is None:
        found = calibrated(collected.keyframes, solve)
        notes = (*collected.notes, *found.notes)
        if isinstance(method, Batch):
            found, across = crossed(found, solve)
            notes += across
        collected = replace(collected, keyframes=found.keyframes, notes=notes)
    if at_s is not None:
        collected, rows = with_times(collected, at_s, _sub_steps(method, flight))
    if found is None:
        return estimate_of(method.name, collected, solve(collected.keyframes), rows)
    solution = found.solution if rows is None else solve(collected.keyframes)
    return estimate_of(method.name, collected, solution, rows, found.believed(solution))


def collected_for(method: Smoother | Forward | Batch, flight: Flight) -> Collected:
    """Return the keyframes that a method smooths; raises as the method does."""
    settings = Settings(
        resolver=method.resolver,
        gravity=method.gravity,
        angular_acceleration_density=method.angular_acceleration_density,
        sub_steps=_sub_steps(method, flight),
        false_alarm=method.false_alarm,
        causal=isinstance(method, Forward),
        constants=asked(method.estimate),
        own_factors=not isinstance(method, GtsamBatch),
    )
    collected = _beside_landmark(collect(flight, settings))
    if isinstance(method, Forward) and method.angular_acceleration_density is None:
        collected = replace(collected, keyframes=foretelling(collected.keyframes))
    return collected


def _beside_landmark(collected: Collected) -> Collected:
    """Let the way to the landmark, and heights, share the error that all positions have."""
    keyframes = collected.keyframes
    if keyframes.landmark_n_m is None and keyframes.heights is None:
        return collected
    common_m2 = collected.common_position_m2.mean(axis=0)
    return replace(collected, keyframes=replace(keyframes, common_position_m2=common_m2))


def _sub_steps(method: Smoother | Forward | Batch, flight: Flight) -> int:
    """Return how many steps per inertial sample: as stated, or as the keyframes' spacing asks."""
    if method.sub_steps is not None:
        return method.sub_steps
    source = flight.observations or flight.fixes
    if flight.imu is None or source is None or len(source.t_s) < 2 or len(flight.imu.t_s) < 2:
        return 1
    span_s = min(float(np.median(np.diff(source.t_s))), LONGEST_STEP_S)
    samples = span_s / float(np.median(np.diff(flight.imu.t_s)))
    return min(max(ceil(_STEPS * (span_s / _SPAN_S) ** 2 / samples - 1e-6), 1), _MOST)
