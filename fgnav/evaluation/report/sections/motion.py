"""The flight itself: attitude, velocity, height and ground track, beside fixes and the truth."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from fgnav.attitude.baseline_angles import azimuth_elevation, reported_baselines
from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.charts import FIXES, HEIGHT, TRUTH, Chart, Line, Span, unjumped_deg
from fgnav.evaluation.report.parts import Blocks, grid, paragraph
from fgnav.evaluation.report.sections.errors import standard_deviations
from fgnav.evaluation.scores import EULER, hidden
from fgnav.geometry.rotations import log, to_euler, transpose
from fgnav.types.flight import Flight, Truth

_TRACK = 2000  # points of a ground track
_WRAPS = 150  # an angle that wraps more often is drawn as dots
_SIGMAS = 3.0


class _States(NamedTuple):
    """What is drawn of a method, of fixes or of the truth; None where there is none."""

    of: str
    name: str
    t_s: FloatArray
    R_nb: FloatArray | None
    euler_deg: FloatArray | None
    v_n_mps: FloatArray | None
    p_n_m: FloatArray | None

    def line(self, y: FloatArray) -> Line:
        """Return a line, or dots of fixes."""
        return Line(of=self.of, name=self.name, x=self.t_s, y=y, dots=self.of == FIXES)


def motion_charts(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return the motion in time, and the ground track."""
    states = list(_states(flight, methods))
    angles: dict[str, list[tuple[_States, FloatArray]]] = {}
    for one in states:
        if one.R_nb is None or one.euler_deg is None:
            continue
        for k, name in enumerate(EULER):
            angles.setdefault(name, []).append((one, one.euler_deg[:, k]))
        for name, unit_b in reported_baselines(flight).items():
            both_deg = np.degrees(azimuth_elevation(one.R_nb @ unit_b))
            for k, angle in enumerate(("azimuth", "elevation")):
                angles.setdefault(f"{angle}, {name}", []).append((one, both_deg[:, k]))
    lines = {name: ("angle, deg", [_angle_line(*one) for one in of]) for name, of in angles.items()}
    for k, axis in enumerate(("north", "east", "down")):
        velocities = [one.line(one.v_n_mps[:, k]) for one in states if one.v_n_mps is not None]
        lines[f"velocity {axis}"] = "velocity, m/s", velocities
    down = [(one, one.p_n_m[:, 2]) for one in states if one.p_n_m is not None]
    heights = [one.line(flight.origin.height_m - down_m) for one, down_m in down]
    lines["height above the ellipsoid"] = "height, m", heights
    charts = [
        Chart(title=title, y=y, lines=shown, x_limits=time)
        for title, (y, of) in lines.items()
        if (shown := [line for line in of if np.isfinite(line.y).any()])
    ]
    note = "Grey dots: fixes of receivers, at their antennas."
    return (paragraph(note) if flight.fixes else []) + grid([*charts, *_track(states)])


def _states(flight: Flight, methods: Sequence[Method]) -> Iterator[_States]:
    """Yield states of fixes, methods and the truth."""
    for fixes in flight.fixes:
        name = f"fixes of {fixes.antenna}"
        yield _States(FIXES, name, fixes.t_s, None, None, fixes.v_n_mps, fixes.p_n_m)
    for method in methods:
        estimate = method.estimate
        if estimate is None or not len(estimate.t_s):
            continue
        lost = hidden(estimate)
        yield _States(
            method.name,
            method.name,
            estimate.t_s,
            estimate.R_nb,
            np.where([name in lost for name in EULER], np.nan, estimate.euler_deg),
            None if "velocity" in lost else estimate.v_n_mps,
            None if "position" in lost else estimate.p_n_m,
        )
    truth = flight.truth
    if truth is not None and len(truth.t_s):
        euler_deg = np.degrees(to_euler(truth.R_nb))
        yield _States(TRUTH, TRUTH, truth.t_s, truth.R_nb, euler_deg, truth.v_n_mps, truth.p_n_m)


def _angle_line(of: _States, angle_deg: FloatArray) -> Line:
    continuous_deg = unjumped_deg(angle_deg)
    wraps = int((np.isnan(continuous_deg) & np.isfinite(angle_deg)).sum())
    if wraps > min(_WRAPS, 0.3 * len(angle_deg)):
        return Line(of=of.of, name=of.name, x=of.t_s, y=angle_deg, dots=True)
    return of.line(continuous_deg)


def _track(states: Sequence[_States]) -> list[Chart]:
    """Return east and north on one scale; nothing without positions."""
    lines = []
    for one in states:
        if one.p_n_m is not None and np.isfinite(one.p_n_m).any():
            north, east = one.p_n_m[:: max(1, len(one.p_n_m) // _TRACK), :2].T
            lines.append(Line(of=one.of, name=one.name, x=east, y=north, dots=one.of == FIXES))
    chart = Chart(
        title="ground track",
        x="east, m",
        y="north, m",
        lines=lines,
        equal=True,
        height=1.6 * HEIGHT,
    )
    return [chart] if lines else []


def rate_and_bias_charts(flight: Flight, methods: Sequence[Method], time: Span) -> Blocks:
    """Return body rates and biases of inertial units, with ±3σ."""
    charts = []
    for title, unit, field, covariance, scale in (
        ("body rate", "deg/s", "angular_rate_b_radps", "", 180 / np.pi),
        (
            "accelerometer bias",
            "m/s²",
            "accelerometer_bias_mps2",
            "accelerometer_bias_covariance_m2ps4",
            1.0,
        ),
        (
            "gyroscope bias",
            "deg/s",
            "gyroscope_bias_radps",
            "gyroscope_bias_covariance_rad2ps2",
            180 / np.pi,
        ),
    ):
        for k, axis in enumerate("xyz"):
            lines = []
            for method in methods:
                estimate = method.estimate
                values = getattr(estimate, field, None)
                if estimate is None or values is None:
                    continue
                spread = standard_deviations(getattr(estimate, covariance, None))
                half = None if spread is None else _SIGMAS * scale * spread[:, k]
                y = scale * values[:, k]
                lines.append(Line(of=method.name, x=estimate.t_s, y=y, half=half))
            if lines and not covariance and flight.truth is not None:
                lines += _true_rate(flight.truth, k, scale)
            if lines:
                charts.append(
                    Chart(
                        title=f"{title} {axis}",
                        y=f"{title}, {unit}",
                        lines=lines,
                        x_limits=time,
                        y_limits=_limits(lines),
                    )
                )
    return grid(charts)


def _true_rate(truth: Truth, k: int, scale: float) -> list[Line]:
    """Return the truth's mean rate between samples, in body axes, at the middle."""
    if len(truth.t_s) < 2:
        return []
    rotation_rad = log(transpose(truth.R_nb[:-1]) @ truth.R_nb[1:])
    rate = scale * rotation_rad[:, k] / np.diff(truth.t_s)
    return [Line(of=TRUTH, x=(truth.t_s[:-1] + truth.t_s[1:]) / 2, y=rate)]


def _limits(lines: Sequence[Line]) -> tuple[float, float] | None:
    """Return limits that hold lines, and bands of the later half: they begin wide."""
    values = [line.y for line in lines]
    for line in lines:
        if line.half is not None:
            later = slice(len(line.y) // 2, None)
            values += [line.y[later] + side * line.half[later] for side in (-1, 1)]
    finite = np.concatenate([v[np.isfinite(v)] for v in values])
    if not len(finite) or np.ptp(finite) == 0:
        return None
    room = 0.04 * np.ptp(finite)
    return float(finite.min() - room), float(finite.max() + room)
