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
from fgnav.diagnostics.contents import Finding
from fgnav.diagnostics.track import Integrals, detrended, sampled, summed, velocities
from fgnav.diagnostics.windows import FALSE_ALARM, Windows, fitted, is_better, windows_of
from fgnav.geometry.rotations import to_euler
from fgnav.types.flight import Fixes
from fgnav.types.vehicle import WheeledVehicle

UNITS = {"m/s": 1.0, "knots": 1852 / 3600, "km/h": 1 / 3.6, "ft/s": 0.3048, "cm/s": 0.01}
_COLUMNS = ("vn_mps", "ve_mps", "vd_mps")
_FAST_MPS = 5.0  # faster than wind and noise rotate a course
_STEADY = np.cos(np.radians(25.0))  # mean resultant length: directions within 25 deg of their mean
_MIN_WINDOWS = 8
_STEPS = 4  # of Gauss-Newton


def velocity_findings(fixes: Fixes) -> list[Finding]:
    """Return unit, axes or delay by which velocities are the change of positions."""
    windows = windows_of(fixes.t_s)
    v_n_mps = fixes.v_n_mps
    if v_n_mps is None or len(windows) < 2:
        return []
    t_s, row = fixes.t_s, windows.row
    white = np.where(windows.inside[..., None], 1.0 / fixes.position_sigma_m[row], 0.0)
    y = detrended(windows, t_s, fixes.p_n_m[row], 1)
    x = detrended(windows, t_s, summed(t_s, v_n_mps)[row], 1)
    finding = _column_finding(y, x, white) or _delay_finding(t_s, v_n_mps, windows, y, white)
    return [] if finding is None else [finding]


def _column_finding(y: FloatArray, x: FloatArray, white: FloatArray) -> Finding | None:
    tried = []
    for (unit, factor), axes in product(UNITS.items(), signed_permutations()):
        squares = ((white * (y - factor * x @ axes)) ** 2).sum(axis=(1, 2))
        changes = int((np.diag(axes) < 1).sum()) + (factor != 1.0)
        tried.append((float(np.log(squares + 1e-12).mean()), changes, squares, unit, axes))
    given, best = tried[0], min(tried, key=lambda one: one[0])
    if best is given or not is_better(given[2], best[2], len(tried)):
        return None
    equal = [one for one in tried if not is_better(one[2], best[2], len(tried))]
    level, _, _, unit, axes = min(equal, key=lambda one: (one[1], one[0]))
    parts, mends = [], []
    if unit != "m/s":
        parts.append(f"are in {unit}")
        mends.append(f"multiply by {UNITS[unit]:.6g}")
    if (axes != np.eye(3)).any():
        parts.append("have other axes than north, east, down")
        mends.append(f"{', '.join(_COLUMNS)} should read {named_axes(axes.T, _COLUMNS)}")
    return Finding(
        name="fixes velocity",
        where="[fixes] samples, " + ", ".join(_COLUMNS),
        text=(
            f"velocities {' and '.join(parts)}: as given, residual squares of positions are "
            f"{np.exp(given[0] - level):.3g} times larger"
        ),
        mend="; ".join(mends),
        certain=True,
    )


def _delay_finding(
    t_s: FloatArray, v_n_mps: FloatArray, windows: Windows, y: FloatArray, white: FloatArray
) -> Finding | None:
    """Return the delay of velocities beside positions, (W, n, 3), by Gauss-Newton."""
    at_s, delay_s, sigma_s, bound_s = t_s[windows.row], 0.0, np.inf, np.inf
    constant = (white[..., None] * np.eye(3)).reshape(len(y), -1, 3)
    for _ in range(_STEPS):
        inner = [summed(t_s, v_n_mps), v_n_mps]
        x, v = (sampled(t_s, one, (at_s + delay_s).ravel()).reshape(y.shape) for one in inner)
        residual = white * (y - detrended(windows, t_s, x, 1))
        by_delay = (white * v).reshape(len(y), -1, 1)
        here = fitted(residual.reshape(len(y), -1), constant, by_delay, np.zeros(3))
        delay_s += float(np.clip(here.x[0], -0.5, 0.5))
        sigma_s, bound_s = here.sigma(0), here.bound(0)
    if not abs(delay_s) > bound_s:
        return None
    word = "old" if delay_s > 0 else "early"
    return Finding(
        name="velocity delay",
        where="[fixes] samples, vn_mps, ve_mps, vd_mps",
        text=f"velocities are {abs(delay_s):.3f} s {word} (± {sigma_s:.3f} s) beside positions",
        mend="shift their times, or leave them out",
    )


def mounting_findings(
    fixes: Fixes, integrals: Integrals, clock: Clock, vehicle: WheeledVehicle | None
) -> tuple[list[Finding], list[Finding]]:
    """Return how the IMU's axes should be read, and what only wheels would tell."""
    windows = clock.windows
    row, inside = windows.row, windows.inside[..., None]
    at_s = (fixes.t_s[row] - clock.offset_s).ravel()
    R_sb = sampled(integrals.t_s, integrals.R_sb, at_s).reshape(*row.shape, 3, 3)
    R_nb = clock.R_ns[:, None] @ R_sb
    down_b = _unit(R_nb[..., 2, :].mean(axis=1))
    v_n_mps, _ = velocities(fixes)
    if v_n_mps is None:
        return [], []
    mean_n_mps = (v_n_mps[row] * inside).sum(axis=1) / inside.sum(axis=1)
    # A car reverses, but not for long: by distance.
    along_b = np.einsum("wnji,wnj->wi", R_nb, v_n_mps[row] * inside) / inside.sum(axis=1)
    fast = np.linalg.norm(along_b, axis=1) > _FAST_MPS
    fast &= np.abs(mean_n_mps[:, 2]) < np.linalg.norm(mean_n_mps[:, :2], axis=1)
    ahead_b = _unit(along_b[fast])
    is_ahead = _is_steady(ahead_b)
    down_b = down_b[fast] if len(ahead_b) >= _MIN_WINDOWS else down_b
    if not _is_steady(down_b):
        return [], []
    finding = _quarter_turn(down_b, ahead_b if is_ahead else None)
    if finding is not None or not is_ahead:
        return [] if finding is None else [finding], []
    return _lean(down_b, ahead_b, vehicle)


def _is_steady(directions: FloatArray) -> bool:
    enough = len(directions) >= _MIN_WINDOWS
    return bool(enough and np.linalg.norm(directions.mean(axis=0)) > _STEADY)


def _quarter_turn(down_b: FloatArray, ahead_b: FloatArray | None) -> Finding | None:
    """Return quarter turns by which gravity and travel fit the axes significantly better."""
    ways = signed_permutations()
    ways = ways[np.linalg.det(ways) > 0]
    if ahead_b is None:  # a rocket stands on its tail, nothing lies on its side or back
        ways = ways[ways[:, 2, 0] == 0]
    fit = np.einsum("qj,wj->qw", ways[:, 2], down_b)
    if ahead_b is not None:
        fit = fit + np.einsum("qj,wj->qw", ways[:, 0], ahead_b)
    mean = fit.mean(axis=1)
    equal = np.flatnonzero(mean > mean.max() - 1e-9)
    best = int(equal[np.argmax(np.trace(ways[equal], axis1=1, axis2=2))])
    gain = fit[best] - fit[0]
    bound = -gain.std(ddof=1) / np.sqrt(len(gain)) * stdtrit(len(gain) - 1, FALSE_ALARM / len(ways))
    if best == 0 or gain.mean() <= max(bound, 1.0):  # 1: nearer to another axis by an octant
        return None
    evidence = "gravity" if ahead_b is None else "gravity and travel"
    shown = ", ".join(f"{x:.2f}" for x in _unit(down_b.mean(axis=0)) + 0.0)
    names = named_axes(ways[best])
    listed = str(names.split(", ")).replace("'", '"')
    return Finding(
        name="imu mounting",
        where="[imu] samples, fx_mps2 to wz_radps",
        text=(
            f"{evidence} over {len(gain)} windows lie along other axes than forward, right, down "
            f"(down is [{shown}])"
        ),
        mend=(
            f"x, y, z of both sensors should read {names}: [imu] axes = {listed}, unless the "
            "flight has others"
        ),
    )


def _lean(
    down_b: FloatArray, ahead_b: FloatArray, vehicle: WheeledVehicle | None
) -> tuple[list[Finding], list[Finding]]:
    """Return angles beyond a vehicle's own in most windows: medians and signs, for manoeuvres."""
    z = _unit(down_b - (down_b * ahead_b).sum(axis=1, keepdims=True) * ahead_b)
    angles_rad = to_euler(np.stack([ahead_b, np.cross(z, ahead_b), z], axis=1))
    count, median_rad = len(angles_rad), np.median(angles_rad, axis=0)
    limit_rad = (WheeledVehicle() if vehicle is None else vehicle).axes_sigma_rad
    beyond = (angles_rad * np.sign(median_rad) > limit_rad).sum(axis=0)
    if (bdtrc(beyond - 1, count, 0.5) > FALSE_ALARM / 3).all():
        return [], []
    # Sigma of a median, and that of the sample from its median deviation, of normal noise.
    spread_rad = 1.4826 * np.median(np.abs(angles_rad - median_rad), axis=0)
    sigmas = ", ".join(f"{x:.1f}" for x in np.degrees(np.sqrt(np.pi / 2 / count) * spread_rad))
    shown = ", ".join(f"{x:.1f}" for x in np.degrees(median_rad).round(1) + 0.0)
    text = (
        f"by gravity and travel over {count} windows, roll, pitch, yaw of the IMU are [{shown}] "
        f"deg (± {sigmas})"
    )
    if vehicle is None:
        why = f'{text}: a mounting only on wheels; state [vehicle] kind = "wheeled"'
        return [], [Finding(name="imu mounting", text=why)]
    mend = f"[imu] mounting_deg = [{shown}], unless the flight has another"
    where = "[imu] samples, fx_mps2 to wz_radps"
    return [Finding(name="imu mounting", text=text, mend=mend, where=where)], []


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True).clip(1e-12))
