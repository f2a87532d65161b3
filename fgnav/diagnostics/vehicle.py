"""Columns of velocities against positions, and mounting of the IMU in the vehicle.

Gravity is down, and what drives or flies goes nose first: directions that stay in the IMU's axes
show how it lies. By less than a quarter turn only wheels tell a mounting from a body that leans,
such as a wing at its angle of attack.
"""

from itertools import product

import numpy as np
from scipy.special import bdtrc, stdtrit

from fgnav.checks import FloatArray
from fgnav.diagnostics.axes import named_axes, signed_permutations
from fgnav.diagnostics.clock import Clock
from fgnav.diagnostics.contents import SAMPLES, Finding
from fgnav.diagnostics.track import Integrals, detrended, velocities
from fgnav.diagnostics.windows import FALSE_ALARM, fitted, is_better, windows_of
from fgnav.geometry.interpolation import corrected_integral, interpolate_tensors
from fgnav.geometry.rotations import to_euler
from fgnav.types.flight import Fixes
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle

UNITS = {"m/s": 1.0, "knots": 1852 / 3600, "km/h": 1 / 3.6, "ft/s": 0.3048, "cm/s": 0.01}
_COLUMNS = ("vn_mps", "ve_mps", "vd_mps")
_VELOCITIES = "[fixes] samples, " + ", ".join(_COLUMNS)
_FAST_MPS = 5.0  # faster than wind and noise rotate a course
_STEADY = np.cos(np.radians(25.0))  # mean resultant length: directions within 25 deg of their mean
_MIN_WINDOWS = 8
_STEPS = 4  # of Gauss-Newton


def velocity_finding(fixes: Fixes) -> Finding | None:
    """Return unit, axes or delay by which velocities are the change of positions."""
    windows, t_s, v_n_mps = windows_of(fixes.t_s), fixes.t_s, fixes.v_n_mps
    if v_n_mps is None or len(windows) < 2:
        return None
    rows, way_m = windows.row, corrected_integral(t_s, v_n_mps)
    white = np.where(windows.inside[..., None], 1.0 / fixes.position_sigma_m[rows], 0.0)
    y = detrended(windows, t_s, fixes.p_n_m[rows], 1)
    finding = _column_finding(y, detrended(windows, t_s, way_m[rows], 1), white)
    if finding is not None:
        return finding
    constant = (white[..., None] * np.eye(3)).reshape(len(y), -1, 3)
    delay_s, sigma_s, bound_s = 0.0, np.inf, np.inf
    for _ in range(_STEPS):
        at_s = (t_s[rows] + delay_s).ravel()
        x, v = (
            interpolate_tensors(at_s, t_s, values).reshape(y.shape) for values in (way_m, v_n_mps)
        )
        residual = (white * (y - detrended(windows, t_s, x, 1))).reshape(len(y), -1)
        by_delay = (white * v).reshape(len(y), -1, 1)
        here = fitted(residual, constant, by_delay, np.zeros(3))
        delay_s += float(np.clip(here.x[0], -0.5, 0.5))
        sigma_s, bound_s = here.sigma(0), here.bound(0)
    if not abs(delay_s) > bound_s:
        return None
    word = "old" if delay_s > 0 else "early"
    text = f"velocities are {abs(delay_s):.3f} s {word} (± {sigma_s:.3f} s) beside positions"
    return Finding("velocity delay", text, "shift their times, or leave them out", _VELOCITIES)


def _column_finding(y: FloatArray, x: FloatArray, white: FloatArray) -> Finding | None:
    """Return unit and axes of integrated velocities, (W, n, 3), that fit positions better."""
    tried = []
    for (unit, factor), axes in product(UNITS.items(), signed_permutations()):
        squares = ((white * (y - factor * x @ axes)) ** 2).sum(axis=(1, 2))
        changes = int((np.diag(axes) < 1).sum()) + (factor != 1.0)
        tried.append((float(np.log(squares + 1e-12).mean()), changes, squares, unit, axes))
    given, best = tried[0], min(tried, key=lambda fit: fit[0])
    if best is given or not is_better(given[2], best[2], len(tried)):
        return None
    equal = [fit for fit in tried if not is_better(fit[2], best[2], len(tried))]
    level, _, _, unit, axes = min(equal, key=lambda fit: (fit[1], fit[0]))
    parts, mends = [], []
    if unit != "m/s":
        parts.append(f"are in {unit}")
        mends.append(f"multiply by {UNITS[unit]:.6g}")
    if (axes != np.eye(3)).any():
        parts.append("have other axes than north, east, down")
        mends.append(f"{', '.join(_COLUMNS)} should read {named_axes(axes.T, _COLUMNS)}")
    text = (
        f"velocities {' and '.join(parts)}: as given, residual squares of positions are "
        f"{np.exp(given[0] - level):.3g} times larger"
    )
    return Finding("fixes velocity", text, "; ".join(mends), _VELOCITIES, certain=True)


def mounting_finding(
    fixes: Fixes, integrals: Integrals, clock: Clock, vehicle: WheeledVehicle | FinnedVehicle | None
) -> tuple[Finding | None, bool]:
    """Return the finding on the IMU's mounting, and True if no lean of the body explains it."""
    rows, inside = clock.windows.row, clock.windows.inside[..., None]
    R_sb = interpolate_tensors(fixes.t_s[rows].ravel(), integrals.t_s, integrals.R_sb).reshape(
        *rows.shape, 3, 3
    )
    R_nb, (v_n_mps, _) = clock.R_ns[:, None] @ R_sb, velocities(fixes)
    if v_n_mps is None:
        return None, True
    v_n_mps, count = v_n_mps[rows] * inside, inside.sum(axis=1)
    # A car reverses, but not for long: by distance.
    along_b = np.einsum("wnji,wnj->wi", R_nb, v_n_mps) / count
    mean_n_mps = v_n_mps.sum(axis=1) / count
    fast = np.linalg.norm(along_b, axis=1) > _FAST_MPS
    fast &= np.abs(mean_n_mps[:, 2]) < np.linalg.norm(mean_n_mps[:, :2], axis=1)
    down_b, ahead_b = _unit(R_nb[..., 2, :].mean(axis=1)), _unit(along_b)
    is_ahead = _is_steady(ahead_b[fast])
    down_b = down_b[fast] if fast.sum() >= _MIN_WINDOWS else down_b
    ahead_b = ahead_b[fast] if is_ahead else np.array([1.0, 0.0, 0.0])
    # A rocket stands on its tail: without travel, down along x is no mistake.
    if not _is_steady(down_b) or (not is_ahead and abs(down_b[:, 0].mean()) > np.sqrt(0.5)):
        return None, True
    z = _unit(down_b - (down_b * ahead_b).sum(axis=1, keepdims=True) * ahead_b)
    y = _unit(np.cross(z, ahead_b))
    R_vb = np.stack([np.cross(y, z), y, z], axis=1)
    finding = _axes_exchange(R_vb, "gravity and travel" if is_ahead else "gravity")
    if finding is not None or not is_ahead:
        return finding, True
    wheeled = vehicle if isinstance(vehicle, WheeledVehicle) else None
    return _lean(R_vb, wheeled), wheeled is not None


def _is_steady(directions: FloatArray) -> bool:
    is_sufficient = len(directions) >= _MIN_WINDOWS
    return bool(is_sufficient and np.linalg.norm(directions.mean(axis=0)) > _STEADY)


def _axes_exchange(R_vb: FloatArray, evidence: str) -> Finding | None:
    """Return axes that are significantly nearer to the vehicle's, by at least an octant."""
    ways = signed_permutations()
    ways = ways[np.linalg.det(ways) > 0]
    fit = np.einsum("qij,wij->qw", ways, R_vb)
    best = int(fit.mean(axis=1).argmax())
    gain = fit[best] - fit[0]
    bound = -gain.std(ddof=1) / np.sqrt(len(gain)) * stdtrit(len(gain) - 1, FALSE_ALARM / len(ways))
    if best == 0 or gain.mean() <= max(bound, 1.0):
        return None
    names = named_axes(ways[best])
    listed = str(names.split(", ")).replace("'", '"')
    shown = ", ".join(f"{x:.2f}" for x in R_vb[:, 2].mean(axis=0) + 0.0)
    text = (
        f"{evidence} over {len(gain)} windows lie along other axes than forward, right, down "
        f"(down is [{shown}])"
    )
    mend = f"x, y, z of both sensors should read {names}: [imu] axes = {listed}"
    return Finding("imu mounting", text, f"{mend}, unless the flight has others", SAMPLES)


def _lean(R_vb: FloatArray, vehicle: WheeledVehicle | None) -> Finding | None:
    """Return angles beyond a vehicle's own in most windows: medians and signs, for manoeuvres."""
    angles_rad = to_euler(R_vb)
    count, median_rad = len(angles_rad), np.median(angles_rad, axis=0)
    limit_rad = (WheeledVehicle() if vehicle is None else vehicle).axes_sigma_rad
    beyond = (angles_rad * np.sign(median_rad) > limit_rad).sum(axis=0)
    if (bdtrc(beyond - 1, count, 0.5) > FALSE_ALARM / 3).all():
        return None
    # Sigma of a median, and that of the sample from its median deviation, of normal noise.
    spread_rad = 1.4826 * np.median(np.abs(angles_rad - median_rad), axis=0)
    sigmas = ", ".join(f"{x:.1f}" for x in np.degrees(np.sqrt(np.pi / 2 / count) * spread_rad))
    shown = ", ".join(f"{x:.1f}" for x in np.degrees(median_rad).round(1) + 0.0)
    text = (
        f"by gravity and travel over {count} windows, roll, pitch, yaw of the IMU are [{shown}] "
        f"deg (± {sigmas})"
    )
    mend = f"[imu] mounting_deg = [{shown}], unless the flight has another"
    if vehicle is None:
        mend = 'a mounting only on wheels: state [vehicle] kind = "wheeled"'
    return Finding("imu mounting", text, mend, SAMPLES)


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True).clip(1e-12))
