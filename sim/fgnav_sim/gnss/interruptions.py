"""Interruptions of the phase: outages, lost lock, cycle slips, satellites behind the body."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav_sim.gnss.tables import (
    BodyMaskTable,
    GnssTable,
    LossOfLockTable,
    OutageTable,
    SlipsTable,
    antenna_names,
)

LARGEST_INTEGER = 1_000_000  # an arbitrary integer is drawn from both sides of zero up to this
_HOUR_S = 3600.0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sky:
    """Directions of the satellites of all channels."""

    elevation_rad: FloatArray  # (n, m)
    azimuth_rad: FloatArray  # (n, m)
    e_b: FloatArray | None  # (n, m, 3); directions in body axes, where somebody asked for them


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Tracking:
    """Tracked links, and changes of their integers."""

    tracked: BoolArray  # (n, a, m)
    flagged: BoolArray  # (n, a, m); where receivers announce that phase does not continue
    # (n, a, m); by how much phase differs from what it is with the integer of the satellite's whole
    # pass
    half_cycles: IntArray


def track(
    sensor: GnssTable,
    above: BoolArray,
    sky: Sky,
    t_s: FloatArray,
    antennas: int,
    *,
    rng: np.random.Generator,
) -> Tracking:
    """Return the tracked links of satellites that are above the mask at ``above``, (n, m).

    A link that comes back has a new arbitrary integer and says so. A loss of lock shorter than the
    interval leaves no gap, but a new integer and a flag all the same. A slip changes the integer of
    a link that is tracked before and after it, and says so or not.
    """
    lock_rng, slips_rng, integer_rng = rng.spawn(3)
    shape = (len(above), antennas, above.shape[1])
    tracked = np.repeat(above[:, None], antennas, axis=1)
    tracked &= ~_blocked(sensor.outages, sky, t_s, antennas)
    if sensor.body_mask is not None and sky.e_b is not None:
        tracked &= _uncovered(sensor.body_mask, sky.e_b, antennas)
    relocked = np.zeros(shape, dtype=bool)
    if sensor.loss_of_lock is not None:
        lost, relocked = _losses(sensor.loss_of_lock, shape, t_s, sensor.rate_hz, rng=lock_rng)
        tracked &= ~lost
    before = np.zeros_like(tracked)
    before[1:] = tracked[:-1]
    relocked &= tracked
    relocked[1:] |= tracked[1:] & ~before[1:]
    relocked[0] = False
    changes = np.zeros(shape, dtype=np.int32)
    changes[relocked] = integer_rng.integers(
        -LARGEST_INTEGER, LARGEST_INTEGER, np.count_nonzero(relocked)
    )
    # The pass's own integer begins when the satellite rises: nothing to add to it there.
    risen = np.zeros_like(above)
    risen[1:] = above[1:] & ~above[:-1]
    changes[np.repeat(risen[:, None], antennas, axis=1) & relocked] = 0
    changes *= 2
    flagged = relocked
    if sensor.slips is not None:
        flagged = flagged | _slip(sensor.slips, changes, tracked & before, t_s, rng=slips_rng)
    half_cycles = np.cumsum(changes, axis=0, dtype=np.int32)
    return Tracking(tracked=tracked, flagged=flagged, half_cycles=half_cycles)


def _blocked(
    outages: tuple[OutageTable, ...], sky: Sky, t_s: FloatArray, antennas: int
) -> BoolArray:
    """Return the links that outages take away, (n, a, m)."""
    blocked = np.zeros((len(t_s), antennas, sky.elevation_rad.shape[1]), dtype=bool)
    names = antenna_names(antennas)
    for outage in outages:
        first, second = np.radians(outage.azimuth_deg)
        width = (second - first) % (2 * np.pi) or 2 * np.pi
        low, high = np.radians(outage.elevation_deg)
        inside = (sky.azimuth_rad - first) % (2 * np.pi) <= width
        inside &= (sky.elevation_rad >= low) & (sky.elevation_rad <= high)
        concerned = [not outage.antennas or name in outage.antennas for name in names]
        blocked |= (outage.holds(t_s)[:, None] & inside)[:, None] & np.array(concerned)[
            None, :, None
        ]
    return blocked


def _uncovered(mask: BodyMaskTable, e_b: FloatArray, antennas: int) -> BoolArray:
    """Return the links whose satellite is within the cone of the antenna, (n, a, m)."""
    axes_b = np.array(mask.axes_b)
    axes_b = axes_b / np.linalg.norm(axes_b, axis=1, keepdims=True)
    cosine = np.einsum("nmi,ai->nam", e_b, np.broadcast_to(axes_b, (antennas, 3)))
    return np.asarray(cosine >= np.cos(np.radians(mask.half_angle_deg)))


def _events(
    rate_per_hour: float, shape: tuple[int, int, int], span_s: float, *, rng: np.random.Generator
) -> tuple[FloatArray, IntArray]:
    """Return times, (k,), and links, (2, k) antennas and channels, of a Poisson process each."""
    count = rng.poisson(rate_per_hour * span_s / _HOUR_S, shape[1:])
    links = np.repeat(np.indices(shape[1:]).reshape(2, -1), count.ravel(), axis=1)
    return np.asarray(rng.uniform(0.0, span_s, links.shape[1])), links


def _losses(
    table: LossOfLockTable,
    shape: tuple[int, int, int],
    t_s: FloatArray,
    rate_hz: float,
    *,
    rng: np.random.Generator,
) -> tuple[BoolArray, BoolArray]:
    """Return where lock is lost, and the first epochs after it, (n, a, m) each."""
    begin_s, links = _events(table.rate_per_hour, shape, len(t_s) / rate_hz, rng=rng)
    end_s = begin_s + rng.exponential(table.mean_s, len(begin_s))
    begin, end = np.searchsorted(t_s, begin_s), np.searchsorted(t_s, end_s)
    depth = np.zeros((shape[0] + 1, *shape[1:]), dtype=np.int16)
    np.add.at(depth, (begin, *links), 1)
    np.add.at(depth, (end, *links), -1)
    after = np.zeros(depth.shape, dtype=bool)
    after[(end, *links)] = True
    return np.cumsum(depth, axis=0)[:-1] > 0, after[:-1]


def _slip(
    table: SlipsTable,
    changes: IntArray,
    unbroken: BoolArray,
    t_s: FloatArray,
    *,
    rng: np.random.Generator,
) -> BoolArray:
    """Add slips to the changes, half cycles (n, a, m), in place; return those announced."""
    n, antennas, channels = changes.shape
    span_s = float(t_s[-1] - t_s[0])
    when_s, links = _events(table.rate_per_hour, (n, antennas, channels), span_s, rng=rng)
    size = 2 * rng.integers(1, table.largest_cycles, len(when_s), endpoint=True)
    side = rng.choice((-1, 1), len(when_s))
    announced = rng.random(len(when_s)) < table.flagged_share
    size = side * (size + (rng.random(len(when_s)) < table.half_cycle_share))
    at = (np.searchsorted(t_s, when_s), *links)
    size *= unbroken[at]  # nothing slips where nothing is tracked
    np.add.at(changes, at, size)
    flagged = np.zeros(changes.shape, dtype=bool)
    flagged[tuple(axis[announced] for axis in at)] = True
    return flagged & unbroken
