"""Phases of antennas as rows of the graph: live arcs of each epoch, block by block.

Causal throughout: an epoch's rows, and the block that it is in, come from what was there by then.
"""

from collections.abc import Sequence
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
from fgnav.assembly.position.whitening import Channels, Epoch, Transition, by_clock
from fgnav.checks import BoolArray, FloatArray, IntArray
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


class _Seen(NamedTuple):
    """Channels of epochs alike."""

    of: NumberedArcs
    alike: tuple[bytes, bytes]  # arcs, and which channels have code
    channel: IntArray  # with phase
    coded: IntArray  # with code alone
    freedom: int  # combinations that no clock is in


class LiveRows(NamedTuple):
    """Epochs of phases, and the blocks that they are in."""

    row: list[int]  # (k,), keyframes
    block: list[int]  # (k,), numbers
    arms_b_m: list[FloatArray]  # (k,)
    epochs: list[Epoch]  # (k,)
    transitions: list[Transition]  # to blocks
    names: list[ArcNames]  # of blocks
    first_block: int
    goes_on: EarlierArcs | None

    @property
    def rows(self) -> Sequence[PhaseRows]:
        """Rows of epochs, made on demand."""
        return OnDemand(len(self.epochs), lambda i: self.epochs[i].whitened(), MANY)

    @property
    def blocks(self) -> Sequence[ArcBlock]:
        """Blocks, made on demand."""
        return OnDemand(len(self.transitions), lambda j: self.transitions[j].whitened())


def live_rows(
    observed: tuple[Observed, ...],
    t_s: FloatArray,
    R_nb: FloatArray,
    earlier: EarlierArcs | None = None,
) -> LiveRows:
    """Return the phases of antennas at keyframes, (n,), by live arcs; R_nb winds them up.

    Of epochs after ``earlier`` alone.
    """
    names = dict.fromkeys(name for one in observed for name in one.of.satellites)
    if earlier is not None:
        names |= dict.fromkeys(earlier.satellites)
    number = {name: k for k, name in enumerate(sorted(names))}
    arcs, first = [], 0
    at: dict[int, tuple[NumberedArcs, int]] = {}
    for one in observed:
        arcs.append(numbered(one, first, number, R_nb, earlier))
        first = max(first, 1 + int(arcs[-1].arc.max(initial=-1)))
        for k, i in zip(one.row.tolist(), one.epoch.tolist(), strict=True):
            at[k] = arcs[-1], i
    live, begun = _resumed(earlier, number)
    measured: _Measured | None = None
    seen: _Seen | None = None
    out = LiveRows([], [], [], [], [], [], begun, None)
    for k in sorted(at):
        if earlier is not None and t_s[k] <= earlier.t_s:
            continue
        of, i = at[k]
        before, seen = seen, _seen(of, i, seen)
        if not seen.freedom:
            continue
        now_s, is_same = float(t_s[k]), seen is before
        if (
            live is None
            or now_s - live.t_s > _BLOCK_S - _ROUNDING_S
            or not (is_same or _goes_on_in(of, i, live, seen))
        ):
            after = _next(of, i, live, now_s, seen)
            out.transitions.append(_transition(of, (live, after), i, k))
            out.names.append(_names(of, after, i))
            live, is_same = after, False
        if measured is None or not is_same:
            live = live._replace(channel=seen.channel)
            measured = _measured(of, live, seen.coded, measured)
        out.epochs.append(_epoch(of, i, measured, now_s - live.t_s))
        out.row.append(k)
        out.block.append(begun + len(out.transitions) - 1)
        out.arms_b_m.append(of.arm_b_m)
    if not arcs:
        return out
    so_far = live, begun + len(out.transitions)
    return out._replace(goes_on=_goes_on(arcs[0], at, t_s, number, so_far))


def _resumed(earlier: EarlierArcs | None, number: dict[str, int]) -> tuple[LiveBlock | None, int]:
    """Return the block that goes on, and how many there have been."""
    if earlier is None or earlier.live is None:
        return None, 0
    satellite = np.array([number[name] for name in earlier.satellites], dtype=np.int64)
    return earlier.live._replace(satellite=satellite), earlier.blocks


def _goes_on(
    of: NumberedArcs,
    at: dict[int, tuple[NumberedArcs, int]],
    t_s: FloatArray,
    number: dict[str, int],
    so_far: tuple[LiveBlock | None, int],
) -> EarlierArcs | None:
    """Return the arcs that later epochs need, as of the last one."""
    live, blocks = so_far
    if not at or live is None:
        return None
    k = max(at)
    i = at[k][1]
    channels = zip(of.of.satellites, of.of.signals, strict=True)
    local = of.of.arc[i]
    links = {
        channel: (int(of.arc[i, j]), float(of.offset_m[local[j]]), float(of.wound[i, j]))
        for j, channel in enumerate(channels)
        if local[j] >= 0
    }
    named = {place: name for name, place in number.items()}
    satellites = tuple(named[s] for s in live.satellite.tolist())
    return EarlierArcs(float(t_s[k]), links, 1 + int(of.arc.max()), blocks, live, satellites)


def _seen(of: NumberedArcs, i: int, before: _Seen | None) -> _Seen:
    """Return the channels of an epoch: those before where they and their arcs are the same."""
    alike = of.arc[i].tobytes(), np.isfinite(of.of.code_m[i]).tobytes()
    if before is not None and before.of is of and before.alike == alike:
        return before
    channel, coded = _channels(of, i)
    return _Seen(of, alike, channel, coded, _freedom(of, channel) + _freedom(of, coded))


def _goes_on_in(of: NumberedArcs, i: int, live: LiveBlock, seen: _Seen) -> bool:
    """Return True if a block has the arcs of an epoch, and all satellites with code alone."""
    is_live = np.isin(of.satellite[seen.coded], live.satellite)
    return np.array_equal(of.arc[i, seen.channel], live.arc) and bool(is_live.all())


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


def _freedom(of: NumberedArcs, channel: IntArray) -> int:
    """Count the combinations of channels that are free of clocks."""
    return len(channel) - len(set(of.of.group[channel].tolist()))


def _next(of: NumberedArcs, i: int, before: LiveBlock | None, t_s: float, seen: _Seen) -> LiveBlock:
    """Return the next block's arcs, and the satellites that are tracked or were lately."""
    channel = seen.channel
    last: dict[int, float] = {}
    if before is not None:
        last = dict(zip(before.satellite.tolist(), before.seen_s.tolist(), strict=True))
    last.update(dict.fromkeys(of.satellite[np.append(channel, seen.coded)].tolist(), t_s))
    satellite = np.array(sorted(s for s, when in last.items() if t_s - when <= _REMEMBERED_S))
    arc, seen_s = of.arc[i, channel], np.array([last[s] for s in satellite.tolist()])
    coded_s = t_s
    if before is not None and np.array_equal(arc, before.arc):
        is_due = t_s - before.coded_s > _CODE_S - _ROUNDING_S
        coded_s = t_s if is_due else before.coded_s
    return LiveBlock(t_s, channel, arc, satellite, seen_s, coded_s)


class _Measured(NamedTuple):
    """Channels of epochs of blocks alike, clock after clock."""

    live: LiveBlock  # one of the blocks
    coded: IntArray  # with code alone
    of_all: IntArray  # those with phase and these
    is_code: BoolArray
    channels: Channels

    def is_of(self, live: LiveBlock, coded: IntArray) -> bool:
        """Return True if another block has the same channels."""
        same = (self.live.channel, live.channel), (self.live.satellite, live.satellite)
        return all(np.array_equal(*pair) for pair in (*same, (self.coded, coded)))


def _measured(
    of: NumberedArcs, live: LiveBlock, coded: IntArray, before: _Measured | None
) -> _Measured:
    """Return the channels of an epoch: those before where they are the same."""
    if before is not None and before.is_of(live, coded):
        return before
    phased = live.channel
    order, clock = by_clock(of.of.group[phased], of.of.group[coded])
    ambiguity = np.append(np.arange(len(phased)), np.full(len(coded), -1))[order]
    of_all = np.append(phased, coded)[order]
    channels = Channels(clock, ambiguity, _places(of, live, of_all), *live.sizes)
    return _Measured(live, coded, of_all, ambiguity < 0, channels)


def _epoch(of: NumberedArcs, i: int, measured: _Measured, age_s: float) -> Epoch:
    """Build the channels of an epoch: phases, and codes without phase."""
    channel, is_code, gnss = measured.of_all, measured.is_code, of.of
    e_n, measured_m = gnss.e_n[i, channel], of.phase_m[i, channel]
    sigma_m = gnss.phase_sigma_m[i, channel]
    if len(measured.coded):
        measured_m = np.where(is_code, gnss.code_m[i, channel], measured_m)
        sigma_m = np.where(is_code, gnss.code_sigma_m[i, channel], sigma_m)
    seen = np.empty((len(channel), 4))
    np.negative(e_n, out=seen[:, :3])
    np.subtract(measured_m, e_n @ gnss.place_n_m[i], out=seen[:, 3])
    return Epoch(measured.channels, seen, sigma_m, age_s)


def _places(of: NumberedArcs, live: LiveBlock, channel: IntArray) -> IntArray:
    """Find the satellite of each channel among a block's, (c,)."""
    return np.searchsorted(live.satellite, of.satellite[channel])


def _transition(
    of: NumberedArcs, blocks: tuple[LiveBlock | None, LiveBlock], i: int, row: int
) -> Transition:
    """Build the transition to a block from the previous one, with its first epoch's code.

    Phase less code is free of geometry and of what stays with satellites: it determines ambiguities
    but for a clock, common to all, that turns of the antenna wind up.
    """
    before, after = blocks
    c, s = after.sizes
    error_m = np.zeros(s)
    for channel in _channels(of, i):
        error_m[_places(of, after, channel)] = of.of.error_sigma_m[i, channel]
    sigma = np.concatenate(
        [
            np.full(c, UNKNOWN_M),
            error_m,
            np.full(s, max(of.of.error_rate_mps[i], _STILL_MPS_PER_SQRT_S)),
        ]
    )
    source, dt_s = np.full(after.size, -1), 0.0
    if before is not None:
        source, dt_s = _sources(before, after), after.t_s - before.t_s
        walks = (
            _STILL_M_PER_SQRT_S,
            max(of.of.error_walk_m_per_sqrt_s[i], _STILL_ERROR),
            _STILL_MPS_PER_SQRT_S,
        )
        still = np.repeat(walks, (c, s, s)) * np.sqrt(dt_s)
        sigma = np.where(source >= 0, still, sigma)
    return Transition(
        begin_row=row,
        sigma=sigma,
        source=source,
        dt_s=dt_s,
        size=(0, 0) if before is None else before.sizes,
        codes=_codes(of, after, i),
    )


def _codes(of: NumberedArcs, live: LiveBlock, i: int) -> Epoch:
    """Return phase less code of the channels that have both, about no place."""
    is_due = live.coded_s == live.t_s
    coded = np.flatnonzero(np.isfinite(of.code_apart_m[i, live.channel]) & is_due)
    order, clock = by_clock(of.of.group[live.channel[coded]])
    ambiguity = coded[order]
    channel, seen = live.channel[ambiguity], np.zeros((len(order), 4))
    seen[:, 3] = of.code_apart_m[i, channel]
    nowhere = np.full(len(order), -1)
    channels = Channels(clock, ambiguity, nowhere, *live.sizes)
    return Epoch(channels, seen, of.of.code_sigma_m[i, channel], 0.0)


def _sources(before: LiveBlock, after: LiveBlock) -> IntArray:
    """Find the element of A that each of A' continues, (d',); -1 of none."""
    source = np.full(after.size, -1)
    (b, p), (c, s) = before.sizes, after.sizes
    _, new, old = np.intersect1d(after.arc, before.arc, return_indices=True)
    source[new] = old
    _, new, old = np.intersect1d(after.satellite, before.satellite, return_indices=True)
    source[c + new], source[c + s + new] = b + old, b + p + old
    return source
