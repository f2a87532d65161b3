"""Small errors of the accelerometer's clock and lever arm, as far as the motion tells them.

Two errors of the attitude matter. They are integrated: residuals of neighbouring epochs go
together, and slow unknowns are known worse than as many independent velocities would tell. And they
make the body rates noisy that multiply the lever arm: where a body hardly turns, such noise would
draw the arm to zero [1]_, so that what it adds to the normal equations is taken off them.

References
----------
.. [1] W. A. Fuller, "Measurement Error Models", Wiley 1987, section 2.2.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotations import skew
from fgnav.set_up.array.inertial_motion import (
    ARM,
    BIAS,
    CLOCK,
    VELOCITY_MPS,
    Equations,
    Motion,
    equations,
)
from fgnav.set_up.findings import Finding

_CLOCK_S = 5e-3
_SIGMAS = 5.0
_ARM_M = 0.2
_WIDEST_S, _WIDEST_M = 20.0, 100.0  # what clock and arm are known to at worst
_PLACED_M = 0.02  # to which places of antennas and instruments are known at best
_FREE = BIAS.start  # the first unknown; those before are the matrix, taken as stated
_OF_ARM = slice(ARM.start - _FREE, ARM.stop - _FREE)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Fitted:
    """Clock and lever arm by the velocities, with covariances that hold."""

    late_s: float
    late_sigma_s: float
    arm_b_m: FloatArray
    arm_covariance_m2: FloatArray


def fine_findings(motion: Motion) -> tuple[list[Finding], list[Finding]]:
    """Return small clock errors and wrong lever arms; and what the motion is too weak to tell."""
    fitted = _fitted(motion)
    findings: list[Finding] = []
    unchecked: list[Finding] = []
    if abs(fitted.late_s) > max(_CLOCK_S, _SIGMAS * fitted.late_sigma_s):
        text = (
            f"add {-fitted.late_s * 1e3:+.0f} ms to its t_s (known to "
            f"{fitted.late_sigma_s * 1e3:.1f} ms from the velocities)"
        )
        findings.append(Finding(name="imu clock", text=text))
    elif _SIGMAS * fitted.late_sigma_s > 2 * _CLOCK_S:
        text = f"the motion tells it to {fitted.late_sigma_s * 1e3:.0f} ms only"
        unchecked.append(Finding(name="imu clock", text=text))
    findings += _arm_findings(motion, fitted)
    arm_sigma_m = float(np.sqrt(np.linalg.eigvalsh(fitted.arm_covariance_m2)[-1]))
    if _SIGMAS * arm_sigma_m > 2 * _ARM_M:
        text = f"the motion tells it to {arm_sigma_m:.2f} m only"
        unchecked.append(Finding(name="imu lever arm", text=text))
    return findings, unchecked


def _fitted(motion: Motion) -> _Fitted:
    of = equations(motion)
    A = of.A[:, :, _FREE:]
    y_mps = of.y_mps - of.A[:, :, :_FREE] @ np.eye(3).ravel()
    widest = np.array([np.inf] * 3 + [_WIDEST_S] + [_WIDEST_M] * 3)
    ridge = np.diag(of.ridge[_FREE:] + (VELOCITY_MPS / widest) ** 2)
    information = np.einsum("kip,kiq->pq", A, A) + ridge
    vector = np.einsum("kip,ki->p", A, y_mps)
    left_mps = y_mps - A @ np.linalg.solve(information, vector)
    information[_OF_ARM, _OF_ARM] -= _of_noisy_rates(motion, of)
    inverse = np.linalg.inv(information)
    x = inverse @ vector
    scatter = _scatter(motion, of, A, left_mps) + VELOCITY_MPS**2 * ridge
    covariance = inverse @ scatter @ inverse.T
    place = CLOCK - _FREE
    return _Fitted(
        late_s=float(x[place]),
        late_sigma_s=float(np.sqrt(covariance[place, place])),
        arm_b_m=x[_OF_ARM],
        arm_covariance_m2=covariance[_OF_ARM, _OF_ARM] + _PLACED_M**2 * np.eye(3),
    )


def _of_noisy_rates(motion: Motion, of: Equations) -> FloatArray:
    """Return what noise of the rates adds to the arm's normal equations, (3, 3)."""
    P = motion.rate_covariance[of.epochs]
    kept = (1 - 1 / _neighbours(motion.window[of.epochs]))[:, None, None]
    added = np.einsum("kii->k", P)[:, None, None] * np.eye(3) - P
    return np.asarray((kept * added).sum(axis=0))


def _scatter(motion: Motion, of: Equations, A: FloatArray, left_mps: FloatArray) -> FloatArray:
    """Return the covariance of ``A^T noise``, (q, q): of each velocity alone, and of its integral.

    The attitude's noise is added up over a window, and the residuals say how large both are: what
    neighbours differ by is mostly the velocity's own, what a window spreads over is of both.
    """
    window, R_nb = motion.window[of.epochs], motion.quick.R_nb[of.epochs]
    t_s, imu = motion.quick.t_s, motion.imu
    f_b = interpolate(t_s[of.epochs], imu.t_s, imu.f_b_mps2)
    turned = R_nb @ skew(f_b) * np.median(np.diff(t_s))
    step_m2ps2 = turned @ motion.quick.covariance_rad2[of.epochs] @ turned.swapaxes(1, 2)
    near = window[1:] == window[:-1]
    differ = (np.diff(left_mps, axis=0)[near] ** 2).sum(axis=1).mean()
    spread = (left_mps**2).sum(axis=1).mean()
    size, length = np.einsum("kii->k", step_m2ps2).mean(), _neighbours(window)
    walks = size * np.mean(length - 1 / length) / 6
    parts = [[6.0, size], [3 * np.mean(1 - 1 / length), walks]]
    # Least squares, because pairs of epochs between gaps do not tell the two apart.
    own, grown = np.linalg.lstsq(parts, [differ, spread], rcond=None)[0].clip(0.0)
    # Each window's rows add up to nothing: sums from its start are those to its end, reversed.
    sums = np.cumsum(A, axis=0)
    integrated = np.einsum("kip,kij,kjq->pq", sums, step_m2ps2, sums)
    return np.asarray(own * np.einsum("kip,kiq->pq", A, A) + grown * integrated)


def _neighbours(window: IntArray) -> FloatArray:
    """Return how many epochs each one's window has, (k,)."""
    return np.asarray(np.bincount(window)[window], dtype=np.float64)


def _arm_findings(motion: Motion, fitted: _Fitted) -> list[Finding]:
    """Compare the lever arm that the motion tells with the stated, and with the stated reversed."""
    imu_b_m, antenna_b_m = motion.imu.position_b_m, motion.arm_b_m + motion.imu.position_b_m
    information = np.linalg.inv(fitted.arm_covariance_m2)

    def misfit(position_b_m: FloatArray) -> float:
        off = fitted.arm_b_m - (antenna_b_m - position_b_m)
        return float(off @ information @ off)

    stated, reversed_ = misfit(imu_b_m), misfit(-imu_b_m)
    if stated - reversed_ > _SIGMAS**2 and reversed_ < stated / 4:
        text = (
            "the lever arm has the wrong sign: reversed, position_b_m of the imu is "
            f"{np.sqrt(reversed_):.1f} sigma from what the velocities say, as stated "
            f"{np.sqrt(stated):.1f}"
        )
        return [Finding(name="imu lever arm", text=text)]
    off_b_m = fitted.arm_b_m - motion.arm_b_m
    if stated > (2 * _SIGMAS) ** 2 and np.linalg.norm(off_b_m) > _ARM_M:
        shown = ", ".join(f"{v:.2f}" for v in antenna_b_m - fitted.arm_b_m + 0.0)
        text = f"velocities put it at position_b_m = [{shown}], {np.sqrt(stated):.0f} sigma away"
        return [Finding(name="imu lever arm", text=text)]
    return []
