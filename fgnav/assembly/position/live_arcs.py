"""Phases of antennas as rows of the graph: live arcs of each epoch, block by block.

Causal throughout: an epoch's rows, and the block that it is in, come from what was there by then.
"""

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np

from fgnav.assembly.position.ambiguity_filter import ArcNames
from fgnav.assembly.position.numbered_arcs import (
    EarlierArcs,
    LiveBlock,
    NumberedArcs,
    Observed,
    numbered,
)
from fgnav.assembly.position.whitening import by_clock, whitened_rows
from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import ArcBlock, PhaseRows
from fgnav.graph.types.on_demand import MANY, OnDemand

# Errors of satellites stand still within a block. Of blocks of 1, .5 and .2 s velocities, known by
# phases of the last half second, had squared errors of 3.8, 3.0 and 2.7 of 3
# (docs/theory/gnss_phase.md).
_BLOCK_S = 0.5
# Code determines ambiguities once in so long: receivers smooth it over about a second (Kaplan,
# Hegarty, Understanding GPS, 2nd edition, section 5.6: loop bandwidths of code), and echoes last
# longer.
_CODE_S = 1.0
_ROUNDING_S = 1e-6
_STILL_M_PER_SQRT_S = 1e-4  # of ambiguities, which do not move: whitening needs some noise
_STILL_MPS_PER_SQRT_S = 1e-6
_STILL_ERROR = 1e-5  # m per sqrt(s), of satellites close to a base: squares have 16 digits
UNKNOWN_M = 1e2  # ambiguities, once phase less code is taken off, and before code
_REMEMBERED_S = 60.0  # errors of satellites without phase: they walk by centimetres meanwhile


class LiveRows(NamedTuple):
    """Epochs of phases, and the blocks that they are in; rows of both are made on demand."""

    row: list[int]  # (k,), keyframes
    block: list[int]  # (k,), numbers
    arms_b_m: list[FloatArray]  # (k,)
    rows: Sequence[PhaseRows]  # (k,)
    names: list[ArcNames]  # of blocks
    blocks: Sequence[ArcBlock]
    first_block: int
    goes_on: EarlierArcs | None


class _BlockStart(NamedTuple):
    """The first epoch of a block, and the arcs before and from there on."""

    arcs: NumberedArcs
    epoch: int
    row: int  # keyframe
    before: LiveBlock | None
    after: LiveBlock


def live_rows(
    observed: tuple[Observed, ...],
    t_s: FloatArray,
    R_nb: FloatArray,
    earlier: EarlierArcs | None = None,
) -> LiveRows:
    """Return the phases of antennas at keyframes, (n,), by live arcs; R_nb winds them up.

    Of epochs after ``earlier`` alone.
    """
    names = dict.fromkeys(name for observation in observed for name in observation.of.satellites)
    if earlier is not None:
        names |= dict.fromkeys(earlier.satellites)
    number = {name: k for k, name in enumerate(sorted(names))}
    arcs, first = [], 0
    at: dict[int, tuple[NumberedArcs, int]] = {}
    for observation in observed:
        arcs.append(numbered(observation, first, number, R_nb, earlier))
        first = max(first, 1 + int(arcs[-1].arc.max(initial=-1)))
        for k, i in zip(observation.row.tolist(), observation.epoch.tolist(), strict=True):
            at[k] = arcs[-1], i
    live, first_block = _resumed(earlier, number)
    starts: list[_BlockStart] = []
    rows: list[partial[PhaseRows]] = []
    out = LiveRows([], [], [], (), [], (), first_block, None)
    for k in sorted(at):
        of, i = at[k]
        if (earlier is not None and t_s[k] <= earlier.t_s) or not _freedom(of, i):
            continue
        now_s = float(t_s[k])
        if live is None or not _goes_on_in(of, i, live, now_s):
            before, live = live, _next(of, i, live, now_s)
            starts.append(_BlockStart(of, i, k, before, live))
            out.names.append(_names(of, live, i))
        rows.append(partial(_phase_rows, of, i, live, now_s - live.t_s))
        out.row.append(k)
        out.block.append(first_block + len(starts) - 1)
        out.arms_b_m.append(of.arm_b_m)
    return out._replace(
        rows=OnDemand(len(rows), lambda i: rows[i](), MANY),
        blocks=OnDemand(len(starts), lambda j: _arc_block(starts[j])),
        goes_on=_goes_on(at, t_s, number, live, first_block + len(starts)),
    )


def _resumed(earlier: EarlierArcs | None, number: dict[str, int]) -> tuple[LiveBlock | None, int]:
    """Return the block that goes on, and how many there have been."""
    if earlier is None or earlier.live is None:
        return None, 0
    satellite = np.array([number[name] for name in earlier.satellites], dtype=np.int64)
    return earlier.live._replace(satellite=satellite), earlier.blocks


def _goes_on(
    at: dict[int, tuple[NumberedArcs, int]],
    t_s: FloatArray,
    number: dict[str, int],
    live: LiveBlock | None,
    blocks: int,
) -> EarlierArcs | None:
    """Return the arcs that later epochs need, as of the last one."""
    if not at or live is None:
        return None
    k = max(at)
    of, i = at[k]
    channels = zip(of.of.satellites, of.of.signals, strict=True)
    local = of.of.arc[i]
    links = {
        channel: (int(of.arc[i, j]), float(of.offset_m[local[j]]), float(of.wound[i, j]))
        for j, channel in enumerate(channels)
        if local[j] >= 0
    }
    named = {index: name for name, index in number.items()}
    satellites = tuple(named[s] for s in live.satellite.tolist())
    return EarlierArcs(float(t_s[k]), links, 1 + int(of.arc.max()), blocks, live, satellites)


def _goes_on_in(of: NumberedArcs, i: int, live: LiveBlock, now_s: float) -> bool:
    """Return True if a block has the arcs of an epoch, and all satellites with code alone."""
    if now_s - live.t_s > _BLOCK_S - _ROUNDING_S:
        return False
    phased, coded = _channels(of, i)
    is_live = np.isin(of.satellite[coded], live.satellite)
    return np.array_equal(of.arc[i, phased], live.arc) and bool(is_live.all())


def _names(of: NumberedArcs, live: LiveBlock, i: int) -> ArcNames:
    return ArcNames(
        arc=live.arc,
        group=of.of.group[live.channel],
        wavelength_m=of.of.wavelength_m[live.channel],
        offset_m=of.offset_m[of.of.arc[i, live.channel]],
        link=tuple(
            f"{of.antenna} {of.of.satellites[j]} {of.of.signals[j]}" for j in live.channel.tolist()
        ),
    )


def _channels(of: NumberedArcs, i: int) -> tuple[IntArray, IntArray]:
    """Return the channels of an epoch with phase, and those with code alone."""
    phased = of.arc[i] >= 0
    return np.flatnonzero(phased), np.flatnonzero(~phased & np.isfinite(of.of.code_m[i]))


def _freedom(of: NumberedArcs, i: int) -> int:
    """Count the combinations of an epoch's channels that are free of clocks."""
    return sum(
        len(channel) - len(set(of.of.group[channel].tolist())) for channel in _channels(of, i)
    )


def _next(of: NumberedArcs, i: int, before: LiveBlock | None, t_s: float) -> LiveBlock:
    """Return the next block's arcs, and the satellites that are tracked or were lately."""
    phased, coded = _channels(of, i)
    last: dict[int, float] = {}
    if before is not None:
        last = dict(zip(before.satellite.tolist(), before.seen_s.tolist(), strict=True))
    last.update(dict.fromkeys(of.satellite[np.append(phased, coded)].tolist(), t_s))
    satellite = np.array(sorted(s for s, when in last.items() if t_s - when <= _REMEMBERED_S))
    arc, seen_s = of.arc[i, phased], np.array([last[s] for s in satellite.tolist()])
    coded_s = t_s
    if before is not None and np.array_equal(arc, before.arc):
        is_due = t_s - before.coded_s > _CODE_S - _ROUNDING_S
        coded_s = t_s if is_due else before.coded_s
    return LiveBlock(t_s, phased, arc, satellite, seen_s, coded_s)


def _phase_rows(of: NumberedArcs, i: int, live: LiveBlock, age_s: float) -> PhaseRows:
    """Return the rows of an epoch: phases, and codes without phase."""
    gnss = of.of
    phased, coded = _channels(of, i)
    order, clock = by_clock(gnss.group[phased], gnss.group[coded])
    channel = np.append(phased, coded)[order]
    ambiguity = np.append(np.arange(len(phased)), np.full(len(coded), -1))[order]
    e_n, measured_m = gnss.e_n[i, channel], of.phase_m[i, channel]
    sigma_m = gnss.phase_sigma_m[i, channel]
    if len(coded):
        measured_m = np.where(ambiguity < 0, gnss.code_m[i, channel], measured_m)
        sigma_m = np.where(ambiguity < 0, gnss.code_sigma_m[i, channel], sigma_m)
    measured = np.column_stack([-e_n, measured_m - e_n @ gnss.place_n_m[i]])
    columns = ambiguity, _places(of, live, channel)
    return PhaseRows(*whitened_rows(clock, columns, live.sizes, age_s, sigma_m, measured))


def _places(of: NumberedArcs, live: LiveBlock, channel: IntArray) -> IntArray:
    """Find the satellite of each channel among a block's, (c,)."""
    return np.searchsorted(live.satellite, of.satellite[channel])


def _arc_block(start: _BlockStart) -> ArcBlock:
    """Return the transition to a block from the previous one, with its first epoch's code.

    Phase less code is free of geometry and of what stays with satellites: it determines ambiguities
    but for a clock, common to all, that turns of the antenna wind up.
    """
    of, i, before, after = start.arcs, start.epoch, start.before, start.after
    (c, s), (old_c, old_s) = after.sizes, (0, 0) if before is None else before.sizes
    error_m = np.zeros(s)
    for channel in _channels(of, i):
        error_m[_places(of, after, channel)] = of.of.error_sigma_m[i, channel]
    rate_mps = np.full(s, max(of.of.error_rate_mps[i], _STILL_MPS_PER_SQRT_S))
    sigma = np.concatenate([np.full(c, UNKNOWN_M), error_m, rate_mps])
    source, dt_s = np.full(after.size, -1), 0.0
    if before is not None:
        source, dt_s = _sources(before, after), after.t_s - before.t_s
        walk = max(of.of.error_walk_m_per_sqrt_s[i], _STILL_ERROR)
        walks = (_STILL_M_PER_SQRT_S, walk, _STILL_MPS_PER_SQRT_S)
        still = np.repeat(walks, (c, s, s)) * np.sqrt(dt_s)
        sigma = np.where(source >= 0, still, sigma)
    H, z = _code_rows(of, after, i)
    d, rows = after.size, after.size + len(z)
    from_A, to_A = np.zeros((rows, old_c + 2 * old_s)), np.zeros((rows, d))
    goes_on = np.flatnonzero(source >= 0)
    from_A[goes_on, source[goes_on]] = 1 / sigma[goes_on]
    errors = goes_on[(goes_on >= c) & (goes_on < c + s)]
    from_A[errors, source[errors] + old_s] = dt_s / sigma[errors]
    to_A[np.arange(d), np.arange(d)], to_A[d:] = 1 / sigma, H
    return ArcBlock(start.row, from_A, to_A, np.append(np.zeros(d), z), s)


def _code_rows(of: NumberedArcs, live: LiveBlock, i: int) -> tuple[FloatArray, FloatArray]:
    """Return rows, (m, d), of phase less code of the channels that have both, and right sides."""
    is_due = live.coded_s == live.t_s
    coded = np.flatnonzero(np.isfinite(of.phase_less_code_m[i, live.channel]) & is_due)
    order, clock = by_clock(of.of.group[live.channel[coded]])
    ambiguity = coded[order]
    channel, measured = live.channel[ambiguity], np.zeros((len(order), 4))
    measured[:, 3] = of.phase_less_code_m[i, channel]
    columns = ambiguity, np.full(len(order), -1)
    sigma_m = of.of.code_sigma_m[i, channel]
    _, H, z = whitened_rows(clock, columns, live.sizes, 0.0, sigma_m, measured)
    return H, z


def _sources(before: LiveBlock, after: LiveBlock) -> IntArray:
    """Find the element of A that each of A' continues, (d',); -1 of none."""
    source = np.full(after.size, -1)
    (b, p), (c, s) = before.sizes, after.sizes
    _, new, old = np.intersect1d(after.arc, before.arc, return_indices=True)
    source[new] = old
    _, new, old = np.intersect1d(after.satellite, before.satellite, return_indices=True)
    source[c + new], source[c + s + new] = b + old, b + p + old
    return source
