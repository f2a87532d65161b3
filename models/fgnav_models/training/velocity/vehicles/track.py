"""A way through space and its attitudes as splines, with the vehicle's own shaking on top."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import from_euler, to_euler
from fgnav_sim.motion import State, body_rates

STEP_S = 0.05  # between knots: commands of vehicles are slower by an order
_SHAKES_HZ = 200.0  # knots of the shaking: white up to what an inertial unit samples
_DEGREE = 5  # third derivatives are continuous
_MARGIN_S = 0.5  # knots before and after a flight, where splines have their ends


def knots_s(duration_s: float) -> FloatArray:
    """Return the times of knots, a little beyond both ends of a flight."""
    return np.arange(-_MARGIN_S, duration_s + _MARGIN_S, STEP_S)


@dataclass(frozen=True, eq=False, slots=True)
class Track:
    """Splines of position, (n, 3), and 3-2-1 angles, (n, 3), and shaking at its own knots.

    ``shaking`` holds accelerations and rates in body axes, (m, 6): what an inertial unit feels of
    engine, rotors and road. Velocities of it, millimetres per second, are left out.
    """

    position: Any
    angles: Any
    shaking: FloatArray

    def __call__(self, t_s: FloatArray) -> State:
        """Return the motion at times since the start, (n,)."""
        state = self.calm(t_s)
        phase = (t_s + _MARGIN_S) * _SHAKES_HZ
        shaken = np.stack([np.interp(phase, np.arange(len(x)), x) for x in self.shaking.T], 1)
        return replace(
            state,
            a_n_mps2=state.a_n_mps2 + np.einsum("nij,nj->ni", state.R_nb, shaken[:, :3]),
            w_nb_b_radps=state.w_nb_b_radps + shaken[:, 3:],
        )

    def calm(self, t_s: FloatArray) -> State:
        """Return the motion without shaking."""
        angles = [self.angles.derivative(k)(t_s).T if k else self.angles(t_s).T for k in range(3)]
        roll, pitch, yaw = np.stack(angles, axis=1)
        w_b_radps, alpha_b_radps2 = body_rates(roll, pitch, yaw)
        return State(
            p_n_m=self.position(t_s),
            v_n_mps=self.position.derivative(1)(t_s),
            a_n_mps2=self.position.derivative(2)(t_s),
            R_nb=from_euler(roll[0], pitch[0], yaw[0]),
            w_nb_b_radps=w_b_radps,
            alpha_nb_b_radps2=alpha_b_radps2,
        )


def track(
    p_n_m: FloatArray,
    R_nb: FloatArray,
    shaking: tuple[FloatArray, FloatArray],
    rng: np.random.Generator,
) -> Track:
    """Return a track through knots.

    Parameters
    ----------
    p_n_m : ndarray, shape (n, 3)
        Of the inertial unit, ``STEP_S`` apart.
    R_nb : ndarray, shape (n, 3, 3)
    shaking : pair of ndarray, shape (n,) each
        1-sigma of the shaking's accelerations and rates; axes draw their own share of it.
    """
    from scipy.interpolate import make_interp_spline  # noqa: PLC0415  # lazy, like gnss.orbits

    t_s = STEP_S * np.arange(len(p_n_m)) - _MARGIN_S
    angles = np.unwrap(to_euler(R_nb), axis=0)
    fine_s = np.arange(t_s[0], t_s[-1], 1 / _SHAKES_HZ)
    share = np.exp(0.4 * rng.standard_normal(6))
    sizes = [np.interp(fine_s, t_s, size) for size in shaking]
    size = np.repeat(np.stack(sizes, axis=1), 3, axis=1) * share
    return Track(
        position=make_interp_spline(t_s, p_n_m, k=_DEGREE),
        angles=make_interp_spline(t_s, angles, k=_DEGREE),
        shaking=size * rng.standard_normal(size.shape),
    )
