"""Least-squares positions of many epochs from corrected code ranges."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.flight import Flight
from fgnav.gnss.code_model import CodeChannels, CodeRanges, atmosphere_m
from fgnav.gnss.least_squares import Fits, fit
from fgnav.gnss.satellites import angles, signal_paths

_CONVERGED_M = 1e-4
_NEAR_M = 1e4  # elevations and the atmosphere mean something once a step is smaller
_MAX_STEPS = 15  # 6 suffice from an origin 1000 km away; the caller sees what did not converge
_LOWEST_SINE = 0.05  # weights fall no further


@dataclass(frozen=True, eq=False, slots=True)
class Equations:
    """Ranges of n epochs linearised at a position: ``y = A (step, clocks in metres)``."""

    A: FloatArray  # (n, m, 3 + c)
    y: FloatArray
    variance_m2: FloatArray
    elevation_rad: FloatArray


def _equations(
    flight: Flight, channels: CodeChannels, ranges: CodeRanges, p_e_m: FloatArray, *, model: bool
) -> Equations:
    paths = signal_paths(ranges.states, p_e_m, np.zeros_like(p_e_m))
    seen = angles(p_e_m, paths.e_e)
    sigma_m = growing(flight, flight.gnss_noise.code_m, seen[0])
    y, variance_m2 = ranges.range_m - paths.range_m, ranges.message_variance_m2 + sigma_m**2
    if model:
        delay_m, left_m2 = atmosphere_m(flight, channels, p_e_m, seen, ranges.gps_s)
        y, variance_m2 = y - delay_m, variance_m2 + left_m2
    clocks = np.broadcast_to(channels.clock_of, (*y.shape, len(channels.constellations)))
    A = np.concatenate([-paths.e_e, clocks], axis=2)
    return Equations(A, y, variance_m2, seen[0])


def growing(flight: Flight, sigma: float, elevation_rad: FloatArray) -> FloatArray:
    """Return standard deviations of links as they grow towards the horizon."""
    if flight.gnss_noise.elevation_weights == "uniform":
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
    model: bool,
    start_e_m: FloatArray | None = None,
) -> Adjusted:
    """Solve for position and clocks by Gauss-Newton, all epochs at once.

    From the origin, which may be far away, or from places (n, 3) less than 10 km off.
    """
    n, steps = len(wanted), 0
    p_e_m = np.repeat(flight.origin.p_e_m[None], n, axis=0) if start_e_m is None else start_e_m
    step_m = np.full(n, np.inf if start_e_m is None else _NEAR_M)
    while True:
        equations = _equations(flight, channels, ranges, p_e_m, model=model)
        far = (step_m > _NEAR_M)[:, None]
        use = wanted & (far | (equations.elevation_rad >= flight.elevation_mask_rad))
        fits = fit(equations.A, equations.y, equations.variance_m2, use)
        converged = fits.solved & (step_m < _CONVERGED_M)
        if (converged | ~fits.solved).all() or steps == _MAX_STEPS:
            return Adjusted(p_e_m, equations, fits, use, converged)
        steps += 1
        step = np.where(fits.solved[:, None], fits.x[:, :3], 0.0)
        step_m = np.where(fits.solved, np.linalg.norm(step, axis=1), np.inf)
        p_e_m = p_e_m + step


def misfit(flight: Flight, at: Adjusted) -> float:
    """Return the median residual of a sample of epochs, in sigmas of the code noise per freedom."""
    sigma_m = growing(flight, flight.gnss_noise.code_m, at.equations.elevation_rad)
    spare = at.converged & (at.fits.freedom > 0)
    if not spare.any():
        return np.inf
    squares = np.where(at.use, at.fits.residual / sigma_m, 0.0)[spare] ** 2
    return float(np.median(squares.sum(axis=1) / at.fits.freedom[spare]))
