"""Commanded motion with exact truth: every command knows its first and second derivative."""

from dataclasses import dataclass
from typing import Protocol, TypeAlias

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.earth import GravityModel, Origin
from fgnav.geometry.rotations import from_euler, transpose
from fgnav.io.strict_toml import Positive, Table, Vector


class Hold(Table, frozen=True, tag="hold", tag_field="kind"):
    """A constant angle."""

    angle_deg: float = 0.0

    def __call__(self, t_s: FloatArray) -> FloatArray:
        """Return angle, rate and acceleration, rad and s, (3, n)."""
        zero = np.zeros_like(t_s)
        return np.stack([zero + np.radians(self.angle_deg), zero, zero])


class Ramp(Table, frozen=True, tag="ramp", tag_field="kind"):
    """A rise from zero to the amplitude, then hold.

    The rise is the quintic whose rate and acceleration vanish at both ends, so that the angular
    acceleration stays continuous.
    """

    amplitude_deg: float
    rise_s: Positive = 10.0

    def __call__(self, t_s: FloatArray) -> FloatArray:
        """Return angle, rate and acceleration, rad and s, (3, n)."""
        u = np.clip(t_s / self.rise_s, 0.0, 1.0)
        value = u**3 * (10 - 15 * u + 6 * u**2)
        rate = 30 * (u * (1 - u)) ** 2 / self.rise_s
        acceleration = 60 * u * (1 - u) * (1 - 2 * u) / self.rise_s**2
        return np.asarray(np.radians(self.amplitude_deg) * np.stack([value, rate, acceleration]))


class Sine(Table, frozen=True, tag="sine", tag_field="kind"):
    """``offset + amplitude sin(rate t + phase)``."""

    amplitude_deg: float
    rate_radps: Positive = 1.0
    phase_deg: float = 0.0
    offset_deg: float = 0.0

    def __call__(self, t_s: FloatArray) -> FloatArray:
        """Return angle, rate and acceleration, rad and s, (3, n)."""
        amplitude, rate = np.radians(self.amplitude_deg), self.rate_radps
        argument = rate * t_s + np.radians(self.phase_deg)
        deflection = amplitude * np.sin(argument)
        return np.stack(
            [
                deflection + np.radians(self.offset_deg),
                amplitude * rate * np.cos(argument),
                -(rate**2) * deflection,
            ]
        )


class Rate(Table, frozen=True, tag="rate", tag_field="kind"):
    """A constant rate: a rolling body where it is the command of roll."""

    rate_degps: float
    start_deg: float = 0.0

    def __call__(self, t_s: FloatArray) -> FloatArray:
        """Return angle, rate and acceleration, rad and s, (3, n)."""
        rate, zero = np.radians(self.rate_degps), np.zeros_like(t_s)
        return np.stack([np.radians(self.start_deg) + rate * t_s, zero + rate, zero])


Command: TypeAlias = Hold | Ramp | Sine | Rate


class Straight(Table, frozen=True, tag="straight", tag_field="kind"):
    """A straight line at constant speed in the frame ``n``, which does not follow the ellipsoid."""

    speed_mps: float = 100.0
    course_deg: float = 0.0
    climb_mps: float = 0.0

    def __call__(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement, velocity and acceleration in ``n``, each (n, 3)."""
        course = np.radians(self.course_deg)
        v = np.array(
            [self.speed_mps * np.cos(course), self.speed_mps * np.sin(course), -self.climb_mps]
        )
        return t_s[:, None] * v, np.tile(v, (len(t_s), 1)), np.zeros((len(t_s), 3))


class Arc(Table, frozen=True, tag="arc", tag_field="kind"):
    """A circle at constant horizontal speed, to the right (clockwise from above) or to the left."""

    speed_mps: Positive = 100.0
    radius_m: Positive = 800.0
    course_deg: float = 0.0
    climb_mps: float = 0.0
    left: bool = False

    def __call__(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return displacement, velocity and acceleration in ``n``, each (n, 3)."""
        rate_radps = self.speed_mps / self.radius_m * (-1.0 if self.left else 1.0)
        start = np.radians(self.course_deg)
        course = start + rate_radps * t_s
        sine, cosine, zero = np.sin(course), np.cos(course), np.zeros_like(t_s)
        signed_radius_m = self.speed_mps / rate_radps
        north_m = signed_radius_m * (sine - np.sin(start))
        east_m = -signed_radius_m * (cosine - np.cos(start))
        v, a = self.speed_mps, self.speed_mps * rate_radps
        return (
            np.stack([north_m, east_m, -self.climb_mps * t_s], axis=1),
            np.stack([v * cosine, v * sine, zero - self.climb_mps], axis=1),
            np.stack([-a * sine, a * cosine, zero], axis=1),
        )


Track: TypeAlias = Straight | Arc


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class State:
    """True motion of the body at given times."""

    # p_n_m, v_n_mps, a_n_mps2: (n, 3); of the body's origin; derivatives as seen in the frame
    # ``n``, which turns with the Earth
    p_n_m: FloatArray
    v_n_mps: FloatArray
    a_n_mps2: FloatArray
    R_nb: FloatArray  # (n, 3, 3)
    # w_nb_b_radps, alpha_nb_b_radps2: (n, 3); angular rate and acceleration of the body against
    # ``n``, in body axes
    w_nb_b_radps: FloatArray
    alpha_nb_b_radps2: FloatArray

    def at(self, lever_b_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return position, velocity and acceleration in ``n`` of points fixed to the body.

        Parameters
        ----------
        lever_b_m : ndarray, shape (3,) or (n, 3)
            The points in body axes.
        """
        lever_b_m = np.broadcast_to(lever_b_m, self.p_n_m.shape)
        w = self.w_nb_b_radps
        lever_b_mps = np.cross(w, lever_b_m)
        pull_b_mps2 = np.cross(self.alpha_nb_b_radps2, lever_b_m) + np.cross(w, lever_b_mps)
        return (
            self.p_n_m + rotated(self.R_nb, lever_b_m),
            self.v_n_mps + rotated(self.R_nb, lever_b_mps),
            self.a_n_mps2 + rotated(self.R_nb, pull_b_mps2),
        )

    def inertial_rate_b_radps(self, origin: Origin) -> FloatArray:
        """Return the angular rate against inertial space in body axes, (n, 3)."""
        return self.w_nb_b_radps + origin.earth_rate_n_radps @ self.R_nb

    def specific_force_b_mps2(
        self, origin: Origin, lever_b_m: FloatArray, model: GravityModel
    ) -> FloatArray:
        """Return the specific force at a point of the body, body axes, (n, 3).

        ``f = R_bn (a + 2 omega_ie x v - g(p))`` with position, velocity and acceleration of the
        accelerometer itself against the turning Earth, so that ``g`` holds the whole centrifugal
        part [1]_.

        References
        ----------
        .. [1] Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems,
           2nd ed., section 5.3 (Earth frame), solved for the specific force.
        """
        p_n_m, v_n_mps, a_n_mps2 = self.at(lever_b_m)
        coriolis_n_mps2 = 2 * np.cross(origin.earth_rate_n_radps, v_n_mps)
        f_n_mps2 = a_n_mps2 + coriolis_n_mps2 - origin.gravity_n_mps2(p_n_m, model)
        return rotated(transpose(self.R_nb), f_n_mps2)


class Trajectory(Protocol):
    """Anything that knows the true motion at any time: commanded, or flown by a rigid body."""

    def __call__(self, t_s: FloatArray, /) -> State:
        """Return the motion at times since the start, (n,)."""


class Motion(Table, frozen=True):
    """Path of the body, and one command per Euler angle."""

    position_n_m: Vector = (0.0, 0.0, 0.0)  # where the path starts
    path: Track = Straight()
    # roll, pitch, yaw: 3-2-1 angles against the frame ``n``; they do not follow the path
    roll: Command = Hold()
    pitch: Command = Hold()
    yaw: Command = Hold()

    def __call__(self, t_s: FloatArray) -> State:
        """Return the true motion at times since the start, (n,)."""
        displacement_m, v_n_mps, a_n_mps2 = self.path(t_s)
        roll, pitch, yaw = self.roll(t_s), self.pitch(t_s), self.yaw(t_s)
        w_b_radps, alpha_b_radps2 = body_rates(roll, pitch, yaw)
        return State(
            p_n_m=displacement_m + np.array(self.position_n_m),
            v_n_mps=v_n_mps,
            a_n_mps2=a_n_mps2,
            R_nb=from_euler(roll[0], pitch[0], yaw[0]),
            w_nb_b_radps=w_b_radps,
            alpha_nb_b_radps2=alpha_b_radps2,
        )


def body_rates(
    roll: FloatArray, pitch: FloatArray, yaw: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return body rate and its derivative, (n, 3), of angles with two derivatives, each (3, n)."""
    (phi, phi1, phi2), (theta, theta1, theta2), (_, psi1, psi2) = roll, pitch, yaw
    sp, cp, st, ct = np.sin(phi), np.cos(phi), np.sin(theta), np.cos(theta)
    # Yaw rate seen after the pitch rotation: x is -psi1 st, z is psi1 ct. Roll then mixes y and z.
    z, z1 = psi1 * ct, psi2 * ct - psi1 * theta1 * st
    w = [phi1 - psi1 * st, theta1 * cp + z * sp, z * cp - theta1 * sp]
    alpha = [
        phi2 - psi2 * st - psi1 * theta1 * ct,
        theta2 * cp + z1 * sp + phi1 * w[2],
        z1 * cp - theta2 * sp - phi1 * w[1],
    ]
    return np.stack(w, axis=1), np.stack(alpha, axis=1)


def rotated(R: FloatArray, v: FloatArray) -> FloatArray:
    """Return ``R @ v`` item by item, (n, 3)."""
    return np.asarray(np.einsum("nij,nj->ni", R, v))
