"""Commands of drivers and pilots: targets that hold for a while, reached at a limited pace."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav_models.training.velocity.vehicles.track import STEP_S
from fgnav_sim.ranges import log_uniform


@dataclass(frozen=True, slots=True)
class Draws:
    """Random commands at n knots."""

    n: int
    rng: np.random.Generator

    def uniform(self, low: float, high: float) -> float:
        """Return a number within a range."""
        return float(self.rng.uniform(low, high))

    def log_uniform(self, low: float, high: float) -> float:
        """Return a number whose logarithm is uniform."""
        return log_uniform((low, high), self.rng)

    def targets(self, lasting_s: tuple[float, float], draw: Callable[[], float]) -> FloatArray:
        """Return targets, (n,), each for a time that is uniform within a range."""
        out, first = np.empty(self.n), 0
        while first < self.n:
            last = first + max(1, round(self.uniform(*lasting_s) / STEP_S))
            out[first:last] = draw()
            first = last
        return out

    def wander(self, sigma: float, time_s: float) -> FloatArray:
        """Return a stationary Gaussian process, (n,), smooth over about half of its time."""
        from scipy.signal import lfilter  # noqa: PLC0415  # lazy, like gnss.orbits

        keep = np.exp(-STEP_S / time_s)
        white = np.sqrt(1 - keep**2) * self.rng.standard_normal(self.n)
        white[0] = self.rng.standard_normal()
        rough = lfilter([1.0], [1.0, -keep], white)
        return np.asarray(sigma * smooth(np.asarray(rough), time_s / 4))

    def gusts(self, largest: float, time_s: float) -> FloatArray:
        """Return three such processes, (n, 3), each of a size of its own."""
        return np.stack([self.wander(self.uniform(0.0, largest), time_s) for _ in range(3)], axis=1)

    def wind(self, largest: float) -> FloatArray:
        """Return a level wind, (3,), of a size of its own."""
        size = self.uniform(0.0, largest)
        return np.concatenate([size * self.rng.standard_normal(2), [0.0]])


def followed(target: FloatArray, up: float, down: float) -> FloatArray:
    """Return values that follow targets, no faster than ``up`` and ``down`` a second."""
    out = np.empty_like(target)
    now = target[0]
    for k, wanted in enumerate(target):
        now += min(max(wanted - now, -down * STEP_S), up * STEP_S)
        out[k] = now
    return out


def smooth(values: FloatArray, sigma_s: float) -> FloatArray:
    """Return values by a Gaussian kernel, along the first axis."""
    from scipy.ndimage import gaussian_filter1d  # noqa: PLC0415  # lazy, like gnss.orbits

    return np.asarray(gaussian_filter1d(values, sigma_s / STEP_S, axis=0, mode="nearest"))


def integral(rate: FloatArray) -> FloatArray:
    """Return the integral from the first knot, along the first axis, by trapezia."""
    steps = (rate[1:] + rate[:-1]) * (STEP_S / 2)
    return np.concatenate([np.zeros_like(rate[:1]), np.cumsum(steps, axis=0)])


def leaning(sigma_deg: float, rng: np.random.Generator) -> FloatArray:
    """Return the mounting rotation of an inertial unit, ``R_vb``, (3, 3)."""
    from fgnav.geometry.rotations import exp  # noqa: PLC0415  # beside the lazy ones

    return np.asarray(exp(np.radians(sigma_deg) * rng.standard_normal((1, 3)))[0])
