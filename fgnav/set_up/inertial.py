"""Whether accelerometer and gyroscope say what the array and the code say of the motion.

Velocities are compared, not accelerations: specific force, turned by the array's attitudes and
integrated, against the velocity by Doppler. A wrong unit, axis, lever arm or clock each leaves its
own trace, so each is tried on its own and the one that fits best is named.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.flight import Flight, Imu
from fgnav.rotations import log, skew, transpose
from fgnav.set_up.findings import Finding
from fgnav.set_up.quick import Quick
from fgnav.set_up.regression import Regression

_G_MPS2 = 9.80665  # the unit g
_LEAP_S = 18.0  # GPS time ahead of UTC since 2017
_WINDOW_S, _WINDOW_EPOCHS = 4.0, 8  # over which errors of the attitude have not yet added up
_REACH_S, _STEP_S = 20.0, 0.1  # of the search for the clock's error
_BETTER = 0.5  # a hypothesis must leave at most this share of the squares of the stated set-up
_AS_GOOD = 1.1
_CLOCK_S = 5e-3
_SIGMAS = 5.0
_ARM_M = 0.2
_VELOCITY_MPS = 0.05  # noise against which the bias is weighed
_BIASES = 5.0  # a bias may be so many times the stated
_COLUMNS = 9 + 3 + 1 + 3  # matrix, bias, clock, lever arm
_BIAS, _CLOCK, _ARM = slice(9, 12), 12, slice(13, 16)
_NOSE_FIRST = 0.9  # of the speed
_RATE_SPAN_S = 0.4
_AXES = "xyz"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Motion:
    """What does not change between hypotheses."""

    quick: Quick
    imu: Imu
    grid_s: FloatArray  # at the accelerometer's rate, (m,)
    R_nb: FloatArray  # on the grid, (m, 3, 3)
    gained_mps: FloatArray  # velocity less gravity and Coriolis since the first epoch, (n, 3)
    turning: FloatArray  # derivative of R_nb, (n, 3, 3)
    window: IntArray  # (n,)
    arm_b_m: FloatArray  # from the accelerometer to the antenna, as stated


def inertial_findings(
    flight: Flight, imu: Imu, quick: Quick
) -> tuple[list[Finding], list[Finding]]:
    """Return what of the inertial sensors' set-up the motion contradicts, and what it cannot tell.

    Raises
    ------
    NoSolutionError
        If the accelerometer does not overlap the epochs.
    """
    motion = _motion(flight, imu, quick)
    matrix = _matrix_finding(motion)
    clock = _clock_finding(motion)
    found = [finding for finding in (matrix, clock) if finding is not None]
    if found:
        return [min(found, key=lambda pair: pair[0])[1], *_gyroscope_findings(motion)], []
    fine, unchecked = _fine_findings(motion)
    return [*fine, *_gyroscope_findings(motion)], unchecked


def _motion(flight: Flight, imu: Imu, quick: Quick) -> _Motion:
    t_s = quick.t_s
    grid_s = np.arange(t_s[0], t_s[-1], float(np.median(np.diff(imu.t_s))))
    step_s = np.diff(t_s)[:, None]
    apparent = quick.gravity_n_mps2 - 2 * np.cross(
        flight.origin.earth_rate_n_radps[None], quick.v_n_mps
    )
    known = np.vstack([np.zeros(3), np.cumsum((apparent[1:] + apparent[:-1]) / 2 * step_s, axis=0)])
    spacing_s = float(np.median(step_s))
    length_s = max(_WINDOW_S, _WINDOW_EPOCHS * spacing_s)
    gap = np.concatenate([[0], np.cumsum(np.diff(t_s) > 3 * spacing_s)])
    _, window = np.unique(np.floor((t_s - t_s[0]) / length_s) + 1e6 * gap, return_inverse=True)
    return _Motion(
        quick=quick,
        imu=imu,
        grid_s=grid_s,
        R_nb=RotationSpline(t_s, Rotation.from_matrix(quick.R_nb))(grid_s).as_matrix(),
        gained_mps=quick.v_n_mps - known,
        turning=quick.R_nb @ skew(_rates(quick, max(1, round(_RATE_SPAN_S / 2 / spacing_s)))),
        window=window,
        arm_b_m=flight.antennas[0].position_b_m - imu.position_b_m,
    )


def _rates(quick: Quick, reach: int) -> FloatArray:
    """Return angular rates, (n, 3), rad/s: means over some epochs each way, else noise biases."""
    between = log(transpose(quick.R_nb[:-1]) @ quick.R_nb[1:])
    total = np.vstack([np.zeros(3), np.cumsum(between, axis=0)])
    k = np.arange(len(total))
    first, last = np.maximum(k - reach, 0), np.minimum(k + reach, len(total) - 1)
    return np.asarray((total[last] - total[first]) / (quick.t_s[last] - quick.t_s[first])[:, None])


def _regression(motion: _Motion, late_s: float = 0.0, *, full: bool = True) -> Regression:
    """Return the equations of velocity, as if the accelerometer's times were to be raised so much.

    Not in full, only the scale and the bias of the specific force are left unknown.
    """
    imu, t_s = motion.imu, motion.quick.t_s
    sampled_s = imu.t_s + late_s
    inside = (motion.grid_s >= sampled_s[0]) & (motion.grid_s <= sampled_s[-1])
    if inside.sum() < 2 * _WINDOW_EPOCHS:
        raise NoSolutionError("the accelerometer does not overlap the epochs of GNSS")
    at_s, R_nb = motion.grid_s[inside], motion.R_nb[inside]
    f = np.stack([np.interp(at_s, sampled_s, x) for x in imu.f_b_mps2.T], axis=1)
    if full:
        by_element = (R_nb[:, :, :, None] * f[:, None, None, :]).reshape(-1, 3, 9)
        jerk = np.einsum("nij,nj->ni", R_nb, np.gradient(f, at_s, axis=0))[:, :, None]
        integrand = np.concatenate([by_element, R_nb, jerk], axis=2)
    else:
        integrand = np.concatenate([np.einsum("nij,nj->ni", R_nb, f)[:, :, None], R_nb], axis=2)
    middles = (integrand[1:] + integrand[:-1]) / 2 * (at_s[1] - at_s[0])
    total = np.concatenate([np.zeros((1, *integrand.shape[1:])), np.cumsum(middles, axis=0)])
    epochs = np.flatnonzero((t_s >= at_s[0]) & (t_s <= at_s[-1]))
    place = np.searchsorted(at_s, t_s[epochs]).clip(1, len(at_s) - 1)
    share = ((t_s[epochs] - at_s[place - 1]) / (at_s[place] - at_s[place - 1]))[:, None, None]
    A = total[place - 1] + share * (total[place] - total[place - 1])
    y = motion.gained_mps[epochs]
    if full:
        A = np.concatenate([A, motion.turning[epochs]], axis=2)
    else:
        y = y - motion.turning[epochs] @ motion.arm_b_m
    window = motion.window[epochs]
    A, y = _less_mean(A, window), _less_mean(y, window)
    ridge = np.zeros(A.shape[2])
    ridge[_BIAS if full else slice(1, 4)] = (
        _VELOCITY_MPS / (_BIASES * imu.accelerometer_bias_mps2)
    ) ** 2
    return Regression.of(A.reshape(-1, A.shape[2]), y.ravel(), ridge)


def _less_mean(x: FloatArray, window: IntArray) -> FloatArray:
    """Take each window's mean off: its first velocity is unknown."""
    count = np.bincount(window).clip(1)
    flat = x.reshape(len(x), -1)
    mean = np.stack([np.bincount(window, c) / count for c in flat.T], axis=1)
    return np.asarray((flat - mean[window]).reshape(x.shape))


def _held(motion: _Motion, M: FloatArray | None, *, clock: bool, arm: bool) -> dict[int, float]:
    """Return the unknowns that a hypothesis states."""
    held = {} if M is None else dict(enumerate(M.ravel().tolist()))
    if not clock:
        held[_CLOCK] = 0.0
    if not arm:
        held |= dict(zip(range(_ARM.start, _ARM.stop), motion.arm_b_m.tolist(), strict=True))
    return held


def _axes() -> Iterator[FloatArray]:
    """Yield all ways to exchange and reverse axes, none first."""
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            M = np.zeros((3, 3))
            M[range(3), order] = signs
            yield M


def _matrix_finding(motion: _Motion) -> tuple[float, Finding] | None:
    """Return the unit or the axes that fit best, if it is not the stated set-up."""
    rate_hz = 1.0 / float(np.median(np.diff(motion.imu.t_s)))
    units = {"": 1.0, "g": _G_MPS2, "increments": rate_hz}
    regression = _regression(motion)
    left = {
        (unit, k): regression.fit(_held(motion, factor * M, clock=False, arm=False))[2]
        for unit, factor in units.items()
        for k, M in enumerate(_axes())
    }
    (unit, k), least = min(left.items(), key=lambda item: item[1])
    share = least / left["", 0]
    if (unit, k) == ("", 0) or share > _BETTER:
        return None
    least /= regression.rows
    evidence = f"they explain the velocities {1 / np.sqrt(share):.1f} times as well"
    if unit:
        what = {
            "g": f"accelerations are in g; multiply by {_G_MPS2}",
            "increments": f"accelerations are increments; multiply by the rate, {rate_hz:g} Hz",
        }[unit]
        return least, Finding(name="imu unit", text=f"{what}: {evidence}")
    return least, _axes_finding(motion, list(_axes())[k], evidence)


def _axes_finding(motion: _Motion, M: FloatArray, evidence: str) -> Finding:
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
    text = f"accelerometer axes are {what}: x, y, z should read {_named(M)}; so {evidence}"
    return Finding(name="imu axes", text=text)


def _named(M: FloatArray) -> str:
    """Return in words which axes a signed permutation reads."""
    return ", ".join(f"{'-' if row.sum() < 0 else ''}{_AXES[np.abs(row).argmax()]}" for row in M)


def _clock_finding(motion: _Motion) -> tuple[float, Finding] | None:
    """Return a clock error that the eye can see, 0.1 s to 20 s, and leap seconds by name."""
    late_s = np.arange(-_REACH_S, _REACH_S + _STEP_S / 2, _STEP_S)
    left = np.array([_left_late(motion, late) for late in late_s])
    stated = _left_late(motion, 0.0)
    share = left / stated
    best = int(np.nanargmin(share))
    if share[best] > _BETTER or abs(late_s[best]) < _STEP_S / 2:
        return None
    for leap in (_LEAP_S, -_LEAP_S):
        k = int(np.abs(late_s - leap).argmin())
        if share[k] <= max(_AS_GOOD * share[best], _BETTER / 4) and share[k] <= _BETTER:
            text = (
                f"its clock is {leap:+.0f} s from GPS time, the leap seconds of UTC: shift t_s; "
                f"velocities then fit {1 / np.sqrt(share[k]):.1f} times as well"
            )
            return float(left[k]), Finding(name="imu clock", text=text)
    text = (
        f"add {late_s[best]:.1f} s to its t_s: velocities then fit "
        f"{1 / np.sqrt(share[best]):.1f} times as well"
    )
    return float(left[best]), Finding(name="imu clock", text=text)


def _left_late(motion: _Motion, late_s: float) -> float:
    """Return the mean square left with a shifted clock; NaN with under a third of the epochs."""
    try:
        regression = _regression(motion, late_s, full=False)
    except NoSolutionError:
        return np.nan
    if regression.rows < len(motion.quick.t_s):  # of three rows each
        return np.nan
    return regression.fit({0: 1.0})[2] / regression.rows


def _fine_findings(motion: _Motion) -> tuple[list[Finding], list[Finding]]:
    """Return small clock errors and wrong lever arms; and what the motion is too weak to tell."""
    regression = _regression(motion)
    eye = np.eye(3)
    findings: list[Finding] = []
    unchecked: list[Finding] = []
    x, covariance, left = regression.fit(_held(motion, eye, clock=True, arm=True))
    noise = left / max(regression.rows - _COLUMNS, 1)
    late_s, sigma_s = float(x[_CLOCK]), float(np.sqrt(noise * covariance[_CLOCK, _CLOCK]))
    if abs(late_s) > max(_CLOCK_S, _SIGMAS * sigma_s):
        text = (
            f"add {-late_s * 1e3:+.0f} ms to its t_s (known to {sigma_s * 1e3:.1f} ms from the "
            "velocities)"
        )
        findings.append(Finding(name="imu clock", text=text))
    elif _SIGMAS * sigma_s > 2 * _CLOCK_S:
        text = f"the motion tells it to {sigma_s * 1e3:.0f} ms only"
        unchecked.append(Finding(name="imu clock", text=text))
    arm_covariance_m2 = noise * covariance[_ARM, _ARM]
    findings += _arm_findings(motion, x[_ARM], arm_covariance_m2)
    arm_sigma_m = float(np.sqrt(np.linalg.eigvalsh(arm_covariance_m2)[-1]))
    if _SIGMAS * arm_sigma_m > 2 * _ARM_M:
        text = f"the motion tells it to {arm_sigma_m:.2f} m only"
        unchecked.append(Finding(name="imu lever arm", text=text))
    return findings, unchecked


def _arm_findings(motion: _Motion, arm_b_m: FloatArray, covariance_m2: FloatArray) -> list[Finding]:
    """Compare the lever arm that the motion tells with the stated, and with the stated reversed."""
    imu_b_m, antenna_b_m = motion.imu.position_b_m, motion.arm_b_m + motion.imu.position_b_m
    information = np.linalg.pinv(covariance_m2, hermitian=True)

    def misfit(position_b_m: FloatArray) -> float:
        off = arm_b_m - (antenna_b_m - position_b_m)
        return float(off @ information @ off)

    stated, reversed_ = misfit(imu_b_m), misfit(-imu_b_m)
    if stated - reversed_ > _SIGMAS**2 and reversed_ < stated / 4:
        text = (
            "the lever arm has the wrong sign: reversed, position_b_m of the imu is "
            f"{np.sqrt(reversed_):.1f} sigma from what the velocities say, as stated "
            f"{np.sqrt(stated):.1f}"
        )
        return [Finding(name="imu lever arm", text=text)]
    off_b_m = arm_b_m - motion.arm_b_m
    if stated > (2 * _SIGMAS) ** 2 and np.linalg.norm(off_b_m) > _ARM_M:
        shown = ", ".join(f"{v:.2f}" for v in antenna_b_m - arm_b_m + 0.0)
        text = f"velocities put it at position_b_m = [{shown}], {np.sqrt(stated):.0f} sigma away"
        return [Finding(name="imu lever arm", text=text)]
    return []


def _gyroscope_findings(motion: _Motion) -> list[Finding]:
    """Compare turns by the gyroscope with turns of the array."""
    imu, t_s = motion.imu, motion.quick.t_s
    if imu.w_b_radps is None:
        return []
    middles = (imu.w_b_radps[1:] + imu.w_b_radps[:-1]) / 2 * np.diff(imu.t_s)[:, None]
    total = np.vstack([np.zeros(3), np.cumsum(middles, axis=0)])
    angle = np.stack([np.interp(t_s, imu.t_s, x) for x in total.T], axis=1)
    covered = (t_s[:-1] >= imu.t_s[0]) & (t_s[1:] <= imu.t_s[-1])
    told = np.diff(angle, axis=0)[covered]
    turn = log(transpose(motion.quick.R_nb[:-1]) @ motion.quick.R_nb[1:])[covered]
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    units = {"": 1.0, "degrees": np.pi / 180, "increments": rate_hz}
    left = {
        (unit, k): float(((turn - factor * told @ M.T) ** 2).sum())
        for unit, factor in units.items()
        for k, M in enumerate(_axes())
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
    text = f"axes are exchanged or reversed: x, y, z should read {_named(list(_axes())[k])}; "
    return [Finding(name="gyroscope axes", text=text + evidence)]
