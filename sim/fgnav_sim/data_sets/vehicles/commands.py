"""What drivers and pilots do: targets that hold for a while, reached at a limited pace."""

from collections.abc import Callable

import numpy as np

from fgnav.checks import FloatArray
from fgnav_sim.data_sets.vehicles.track import STEP_S


def targets(
    count: int,
    lasting_s: tuple[float, float],
    draw: Callable[[np.random.Generator], float],
    rng: np.random.Generator,
) -> FloatArray:
    """Return targets at knots, (count,), each for a time that is uniform within a range."""
    out = np.empty(count)
    first = 0
    while first < count:
        last = first + max(1, round(float(rng.uniform(*lasting_s)) / STEP_S))
        out[first:last] = draw(rng)
        first = last
    return out


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


def wander(count: int, sigma: float, time_s: float, rng: np.random.Generator) -> FloatArray:
    """Return a stationary Gaussian process, (count,), smooth over about half of its time."""
    from scipy.signal import lfilter  # noqa: PLC0415  # lazy, like gnss.orbits

    keep = np.exp(-STEP_S / time_s)
    white = np.sqrt(1 - keep**2) * rng.standard_normal(count)
    white[0] = rng.standard_normal()
    rough = lfilter([1.0], [1.0, -keep], white)
    found = smooth(np.asarray(rough), time_s / 4)
    return np.asarray(sigma * found)


def integral(rate: FloatArray) -> FloatArray:
    """Return the integral from the first knot, along the first axis, by trapezia."""
    steps = (rate[1:] + rate[:-1]) * (STEP_S / 2)
    return np.concatenate([np.zeros_like(rate[:1]), np.cumsum(steps, axis=0)])


def log_uniform(low: float, high: float, rng: np.random.Generator) -> float:
    """Return a number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def leaning(sigma_deg: float, rng: np.random.Generator) -> FloatArray:
    """Return how an inertial unit is turned against its vehicle, ``R_vb``, (3, 3)."""
    from fgnav.geometry.rotations import exp  # noqa: PLC0415  # beside the lazy ones

    return np.asarray(exp(np.radians(sigma_deg) * rng.standard_normal((1, 3)))[0])
