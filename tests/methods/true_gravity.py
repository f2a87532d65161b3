"""Gravity directions drawn about the truth, as a network of known accuracy would tell them."""

from dataclasses import dataclass

import numpy as np

from fgnav.gravity import GravityDirection
from fgnav.integers.resolvers.truth import attitude_at
from fgnav.types.flight import Flight


@dataclass(frozen=True)
class TrueGravity:
    """Errs by white noise of a stated size across the vertical, at every fix or GNSS epoch."""

    sigma_deg: float = 3.0
    seed: int = 0
    every: int = 1  # epoch
    name: str = "true-gravity"
    looks_ahead: bool = False

    def __call__(self, flight: Flight) -> GravityDirection:
        """Estimate."""
        source = flight.first_fixes if flight.observations is None else flight.observations
        t_s, rng = source.t_s[:: self.every], np.random.default_rng(self.seed)
        R_nb, covered = attitude_at(flight.truth, t_s)
        sigma = np.radians(self.sigma_deg)
        g_b = R_nb[:, 2] + sigma * rng.standard_normal((len(t_s), 3))
        g_b /= np.linalg.norm(g_b, axis=1, keepdims=True)
        across = np.eye(3) - g_b[:, :, None] * g_b[:, None, :]
        return GravityDirection(
            t_s=t_s[covered], g_b=g_b[covered], covariance=sigma**2 * across[covered]
        )
