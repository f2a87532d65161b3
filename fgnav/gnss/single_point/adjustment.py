"""Least-squares positions of many epochs from corrected code ranges."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.gnss.least_squares import Fits, fit
from fgnav.gnss.orbits.satellites import angles, signal_paths
from fgnav.gnss.single_point.model import CodeChannels, CodeRanges, atmosphere_m
from fgnav.types.flight import Flight
from fgnav.types.instruments import GnssNoise

_CONVERGED_M = 1e-4
_NEAR_M = 1e4  # elevations and the atmosphere mean something once a step is smaller
_MAX_STEPS = 15  # 6 suffice from an origin 1000 km away; the caller sees what did not converge
_LOWEST_SINE = 0.05  # weights fall no further
_GRID_M = 2.0**-20  # to which causal positions are rounded: rounding of sums leaves 1e-8


@dataclass(frozen=True, eq=False, slots=True)
class Equations:
    """Ranges of n epochs linearised at a position: ``y = A (step, clocks in metres)``."""

    A: FloatArray  # (n, m, 3 + c)
    y: FloatArray
    variance_m2: FloatArray
    elevation_rad: FloatArray


def _equations(
    flight: Flight,
    channels: CodeChannels,
    ranges: CodeRanges,
    p_e_m: FloatArray,
) -> Equations:
    paths = signal_paths(ranges.states, p_e_m, np.zeros_like(p_e_m))
    direction = angles(p_e_m, paths.e_e)
    sigma_m = growing(flight.gnss_noise, flight.gnss_noise.code_m, direction[0])
    y, variance_m2 = ranges.range_m - paths.range_m, ranges.message_variance_m2 + sigma_m**2
    if flight.gnss_noise.atmosphere:
        delay_m, left_m2 = atmosphere_m(flight, channels, p_e_m, direction, ranges.gps_s)
        y, variance_m2 = y - delay_m, variance_m2 + left_m2
    clocks = np.broadcast_to(channels.clock_of, (*y.shape, len(channels.constellations)))
    A = np.concatenate([-paths.e_e, clocks], axis=2)
    return Equations(A, y, variance_m2, direction[0])


def growing(noise: GnssNoise, sigma: float, elevation_rad: FloatArray) -> FloatArray:
    """Return standard deviations of links as they grow towards the horizon."""
    if noise.elevation_weights == "uniform":
        return np.full_like(elevation_rad, sigma)
    return np.asarray(sigma / np.sin(elevation_rad).clip(_LOWEST_SINE))


@dataclass(frozen=True, eq=False, slots=True)
class Adjusted:
    """Converged positions of n epochs."""

    p_e_m: FloatArray
    equations: Equations
    fits: Fits
    use: BoolArray
    converged: BoolArray


def adjust(
    flight: Flight,
    channels: CodeChannels,
    ranges: CodeRanges,
    wanted: BoolArray,
    *,
    start_e_m: FloatArray | None = None,
    each: bool = False,
) -> Adjusted:
    """Solve for position and clocks by Gauss-Newton, all epochs at once.

    From the origin, which may be far away, or from places (n, 3) less than 10 km off.

    With ``each`` no epoch depends on which others there are: it stops where it converges, however
    long others take, and positions are multiples of a micrometre, so that sums taken in another
    order end at the same place.
    """
    n, steps = len(wanted), 0
    p_e_m = np.repeat(flight.origin.p_e_m[None], n, axis=0) if start_e_m is None else start_e_m
    step_m = np.full(n, np.inf if start_e_m is None else _NEAR_M)
    while True:
        equations = _equations(flight, channels, ranges, p_e_m)
        far = (step_m > _NEAR_M)[:, None]
        use = wanted & (far | (equations.elevation_rad >= flight.elevation_mask_rad))
        fits = fit(equations.A, equations.y, equations.variance_m2, use)
        converged = fits.solved & (step_m < _CONVERGED_M)
        if (converged | ~fits.solved).all() or steps == _MAX_STEPS:
            return Adjusted(p_e_m, equations, fits, use, converged)
        steps += 1
        moves = fits.solved & ~converged if each else fits.solved
        step = np.where(moves[:, None], fits.x[:, :3], 0.0)
        step_m = np.where(moves, np.linalg.norm(step, axis=1), step_m if each else np.inf)
        p_e_m = p_e_m + step
        if each:
            rounded_m = np.rint(p_e_m / _GRID_M) * _GRID_M
            p_e_m = np.where(moves[:, None], rounded_m, p_e_m)
