"""The sky over the flight, and how strong satellites were received."""

from collections.abc import Iterator

import numpy as np

from fgnav.checks import BoolArray, IntArray
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
from fgnav.evaluation.report.parts import Blocks, grid
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_POINTS = 60  # of a satellite's way
_CELLS = 240  # of a row of carrier-to-noise densities
_LEVELS_DBHZ = (25.0, 30.0, 35.0, 40.0, 45.0)  # between colours
_MOST = 56  # rows of a figure


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
    has_cn0 = bool(is_finite.any())
    title = "C/N0, dBHz, mean over antennas" if has_cn0 else "tracked channels: no C/N0 recorded"
    levels = [f"below {_LEVELS_DBHZ[0]:g}", *(f"{level:g}+" for level in _LEVELS_DBHZ)]
    colours = dict(zip(levels, CN0_COLOURS, strict=True))
    for first in range(0, len(shown), _MOST):
        some = shown[first : first + _MOST]
        rows = {names[k]: kinds[:, k] for k in some.tolist()}
        yield cells_chart(title, rows, edges_s, colours, time)


def _tracked(observations: Observations) -> BoolArray:
    """Select the channels that any antenna measured, (n, m)."""
    return np.asarray(np.isfinite(observations.code_m).any(axis=1))
