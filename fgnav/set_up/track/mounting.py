"""How the inertial unit lies in the vehicle: gravity and the way of travel in its axes.

Gravity is down, and what flies or drives goes nose first. Neither must be so of a body that rolls,
hovers or slips; only directions that stay where they are in the unit's axes say anything. By less
than a quarter turn only wheels tell a unit that leans from a body that does, such as a wing at its
angle of attack.
"""

import numpy as np

from fgnav.attitude.flight_vectors import Track
from fgnav.checks import FloatArray
from fgnav.geometry.rotations import to_euler
from fgnav.identification.track.clock import Clock
from fgnav.identification.track.integrals import Integrals, sampled
from fgnav.identification.track.motion import Series
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.set_up.findings import Finding
from fgnav.set_up.track.axes import named_axes, signed_permutations
from fgnav.types.vehicle import WheeledVehicle

_FAST_MPS = 5.0  # a course is meant: faster than wind and noise turn it
_STEADY = np.cos(np.radians(25.0))  # mean resultant length: directions within 25 deg of their mean
_FEWEST = 8  # windows
_SAMPLES = "[imu] samples, fx_mps2 to wz_radps"


def mounting_findings(
    series: Series,
    integrals: Integrals,
    clock: Clock,
    track: Track,
    vehicle: WheeledVehicle | None,
) -> tuple[list[Finding], list[Finding]]:
    """Return how the axes should be read, and what only wheels would tell."""
    windows = clock.windows
    t_s = series.t_s[windows.row]
    R_sb = sampled(integrals.t_s, integrals.R_sb, (t_s - clock.late_s).ravel())
    R_nb = clock.R_ns[:, None] @ R_sb.reshape(*t_s.shape, 3, 3)
    down_b = _unit(R_nb[..., 2, :].mean(axis=1))
    v_n = (
        track.v_n_mps if track.v_n_mps is not None else np.gradient(track.p_n_m, track.t_s, axis=0)
    )
    inside = np.searchsorted(track.t_s, t_s).clip(max=len(track.t_s) - 1)
    v_n = v_n[inside]
    # A car reverses, but not for long: by distance.
    along_b = np.einsum("wnji,wnj->wi", R_nb, np.nan_to_num(v_n) * windows.inside[..., None])
    fast = np.linalg.norm(along_b, axis=1) > _FAST_MPS * windows.inside.sum(axis=1)
    level = np.abs(np.nan_to_num(v_n)[..., 2].mean(axis=1)) < np.linalg.norm(
        np.nan_to_num(v_n)[..., :2].mean(axis=1), axis=1
    )
    ahead = _unit(along_b[fast & level])
    down = down_b[fast & level] if len(ahead) >= _FEWEST else down_b
    steady_down = len(down) >= _FEWEST and np.linalg.norm(down.mean(axis=0)) > _STEADY
    steady_ahead = len(ahead) >= _FEWEST and np.linalg.norm(ahead.mean(axis=0)) > _STEADY
    if not steady_down:
        return [], []
    turned = _turned(down, ahead if steady_ahead else None)
    if turned or not steady_ahead:
        return turned, []
    return _leaning(down, ahead, vehicle)


def _turned(down_b: FloatArray, ahead_b: FloatArray | None) -> list[Finding]:
    from scipy.stats import t as student  # noqa: PLC0415  # lazy: a slow import

    ways = signed_permutations()
    ways = ways[np.linalg.det(ways) > 0]
    if ahead_b is None:  # a rocket stands on its tail, nothing lies on its side or back
        ways = ways[ways[:, 2, 0] == 0]
    fit = np.einsum("qj,wj->qw", ways[:, 2], down_b)
    if ahead_b is not None:
        fit = fit + np.einsum("qj,wj->qw", ways[:, 0], ahead_b)
    # Of ways that fit alike the one that turns least.
    mean = fit.mean(axis=1)
    alike = np.flatnonzero(mean > mean.max() - 1e-9)
    best = int(alike[np.argmax(np.trace(ways[alike], axis1=1, axis2=2))])
    gain = fit[best] - fit[0]
    spread = gain.std(ddof=1) / np.sqrt(len(gain))
    if best == 0 or gain.mean() <= spread * student.isf(FALSE_ALARM / len(ways), len(gain) - 1):
        return []
    if gain.mean() < 1.0:  # nearer to another axis, but no quarter turn from its own
        return []
    told = "gravity" if ahead_b is None else "gravity and the way of travel"
    shown = ", ".join(f"{x:.2f}" for x in _unit(down_b.mean(axis=0)[None])[0] + 0.0)
    names = named_axes(ways[best])
    stated = str(names.split(", ")).replace("'", '"')
    return [
        Finding(
            name="imu mounting",
            where=_SAMPLES,
            text=(
                f"{told} over {len(gain)} windows lie along other axes than forward, right, down "
                f"(down is [{shown}])"
            ),
            mend=(
                f"x, y, z of both sensors should read {names}: [imu] axes = {stated}, where the "
                "flight states none yet"
            ),
        )
    ]


def _leaning(
    down_b: FloatArray, ahead_b: FloatArray, vehicle: WheeledVehicle | None
) -> tuple[list[Finding], list[Finding]]:
    """Return angles that most windows have beyond those a vehicle's axes may have.

    Medians and signs, for curves and manoeuvres turn some windows by tens of degrees.
    """
    from scipy.stats import binom  # noqa: PLC0415  # lazy, as above

    z = _unit(down_b - (down_b * ahead_b).sum(axis=1, keepdims=True) * ahead_b)
    R_bu = np.stack([ahead_b, np.cross(z, ahead_b), z], axis=1)
    angles_rad = to_euler(R_bu)
    usual = WheeledVehicle() if vehicle is None else vehicle
    median_rad = np.median(angles_rad, axis=0)
    beyond = (angles_rad * np.sign(median_rad) > usual.axes_sigma_rad).sum(axis=0)
    if (binom.sf(beyond - 1, len(angles_rad), 0.5) > FALSE_ALARM / 3).all():
        return [], []
    # A median's sigma from that of what is drawn, and that from the median distance, if normal.
    spread_rad = 1.4826 * np.median(np.abs(angles_rad - median_rad), axis=0)
    sigma_deg = np.degrees(np.sqrt(np.pi / 2 / len(angles_rad)) * spread_rad)
    shown = ", ".join(f"{x:.1f}" for x in np.degrees(median_rad).round(1) + 0.0)
    sigmas = ", ".join(f"{x:.1f}" for x in sigma_deg)
    text = (
        f"gravity and the way of travel over {len(angles_rad)} windows lie off its axes as if it "
        f"were turned by roll, pitch, yaw [{shown}] deg (± {sigmas})"
    )
    if vehicle is None:
        why = f'{text}: on wheels it is the unit that lies so; state [vehicle] kind = "wheeled"'
        return [], [Finding(name="imu mounting", text=why)]
    mend = f"[imu] mounting_deg = [{shown}], where the flight states none yet"
    return [Finding(name="imu mounting", text=text, mend=mend, where=_SAMPLES)], []


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True).clip(1e-12))
