"""Position and velocity of a block of epochs, satellites that contradict the others left out."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.least_squares import fit, fit_consistent
from fgnav.gnss.orbits.satellites import signal_paths
from fgnav.gnss.single_point.adjustment import Adjusted, growing
from fgnav.gnss.single_point.model import CodeRanges
from fgnav.types.instruments import GnssNoise

_MAX_DOP = 100.0


@dataclass(frozen=True, eq=False, slots=True)
class SolvedBlock:
    """Epochs of one block that have an answer."""

    epoch: IntArray
    p_e_m: FloatArray
    covariance_m2: FloatArray
    noise_m2: FloatArray
    clock_s: FloatArray
    v_e_mps: FloatArray
    velocity_covariance_m2ps2: FloatArray
    drift_sps: FloatArray
    used: BoolArray


def solved_block(
    noise: GnssNoise,
    ranges: CodeRanges,
    solve: Callable[..., Adjusted],
    epoch: IntArray,
    start_e_m: FloatArray | None,
    lost: Counter[tuple[str, str]],
) -> SolvedBlock:
    """Solve some epochs by ``adjust``, and count what is lost."""
    wanted = np.isfinite(ranges.range_m)
    at = solve(wanted, start_e_m=start_e_m)
    eq, kept = at.equations, at.use
    if not at.fits.consistent[at.fits.solved].all():
        _, kept = fit_consistent(eq.A, eq.y, eq.variance_m2, at.use)
    dropped = at.use & ~kept
    if dropped.any():
        at = solve(wanted & ~dropped, start_e_m=at.p_e_m)
        eq = at.equations
    geometry = fit(eq.A, eq.y, np.ones_like(eq.y), at.use).covariance
    flat = np.trace(geometry, axis1=1, axis2=2) > _MAX_DOP**2
    good = at.converged & at.fits.consistent & ~flat
    v, velocity_covariance, drift = _velocities(noise, ranges, at, good, lost)
    code = "code observation"
    lost[code, "satellite not healthy"] += int((ranges.coded & ranges.states.unhealthy).sum())
    unknown = ranges.coded & ~wanted & ~ranges.states.unhealthy
    lost[code, "no usable ephemeris"] += int(unknown.sum())
    lost[code, "contradicts the other satellites"] += int(dropped.sum())
    lost[code, "below the elevation mask"] += int((wanted & ~at.use & ~dropped).sum())
    lost["epoch", "fewer satellites than unknowns"] += int((~at.fits.solved).sum())
    lost["epoch", "position did not converge"] += int((at.fits.solved & ~at.converged).sum())
    lost["epoch", "satellites contradict each other"] += int(
        (at.converged & ~at.fits.consistent).sum()
    )
    lost["epoch", "geometry is too weak"] += int((at.converged & at.fits.consistent & flat).sum())
    sigma_m = growing(noise, noise.code_m, eq.elevation_rad)
    gain = at.fits.gain[good, :3]
    noise_m2 = np.where(at.use, sigma_m, 0.0)[good] ** 2
    return SolvedBlock(
        epoch[good],
        at.p_e_m[good],
        at.fits.covariance[good, :3, :3],
        np.einsum("nim,nm,njm->nij", gain, noise_m2, gain),
        at.fits.x[good, 3:] / C_MPS,
        v[good],
        velocity_covariance[good],
        drift[good],
        at.use[good],
    )


def _velocities(
    noise: GnssNoise,
    ranges: CodeRanges,
    at: Adjusted,
    good: BoolArray,
    lost: Counter[tuple[str, str]],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return velocities (n, 3), covariances and clock drifts from Doppler; NaN where too few."""
    paths = signal_paths(ranges.states, at.p_e_m, np.zeros_like(at.p_e_m))
    y = ranges.rate_mps - paths.range_rate_mps
    sigma_mps = growing(noise, noise.doppler_mps, at.equations.elevation_rad)
    lag = 1 - paths.range_rate_mps / C_MPS  # as transmission lags behind while the range grows
    A = np.concatenate([-paths.e_e * lag[:, :, None], np.ones((*y.shape, 1))], axis=2)
    use = at.use & np.isfinite(y) & good[:, None]
    fits, kept = fit_consistent(A, y, sigma_mps**2, use)
    lost["Doppler observation", "contradicts the other satellites"] += int((use & ~kept).sum())
    fine = fits.consistent & np.isfinite(fits.x).all(axis=1)
    v = np.where(fine[:, None], fits.x[:, :3], np.nan)
    covariance = np.where(fine[:, None, None], fits.covariance[:, :3, :3], np.nan)
    return v, covariance, np.where(fine, fits.x[:, 3], np.nan) / C_MPS
