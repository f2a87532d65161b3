"""What an inertial unit and a track contradict each other in: units, axes, clock, arm, mounting."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.attitude.flight_vectors import Track
from fgnav.checks import FloatArray
from fgnav.identification.track.clock import Clock, clock
from fgnav.identification.track.integrals import Integrals, integrated
from fgnav.identification.track.motion import Series
from fgnav.identification.track.series import series_of, where_it_moves
from fgnav.identification.track.windows import FALSE_ALARM
from fgnav.set_up.findings import Finding
from fgnav.set_up.track.axes import Reading, best_reading, named_axes
from fgnav.set_up.track.mounting import mounting_findings
from fgnav.set_up.track.velocities import Age, velocity_findings
from fgnav.types.flight import Fixes, Flight, Imu

_SAMPLES = "[imu] samples"
_RATES = ("wx", "wy", "wz")
_ARM_M = 0.2  # less is within what antennas and units are measured to on a vehicle
_LEAP_S = 18  # GPS time ahead of UTC since 2017
_TELLS_S = 0.5  # known no better, a clock counts as not checked


class _Judged(NamedTuple):
    series: Series
    clock: Clock


def track_findings(flight: Flight, imu: Imu, fixes: Fixes) -> tuple[list[Finding], list[Finding]]:
    """Return what fixes and inertial unit contradict each other in, and what they cannot tell."""
    fixes = where_it_moves(fixes)
    findings, age = velocity_findings(fixes)
    if imu.w_b_radps is None:
        reason = "without a gyroscope nothing turns specific force between fixes"
        return findings, [Finding(name="imu axes, lever arm, clock", text=reason)]
    usable = fixes if not findings else replace(fixes, v_n_mps=None, velocity_sigma_mps=None)
    series = series_of(flight.origin, usable)
    arm_b_m = flight.antenna(fixes.antenna).position_b_m - imu.position_b_m
    judged, integrals = _judged(series, imu, arm_b_m)
    if not judged:
        reason = "too few fixes within the unit's record"
        return findings, [Finding(name="imu axes, lever arm, clock", text=reason)]
    main = min(judged, key=lambda one: one.clock.reach_s)
    reading = _reading([one.series for one in judged], imu, _clocks(judged), arm_b_m)
    if reading is not None:
        return [*findings, _reading_finding(reading, imu)], [
            Finding(name="imu clock, lever arm", text="until its axes are right")
        ]
    delay = _delay_finding(judged, age)
    by_position = [one for one in judged if one.series.what == "position"]
    if delay is not None:
        findings.append(delay)
        main = by_position[0]
    late = _clock_finding(main.clock, imu)
    findings += [late] if late is not None else []
    unchecked = []
    if main.clock.reach_s > _TELLS_S:
        reach_s = main.clock.reach_s
        limit = f"to {reach_s:.2g} s only" if np.isfinite(reach_s) else "not at all"
        reason = f"the motion tells it {limit}"
        unchecked.append(Finding(name="imu clock", text=reason))
    arm, missing = _arm_findings(main.clock, arm_b_m, flight.antenna(fixes.antenna).position_b_m)
    track = Track(
        t_s=usable.t_s,
        epochs=len(usable.t_s),
        p_n_m=usable.p_n_m,
        v_n_mps=usable.v_n_mps,
        arm_b_m=arm_b_m,
    )
    mounting, untold = mounting_findings(main.series, integrals, main.clock, track, flight.vehicle)
    return [*findings, *arm, *mounting], [*unchecked, *missing, *untold]


def axes_findings(flight: Flight, imu: Imu, fixes: Fixes) -> list[Finding]:
    """Return units and axes that are not as stated, at the stated clock first: cheap if they are.

    Where they seem not to be, the clock is sought, too: with another one they may be.
    """
    series = series_of(flight.origin, where_it_moves(fixes))
    arm_b_m = flight.antenna(fixes.antenna).position_b_m - imu.position_b_m
    if imu.w_b_radps is None or _reading(series, imu, (0.0,), arm_b_m) is None:
        return []
    judged, _ = _judged(series, imu, arm_b_m)
    reading = _reading([one.series for one in judged], imu, _clocks(judged), arm_b_m)
    return [] if reading is None else [_reading_finding(reading, imu)]


def _reading(
    series: list[Series], imu: Imu, late_s: tuple[float, ...], arm_b_m: FloatArray
) -> Reading | None:
    """Return how samples should be read by positions or by velocities."""
    readings = (best_reading(one, imu, late_s, arm_b_m) for one in series)
    return next((one for one in readings if one is not None), None)


def _judged(series: list[Series], imu: Imu, arm_b_m: FloatArray) -> tuple[list[_Judged], Integrals]:
    rates = np.zeros_like(imu.f_b_mps2) if imu.w_b_radps is None else imu.w_b_radps
    integrals = integrated(imu.t_s, imu.f_b_mps2, rates)
    both = [(one, clock(one, integrals, imu, arm_b_m)) for one in series]
    return [_Judged(one, found) for one, found in both if found is not None], integrals


def _clocks(judged: list[_Judged]) -> tuple[float, ...]:
    """Return the stated clock, and the one that fits best where it is another."""
    best_s = min(judged, key=lambda one: one.clock.reach_s).clock.late_s
    return (0.0, best_s) if abs(best_s) > 0.05 else (0.0,)


def _reading_finding(reading: Reading, imu: Imu) -> Finding:
    """Say how samples should be read, and blame the sensor that is of the other hand, or both."""
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    mends, parts = [], []
    if reading.force != 1.0:
        unit = "increments" if np.isclose(reading.force, rate_hz) else "g"
        parts.append(f"accelerations are in {unit}")
        mends.append(f"multiply them by {reading.force:.6g}")
    if abs(reading.rate) != 1.0:
        unit = "increments" if np.isclose(abs(reading.rate), rate_hz) else "degrees per second"
        parts.append(f"rates are in {unit}")
        mends.append(f"multiply them by {abs(reading.rate):.6g}")
    if (reading.axes != np.eye(3)).any() or reading.rate < 0:
        parts.append("axes of accelerometer and gyroscope are not the same")
        forces = f"fx, fy, fz should read {named_axes(reading.axes, ('fx', 'fy', 'fz'))}"
        rates = f"wx, wy, wz should read {named_axes(reading.axes_of_rates, _RATES)}"
        if reading.gyroscope_mirrored:
            mends.append(rates)
        elif reading.rate < 0:
            mends.append(f"{forces} and wx, wy, wz be reversed")
        else:
            proper = np.linalg.det(reading.axes) > 0
            mends.append(f"{forces}, or {rates}" if proper else forces)
    since = f" from about {reading.from_s:.1f} s on" if np.isfinite(reading.from_s) else ""
    return Finding(
        name="imu axes" if "axes" in parts[-1] else "imu unit",
        where=f"{_SAMPLES}, fx_mps2 to wz_radps",
        text=f"{' and '.join(parts)}{since}: only so do they explain the track",
        mend="; ".join(mends),
        certain=True,
    )


def _delay_finding(judged: list[_Judged], age: Age | None) -> Finding | None:
    """Return how old velocities are, by positions or by the inertial unit, whichever knows."""
    by_unit = {one.series.what: one.clock for one in judged}
    ages = [] if age is None else [age]
    if len(by_unit) == 2:
        p, v = by_unit["position"], by_unit["velocity"]
        ages.append(
            Age(
                old_s=v.late_s - p.late_s,
                sigma_s=float(np.hypot(p.sigma_s, v.sigma_s)),
                reach_s=float(np.hypot(p.reach_s, v.reach_s)),
            )
        )
    if not ages:
        return None
    best = min(ages, key=lambda one: one.reach_s)
    if not abs(best.old_s) > best.reach_s:
        return None
    word = "old" if best.old_s > 0 else "early"
    return Finding(
        name="velocity delay",
        where="[fixes] samples, vn_mps, ve_mps, vd_mps",
        text=(
            f"velocities are {abs(best.old_s):.3f} s {word} (± {best.sigma_s:.3f} s) beside the "
            "positions of their rows"
        ),
        mend="shift their times, or leave them out",
    )


def _clock_finding(clock: Clock, imu: Imu) -> Finding | None:
    """Return a clock error beyond what chance and a sample's length explain; and its rate."""
    half_s = float(np.median(np.diff(imu.t_s))) / 2
    drift_s = abs(clock.rate) * float(imu.t_s[-1] - imu.t_s[0]) / 2
    off = abs(clock.late_s) > max(clock.reach_s, half_s)
    runs = abs(clock.rate) > clock.rate_reach and drift_s > half_s
    if not off and not runs:
        return None
    rounded_s = round(clock.late_s)
    leap = ", the leap seconds of UTC" if abs(rounded_s) == _LEAP_S else ""
    texts = [
        f"its times are {-clock.late_s:+.3f} s off those of the fixes{leap} "
        f"(± {clock.sigma_s:.3f} s)"
    ]
    mends = [f"add {clock.late_s:.3f} s to its t_s, or to [imu] clock_offset_s"]
    if runs:
        texts.append(f"run {-1e6 * clock.rate:+.0f} ppm fast (± {1e6 * clock.rate_sigma:.0f} ppm)")
        mends.append(f"stretch them by {1e6 * clock.rate:+.0f} ppm about the middle")
    return Finding(
        name="imu clock",
        where=f"{_SAMPLES}, t_s",
        text=" and ".join(texts),
        mend=", ".join(mends),
        # Parts of a second are what recorders delay; whole ones are another clock.
        certain=rounded_s != 0,
    )


def _arm_findings(
    clock: Clock, stated_b_m: FloatArray, antenna_b_m: FloatArray
) -> tuple[list[Finding], list[Finding]]:
    """Test by Hotelling's T squared whether the lever arm is further off than arms are measured.

    Of all arms that near to the stated one the likeliest is tested: where the motion tells one
    direction to millimetres and another to metres, neither alone is a wrong arm.
    """
    from scipy.stats import f as fisher  # noqa: PLC0415  # lazy: a slow import

    if clock.arm_freedom < 3:
        return [], [Finding(name="imu lever arm", text="too few windows with rotation")]
    off_b_m, nu = clock.arm_b_m - stated_b_m, clock.arm_freedom
    covariance = clock.arm_covariance_m2 + 1e-8 * np.eye(3)
    statistic = _squares_beyond(off_b_m, covariance) * (nu - 2) / (3 * nu)
    sigma_m = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    if statistic > fisher.isf(FALSE_ALARM, 3, nu - 2):
        shown = ", ".join(f"{x:.2f}" for x in antenna_b_m - clock.arm_b_m + 0.0)
        text = (
            f"the fixes put it {np.linalg.norm(off_b_m):.2f} m from where it is said to be "
            f"(± {sigma_m:.2f} m)"
        )
        finding = Finding(
            name="imu lever arm",
            where="[imu] position_b_m, [[antenna]] position_b_m",
            text=text,
            mend=f"position_b_m = [{shown}] of the imu would fit",
        )
        return [finding], []
    if sigma_m > _ARM_M:
        return [], [
            Finding(name="imu lever arm", text=f"the motion tells it to {sigma_m:.2f} m only")
        ]
    return [], []


def _squares_beyond(off_m: FloatArray, covariance_m2: FloatArray) -> float:
    """Return the least ``(x - d) C^-1 (x - d)`` of all d within 0.2 m of nothing.

    By Lagrange's multiplier m of that bound: ``d = x / (1 + m C)`` along each axis of C.
    """
    if np.linalg.norm(off_m) <= _ARM_M:
        return 0.0
    from scipy.optimize import brentq  # noqa: PLC0415  # lazy

    squares_m2, axes = np.linalg.eigh(covariance_m2)
    off_m = axes.T @ off_m

    def beyond(log_m: float) -> float:
        return float(np.linalg.norm(off_m / (1.0 + np.exp(log_m) * squares_m2))) - _ARM_M

    widest = np.log(np.linalg.norm(off_m) / _ARM_M)  # d is short enough there, and whole at first
    low, high = -np.log(squares_m2[-1]) - 50.0, widest - np.log(squares_m2[0])
    m = np.exp(brentq(beyond, low, high))
    left_m = off_m * m * squares_m2 / (1.0 + m * squares_m2)
    return float((left_m**2 / squares_m2).sum())
