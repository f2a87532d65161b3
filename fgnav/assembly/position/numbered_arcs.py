"""Observations of antennas at keyframes, with arcs numbered consecutively."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.gnss.undifferenced import Undifferenced
from fgnav.gnss.wind_up import wind_up_cycles

_ROUNDING_S = 1e-6


class Observed(NamedTuple):
    """Observations of an antenna at keyframes; of several the last that has an epoch is taken."""

    of: Undifferenced
    row: IntArray  # (k,), keyframes
    epoch: IntArray  # (k,)
    arm_b_m: FloatArray  # (3,), from the accelerometer to the antenna
    antenna: str = ""


class NumberedArcs(NamedTuple):
    """Observations of antennas, arcs and satellites numbered consecutively."""

    of: Undifferenced
    phase_m: FloatArray  # (n, m), less what is taken off each arc, and less the wind-up
    phase_less_code_m: FloatArray  # (n, m), phase_m less code
    arc: IntArray  # (n, m); -1 without phase
    satellite: IntArray  # (m,)
    arm_b_m: FloatArray
    antenna: str
    offset_m: FloatArray  # (a,), taken off the phases of each arc, by its number among its own
    wound: FloatArray  # (n, m), cycles by which turns of the antenna have wound up phases


class LiveBlock(NamedTuple):
    """A = (ambiguities, errors of satellites, their rates) of a block."""

    t_s: float
    channel: IntArray  # (c,)
    arc: IntArray  # (c,)
    satellite: IntArray  # (s,)
    seen_s: FloatArray  # (s,), when they last had phase
    coded_s: float  # block that codes last entered with

    @property
    def sizes(self) -> tuple[int, int]:
        """Ambiguities, and satellites."""
        return len(self.channel), len(self.satellite)

    @property
    def size(self) -> int:
        """Dimensions of A."""
        return len(self.channel) + 2 * len(self.satellite)


class EarlierArcs(NamedTuple):
    """Arcs of earlier epochs that later phases need."""

    t_s: float  # epoch up to which they have become rows
    links: dict[tuple[str, str], tuple[int, float, float]]  # arc, what is taken off, cycles wound
    arcs: int  # that there have been, or more
    blocks: int
    live: LiveBlock | None
    satellites: tuple[str, ...]  # of the live block


def numbered(
    one: Observed,
    first: int,
    number: dict[str, int],
    R_nb: FloatArray,
    earlier: EarlierArcs | None,
) -> NumberedArcs:
    """Return an antenna's observations, their arcs numbered from ``first`` on.

    Phase less code of each arc's first epoch is taken off, so that numbers are small.
    """
    of, phase_m = one.of, one.of.phase_m.copy()
    continuing, now = _known_links(of, earlier)
    total = np.zeros(phase_m.shape)
    if of.pole_n is not None and len(one.row):
        wound = wind_up_cycles(of.e_n[one.epoch], R_nb[one.row], of.pole_n)
        if of.integers:  # a base's antenna looks up, its front to the north
            still = np.broadcast_to(np.eye(3), (len(one.row), 3, 3))
            wound -= wind_up_cycles(of.e_n[one.epoch], still, of.pole_n)
        total[one.epoch] = wound
        for j, (_, _, cycles) in continuing.items():  # counted on from an earlier epoch
            total[:, j] += np.rint(cycles - total[now, j])
        phase_m[one.epoch] -= of.wavelength_m * total[one.epoch]
    epoch, channel = np.nonzero(of.arc >= 0)
    arc, code_m = of.arc[epoch, channel], of.code_m[epoch, channel]
    difference_m = phase_m[epoch, channel] - np.where(np.isfinite(code_m), code_m, 0.0)
    offset_m = np.zeros(1 + arc.max(initial=-1))
    offset_m[arc[::-1]] = difference_m[::-1]  # as of the first epoch of each arc
    ids = np.arange(len(offset_m)) + (first if earlier is None else earlier.arcs)
    for j, (link, taken_m, _) in continuing.items():
        ids[of.arc[now, j]], offset_m[of.arc[now, j]] = link, taken_m
    phase_m -= np.where(of.arc >= 0, offset_m[of.arc.clip(0)] if len(offset_m) else 0.0, 0.0)
    return NumberedArcs(
        of=of,
        phase_m=phase_m,
        phase_less_code_m=phase_m - of.code_m,
        arc=np.where(of.arc >= 0, ids[of.arc.clip(0)], -1) if len(ids) else of.arc,
        satellite=np.array([number[name] for name in of.satellites], dtype=np.int64),
        arm_b_m=one.arm_b_m,
        antenna=one.antenna,
        offset_m=offset_m,
        wound=total,
    )


def _known_links(
    of: Undifferenced, earlier: EarlierArcs | None
) -> tuple[dict[int, tuple[int, float, float]], int]:
    """Return the arcs that go on from an earlier epoch, by channel, and its row."""
    if earlier is None:
        return {}, 0
    now = int(np.searchsorted(of.t_s, earlier.t_s - _ROUNDING_S))
    continuing = {
        j: earlier.links[channel]
        for j, channel in enumerate(zip(of.satellites, of.signals, strict=True))
        if channel in earlier.links and of.arc[now, j] >= 0
    }
    return continuing, now
