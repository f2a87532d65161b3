"""The sky over the flight: where satellites stood, and how strong they were received."""

import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.evaluation.report.blocks import Blocks, grid
from fgnav.evaluation.report.drawing.chart import Axis
from fgnav.evaluation.report.drawing.shapes import (
    GRID,
    INK,
    RULE,
    Dots,
    Drawing,
    Shape,
    Stroke,
    Text,
    circle,
)
from fgnav.evaluation.report.drawing.strip import LEFT, WIDE, cells, key, strip, time_ticks
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_SIZE, _RADIUS = 340.0, 150.0
_LETTER = 7.0  # width of a letter or digit
_POINTS = 60  # of a satellite's way
_CELLS = 240  # of a row of carrier-to-noise densities
_LEVELS_DBHZ = (25.0, 30.0, 35.0, 40.0, 45.0)  # between colours
_ROW, _TOP = 13.0, 8.0
_MOST = 56  # rows of a drawing
_COLOURS = tuple(f"c{k}" for k in range(len(_LEVELS_DBHZ) + 1))


def sky_charts(flight: Flight, time: Axis) -> Blocks:
    """Return the sky plot and the carrier-to-noise densities; empty without GNSS."""
    observations = flight.observations
    if observations is None or not len(observations.t_s) or not observations.satellites:
        return []
    return grid([_sky(flight, observations), *_strengths(observations, time)])


def _sky(flight: Flight, observations: Observations) -> Drawing:
    """Return azimuth and elevation of each satellite that was received, seen from the origin."""
    from fgnav.gnss.orbits.satellites import look_angles, satellite_states  # noqa: PLC0415
    from fgnav.gnss.single_point.model import orbits_of  # noqa: PLC0415  # lazy: brings numba

    satellites = tuple(dict.fromkeys(observations.satellites))
    rows = np.unique(np.linspace(0, len(observations.t_s) - 1, _POINTS).astype(np.int64))
    t_s = np.tile(observations.t_s[rows][:, None], (1, len(satellites)))
    states = satellite_states(orbits_of(flight), satellites, t_s, rates=False)
    receiver_e_m = np.tile(flight.origin.p_e_m, (len(rows), 1))
    _, elevation_rad, azimuth_rad = look_angles(receiver_e_m, states.p_e_m)
    is_tracked = _tracked(observations)[rows]
    shapes, rings = _circles(flight.elevation_mask_rad)
    ends: dict[str, tuple[float, float]] = {}
    for k, name in enumerate(satellites):
        own = [j for j, other in enumerate(observations.satellites) if other == name]
        shown = is_tracked[:, own].any(axis=1) & (elevation_rad[:, k] > 0)
        if not shown.any():
            continue
        radius = _RADIUS * (1 - elevation_rad[:, k] / (np.pi / 2))
        x = _SIZE / 2 + radius * np.sin(azimuth_rad[:, k])
        y = _SIZE / 2 - radius * np.cos(azimuth_rad[:, k])
        x, y = np.where(shown, x, np.nan), np.where(shown, y, np.nan)
        last = int(np.flatnonzero(shown)[-1])
        ends[name] = (float(x[last]), float(y[last]))
        shapes.append(Stroke(mark=INK, x=x, y=y, width=2.0, name=name))
        shapes.append(Dots(mark=INK, x=x[[last]], y=y[[last]], size=7.0, name=name))
    return Drawing(
        title="sky plot from the origin: north up, dashed the elevation mask",
        width=_SIZE,
        height=_SIZE,
        shapes=[*shapes, *_labels(ends, rings)],
    )


def _circles(mask_rad: float) -> tuple[list[Shape], dict[str, tuple[float, float]]]:
    """Return the grid of the sky, and where its rings of elevation end in the north."""
    middle = _SIZE / 2
    rings = {deg: _RADIUS * (1 - deg / 90) for deg in (0, 30, 60)}
    at, far = _RADIUS * (1 - mask_rad / (np.pi / 2)), _RADIUS + 11
    shapes: list[Shape] = [circle(GRID, (middle, middle), radius) for radius in rings.values()]
    shapes.append(circle(RULE, (middle, middle), at))
    for name, x, y in (("N", 0, -1), ("E", 1, 0), ("S", 0, 1), ("W", -1, 0)):
        shapes.append(Text(x=middle + far * x, y=middle + far * y + 4, text=name))
    return shapes, {f"{deg}°": (middle, middle - r) for deg, r in rings.items() if deg}


def _labels(
    satellites: dict[str, tuple[float, float]], rings: dict[str, tuple[float, float]]
) -> list[Text]:
    """Return the names of points, each where it covers the fewest points and names before it."""
    taken = [(x - 4, y - 4, x + 4, y + 4) for x, y in satellites.values()]
    texts = []
    for name, (x, y) in [*satellites.items(), *rings.items()]:
        width = _LETTER * len(name)
        places = [
            (left, foot)
            for foot in (y - 4, y + 12, y + 4, y - 15, y + 23)
            for left in (x + 5, x - 5 - width)
        ]
        boxes = [(left, foot - 9, left + width, foot + 2) for left, foot in places]
        hits = [sum(_meet(box, other) for other in taken) for box in boxes]
        best = hits.index(min(hits))
        taken.append(boxes[best])
        left, foot = places[best]
        texts.append(Text(x=left, y=foot, text=name, anchor="start"))
    return texts


def _meet(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Return whether two boxes, left, top, right, bottom, have something in common."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _strengths(observations: Observations, time: Axis) -> list[Drawing]:
    """Return a row for each channel: its mean carrier-to-noise density over antennas in time.

    A drawing holds so many rows that a sheet of paper holds it.
    """
    is_tracked = _tracked(observations)
    starts = cells(len(is_tracked), _CELLS)
    level = _levels(observations, is_tracked, starts)
    t_s = np.append(observations.t_s[starts], observations.t_s[-1])
    shown = np.flatnonzero(is_tracked.any(axis=0)).tolist()
    names = [f"{a} {b}" for a, b in zip(observations.satellites, observations.signals, strict=True)]
    is_finite = bool(np.isfinite(observations.cn0_dbhz).any())
    title = "C/N0, dBHz, mean over antennas" if is_finite else "tracked channels: no C/N0 recorded"
    drawings = []
    for first in range(0, len(shown), _MOST):
        shapes: list[Shape] = []
        some = shown[first : first + _MOST]
        for row, k in enumerate(some):
            y = _TOP + _ROW * (row + 0.5)
            shapes.append(Text(x=LEFT - 4, y=y + 4, text=names[k], anchor="end"))
            shapes += strip(level[:, k], t_s, _COLOURS, time, (y, _ROW - 2))
        bottom = _TOP + _ROW * len(some)
        shapes += [*time_ticks(time, bottom + 14), *(_scale(bottom + 36) if is_finite else [])]
        own = title if first == 0 else f"{title}, from {names[some[0]]}"
        drawings.append(Drawing(title=own, width=WIDE, height=bottom + 58, shapes=shapes))
    return drawings


def _tracked(observations: Observations) -> BoolArray:
    """Return which channels any antenna measured, (n, m)."""
    return np.asarray(np.isfinite(observations.code_m).any(axis=1))


def _levels(observations: Observations, is_tracked: BoolArray, starts: IntArray) -> IntArray:
    """Return the colour of each cell, (cells, m): -1 where nothing was received."""
    cn0_dbhz = observations.cn0_dbhz
    is_finite = np.isfinite(cn0_dbhz)
    total = np.add.reduceat(np.where(is_finite, cn0_dbhz, 0.0).sum(axis=1), starts, axis=0)
    number = np.add.reduceat(is_finite.sum(axis=1), starts, axis=0)
    mean = total / np.maximum(number, 1)
    received = np.logical_or.reduceat(is_tracked, starts, axis=0)
    level = np.where(number > 0, np.digitize(mean, _LEVELS_DBHZ), 2)
    return np.where(received, level, -1)


def _scale(y: float) -> list[Shape]:
    """Return what the colours mean."""
    texts = ["below 25", "25 to 30", "30 to 35", "35 to 40", "40 to 45", "above 45"]
    wide = (WIDE - LEFT) / len(texts)
    return key(list(zip(_COLOURS, texts, strict=True)), y, wide)
