"""Whether accelerometer and gyroscope say what the array and the code say of the motion.

Velocities are compared, not accelerations: specific force, turned by the array's attitudes and
integrated, against the velocity by Doppler. A wrong unit, axis, lever arm or clock each leaves its
own trace, so each is tried on its own and the one that fits best is named.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.geometry.rotations import log, transpose
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.set_up.array.inertial_fine import fine_findings
from fgnav.set_up.array.inertial_motion import (
    ARM,
    CLOCK,
    Motion,
    equations,
    motion_of,
    scale_equations,
)
from fgnav.set_up.array.quick import Quick
from fgnav.set_up.findings import Finding
from fgnav.set_up.track.axes import named_axes, signed_permutations
from fgnav.types.flight import Flight, Imu

_G_MPS2 = 9.80665  # the unit g
_LEAP_S = 18  # GPS time ahead of UTC since 2017
_REACH_S, _STEP_S = 20.0, 0.1  # of the search for the clock's error
_BETTER = 0.5  # a hypothesis must leave at most this share of the squares of the stated set-up
_NOSE_FIRST = 0.9  # of the speed


def inertial_findings(
    flight: Flight, imu: Imu, quick: Quick
) -> tuple[list[Finding], list[Finding]]:
    """Return what of the inertial sensors' set-up the motion contradicts, and what it cannot tell.

    Raises
    ------
    NoSolutionError
        If the accelerometer does not overlap the epochs.
    """
    motion = motion_of(flight, imu, quick)
    matrix = _matrix_finding(motion)
    clock = _clock_finding(motion)
    causes = [finding for finding in (matrix, clock) if finding is not None]
    if causes:
        return [min(causes, key=lambda pair: pair[0])[1], *_gyroscope_findings(motion)], []
    fine, unchecked = fine_findings(motion)
    return [*fine, *_gyroscope_findings(motion)], unchecked


def axes_findings(flight: Flight, imu: Imu, quick: Quick) -> list[Finding]:
    """Return units and axes that are certainly not as stated; raises as ``inertial_findings``."""
    matrix = _matrix_finding(motion_of(flight, imu, quick))
    return [] if matrix is None or not matrix[1].certain else [matrix[1]]


def _matrix_finding(motion: Motion) -> tuple[float, Finding] | None:
    """Return the unit or the axes that fit best, if it is not the stated set-up.

    Certain by an F test in which each window, whatever goes together in it, counts as one vector.
    """
    from scipy.stats import f as fisher  # noqa: PLC0415  # lazy: a slow import

    rate_hz = 1.0 / float(np.median(np.diff(motion.imu.t_s)))
    units = {"": 1.0, "g": _G_MPS2, "increments": rate_hz}
    regression = equations(motion).regression()
    right = {CLOCK: 0.0} | dict(enumerate(motion.arm_b_m.tolist(), ARM.start))
    left = {
        (unit, k): regression.fit(dict(enumerate((factor * M).ravel().tolist())) | right)[1]
        for unit, factor in units.items()
        for k, M in enumerate(signed_permutations())
    }
    (unit, k), least = min(left.items(), key=lambda item: item[1])
    share = least / left["", 0]
    if (unit, k) == ("", 0) or share > _BETTER:
        return None
    freedom = 3 * len(np.unique(motion.window))
    certain = bool(share * fisher.isf(FALSE_ALARM / len(left), freedom, freedom) < 1.0)
    least /= regression.rows
    evidence = f"they explain the velocities {1 / np.sqrt(share):.1f} times as well"
    if unit:
        what = {
            "g": f"accelerations are in g; multiply by {_G_MPS2}",
            "increments": f"accelerations are increments; multiply by the rate, {rate_hz:g} Hz",
        }[unit]
        text = f"{what}: {evidence}"
        return least, Finding(name="imu unit", text=text, certain=certain)
    axes = _axes_finding(motion, signed_permutations()[k], evidence)
    return least, replace(axes, certain=certain)


def _axes_finding(motion: Motion, M: FloatArray, evidence: str) -> Finding:
    """Name exchanged or reversed axes: the array's where only so the body flies nose first."""
    R_nb, v_n_mps = motion.quick.R_nb, motion.quick.v_n_mps
    speed_mps = np.median(np.linalg.norm(v_n_mps, axis=1))
    ahead_mps = np.median(np.einsum("ni,ni->n", R_nb[:, :, 0], v_n_mps))
    turned_mps = np.median(np.einsum("ni,ni->n", (R_nb @ M)[:, :, 0], v_n_mps))
    if np.linalg.det(M) > 0 and ahead_mps < 0 and turned_mps > _NOSE_FIRST * speed_mps:
        text = (
            "the body flies tail first by its antennas and nose first by its accelerometer: check "
            f"the signs of position_b_m of the antennas; turned, {evidence}"
        )
        return Finding(name="antenna axes", text=text)
    what = "exchanged" if np.abs(M - np.diag(np.diag(M))).any() else "reversed"
    text = f"accelerometer axes are {what}: x, y, z should read {named_axes(M)}; so {evidence}"
    return Finding(name="imu axes", text=text)


def _clock_finding(motion: Motion) -> tuple[float, Finding] | None:
    """Return a clock error of 0.1 s to 20 s; leap seconds where these fit best.

    None where the record overlaps too few epochs by its stated tags to be compared.
    """
    late_s = np.arange(-_REACH_S, _REACH_S + _STEP_S / 2, _STEP_S)
    left = np.array([_left_late(motion, late) for late in late_s])
    stated = _left_late(motion, 0.0)
    share = left / stated
    if np.isnan(share).all():
        return None
    best = int(np.nanargmin(share))
    if share[best] > _BETTER or abs(late_s[best]) < _STEP_S / 2:
        return None
    leap = ", the leap seconds of UTC" if round(abs(late_s[best])) == _LEAP_S else ""
    text = (
        f"add {late_s[best]:.1f} s to its t_s{leap}: velocities then fit "
        f"{1 / np.sqrt(share[best]):.1f} times as well"
    )
    return float(left[best]), Finding(
        name="imu clock", text=text, where="[imu] samples, t_s", certain=True
    )


def _left_late(motion: Motion, late_s: float) -> float:
    """Return the mean square left with a shifted clock; NaN with under a third of the epochs."""
    try:
        regression = scale_equations(motion, late_s).regression()
    except NoSolutionError:
        return np.nan
    if regression.rows < len(motion.quick.t_s):  # of three rows each
        return np.nan
    return regression.fit({0: 1.0})[1] / regression.rows


def _gyroscope_findings(motion: Motion) -> list[Finding]:
    """Compare turns by the gyroscope with turns of the array."""
    imu, t_s = motion.imu, motion.quick.t_s
    if imu.w_b_radps is None:
        return []
    angle = interpolate(t_s, imu.t_s, integral(imu.t_s, imu.w_b_radps))
    covered = (t_s[:-1] >= imu.t_s[0]) & (t_s[1:] <= imu.t_s[-1])
    turns_rad = np.diff(angle, axis=0)[covered]
    turn = log(transpose(motion.quick.R_nb[:-1]) @ motion.quick.R_nb[1:])[covered]
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    units = {"": 1.0, "degrees": np.pi / 180, "increments": rate_hz}
    left = {
        (unit, k): float(((turn - factor * turns_rad @ M.T) ** 2).sum())
        for unit, factor in units.items()
        for k, M in enumerate(signed_permutations())
    }
    (unit, k), least = min(left.items(), key=lambda item: item[1])
    share = least / left["", 0]
    if (unit, k) == ("", 0) or share > _BETTER:
        return []
    evidence = f"they then fit the array's turns {1 / np.sqrt(share):.1f} times as well"
    if unit:
        what = {
            "degrees": "rates are in degrees per second; multiply by pi / 180",
            "increments": f"rates are increments; multiply by the rate, {rate_hz:g} Hz",
        }[unit]
        return [Finding(name="gyroscope unit", text=f"{what}: {evidence}")]
    named = named_axes(signed_permutations()[k])
    text = f"axes are exchanged or reversed: x, y, z should read {named}; {evidence}"
    return [Finding(name="gyroscope axes", text=text)]
