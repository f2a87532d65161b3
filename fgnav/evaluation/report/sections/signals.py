"""The sky over the flight, how strong satellites were received, and what methods leave of them."""

from collections.abc import Iterator, Sequence
from functools import partial

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.evaluation.comparison import Comparison
from fgnav.evaluation.internal_consistency.residuals import (
    Residuals,
    antenna_residuals,
    array_phase_residuals,
)
from fgnav.evaluation.report.charts import (
    CN0_COLOURS,
    INK_LINE,
    TRUTH,
    WIDTH,
    Chart,
    Line,
    Span,
    cells_chart,
    cells_of,
)
from fgnav.evaluation.report.parts import Blocks, folded, grid, number, paragraph, table
from fgnav.evaluation.scores import EULER, finite_mean, hidden
from fgnav.gnss.undifferenced import Undifferenced, undifferenced
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

# Method, times (n,), channels, and values (n, channels).
_Channels = tuple[str, FloatArray, Sequence[str], FloatArray]
_EXPLANATION = (
    "RMS in cells of time. The array's phase less what the attitude makes of it, whole cycles "
    "taken off, over all baselines; code and phase of the first antenna less what the position "
    "makes of them, clocks of each epoch and a constant of each arc of phase taken off: errors of "
    "the position, of orbits and of the atmosphere that drift within an arc stay in. A row is cut "
    "at its upper edge."
)
_POINTS = 60  # of a satellite's way
_CELLS = 240  # of a row of carrier-to-noise densities
_LEVELS_DBHZ = (25.0, 30.0, 35.0, 40.0, 45.0)  # between colours
_MOST = 56  # rows of a figure
_CHANNELS = 28  # those of residuals


def sky_charts(flight: Flight, time: Span) -> Blocks:
    """Return the sky plot and the carrier-to-noise densities; empty without GNSS."""
    observations = flight.observations
    if observations is None or not len(observations.t_s) or not observations.satellites:
        return []
    return grid([_sky(flight, observations), *_strengths(observations, time)])


def _sky(flight: Flight, observations: Observations) -> Chart:
    """Return azimuth and elevation of each satellite that was received, seen from the origin."""
    from fgnav.gnss.orbits.satellites import look_angles, satellite_states  # noqa: PLC0415
    from fgnav.gnss.single_point.model import orbits_of  # noqa: PLC0415  # lazy: brings numba

    satellites = tuple(dict.fromkeys(observations.satellites))
    rows = np.unique(np.linspace(0, len(observations.t_s) - 1, _POINTS).astype(np.int64))
    t_s = np.tile(observations.t_s[rows][:, None], (1, len(satellites)))
    states = satellite_states(orbits_of(flight), satellites, t_s, rates=False)
    receiver_e_m = np.tile(flight.origin.p_e_m, (len(rows), 1))
    _, elevation_rad, azimuth_rad = look_angles(receiver_e_m, states.p_e_m)
    tracked, zenith_deg = _tracked(observations)[rows], 90 - np.degrees(elevation_rad)
    circle = np.linspace(0.0, 2 * np.pi, 73)
    mask_deg = np.full(73, 90 - np.degrees(flight.elevation_mask_rad))
    lines, notes = [Line(TRUTH, circle, mask_deg, "elevation mask")], []
    for k, name in enumerate(satellites):
        channels = [other == name for other in observations.satellites]
        shown = tracked[:, channels].any(axis=1) & (elevation_rad[:, k] > 0)
        if shown.any():
            x, y = azimuth_rad[shown, k], zenith_deg[shown, k]
            lines.append(Line(INK_LINE, np.unwrap(x), y, name))
            lines.append(Line(INK_LINE, x[-1:], y[-1:], name, dots=True))
            notes.append((float(x[-1]), float(y[-1]), name))
    title = "sky plot from the origin: north up, dashed the elevation mask"
    return Chart(title, "elevation", lines, "azimuth", notes=notes, polar=True, height=0.7 * WIDTH)


def _strengths(observations: Observations, time: Span) -> Iterator[Chart]:
    """Yield a row for each channel: its mean carrier-to-noise density over antennas in time."""
    tracked, cn0_dbhz = _tracked(observations), observations.cn0_dbhz
    starts, edges_s = cells_of(observations.t_s, _CELLS)
    is_finite = np.isfinite(cn0_dbhz)
    total = np.add.reduceat(np.where(is_finite, cn0_dbhz, 0.0).sum(axis=1), starts, axis=0)
    count = np.add.reduceat(is_finite.sum(axis=1), starts, axis=0)
    level = np.digitize(total / np.maximum(count, 1), _LEVELS_DBHZ)
    received = np.logical_or.reduceat(tracked, starts, axis=0)
    kinds: IntArray = np.where(received, np.where(count > 0, level, 2), -1)
    shown = np.flatnonzero(tracked.any(axis=0))
    names = [f"{a} {b}" for a, b in zip(observations.satellites, observations.signals, strict=True)]
    is_stated = bool(is_finite.any())
    title = "C/N0, dBHz, mean over antennas" if is_stated else "tracked channels: no C/N0 recorded"
    levels = [f"below {_LEVELS_DBHZ[0]:g}", *(f"{level:g}+" for level in _LEVELS_DBHZ)]
    colours = dict(zip(levels, CN0_COLOURS, strict=True))
    for first in range(0, len(shown), _MOST):
        some = shown[first : first + _MOST]
        rows = {names[k]: kinds[:, k] for k in some.tolist()}
        yield cells_chart(title, rows, edges_s, colours, time)


def _tracked(observations: Observations) -> BoolArray:
    """Return which channels any antenna measured, (n, m)."""
    return np.asarray(np.isfinite(observations.code_m).any(axis=1))


def channel_charts(title: str, unit: str, series: Sequence[_Channels], time: Span) -> list[Chart]:
    """Return RMS in cells of time, a row for each channel, all on one scale."""
    edges_s = np.linspace(*time, 91)
    middle_s = np.append((edges_s[:-1] + edges_s[1:]) / 2, np.nan)
    means = [(of, _rms_in_cells(t_s, y, edges_s), names) for of, t_s, names, y in series]
    columns = [
        (name, column) for _, y, names in means for name, column in zip(names, y.T, strict=True)
    ]
    channels = sorted({name for name, column in columns if np.isfinite(column).any()})
    sizes = [float(np.nanpercentile(y, 99.0)) for _, y, _ in means if np.isfinite(y).any()]
    full = float(np.median(sizes or [1.0])) or 1.0
    charts = []
    for first in range(0, len(channels), _CHANNELS):
        rows = channels[first : first + _CHANNELS]
        lines = []
        for of, y, names in means:
            parts = dict(zip(names, (y.T / full).clip(None, 1), strict=True))
            heights = [
                np.append(k + 0.45 - 0.9 * parts[name], np.nan)
                for k, name in enumerate(rows)
                if name in parts
            ]
            if heights:
                lines.append(Line(of, np.tile(middle_s, len(heights)), np.concatenate(heights)))
        named = f"{title}: RMS, {unit}; row height {full:.3g} {unit}"
        height = 30 + 13.0 * len(rows)
        charts.append(Chart(named, lines=lines, rows=rows, x_limits=time, height=height))
    return charts


def _rms_in_cells(t_s: FloatArray, values: FloatArray, edges_s: FloatArray) -> FloatArray:
    """Return root mean squares in cells of time, (c, m); NaN in a cell without a value."""
    count = len(edges_s) - 1
    cell = (np.searchsorted(edges_s, t_s, side="right") - 1).clip(0, count - 1)
    total, number = np.zeros((2, count, values.shape[1]))
    np.add.at(total, cell, np.nan_to_num(values) ** 2)
    np.add.at(number, cell, np.isfinite(values))
    return np.asarray(np.sqrt(total / np.where(number > 0, number, np.nan)))


def residual_blocks(flight: Flight, comparison: Comparison, time: Span) -> Blocks:
    """Return rows and tables of residuals by satellite; empty without observations."""
    differences, observed = comparison.double_differences, _observed(flight)

    def of_array(estimate: Estimate) -> Residuals | None:
        if differences is None or hidden(estimate) & set(EULER):
            return None
        return array_phase_residuals(differences, estimate)

    def of_antenna(estimate: Estimate, *, of_phase: bool) -> Residuals | None:
        if observed is None or "position" in hidden(estimate):
            return None
        arm_b_m = flight.antennas[0].position_b_m
        return antenna_residuals(observed, estimate, arm_b_m, of_phase=of_phase)

    charts, tables = [], []
    for title, unit, scale, residuals in (
        ("phase of the array", "mm", 1e3, of_array),
        ("code of the first antenna", "m", 1.0, partial(of_antenna, of_phase=False)),
        ("phase of the first antenna", "mm", 1e3, partial(of_antenna, of_phase=True)),
    ):
        series = [
            (method.name, left.t_s, left.channels, scale * left.value_m)
            for method in comparison.solved
            if method.estimate is not None and (left := residuals(method.estimate)) is not None
        ]
        charts += channel_charts(title, unit, series, time)
        tables += _table(title, unit, series)
    by_satellite = folded("RMS by satellite and method", tables)
    return paragraph(_EXPLANATION) + grid(charts) + by_satellite if charts else []


def _observed(flight: Flight) -> Undifferenced | None:
    try:
        return None if flight.observations is None else undifferenced(flight)
    except NoSolutionError:  # too few satellites: then no method has a position by them either
        return None


def _table(title: str, unit: str, series: Sequence[_Channels]) -> Blocks:
    """Return the RMS of each channel and method."""
    rms: dict[str, dict[str, float]] = {}
    for of, _, channels, values in series:
        for name, value in zip(channels, np.sqrt(finite_mean(values**2, 0)).tolist(), strict=True):
            if np.isfinite(value):
                rms.setdefault(name, {})[of] = value
    heads = ["channel", *(f"{of}, {unit}" for of, *_ in series)]
    rows = ([name, *(number(rms[name].get(of)) for of, *_ in series)] for name in sorted(rms))
    return table(heads, rows, title)
