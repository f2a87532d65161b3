"""The skies of a data set: where and when its runs are, and which satellites they see."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.earth import ecef, ned_axes
from fgnav_sim.data_sets.world import AnySites, AnyTimes, SatellitesTable, World
from fgnav_sim.gnss.constellation import built_in_positions
from fgnav_sim.gnss.selection import best_geometry, lasting, period
from fgnav_sim.scenario import gps_s

_BLOCK = 8192  # skies at a time: small enough for the cache, large enough to forget the loop
_ALL = 16  # of one constellation; more are never above 10 degrees


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sky:
    """Satellites of every epoch, in slots: those of a constellation and signal side by side."""

    t_s: FloatArray  # (n,)
    satellites: NDArray[np.str_]  # (n, m); ``""`` in slots without one
    signals: tuple[str, ...]  # length m
    constellations: tuple[str, ...]  # length m
    # (n, m, 3); unit vectors to satellites in the place's own North-East-Down axes; 0 in empty
    # slots
    e_n: FloatArray
    elevation_rad: FloatArray  # (n, m); NaN in empty slots
    number: IntArray  # (n, m); of the satellite among all; 0 in empty slots


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Series:
    """Spans of time at places, (q, l): the skies that epochs are taken from.

    ``row`` is where each epoch, (n,), stands among the skies, (q l,).
    """

    t_s: FloatArray
    p_e_m: FloatArray
    R_ne: FloatArray
    row: IntArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Slots:
    """Satellites of slots by number, (k, m), whether there is one, and their directions."""

    number: IntArray
    filled: BoolArray
    e_n: FloatArray


def skies(world: World, runs: int, *, rng: np.random.Generator) -> Sky:
    """Return the skies of whole runs, ``n = runs * world.runs.epochs`` epochs.

    Raises
    ------
    BadInputError
        If a constellation has no built-in almanac.
    """
    series_rng, choice_rng = rng.spawn(2)
    series = _series(world, runs, rng=series_rng)
    satellites, moment, position_e_m = _positions(world, series.t_s)
    table = world.satellites
    parts: list[_Slots] = []
    for letter, signals in table.signals.items():
        members = np.flatnonzero([name[0] == letter for name in satellites])
        slots = _constellation(
            world, series, members, position_e_m[:, members], moment, rng=choice_rng.spawn(1)[0]
        )
        parts += [slots] * len(signals)
    width = [slots.number.shape[1] for slots in parts]
    kinds = [(letter, s) for letter, signals in table.signals.items() for s in signals]
    filled = np.concatenate([slots.filled for slots in parts], axis=1)[series.row]
    e_n = np.concatenate([slots.e_n for slots in parts], axis=1)[series.row]
    number = np.concatenate([slots.number for slots in parts], axis=1)[series.row]
    elevation_rad = np.where(filled, np.arcsin(np.clip(-e_n[..., 2], -1, 1)), np.nan)
    return Sky(
        t_s=series.t_s.ravel()[series.row],
        satellites=np.where(filled, np.array(satellites)[number], ""),
        signals=tuple(s for (_, s), w in zip(kinds, width, strict=True) for _ in range(w)),
        constellations=tuple(c for (c, _), w in zip(kinds, width, strict=True) for _ in range(w)),
        e_n=e_n,
        elevation_rad=elevation_rad,
        number=number,
    )


def _series(world: World, runs: int, *, rng: np.random.Generator) -> _Series:
    """Return the series of skies; runs share those of a day at a given place if they can."""
    site_rng, time_rng = rng.spawn(2)
    epochs, step_s = world.runs.epochs, world.runs.step_s
    p_e_m, R_ne = _places(world, runs, rng=site_rng)
    offset = np.arange(epochs)
    if isinstance(world.times, AnyTimes):
        shared = world.times.runs_per_moment if isinstance(world.sites, AnySites) else 1
        moments = -(-runs // shared)
        start_s = time_rng.uniform(0.0, 86_400.0 * world.times.days, moments)
        t_s = np.repeat(start_s, shared)[:runs, None] + step_s * offset
        return _Series(t_s=t_s, p_e_m=p_e_m, R_ne=R_ne, row=np.arange(runs * epochs))
    grid = max(1, int(np.ceil(world.times.duration_s / step_s - 1e-6)))  # epochs of the span
    first = time_rng.integers(0, grid - epochs, runs, endpoint=True)
    at = first[:, None] + offset
    if isinstance(world.sites, AnySites) or _differs(world.satellites):
        return _Series(t_s=step_s * at, p_e_m=p_e_m, R_ne=R_ne, row=np.arange(runs * epochs))
    t_s = step_s * np.arange(grid)[None]
    return _Series(t_s=t_s, p_e_m=p_e_m[:1], R_ne=R_ne[:1], row=at.ravel())


def _differs(table: SatellitesTable) -> bool:
    """Return True if two runs at one place and time may have different satellites."""
    by_chance = table.choose != "all" and table.pick == "random"
    return by_chance or isinstance(table.choose, tuple)


def _places(world: World, runs: int, *, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return each run's place in ECEF, (r, 3), and its axes, (r, 3, 3)."""
    if isinstance(world.sites, AnySites):
        latitude = np.arcsin(rng.uniform(-1.0, 1.0, runs))
        longitude = rng.uniform(-np.pi, np.pi, runs)
        height_m = rng.uniform(*world.sites.height_m, runs)
    else:
        frame = world.sites.place.frame
        site = [frame.latitude_rad, frame.longitude_rad, frame.height_m]
        latitude, longitude, height_m = np.tile(site, (runs, 1)).T
    return ecef(latitude, longitude, height_m).reshape(-1, 3), ned_axes(latitude, longitude)


def _positions(world: World, t_s: FloatArray) -> tuple[tuple[str, ...], IntArray, FloatArray]:
    """Return all satellites, each sky's moment (k,), and positions at the moments (t, s, 3)."""
    distinct_s, moment = np.unique(t_s, return_inverse=True)
    letters = tuple(world.satellites.signals)
    names, p_e_m = built_in_positions(letters, gps_s(world.start), distinct_s)
    return names, moment.ravel(), p_e_m


def _constellation(
    world: World,
    series: _Series,
    numbers: IntArray,
    position_e_m: FloatArray,
    moment: IntArray,
    *,
    rng: np.random.Generator,
) -> _Slots:
    """Return the slots of one constellation in all skies."""
    count, length = len(moment), series.t_s.shape[1]
    towards = np.empty((count, len(numbers), 3))
    above = np.empty((count, len(numbers)), dtype=bool)
    lowest = np.sin(np.radians(world.satellites.mask_deg))
    for first in range(0, count, _BLOCK):
        block = slice(first, first + _BLOCK)
        where = np.arange(first, min(first + _BLOCK, count)) // length
        e_e = position_e_m[moment[block]] - series.p_e_m[where, None]
        towards[block] = e_e @ series.R_ne[where].swapaxes(1, 2)
        towards[block] /= np.sqrt(np.einsum("nsi,nsi->ns", towards[block], towards[block]))[
            ..., None
        ]
        above[block] = -towards[block, :, 2] > lowest  # a comparison with NaN is false
    kept, most = _choose(world.satellites, series, towards, above, rng=rng)
    most = min(most, len(numbers))
    # The highest first where there are too many for the slots; else in the order of their names.
    rank = np.argsort(np.where(kept, towards[..., 2], np.inf), axis=1, kind="stable")[:, :most]
    filled = np.take_along_axis(kept, rank, axis=1)
    column = np.sort(np.where(filled, rank, len(numbers)), axis=1)
    filled = column < len(numbers)
    column = np.where(filled, column, 0)
    e_n = np.take_along_axis(towards, column[..., None], axis=1)
    return _Slots(
        number=np.where(filled, numbers[column], 0),
        filled=filled,
        e_n=np.where(filled[..., None], e_n, 0.0),
    )


def _choose(
    table: SatellitesTable,
    series: _Series,
    towards: FloatArray,
    above: BoolArray,
    *,
    rng: np.random.Generator,
) -> tuple[BoolArray, int]:
    """Select the satellites of each sky, (k, s); return also the largest number there may be."""
    if table.choose == "all":
        return above, _ALL
    length = series.t_s.shape[1]
    number = period(series.t_s)
    begin = np.flatnonzero(np.diff(number, axis=1, prepend=number[:, :1] - 1).ravel())
    low, high = table.choose if isinstance(table.choose, tuple) else (table.choose, table.choose)
    wanted = rng.integers(low, high, len(series.t_s), endpoint=True)[begin // length]
    candidates = lasting(above, begin, wanted)
    if table.pick == "geometry":
        kept = best_geometry(towards[begin], candidates, wanted)
    else:
        order = np.where(candidates, rng.random(candidates.shape), np.inf)
        last = np.sort(order, axis=1)[np.arange(len(order)), np.minimum(wanted, order.shape[1]) - 1]
        kept = candidates & (order <= last[:, None])
    lengths = np.diff(begin, append=above.shape[0])
    return np.asarray(above & np.repeat(kept, lengths, axis=0)), high
