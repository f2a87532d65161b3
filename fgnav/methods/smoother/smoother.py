"""The smoother as a method: a sliding window, or the whole flight at once."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from fgnav.checks import BadInputError, FloatArray, positive
from fgnav.estimate import Estimate
from fgnav.flight import Flight
from fgnav.gravity import GravityEstimator
from fgnav.integers.lambda_ import Lambda
from fgnav.integers.resolver import Resolver
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.collect import Collected, Settings, collect
from fgnav.methods.smoother.graph import Solution
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.preintegration import SUB_STEPS
from fgnav.methods.smoother.window import solve_window
from fgnav.rotations import skew, transpose


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
    sub_steps : int
        Integration steps per accelerometer sample.
    false_alarm : float
        Share of right epochs that the chi-square test of the array may turn away.
    name : str
    """

    resolver: Resolver = field(default_factory=Lambda)
    lag_s: float = 5.0
    gravity: GravityEstimator | None = None
    angular_acceleration_density: float | None = None
    sub_steps: int = SUB_STEPS
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
        return _estimate(self, flight, lambda keyframes: solve_window(keyframes, self.lag_s))


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
    sub_steps: int = SUB_STEPS
    false_alarm: float = 1e-4
    name: str = "batch"

    def __post_init__(self) -> None:
        """Reject settings that mean nothing."""
        _check(self)

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate every keyframe; raises as ``Smoother`` does."""
        return _estimate(self, flight, solve_batch)


def _check(method: Smoother | Batch) -> None:
    positive(f"{method.name} false_alarm", method.false_alarm)
    if method.sub_steps < 1:
        raise BadInputError(f"{method.name} sub_steps: must be 1 or more, got {method.sub_steps}")
    if method.angular_acceleration_density is not None:
        positive(f"{method.name} angular_acceleration_density", method.angular_acceleration_density)


def _estimate(
    method: Smoother | Batch, flight: Flight, solve: Callable[[Keyframes], Solution]
) -> Estimate:
    settings = Settings(
        resolver=method.resolver,
        gravity=method.gravity,
        angular_acceleration_density=method.angular_acceleration_density,
        sub_steps=method.sub_steps,
        false_alarm=method.false_alarm,
    )
    collected = collect(flight, settings)
    return _at_origin(method.name, collected, solve(collected.keyframes))


def _at_origin(name: str, collected: Collected, solution: Solution) -> Estimate:
    """Move states from the accelerometer to the body's origin, covariances with them.

    The covariance of velocity takes the errors of velocity and angular rate as independent.
    """
    keyframes = collected.keyframes
    imu = keyframes.preintegrate.imu
    R_nb, arm_b_m = solution.R_nb, -imu.position_b_m
    arm = skew(arm_b_m[None])[0]
    A = np.hstack([-arm, np.eye(3)])
    position_b_m2 = A @ solution.pose_covariance @ A.T
    w_b_radps = _rates(keyframes, solution)
    earth_b_radps = np.einsum("nji,j->ni", R_nb, keyframes.preintegrate.earth_rate_n_radps)
    swing_b_mps = np.cross(w_b_radps - earth_b_radps, arm_b_m)
    turned_m2ps2 = R_nb @ (arm @ solution.slot_covariance[:, 3:, 3:] @ arm.T) @ transpose(R_nb)
    return Estimate(
        method=name,
        t_s=keyframes.t_s,
        epochs=collected.epochs,
        R_nb=R_nb,
        attitude_covariance_rad2=solution.pose_covariance[:, :3, :3],
        p_n_m=solution.p_n_m + R_nb @ arm_b_m,
        position_covariance_m2=R_nb @ position_b_m2 @ transpose(R_nb)
        + collected.common_position_m2,
        v_n_mps=solution.v_n_mps + np.einsum("nij,nj->ni", R_nb, swing_b_mps),
        velocity_covariance_m2ps2=solution.velocity_covariance_m2ps2 + turned_m2ps2,
        angular_rate_b_radps=w_b_radps,
        accelerometer_bias_mps2=solution.slot[:, :3],
        converged=solution.converged,
        integers=collected.integers,
        losses=collected.losses,
        notes=(*collected.notes, *_notes(name, keyframes, solution)),
    )


def _rates(keyframes: Keyframes, solution: Solution) -> FloatArray:
    """Return body rates against inertial space at keyframes, (n, 3)."""
    imu = keyframes.preintegrate.imu
    if imu.w_b_radps is None:
        return -solution.slot[:, 3:]
    told = [np.interp(keyframes.t_s, imu.t_s, column) for column in imu.w_b_radps.T]
    return np.asarray(np.stack(told, axis=1) - solution.slot[:, 3:])


def _notes(name: str, keyframes: Keyframes, solution: Solution) -> tuple[str, ...]:
    notes = []
    if keyframes.preintegrate.imu.w_b_radps is None:
        density = keyframes.preintegrate.angular_acceleration_density
        told = ", ".join(f"{value:.2g}" for value in density)
        notes.append(f"Angular acceleration density about the body axes: {told} (rad/s2)2/Hz.")
    if not solution.converged:
        notes.append(f"{name} did not end at a minimum: do not use the estimate.")
    return tuple(notes)
