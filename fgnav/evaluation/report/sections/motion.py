"""The flight itself: attitude, velocity, height and ground track, beside fixes and the truth."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fgnav.attitude.baseline_angles import azimuth_elevation, reported_baselines
from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.charts import (
    FIXES,
    HEIGHT,
    TRUTH,
    Chart,
    Line,
    Series,
    Span,
    spanning,
    time_charts,
    unjumped_deg,
)
from fgnav.evaluation.report.parts import Blocks, grid, paragraph
from fgnav.evaluation.report.sections.errors import NORTH_EAST_DOWN
from fgnav.evaluation.scores import EULER, hidden
from fgnav.geometry.rotations import log, to_euler, transpose
from fgnav.types.estimate import sigmas
from fgnav.types.flight import Flight

_TRACK = 2000  # points of a ground track
_WRAPS = 150  # an angle that wraps more often is drawn as dots
_SIGMAS = 3.0
_ACCELEROMETER = "accelerometer_bias_mps2", "accelerometer_bias_covariance_m2ps4"
_GYROSCOPE = "gyroscope_bias_radps", "gyroscope_bias_covariance_rad2ps2"
_RATES = (
    ("body rate", "deg/s", "angular_rate_b_radps", ""),
    ("accelerometer bias", "m/s²", *_ACCELEROMETER),
    ("gyroscope bias", "deg/s", *_GYROSCOPE),
)


class _States(NamedTuple):
    """States of a method, of fixes or of the truth; None where there are none."""

    style: str
    name: str
    t_s: FloatArray
    R_nb: FloatArray | None
    euler_deg: FloatArray | None
    v_n_mps: FloatArray | None
    p_n_m: FloatArray | None

    def line(self, x: FloatArray, y: FloatArray) -> Line:
        """Return a line, or dots of fixes."""
        return Line(self.style, x, y, self.name, dots=self.style == FIXES)


def motion_charts(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return the motion in time, and the ground track."""
    states = list(_states(flight, methods))
    series = [line for state in states for line in _series(flight, state)]
    tracks = []
    for state in states:
        if state.p_n_m is not None and np.isfinite(state.p_n_m).any():
            north, east = state.p_n_m[:: max(1, len(state.p_n_m) // _TRACK), :2].T
            tracks.append(state.line(east, north))
    track = Chart("ground track", "north, m", tracks, "east, m", equal=True, height=1.6 * HEIGHT)
    note = paragraph("Grey dots: fixes of receivers, at their antennas.") if flight.fixes else []
    return note + grid([*time_charts(series, time), *([track] if tracks else [])])


def _states(flight: Flight, methods: Sequence[Method]) -> Iterator[_States]:
    """Yield states of methods, the truth and fixes."""
    for method in methods:
        estimate = method.solution
        if len(estimate.t_s):
            lost = hidden(estimate)
            yield _States(
                *(method.name, method.name, estimate.t_s, estimate.R_nb),
                np.where([name in lost for name in EULER], np.nan, estimate.euler_deg),
                None if "velocity" in lost else estimate.v_n_mps,
                None if "position" in lost else estimate.p_n_m,
            )
    truth = flight.truth
    if truth is not None and len(truth.t_s):
        euler_deg = np.degrees(to_euler(truth.R_nb))
        yield _States(TRUTH, TRUTH, truth.t_s, truth.R_nb, euler_deg, truth.v_n_mps, truth.p_n_m)
    for fixes in flight.fixes:
        name = f"fixes of {fixes.antenna}"
        yield _States(FIXES, name, fixes.t_s, None, None, fixes.v_n_mps, fixes.p_n_m)


def _series(flight: Flight, states: _States) -> Series:
    """Yield angles, those of baselines too, velocities and height."""
    if states.R_nb is not None and states.euler_deg is not None:
        angles_deg = dict(zip(EULER, states.euler_deg.T, strict=True))
        for name, unit_b in reported_baselines(flight).items():
            azimuth_deg, elevation_deg = np.degrees(azimuth_elevation(states.R_nb @ unit_b)).T
            angles_deg |= {f"azimuth, {name}": azimuth_deg, f"elevation, {name}": elevation_deg}
        for name, angle_deg in angles_deg.items():
            yield name, "angle, deg", _angle_line(states, angle_deg)
    if states.v_n_mps is not None:
        for axis, velocity_mps in zip(NORTH_EAST_DOWN, states.v_n_mps.T, strict=True):
            yield f"velocity {axis}", "velocity, m/s", states.line(states.t_s, velocity_mps)
    if states.p_n_m is not None:
        height_m = flight.origin.height_m - states.p_n_m[:, 2]
        yield "height above the ellipsoid", "height, m", states.line(states.t_s, height_m)


def _angle_line(states: _States, angle_deg: FloatArray) -> Line:
    """Return a line broken where the angle wraps, or dots where it does so often."""
    continuous_deg = unjumped_deg(angle_deg)
    wraps = int((np.isnan(continuous_deg) & np.isfinite(angle_deg)).sum())
    if wraps > min(_WRAPS, 0.3 * len(angle_deg)):
        return Line(states.style, states.t_s, angle_deg, states.name, dots=True)
    return states.line(states.t_s, continuous_deg)


def rate_and_bias_charts(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return body rates and biases of inertial units, with ±3σ."""
    return grid(time_charts(_rates_and_biases(flight, methods), time, spanning))


def _rates_and_biases(flight: Flight, methods: Sequence[Method]) -> Series:
    for name, unit, field, covariance in _RATES:
        scale = 180 / np.pi if unit == "deg/s" else 1.0
        estimates = {m.name: m.solution for m in methods}
        has = {
            of: estimate
            for of, estimate in estimates.items()
            if getattr(estimate, field) is not None
        }
        for k, axis in enumerate("xyz"):
            for of, estimate in has.items():
                spread = sigmas(getattr(estimate, covariance, None))
                half = None if spread is None else _SIGMAS * scale * spread[:, k]
                line = Line(of, estimate.t_s, scale * getattr(estimate, field)[:, k], half=half)
                yield f"{name} {axis}", f"{name}, {unit}", line
            truth = flight.truth
            if has and not covariance and truth is not None and len(truth.t_s) > 1:
                rotation_rad = log(transpose(truth.R_nb[:-1]) @ truth.R_nb[1:])[:, k]
                rate = scale * rotation_rad / np.diff(truth.t_s)  # mean rate between samples
                line = Line(TRUTH, (truth.t_s[:-1] + truth.t_s[1:]) / 2, rate)
                yield f"{name} {axis}", f"{name}, {unit}", line
