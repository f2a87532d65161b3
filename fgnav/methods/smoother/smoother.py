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
from fgnav.methods.smoother.ahead import foretelling
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.by_gtsam import solve_by_gtsam
from fgnav.methods.smoother.collect import Collected, Settings, collect
from fgnav.methods.smoother.estimates import estimate_of
from fgnav.methods.smoother.graph import Solution
from fgnav.methods.smoother.interpolation import with_times
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.window import solve_forward, solve_window

# Integration steps between keyframes a tenth of a second apart; the lag of GTSAM's steps shows in
# proportion to the square of that time. Against 100 steps, 20 cost 0.3 % of the RMS error in roll
# and 0.6 % in pitch, 50 cost 0.1 % (sine of 20 degrees, six flights).
_STEPS, _SPAN_S = 20, 0.1
_LONGEST_S, _MOST = 0.2, 5  # keyframes are no further apart; and that is fine enough


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
    name : str
    """

    resolver: Resolver = field(default_factory=Lambda)
    lag_s: float = 5.0
    gravity: GravityEstimator | None = None
    angular_acceleration_density: float | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
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

    def at(self, flight: Flight, t_s: FloatArray) -> Estimate:
        """Estimate at any times, (m,), within the flight: these become keyframes without GNSS.

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
    resolver, gravity, angular_acceleration_density, sub_steps, false_alarm, name
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
    name: str = "forward"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        positive(f"{self.name} lag_s", self.lag_s)
        _check(self)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, partial(solve_forward, lag_s=self.lag_s))

    def at(self, flight: Flight, t_s: FloatArray) -> Estimate:
        """Estimate at any times, as ``Smoother`` does."""
        return _estimate(self, flight, partial(solve_forward, lag_s=self.lag_s), t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """The whole flight at once: the accuracy that the sliding window is held against.

    Attributes
    ----------
    resolver, gravity, angular_acceleration_density, sub_steps, false_alarm, name
        As in ``Smoother``.
    """

    resolver: Resolver = field(default_factory=Lambda)
    gravity: GravityEstimator | None = None
    angular_acceleration_density: float | None = None
    sub_steps: int | None = None
    false_alarm: float = 1e-4
    name: str = "batch"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        _check(self)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, solve_batch)

    def at(self, flight: Flight, t_s: FloatArray) -> Estimate:
        """Estimate at any times, as ``Smoother`` does."""
        return _estimate(self, flight, solve_batch, t_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class GtsamBatch(Batch):
    """The same graph, solved by GTSAM itself: slower, and the place for factors of one's own."""

    name: str = "gtsam"

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, solve_by_gtsam)

    def at(self, flight: Flight, t_s: FloatArray) -> Estimate:
        """Estimate at any times, as ``Smoother`` does."""
        return _estimate(self, flight, solve_by_gtsam, t_s)


def _check(method: Smoother | Forward | Batch) -> None:
    positive(f"{method.name} false_alarm", method.false_alarm)
    if method.sub_steps is not None and method.sub_steps < 1:
        raise BadInputError(f"{method.name} sub_steps: must be 1 or more, got {method.sub_steps}")
    if method.angular_acceleration_density is not None:
        positive(f"{method.name} angular_acceleration_density", method.angular_acceleration_density)


def _estimate(
    method: Smoother | Forward | Batch,
    flight: Flight,
    solve: Callable[[Keyframes], Solution],
    at_s: FloatArray | None = None,
) -> Estimate:
    sub_steps = _sub_steps(flight) if method.sub_steps is None else method.sub_steps
    settings = Settings(
        resolver=method.resolver,
        gravity=method.gravity,
        angular_acceleration_density=method.angular_acceleration_density,
        sub_steps=sub_steps,
        false_alarm=method.false_alarm,
    )
    collected = _beside_landmark(collect(flight, settings))
    if isinstance(method, Forward) and method.angular_acceleration_density is None:
        collected = replace(collected, keyframes=foretelling(collected.keyframes))
    if at_s is None:
        return estimate_of(method.name, collected, solve(collected.keyframes))
    dense, rows = with_times(collected, at_s, sub_steps)
    return estimate_of(method.name, dense, solve(dense.keyframes), rows)


def _beside_landmark(collected: Collected) -> Collected:
    """Let the way to the landmark share the error that all positions have in common."""
    keyframes = collected.keyframes
    if keyframes.landmark_n_m is None:
        return collected
    common_m2 = collected.common_position_m2.mean(axis=0)
    return replace(collected, keyframes=replace(keyframes, common_position_m2=common_m2))


def _sub_steps(flight: Flight) -> int:
    """Return how many steps per inertial sample the keyframes' spacing asks for."""
    source = flight.observations or flight.fixes
    if flight.imu is None or source is None or len(source.t_s) < 2 or len(flight.imu.t_s) < 2:
        return 1
    span_s = min(float(np.median(np.diff(source.t_s))), _LONGEST_S)
    samples = span_s / float(np.median(np.diff(flight.imu.t_s)))
    return min(max(ceil(_STEPS * (span_s / _SPAN_S) ** 2 / samples - 1e-6), 1), _MOST)
