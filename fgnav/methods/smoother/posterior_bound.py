"""The best that all measurements allow: the posterior Cramer-Rao bound of the whole chain."""

from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.cubic_spline import cubic_spline
from fgnav.flight import Flight, Truth
from fgnav.integers.truth import attitude_at
from fgnav.methods.smoother.collect import Collected
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.linear import blocks_of, eliminated
from fgnav.rotations import log, transpose

_APART_S = 0.01  # of two attitudes that tell a rate
_LEAST = 1e-9  # (rad/s2)2/Hz: of a steady turn; with less, rounding would leave rates open


def posterior_bound(
    flight: Flight, collected: Collected, density: FloatArray | None = None
) -> FloatArray:
    """Return the least covariance of rotations at keyframes, (n, 3, 3), rad2, body axes.

    The inverse of the information of all that is measured, taken at the truth, with that of a rate
    that is a random walk [1]_. A motion smoother than that walk, as a commanded swing is, may be
    estimated better by who knows of it.

    Parameters
    ----------
    flight : Flight
        With truth, and without a gyroscope.
    collected : Collected
        Its keyframes.
    density : ndarray, shape (3,), optional
        Intensity of white angular acceleration, (rad/s2)2/Hz; by default that of the walk whose
        mean rates between keyframes change by as much, in the mean square, as the true ones.

    Raises
    ------
    NoSolutionError
        If the flight has no truth.

    References
    ----------
    .. [1] Tichavsky, Muravchik, Nehorai: Posterior Cramer-Rao bounds for discrete-time nonlinear
       filtering, IEEE Trans. Signal Processing 46, 1998, eqs. 3 and 21.
    """
    if flight.truth is None:
        raise NoSolutionError(f"flight {flight.name}: a posterior bound needs its truth")
    there = _at_truth(collected.keyframes, flight.truth)
    if density is None:
        density = _walked(there.t_s, there.R_nb)
    factor = np.maximum(density, _LEAST) / there.preintegrate.angular_acceleration_density
    n = len(there.t_s)
    chain = eliminated(next(blocks_of(there, [0], n)), factor)
    return chain.marginals(0, n - 1).covariance[:, :3, :3]


def _walked(t_s: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return the intensity of a walk, (3,): its mean rates change by ``S (T1 + T2) / 3``."""
    span_s = np.diff(t_s)[:, None]
    mean_radps = log(transpose(R_nb[:-1]) @ R_nb[1:]) / span_s
    walk_s = (span_s[1:] + span_s[:-1]) / 3
    return np.asarray((np.diff(mean_radps, axis=0) ** 2 / walk_s).mean(axis=0))


def _at_truth(keyframes: Keyframes, truth: Truth) -> Keyframes:
    """Return keyframes whose states are the true ones of the accelerometer; its bias stays 0."""
    t_s, arm_b_m = keyframes.t_s, keyframes.preintegrate.imu.position_b_m
    earth_n_radps = keyframes.preintegrate.earth_rate_n_radps
    R_nb, half_s = attitude_at(truth, t_s)[0], _APART_S / 2
    before, after = (np.clip(t_s + h, truth.t_s[0], truth.t_s[-1]) for h in (-half_s, half_s))
    turned = log(transpose(attitude_at(truth, before)[0]) @ attitude_at(truth, after)[0])
    w_b_radps = turned / (after - before)[:, None]
    p_n_m, v_n_mps = (cubic_spline(truth.t_s, x, t_s) for x in (truth.p_n_m, truth.v_n_mps))
    swing_n_mps = np.einsum("nij,nj->ni", R_nb, np.cross(w_b_radps, arm_b_m))
    inertial_b_radps = w_b_radps + np.einsum("nji,j->ni", R_nb, earth_n_radps)
    slot = np.hstack([np.zeros((len(t_s), 3)), -inertial_b_radps])
    moved_n_m, fast_n_mps = p_n_m + R_nb @ arm_b_m, v_n_mps + swing_n_mps
    return replace(keyframes, R_nb=R_nb, p_n_m=moved_n_m, v_n_mps=fast_n_mps, slot=slot)
