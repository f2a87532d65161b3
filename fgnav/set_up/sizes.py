"""What the size of inertial samples gives away about their unit, without an array to judge by."""

import numpy as np

from fgnav.attitude.flight_vectors import Track
from fgnav.checks import FloatArray
from fgnav.geometry.earth import Origin
from fgnav.set_up.findings import Finding
from fgnav.types.flight import Imu

_G_MPS2 = 9.80665
_FORCES = "[imu] samples, fx_mps2, fy_mps2, fz_mps2"
_SPAN_S = 0.5  # of means whose change is compared
_FEWEST = 20
_RELATED = 0.5  # correlation that says anything
_ALIKE = 3.0  # times: a slope at so loose a correlation is known no better
_NEAR_S = 2.5
_LESS = 0.8  # of what is the least: no scale factor, bias or noise leaves so little


def size_findings(
    imu: Imu,
    expected_mps2: float | None = _G_MPS2,
    share: float | None = None,
) -> list[Finding]:
    """Return units of specific force and of rates that cannot be right.

    ``expected_mps2``: median size of the specific force by the track (``expected_force``); that at
    rest where there is none; None where the track does not tell. ``share``: ``share_of_least``.
    """
    if len(imu.t_s) < 2:
        return []
    forces = [] if expected_mps2 is None else _force_findings(imu, expected_mps2)
    if not any(finding.certain for finding in forces) and share is not None and share < _LESS:
        forces = [_too_little(share)]
    return [*forces, *_rate_findings(imu)]


def expected_force(track: Track, origin: Origin) -> float | None:
    """Return the median size of gravity less acceleration, m/s2, which no rotation changes.

    None where velocities are missing or it is so small that their noise could be it.
    """
    if track.v_n_mps is None or len(track.t_s) < _FEWEST:
        return None
    step_s = np.diff(track.t_s)
    near = step_s < _NEAR_S
    change = np.diff(track.v_n_mps, axis=0)[near] / step_s[near, None]
    force = change - origin.gravity_n_mps2(track.p_n_m[:-1][near])
    size = np.linalg.norm(force[np.isfinite(force).all(axis=1)], axis=1)
    if len(size) < _FEWEST // 2 or np.median(size) < _G_MPS2 / 2:
        return None
    return float(np.median(size))


def _force_findings(imu: Imu, expected_mps2: float) -> list[Finding]:
    median_mps2 = float(np.median(np.linalg.norm(imu.f_b_mps2, axis=1)))
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    if abs(median_mps2 - expected_mps2) < 0.2 * expected_mps2:
        return []
    units = {
        f"accelerations look like g, not m/s2; multiply by {_G_MPS2:g}": _G_MPS2,
        f"accelerations look like increments; multiply by the rate, {rate_hz:g} Hz": rate_hz,
    }
    for text, factor in units.items():
        if abs(median_mps2 * factor - expected_mps2) < 0.2 * expected_mps2:
            size = f"the median of |f| is {median_mps2:.3f}: {text}"
            return [Finding(name="imu unit", text=size, where=_FORCES, certain=True)]
    steady_mps2 = float(np.median(np.linalg.norm(_means(imu, imu.f_b_mps2), axis=1)))
    if abs(steady_mps2 / _G_MPS2 - expected_mps2) < 0.2 * expected_mps2:  # of means: no vibration
        size = f"the median of |f| is {steady_mps2:.3f}: accelerations look multiplied by g twice"
        mend = f"divide by {_G_MPS2:g}"
        return [Finding(name="imu unit", text=size, mend=mend, where=_FORCES, certain=True)]
    if median_mps2 < 0.2 * expected_mps2:
        text = (
            f"the median of |f| is {median_mps2:.3f} m/s2: gravity looks removed, or the flight "
            "is in free fall; specific force is wanted"
        )
        return [Finding(name="imu gravity", text=text, where=_FORCES)]
    return []


def _too_little(share: float) -> Finding:
    return Finding(
        name="imu gravity",
        text=(
            f"the mean of |f| is {share:.2f} x the least that changes of velocity and gravity "
            "leave: gravity is removed, an axis is missing, or a unit is wrong"
        ),
        where=_FORCES,
        certain=True,
    )


def _rate_findings(imu: Imu) -> list[Finding]:
    """Compare the gyroscope with the turn of gravity in the body."""
    if imu.w_b_radps is None:
        return []
    correlation, slope = _related(*_gravity(imu, imu.w_b_radps))
    if correlation < _RELATED or 1 / _ALIKE < slope < _ALIKE:
        return []
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    units = {
        "look like degrees per second; multiply by pi / 180": np.pi / 180,
        f"look like increments; multiply by the rate, {rate_hz:g} Hz": rate_hz,
    }
    for text, factor in units.items():
        if factor / _ALIKE < slope < _ALIKE * factor:
            evidence = f"gravity turns {slope:.3g} times as fast as they say"
            return [
                Finding(
                    name="gyroscope unit",
                    text=f"rates {text}: {evidence}",
                    where="[imu] samples, wx_radps, wy_radps, wz_radps",
                    certain=True,
                )
            ]
    return []


def _related(rates: FloatArray, seen: FloatArray) -> tuple[float, float]:
    """Return correlation and slope of turns that are seen by rates; 0 where there is nothing."""
    square, product = float((rates**2).sum()), float((rates * seen).sum())
    if len(rates) < _FEWEST or square == 0 or product <= 0:
        return 0.0, 0.0
    return product / float(np.sqrt(square * (seen**2).sum())), product / square


def _gravity(imu: Imu, w_b_radps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return turns of specific force against the body, told by the gyroscope and seen."""
    f, w = _means(imu, imu.f_b_mps2), _means(imu, w_b_radps)
    turned = -np.cross(w, f) * (_in_a_mean(imu) * float(np.median(np.diff(imu.t_s))))
    return (turned[1:] + turned[:-1]) / 2, f[1:] - f[:-1]


def _means(imu: Imu, x: FloatArray) -> FloatArray:
    """Return means of samples, (m, 3), over half seconds."""
    block = _in_a_mean(imu)
    count = len(x) // block
    return np.asarray(x[: count * block].reshape(count, block, 3).mean(axis=1))


def _in_a_mean(imu: Imu) -> int:
    return max(1, round(_SPAN_S / float(np.median(np.diff(imu.t_s)))))
