"""Baselines of receivers against places of antennas: length, and which way they point.

Which way is tested by whatever else tells it: fixes of the same antennas, attitudes that motion
determines beside a gyroscope, specific force along the baseline, and the course of a vehicle that
goes nose first. Each gives the angle about the vertical from where the places would point.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.stats import norm

from fgnav.alignment.in_motion.windows import in_motion_smoothed
from fgnav.alignment.matching import nearest
from fgnav.attitude.flight_vectors import Track, measured_vectors, track_by_fixes
from fgnav.attitude.receiver_baselines import (
    KNOWN_RAD,
    SHORTEST_M,
    BodyBaseline,
    body_baseline,
    fix_baselines,
    stated_vector_b_m,
)
from fgnav.diagnostics.contents import Finding
from fgnav.diagnostics.windows import FALSE_ALARM
from fgnav.geometry.interpolation import interpolate
from fgnav.types.flight import Baseline, Flight

_SIGMAS = float(norm.isf(FALSE_ALARM / 2))
_SLOW_MPS = 2.0  # below, wind and noise turn a course
_STEADY = np.cos(np.radians(25.0))  # mean resultant length: angles within 25 deg of their mean
_MIN_SAMPLES = 8  # samples
_MIN_OFFSET_RAD = np.radians(2.0)  # of an offset: on a metre, antennas are placed to 3 cm
_OPPOSITE_RAD = np.radians(135.0)  # nearer to half a turn than to a quarter


class _Misalignment(NamedTuple):
    """The angle of a baseline from where the places of its antennas point, and what tells it."""

    angle_rad: float
    sigma_rad: float
    by: str
    is_certain: bool = True


def baseline_findings(flight: Flight) -> Iterator[Finding]:
    """Yield what contradicts the places of antennas of each baseline, and of pairs of fixes.

    Fixes of two receivers may be apart by errors that neither states: of them nothing is certain.
    """
    differences = [] if flight.observations is not None else [*fix_baselines(flight)]
    for of in (*flight.baselines, *differences):
        if len(of.t_s) < _MIN_SAMPLES:
            continue
        is_given = of in flight.baselines
        where = "[[baseline]] antennas" if is_given else "[[fixes]] antenna"
        finding = _length_finding(flight, of, where)
        if finding is None and np.linalg.norm(stated_vector_b_m(flight, of)) > SHORTEST_M:
            finding = _direction_finding(flight, body_baseline(flight, of), where)
        if finding is not None:
            yield replace(finding, certain=finding.certain and is_given)


def _length_finding(flight: Flight, of: Baseline, where: str) -> Finding | None:
    """Return a length that a sample's own noise does not explain."""
    nominal_m = float(np.linalg.norm(stated_vector_b_m(flight, of)))
    name, both = f"baseline {' '.join(of.antennas)}", " and ".join(of.antennas)
    if of.measured != "vector":
        if nominal_m > SHORTEST_M:
            return None
        text = f"{both} have the same place, and no heading from one to the other"
        return Finding(name, text, "state position_b_m of each", where, certain=True)
    # Of squares, for the noise of three axes makes a short vector longer.
    square = (of.vector_n_m**2).sum(axis=1) - np.einsum("kii->k", of.covariance_m2)
    length_m = float(np.sqrt(max(np.median(square), 0.0)))
    sample_m = float(np.sqrt(np.median(np.einsum("kii->k", of.covariance_m2) / 3)))
    sigma_m = sample_m / np.sqrt(len(square))
    if abs(length_m - nominal_m) < max(_SIGMAS * sigma_m, 2 * sample_m):
        return None
    text = (
        f"the receiver has {length_m:.3f} m (± {sigma_m:.3f}), places are {nominal_m:.3f} m apart"
    )
    is_zero = nominal_m < SHORTEST_M
    mend = "state position_b_m of each" if is_zero else f"check position_b_m of {both}"
    return Finding(name, text, mend, where, certain=is_zero)


def _direction_finding(flight: Flight, baseline: BodyBaseline, where: str) -> Finding | None:
    """Return an angle that neither chance nor a tape explains, by the first that tells it."""
    if np.median(baseline.variance_rad2) > KNOWN_RAD**2:
        return None
    misalignment = next(_misalignments(flight, baseline), None)
    if misalignment is None or abs(misalignment.angle_rad) < max(
        _SIGMAS * misalignment.sigma_rad, _MIN_OFFSET_RAD
    ):
        return None
    first, second = baseline.of.antennas
    degrees = (
        f"{np.degrees(misalignment.angle_rad):.1f} deg (± {np.degrees(misalignment.sigma_rad):.1f})"
    )
    if abs(misalignment.angle_rad) > _OPPOSITE_RAD:
        text = f"{first} and {second} are exchanged: {misalignment.by}, it points {degrees} off"
        mend = "exchange their names, or their position_b_m"
        return Finding(baseline.name, text, mend, where, certain=misalignment.is_certain)
    cosine, sine = np.cos(misalignment.angle_rad), np.sin(misalignment.angle_rad)
    x, y, z = stated_vector_b_m(flight, baseline.of)
    rotated = np.array([cosine * x - sine * y, sine * x + cosine * y, z])
    position = flight.antenna(first).position_b_m + rotated
    shown = ", ".join(f"{value:.2f}" for value in position + 0.0)
    text = f"{misalignment.by}, it points {degrees} beside the places of its antennas"
    return Finding(baseline.name, text, f"position_b_m = [{shown}] of {second} would fit", where)


def _misalignments(flight: Flight, baseline: BodyBaseline) -> Iterator[_Misalignment]:
    """Yield what tells the angle, the surest first."""
    fixes = None if flight.observations is not None else flight.first_fixes
    for other in () if baseline.of not in flight.baselines else fix_baselines(flight):
        if {*other.antennas} == {*baseline.of.antennas} and len(other.t_s) >= _MIN_SAMPLES:
            yield _by_fixes(baseline.of, other)
    if fixes is None:
        return
    track = track_by_fixes(fixes, flight.antenna(fixes.antenna))
    for estimate in (_by_motion, _by_force, _by_course):
        misalignment = estimate(flight, baseline, track)
        if misalignment is not None:
            yield misalignment


def _by_fixes(of: Baseline, fixes: Baseline) -> _Misalignment:
    """Return the angle from differences of fixes: of names alone, whatever the places."""
    sign = 1.0 if of.antennas == fixes.antennas else -1.0
    between = interpolate(of.t_s, fixes.t_s, sign * fixes.vector_n_m)
    angle = of.heading_rad - np.arctan2(between[:, 1], between[:, 0])
    sigma = np.hypot(np.median(of.heading_sigma_rad), np.median(fixes.heading_sigma_rad))
    mean = float(np.angle(np.exp(1j * angle).mean()))
    return _Misalignment(
        mean, float(sigma) / np.sqrt(len(angle)), f"beside fixes at {len(angle)} times"
    )


def _by_motion(flight: Flight, baseline: BodyBaseline, track: Track) -> _Misalignment | None:
    """Return the angle by attitudes of windows whose motion determines their heading."""
    imu = flight.imu
    if imu is None or imu.w_b_radps is None or not len(track.t_s):
        return None
    motion = in_motion_smoothed(imu, track, flight.origin.gravity_n_mps2(track.p_n_m[:1])[0])
    if motion is None or not len(motion.until_s):
        return None
    means, sigmas, end_s = [], [], -np.inf
    for k in range(len(motion.until_s)):
        inside = (baseline.of.t_s >= motion.begun_s[k]) & (baseline.of.t_s <= motion.until_s[k])
        if motion.begun_s[k] < end_s or not inside.any():
            continue
        end_s = motion.until_s[k]
        v_n = motion.R_nu[k] @ motion.rotation.at(baseline.of.t_s[inside]) @ baseline.vector_b_m
        phasor = np.exp(1j * (baseline.of.heading_rad[inside] - np.arctan2(v_n[:, 1], v_n[:, 0])))
        means.append(phasor.mean())
        sigmas.append(motion.sigma_rad[k])
    if not means:
        return None
    weight = np.array(sigmas) ** -2.0
    angle = float(np.angle((weight * np.array(means)).sum()))
    by = f"by motion in {len(means)} windows"
    return _Misalignment(angle, float(np.sqrt(1 / weight.sum())), by)


def _by_force(flight: Flight, baseline: BodyBaseline, track: Track) -> _Misalignment | None:
    """Return half a turn where specific force along the baseline has the other sign, else zero.

    The component of a force along a vector is the same in all axes.
    """
    pairs, _ = measured_vectors(flight, track)
    if "specific force" not in pairs.sources or baseline.of.measured == "heading":
        return None
    k = pairs.sources.index("specific force")
    index, _ = nearest(baseline.of.t_s, track.t_s)
    is_near = np.abs(baseline.of.t_s[index] - track.t_s) <= np.median(np.diff(baseline.of.t_s)) / 2
    e_n = np.where(is_near[:, None], baseline.of.vector_n_m[index], np.nan)
    along_n = np.einsum("ki,ki->k", pairs.v_n[:, k], e_n)
    along_b = pairs.v_b[:, k] @ baseline.vector_b_m
    valid = np.isfinite(along_n + along_b)
    x, y = along_b[valid], along_n[valid]
    if len(x) < _MIN_SAMPLES or not x.any():
        return None
    slope = float(x @ y / (x @ x))
    sigma = float(np.sqrt(((y - slope * x) ** 2).mean() / (x @ x)))
    if abs(slope) < _SIGMAS * sigma:
        return None
    by = f"specific force along it is {slope:.2f} (± {sigma:.2f}) times as large"
    return _Misalignment(np.pi if slope < 0 else 0.0, sigma, by)


def _by_course(_: Flight, baseline: BodyBaseline, track: Track) -> _Misalignment | None:
    """Return the angle from the course of a vehicle that keeps going in one direction."""
    if track.v_n_mps is None:
        return None
    v_n_mps = interpolate(baseline.of.t_s, track.t_s, track.v_n_mps)
    moving = np.linalg.norm(v_n_mps[:, :2], axis=1) > _SLOW_MPS
    if moving.sum() < _MIN_SAMPLES:
        return None
    course = np.arctan2(v_n_mps[moving, 1], v_n_mps[moving, 0])
    nominal = np.arctan2(baseline.vector_b_m[1], baseline.vector_b_m[0])
    phasor = np.exp(1j * (baseline.of.heading_rad[moving] - nominal - course))
    if abs(phasor.mean()) < _STEADY:
        return None
    angle = float(np.angle(phasor.mean()))
    sigma = float(np.sqrt(-2 * np.log(min(abs(phasor.mean()), 1.0))))
    return _Misalignment(
        angle, sigma, f"beside the course at {len(phasor)} times", is_certain=False
    )
