"""The best that all measurements allow: the posterior Cramer-Rao bound of the whole flight."""

import numpy as np

from fgnav.alignment.rates import swing_n_mps
from fgnav.assembly.prepared import PreparedFlight
from fgnav.checks import FloatArray, NoSolutionError
from fgnav.evaluation.scores import EULER, Angles
from fgnav.geometry.cubic_spline import cubic_spline
from fgnav.geometry.rotations import euler_jacobian, log, transpose
from fgnav.graph.types.states import States
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.types.estimate import open_angle_variance_rad2
from fgnav.types.flight import Flight, Truth

_APART_S = 0.01  # of two attitudes whose difference is a rate


def posterior_bound(flight: Flight, prepared: PreparedFlight) -> FloatArray:
    """Return the least covariance of rotations at keyframes, (n, 3, 3), rad2, body axes.

    The inverse of the information of all that is measured and of the prior, both linearised at the
    truth [1]_. It bounds the mean error over motions drawn from that prior; an estimator that
    knows more of one motion, as that a swing is commanded, may have less.

    Parameters
    ----------
    flight : Flight
        With truth.
    prepared : PreparedFlight
        Of this flight: its keyframes and measurements.

    Raises
    ------
    NoSolutionError
        If the flight has no truth.

    References
    ----------
    .. [1] Tichavsky, Muravchik, Nehorai: Posterior Cramer-Rao bounds for discrete-time nonlinear
       filtering, IEEE Trans. Signal Processing 46, 1998, eqs. 3 and 21.
    """
    from fgnav.solve.gauss_newton import posterior_at  # noqa: PLC0415  # lazy: its kernels

    states = true_states(flight, prepared)
    return np.asarray(posterior_at(prepared.problem, states).covariance[:, :3, :3])


def posterior_angles(flight: Flight, prepared: PreparedFlight) -> Angles:
    """Return the bound on roll, pitch and yaw, RMS over keyframes, degrees.

    None for all three without a truth at every keyframe, and for an angle that is left open.
    """
    if flight.truth is None:
        return Angles()
    R_nb, is_covered = attitude_at(flight.truth, prepared.problem.t_s)
    if not is_covered.all():
        return Angles()
    J = euler_jacobian(R_nb)
    variance = np.einsum("nij,njk,nik->ni", J, posterior_bound(flight, prepared), J).mean(axis=0)
    bounded = (variance > 0) & (variance < open_angle_variance_rad2())
    sigma_deg = np.degrees(np.sqrt(np.where(bounded, variance, np.nan))).tolist()
    return Angles(**{k: s for k, s, b in zip(EULER, sigma_deg, bounded.tolist(), strict=True) if b})


def true_states(flight: Flight, prepared: PreparedFlight) -> States:
    """Return the true states of the accelerometer at keyframes.

    Biases and derivatives of the rate, of which flights keep no truth, are zero; constants are
    where the search starts. What was measured is linear in them, or next to it.

    Raises
    ------
    NoSolutionError
        If the flight has no truth.
    """
    truth, problem = flight.truth, prepared.problem
    if truth is None:
        raise NoSolutionError(f"flight {flight.name}: a posterior bound needs its truth")
    t_s, arm_b_m = problem.t_s, prepared.imu.position_b_m
    R_nb, w_b_radps = attitude_at(truth, t_s)[0], _rates_b_radps(truth, t_s)
    p_n_m, v_n_mps = (cubic_spline(truth.t_s, x, t_s) for x in (truth.p_n_m, truth.v_n_mps))
    imu_states = np.zeros_like(problem.start.aux)
    if prepared.imu.w_b_radps is None:
        imu_states[:, 3:6] = w_b_radps
    return States(
        R_nb=R_nb,
        p_n_m=p_n_m + R_nb @ arm_b_m,
        v_n_mps=v_n_mps + swing_n_mps(R_nb, w_b_radps, arm_b_m),
        aux=imu_states,
        constants=problem.start.constants,
    )


def _rates_b_radps(truth: Truth, t_s: FloatArray) -> FloatArray:
    """Return true body rates against n, (n, 3)."""
    before = np.clip(t_s - _APART_S / 2, truth.t_s[0], truth.t_s[-1] - _APART_S)
    after = before + _APART_S
    rotation_rad = log(transpose(attitude_at(truth, before)[0]) @ attitude_at(truth, after)[0])
    return np.asarray(rotation_rad / _APART_S)
