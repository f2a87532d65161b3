"""Inertial samples that no moving sensor gives: an axis or a unit that is stuck, a unit changed."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.faulty_samples import stuck_axis, stuck_unit
from fgnav.frontend.recording import coarse_step
from fgnav.set_up.findings import Finding
from fgnav.types.flight import Imu

_G_MPS2 = 9.80665
_FEWEST = 100
_NEAR = 20  # samples on each side of a change of unit
_AXES = "xyz"


def sample_findings(imu: Imu) -> list[Finding]:
    """Return axes that are constant, stretches that repeat one sample, and changes of unit."""
    if len(imu.t_s) < _FEWEST:
        return []
    sensors = {"accelerometer": ("f", "mps2", imu.f_b_mps2)}
    if imu.w_b_radps is not None:
        sensors["gyroscope"] = ("w", "radps", imu.w_b_radps)
    findings = _stuck_unit(imu)
    for sensor, (letter, unit, x) in sensors.items():
        constant = (x == x[0]).all(axis=0)
        if constant.all():
            continue  # simulated without noise, at rest
        for axis, name in enumerate(_AXES):
            where = f"[imu] samples, {letter}{name}_{unit}"
            if constant[axis]:
                text = f"axis {name} is {x[0, axis]:g} in all {len(x)} samples"
                mend = "the axis is not connected or its column is a filler: leave the flight out"
                findings.append(
                    Finding(name=f"{sensor} axis", text=text, where=where, mend=mend, certain=True)
                )
            elif not findings:
                findings += _stuck_axis(imu.t_s, x, axis, f"{sensor} axis", where)
        if not findings:
            findings += _coarse_steps(imu, x, sensor, f"[imu] samples, {letter}*_{unit}")
        findings += _unit_change(imu.t_s, x, sensor, f"[imu] samples, {letter}x_{unit}")
    return findings


def _stuck_axis(t_s: FloatArray, x: FloatArray, axis: int, name: str, where: str) -> list[Finding]:
    """Return a run of equal samples of one axis that rounding does not explain."""
    run = stuck_axis(x, axis, np.zeros(len(x), dtype=np.bool_))
    if run is None:
        return []
    first, length = run
    text = (
        f"axis {_AXES[axis]} stands at {x[first, axis]:.6g} for {length + 1} samples from "
        f"{t_s[first]:.3f} to {t_s[first + length]:.3f} s while the others move"
    )
    return [
        Finding(name=name, text=text, where=where, mend="cut these samples out: a gap is bridged")
    ]


def _coarse_steps(imu: Imu, x: FloatArray, sensor: str, where: str) -> list[Finding]:
    """Return that a sensor is recorded in steps whose rounding is louder than its noise.

    A twelfth of the square of a step, and no white noise of a body that turns slowly (Widrow and
    Kollar, Quantization Noise, 2008, chapter 4).
    """
    noise = imu.accelerometer_noise_mps2_per_sqrt_hz
    if sensor == "gyroscope":
        noise = imu.gyroscope_noise_radps_per_sqrt_hz or np.inf
    of_sample = noise / np.sqrt(np.median(np.diff(imu.t_s)))
    step = coarse_step(x, of_sample)
    if step is None:
        return []
    times = step.size / of_sample
    text = (
        f"axis {_AXES[step.axis]} is recorded in steps of {step.size:.3g}, {times:.2g} times the "
        "noise of a sample: methods that do not look ahead state covariances that are too small"
    )
    mend = "record more digits, or state a noise as large as a step"
    return [Finding(name=f"{sensor} steps", text=text, where=where, mend=mend)]


def _stuck_unit(imu: Imu) -> list[Finding]:
    """Return a run of equal samples of all axes."""
    run = stuck_unit(imu)
    if run is None:
        return []
    first, length = run
    text = (
        f"all axes repeat one sample {length + 1} times from {imu.t_s[first]:.3f} to "
        f"{imu.t_s[first + length]:.3f} s"
    )
    mend = "left out of estimates: a gap is bridged"
    return [Finding(name="imu stuck", text=text, where="[imu] samples", mend=mend)]


def _unit_change(t_s: FloatArray, x: FloatArray, sensor: str, where: str) -> list[Finding]:
    """Return a sample from which on all axes are another unit's.

    There the vector changes by the quotient of two units and keeps its direction; put right, the
    step is an ordinary one; left alone, it is larger than any other.
    """
    rate_hz = 1.0 / float(np.median(np.diff(t_s)))
    other = _G_MPS2 if sensor == "accelerometer" else 180 / np.pi
    size = np.linalg.norm(x, axis=1)
    total = np.concatenate([[0.0], np.cumsum(np.log(size.clip(1e-9)))])
    n, k = len(x), np.arange(_NEAR, len(x) - _NEAR)
    # Where two halves of constant logarithm explain most (least squares of one step).
    gain = (total[k] / k - (total[n] - total[k]) / (n - k)) ** 2 * k * (n - k)
    at = int(k[np.argmax(gain)])
    before, after = x[at - _NEAR : at].mean(axis=0), x[at : at + _NEAR].mean(axis=0)
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    for factor in (other, 1 / other, 1000 / other, rate_hz, 1 / rate_hz):
        mended = np.linalg.norm(x[at] * factor - x[at - 1])
        spread = np.quantile(np.delete(steps[max(at - 10 * _NEAR, 0) : at], -1), 0.99)
        alone = np.linalg.norm(x[at] - x[at - 1])
        aligned = np.linalg.norm(after * factor - before) < 0.1 * np.linalg.norm(before)
        if mended <= spread < alone / 5 and aligned:
            text = (
                f"the {sensor}'s samples are {1 / factor:.4g} times as large from "
                f"{t_s[at]:.3f} s on, in all axes at once"
            )
            return [
                Finding(
                    name=f"{sensor} unit change",
                    text=text,
                    where=where,
                    mend=f"multiply those from row {at + 2} of the file on by {factor:.6g}",
                    certain=True,
                )
            ]
    return []
