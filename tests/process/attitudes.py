"""Rates drawn from the prior, and attitudes with noise."""

import numpy as np

from fgnav.geometry.rotations import exp, from_euler
from fgnav.process.matern import integral, noise_factor, stationary, transition

DEG = np.pi / 180
ARRAY_SIGMA = np.array([0.55, 0.14, 0.065]) * DEG  # of an array's attitudes
_PARTS = 10  # of an interval when rates are drawn


def drawn_attitudes(t_s, own, sigma, mean, rng):
    """Return attitudes (n, 3, 3) of rates drawn from a prior of poles (3,), or (3, 3) by axis."""
    own = np.broadcast_to(own, (3, 3))
    R = np.empty((len(t_s), 3, 3))
    R[0] = np.eye(3)
    root = np.linalg.cholesky(np.array([stationary(axis) for axis in own]))
    x = np.einsum("ipq,qi->pi", root, rng.normal(size=(3, 3))) * sigma
    for k in range(len(t_s) - 1):
        T = (t_s[k + 1] - t_s[k]) / _PARTS
        F, H, L = (
            np.array([of(T, axis) for axis in own]) for of in (transition, integral, noise_factor)
        )
        R[k + 1] = R[k]
        for _ in range(_PARTS):
            noise = np.einsum("ipq,qi->pi", L, rng.normal(size=(4, 3))) * sigma
            before, phi = x[0] + mean, mean * T + np.einsum("iq,qi->i", H, x) + noise[0]
            x = np.einsum("ipq,qi->pi", F, x) + noise[1:]
            phi += T**2 / 12 * np.cross(before, x[0] + mean)
            R[k + 1] = R[k + 1] @ exp(phi[None])[0]
    return R


def sigmas(prior):
    return np.sqrt(prior.variance_rad2ps2)


def with_noise(R_nb, sigma, rng):
    """Return attitudes with white errors and their covariances, (n, 3, 3) both."""
    sigma = np.broadcast_to(sigma, 3)
    V = np.tile(np.diag(sigma**2), (len(R_nb), 1, 1))
    return R_nb @ exp(rng.normal(size=(len(R_nb), 3)) * sigma), V


def sine(t_s, amplitude=20 * DEG):
    """Return attitudes whose Euler angles swing once in 6.3 s."""
    return from_euler(*(amplitude * np.sin(t_s + phase) for phase in (0.0, 1.0, 2.0)))
