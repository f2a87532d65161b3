"""The flight itself: attitude, velocity, height and ground track, beside fixes and the truth."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from fgnav.attitude.baseline_angles import azimuth_elevation, reported_baselines
from fgnav.checks import FloatArray
from fgnav.evaluation.comparison import Method
from fgnav.evaluation.report.blocks import Blocks, grid, paragraph
from fgnav.evaluation.report.drawing.chart import (
    BINS,
    HEIGHT,
    Axis,
    Band,
    Chart,
    Line,
    nested,
    on_one_scale,
    spanning,
)
from fgnav.evaluation.report.drawing.shapes import TRUTH, Drawing
from fgnav.evaluation.report.lines import every, unjumped_deg
from fgnav.evaluation.report.sections.errors import sigmas
from fgnav.evaluation.scores import EULER, hidden
from fgnav.geometry.rotations import log, to_euler, transpose
from fgnav.types.flight import Flight, Truth

_TRACK = 2000  # points of a ground track
_WRAPS = 0.3  # share of the bins of a line that an angle wraps in: more are drawn as dots
_THICK, _THIN = 4.5, 1.6  # lines of methods, below the truth's
_SIGMAS = 3.0
_FIXES = "refused"  # grey


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _States:
    """What is drawn of a method, of fixes or of the truth; None where there is none."""

    mark: str
    name: str
    t_s: FloatArray
    R_nb: FloatArray
    euler_deg: FloatArray
    v_n_mps: FloatArray | None
    p_n_m: FloatArray | None
    dots: bool = False


def motion_charts(
    flight: Flight, methods: Sequence[Method], marks: dict[str, str], time: Axis
) -> Blocks:
    """Return diagrams of the motion in time."""
    states = list(_states(flight, methods, marks))
    if not states:
        return []
    of_angles = {
        name: [(one, one.euler_deg[:, k]) for one in states] for k, name in enumerate(EULER)
    }
    for name, unit_b in reported_baselines(flight).items():
        angles = [(one, np.degrees(azimuth_elevation(one.R_nb @ unit_b))) for one in states]
        for k, angle in enumerate(("azimuth", "elevation")):
            of_angles[f"{angle}, {name}"] = [(one, values[:, k]) for one, values in angles]
    charts = [_angle(of, name, time).drawing() for name, of in of_angles.items()]
    for k, name in enumerate(("north", "east", "down")):
        of = [(s, s.v_n_mps[:, k]) for s in states if s.v_n_mps is not None]
        charts += _series(f"velocity {name}", "m/s", of, time)
    height_m = flight.origin.height_m
    of = [(s, height_m - s.p_n_m[:, 2]) for s in states if s.p_n_m is not None]
    charts += _series("height above the ellipsoid", "m", of, time)
    charts += _track(states)
    note = "Grey dots: fixes of receivers, at their antennas."
    return (paragraph(note) if flight.fixes else []) + grid(charts)


def rate_and_bias_charts(
    flight: Flight, methods: Sequence[Method], marks: dict[str, str], time: Axis
) -> Blocks:
    """Return diagrams of body rates and of the biases of inertial units, with ±3σ."""
    charts = []
    true_rate, widths = _true_rate(flight.truth), nested(len(methods), _THICK, _THIN)
    for title, unit, field, covariance, scale in (
        ("body rate", "deg/s", "angular_rate_b_radps", None, 180 / np.pi),
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
            lines: list[Line] = []
            bands: list[Band] = []
            for method in methods:
                estimate = method.estimate
                values = None if estimate is None else getattr(estimate, field)
                if estimate is None or values is None:
                    continue
                mark, t_s, value = marks[method.name], estimate.t_s, scale * values[:, k]
                width = float(widths[len(lines)])
                lines.append(Line(mark=mark, name=method.name, x=t_s, y=value, width=width))
                spread = None if covariance is None else sigmas(getattr(estimate, covariance))
                if spread is not None:
                    half = _SIGMAS * scale * spread[:, k]
                    bands.append(
                        Band(
                            mark=mark,
                            name=f"±3σ of {method.name}",
                            x=t_s,
                            low=value - half,
                            high=value + half,
                        )
                    )
            if lines and field == "angular_rate_b_radps" and true_rate is not None:
                t_s, rate_radps = true_rate
                value = scale * rate_radps[:, k]
                lines.append(Line(mark=TRUTH, name=TRUTH, x=t_s, y=value))
            if lines:
                edges = [edge[len(edge) // 2 :] for b in bands for edge in (b.low, b.high)]
                y = spanning(f"{title} {axis}, {unit}", [*(line.y for line in lines), *edges])
                charts.append(
                    Chart(title=f"{title} {axis}", x=time, y=y, lines=lines, bands=bands).drawing()
                )
    return grid(charts)


def _true_rate(truth: Truth | None) -> tuple[FloatArray, FloatArray] | None:
    """Return the truth's mean rate between samples, (k - 1, 3), in body axes, at the middle."""
    if truth is None or len(truth.t_s) < 2:
        return None
    steps_s = np.diff(truth.t_s)[:, None]
    turn_rad = log(transpose(truth.R_nb[:-1]) @ truth.R_nb[1:])
    return (truth.t_s[:-1] + truth.t_s[1:]) / 2, turn_rad / steps_s


def _states(flight: Flight, methods: Sequence[Method], marks: dict[str, str]) -> Iterator[_States]:
    """Yield fixes, the methods' states, then the truth's, which is drawn over them."""
    for fixes in flight.fixes:
        yield _States(
            mark=_FIXES,
            name=f"fixes of {fixes.antenna}",
            t_s=fixes.t_s,
            R_nb=np.full((len(fixes.t_s), 3, 3), np.nan),
            euler_deg=np.full((len(fixes.t_s), 3), np.nan),
            v_n_mps=fixes.v_n_mps,
            p_n_m=fixes.p_n_m,
            dots=True,
        )
    for method in methods:
        estimate = method.estimate
        if estimate is None or not len(estimate.t_s):
            continue
        open_ = hidden(estimate)
        euler_deg = np.array(estimate.euler_deg)
        euler_deg[:, [name in open_ for name in EULER]] = np.nan
        yield _States(
            mark=marks[method.name],
            name=method.name,
            t_s=estimate.t_s,
            R_nb=estimate.R_nb,
            euler_deg=euler_deg,
            v_n_mps=None if "velocity" in open_ else estimate.v_n_mps,
            p_n_m=None if "position" in open_ else estimate.p_n_m,
        )
    truth = flight.truth
    if truth is not None and len(truth.t_s):
        yield _States(
            mark=TRUTH,
            name="truth",
            t_s=truth.t_s,
            R_nb=truth.R_nb,
            euler_deg=np.degrees(to_euler(truth.R_nb)),
            v_n_mps=truth.v_n_mps,
            p_n_m=truth.p_n_m,
        )


def _behind(of: list[tuple[_States, FloatArray]]) -> list[tuple[_States, FloatArray, float]]:
    """Return series in the order of drawing with their widths: the roughest first, truth last."""
    ordered = sorted(
        of, key=lambda one: (one[0].mark == TRUTH, not one[0].dots, -_roughness(one[1]))
    )
    dots = sum(one.dots for one, _ in ordered)
    methods = sum(one.mark != TRUTH for one, _ in ordered) - dots
    widths = [*[1.0] * dots, *nested(methods, _THICK, _THIN).tolist(), 1.0]
    return [(one, y, width) for (one, y), width in zip(ordered, widths, strict=False)]


def _roughness(y: FloatArray) -> float:
    """Return the median size of steps."""
    steps = np.abs(np.diff(y))
    finite = steps[np.isfinite(steps)]
    return float(np.median(finite)) if len(finite) else 0.0


def _angle(of: list[tuple[_States, FloatArray]], name: str, time: Axis) -> Chart:
    lines = []
    shown = [(one, y) for one, y in of if np.isfinite(y).any()]
    for one, angle_deg, width in _behind(shown):
        continuous_deg = unjumped_deg(angle_deg)
        jumps = int((np.isnan(continuous_deg) & np.isfinite(angle_deg)).sum())
        dots = jumps > _WRAPS * min(BINS, len(angle_deg))
        y = angle_deg if dots else continuous_deg
        lines.append(Line(mark=one.mark, name=one.name, x=one.t_s, y=y, dots=dots, width=width))
    return Chart(
        title=name, x=time, y=spanning(f"{name}, deg", [line.y for line in lines]), lines=lines
    )


def _series(
    name: str, unit: str, of: list[tuple[_States, FloatArray]], time: Axis
) -> list[Drawing]:
    shown = [(s, y) for s, y in of if np.isfinite(y).any()]
    lines = [
        Line(mark=s.mark, name=s.name, x=s.t_s, y=y, dots=s.dots, width=width)
        for s, y, width in _behind(shown)
    ]
    if not lines:
        return []
    y = spanning(f"{name}, {unit}", [line.y for line in lines])
    return [Chart(title=name, x=time, y=y, lines=lines).drawing()]


def _track(states: list[_States]) -> list[Drawing]:
    """Return east and north on one scale; nothing without positions."""
    lines = []
    shown = [
        (one, one.p_n_m[:, 0])
        for one in states
        if one.p_n_m is not None and np.isfinite(one.p_n_m).any()
    ]
    for one, _, width in _behind(shown):
        if one.p_n_m is not None:
            north, east = one.p_n_m[every(len(one.p_n_m), _TRACK), :2].T
            mark, name, dots = one.mark, one.name, one.dots
            lines.append(
                Line(mark=mark, name=name, x=east, y=north, dots=dots, as_is=True, width=width)
            )
    if not lines:
        return []
    height = 1.6 * HEIGHT
    x = spanning("east, m", [line.x for line in lines])
    y = spanning("north, m", [line.y for line in lines])
    x, y = on_one_scale(x, y, height)
    return [Chart(title="ground track", x=x, y=y, lines=lines, height=height).drawing()]
