"""A flown flight as exact motion at any time: what sensors are simulated from."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import quaternion_wxyz
from fgnav_sim.motion import State, rotated
from fgnav_sim.vehicle.forces import P, Q, V, W
from fgnav_sim.vehicle.model import burning_curve
from fgnav_sim.vehicle.rigid_body import Flown, rotations_of
from fgnav_sim.vehicle.tables import Vehicle

if TYPE_CHECKING:
    from scipy.interpolate import PPoly


_SLACK_S = 5e-3  # receivers' clocks err; so far the outermost quintics go on


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FlownMotion:
    """Motion between the rows of a flight: quintics that meet value, rate and second derivative.

    Rates and accelerations are the derivatives of these very quintics, so that a state is
    consistent in itself at every time: integrating what its sensors feel returns to it. Positions
    of 6e6 m round to 1e-9 m, which makes 6e-5 m/s2 of acceleration between rows of 10 ms.
    """

    position_n_m: "PPoly"
    quaternion_nb: "PPoly"  # wxyz, of unit length at the rows only

    def __call__(self, t_s: FloatArray) -> State:
        """Return the motion at times since the start, (n,).

        Raises
        ------
        BadInputError
            If a time lies outside the flight, but for what clocks err.
        """
        first_s, last_s = self.position_n_m.x[[0, -1]]
        if len(t_s) and not (first_s - _SLACK_S <= t_s.min() and t_s.max() <= last_s + _SLACK_S):
            raise BadInputError(
                f"t_s: must lie within the flight, {first_s:g} to {last_s:g}, "
                f"got {t_s.min():g} to {t_s.max():g}"
            )
        p, q = self.position_n_m, self.quaternion_nb
        wxyz, rate, second = q(t_s), q(t_s, 1), q(t_s, 2)
        norm2 = np.sum(wxyz**2, axis=1, keepdims=True)
        w_b = 2 * _product(_conjugate(wxyz), rate)[:, 1:] / norm2
        growth = 2 * np.sum(wxyz * rate, axis=1, keepdims=True) / norm2
        alpha_b = 2 * _product(_conjugate(wxyz), second)[:, 1:] / norm2 - growth * w_b
        return State(
            p_n_m=p(t_s),
            v_n_mps=p(t_s, 1),
            a_n_mps2=p(t_s, 2),
            R_nb=rotations_of(wxyz),
            w_nb_b_radps=w_b,
            alpha_nb_b_radps2=alpha_b,
        )


def flown_motion(flown: Flown, origin: Origin) -> FlownMotion:
    """Return the motion of a flight in the frame ``n`` of an origin.

    The body's origin is its dry centre of mass, of which the burning motor's moves away.

    Parameters
    ----------
    flown : Flown
        With rows close enough for its spin: at 10 ms and five turns a second quintics are within
        1e-9 of the attitude.
    origin : Origin
        Of the frame; the flight starts wherever it was launched.

    Raises
    ------
    BadInputError
        If fewer than two rows of the flight are above the ground.
    """
    t_s, y, dy, planet = flown.t_s, flown.y, flown.dy, flown.planet
    if len(t_s) < 2:
        raise BadInputError("flown.start: the flight meets the ground at once; start higher")
    R_ni = origin.R_ne @ planet.R_ei(t_s)
    p_i, v_i, a_i, w = y[:, P : P + 3], y[:, V : V + 3], dy[:, V : V + 3], y[:, W : W + 3]
    earth = planet.rate_i_radps
    pull = np.cross(earth, np.cross(earth, p_i))
    p_n_m = rotated(R_ni, p_i) - origin.R_ne @ planet.p_e_m(origin)
    v_n_mps = rotated(R_ni, v_i - np.cross(earth, p_i))
    a_n_mps2 = rotated(R_ni, a_i - 2 * np.cross(earth, v_i) + pull)

    q_ib = y[:, Q : Q + 4] / np.linalg.norm(y[:, Q : Q + 4], axis=1, keepdims=True)
    half = 0.5 * planet.rate_radps * t_s
    zero = np.zeros_like(half)
    q_ei = np.column_stack([np.cos(half), zero, zero, -np.sin(half)])
    q_ne = np.broadcast_to(quaternion_wxyz(origin.R_ne[None]), q_ei.shape)
    q_nb = _product(q_ne, _product(q_ei, q_ib))
    earth_b = rotated(rotations_of(q_ib).swapaxes(1, 2), np.broadcast_to(earth, p_i.shape))
    w_nb = w - earth_b
    alpha_nb = dy[:, W : W + 3] + np.cross(w, earth_b)
    lever, lever_rate, lever_second = _dry_centre_b_m(flown.vehicle, t_s)
    lever_b_mps = np.cross(w_nb, lever) + lever_rate
    pull_b = np.cross(alpha_nb, lever) + np.cross(w_nb, lever_b_mps + lever_rate) + lever_second
    R_nb = rotations_of(q_nb)
    p_n_m += rotated(R_nb, lever)
    v_n_mps += rotated(R_nb, lever_b_mps)
    a_n_mps2 += rotated(R_nb, pull_b)
    rate = 0.5 * _product(q_nb, _pure(w_nb))
    second = 0.5 * (_product(rate, _pure(w_nb)) + _product(q_nb, _pure(alpha_nb)))
    return FlownMotion(
        position_n_m=_quintic(t_s, p_n_m, v_n_mps, a_n_mps2),
        quaternion_nb=_quintic(t_s, q_nb, rate, second),
    )


def _dry_centre_b_m(vehicle: Vehicle, t_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return where the dry centre of mass is from the present one, and two derivatives, (n, 3)."""
    lever = np.zeros((3, len(t_s), 3))
    if vehicle.motor is not None:
        table, grid_s = vehicle.motor, vehicle.motor.time_s
        thrust, shift_m = burning_curve(table), vehicle.body.centre_m - table.loaded_centre_m
        impulse = thrust.antiderivative()
        inside_s = np.clip(t_s, grid_s[0], grid_s[-1])
        burns = (t_s >= grid_s[0]) & (t_s < grid_s[-1])
        total = impulse(grid_s[-1])
        lever[0, :, 0] = shift_m * (1 - impulse(inside_s) / total)
        lever[1, :, 0] = -shift_m * burns * thrust(inside_s) / total
        lever[2, :, 0] = -shift_m * burns * thrust(inside_s, 1) / total
    return lever[0], lever[1], lever[2]


def _quintic(t_s: FloatArray, value: FloatArray, rate: FloatArray, second: FloatArray) -> "PPoly":
    """Return the piecewise quintic through values and two derivatives, each (n, k)."""
    from scipy.interpolate import PPoly  # noqa: PLC0415  # lazy: keeps the command line quick

    h = np.diff(t_s)[:, None]
    c1, c2 = h * rate[:-1], 0.5 * h**2 * second[:-1]
    d = value[1:] - value[:-1] - c1 - c2
    e = h * rate[1:] - c1 - 2 * c2
    f = 0.5 * h**2 * second[1:] - c2
    rows = [6 * d - 3 * e + f, -15 * d + 7 * e - 2 * f, 10 * d - 4 * e + f, c2, c1, value[:-1]]
    powers = [h**power for power in (5, 4, 3, 2, 1, 0)]
    return PPoly(
        np.stack([coefficient / power for coefficient, power in zip(rows, powers, strict=True)]),
        t_s,
    )


def _product(p: FloatArray, q: FloatArray) -> FloatArray:
    """Return the quaternion products p q, (n, 4)."""
    scalar = p[:, :1] * q[:, :1] - np.sum(p[:, 1:] * q[:, 1:], axis=1, keepdims=True)
    vector = p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + np.cross(p[:, 1:], q[:, 1:])
    return np.concatenate([scalar, vector], axis=1)


def _conjugate(wxyz: FloatArray) -> FloatArray:
    """Return conjugated quaternions, (n, 4)."""
    return np.asarray(wxyz * np.array([1.0, -1.0, -1.0, -1.0]))


def _pure(v: FloatArray) -> FloatArray:
    """Return vectors as quaternions without scalar part, (n, 4)."""
    return np.column_stack([np.zeros(len(v)), v])
