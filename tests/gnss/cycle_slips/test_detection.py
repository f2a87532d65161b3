from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fgnav.checks import FloatArray
from fgnav.gnss.cycle_slips.detection import PhaseArcs, phase_arcs
from fgnav.gnss.single_differences import single_differences
from fgnav.types.flight import Flight
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK
from tests.gnss import recordings
from tests.gnss.flights import Made

ARMS = np.array([[0.0, 0, 0], [1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0]])
FAST_S = np.arange(0.0, 4.0, 0.1)
SLOW_S = np.arange(0.0, 900.0, 30.0)
# A spinning vehicle whose receivers' clocks run apart.
SPINNING = Made(
    t_s=FAST_S,
    arms_b_m=ARMS,
    letters="GE",
    v_n_mps=(100.0, 20.0, -5.0),
    yaw_rate_radps=6.0,
    clock_s=(0.0, lambda t: 1e-4 + 1e-6 * t, -3e-4, 0.0),
    code_sigma_m=1.0,
    phase_sigma_m=0.003,
)


@cache
def spinning(interval_s: float = 0.1) -> Flight:
    t_s = FAST_S if interval_s == 0.1 else SLOW_S
    return replace(SPINNING, t_s=t_s, rng=np.random.default_rng(1)).flight()


def arcs(flight: Flight) -> PhaseArcs:
    return phase_arcs(single_differences(flight), tuple(a.name for a in flight.antennas))


def changed(flight: Flight, **fields: FloatArray) -> Flight:
    assert flight.observations is not None
    return replace(flight, observations=replace(flight.observations, **fields))


def high(flight: Flight, count: int = 1) -> list[int]:
    """Return the channels that are highest."""
    elevation = single_differences(flight).elevation_rad[0]
    return [int(j) for j in np.argsort(-np.nan_to_num(elevation))[:count]]


def lost(found: PhaseArcs) -> dict[tuple[str, str], int]:
    return {(loss.what, loss.reason): loss.count for loss in found.unused}


TEST = "cycle slip found by the time-differenced test"


@pytest.mark.parametrize("t_s", [FAST_S, SLOW_S])
@pytest.mark.parametrize("yaw_rate", [0.0, 6.0])
def test_undisturbed_phases_are_one_arc_each(t_s, yaw_rate):
    flight = replace(SPINNING, t_s=t_s, yaw_rate_radps=yaw_rate).flight()
    found = arcs(flight)
    assert found.unused == ()
    assert found.untested < 0.005 * found.steps
    assert found.steps > 500
    assert set(np.unique(found.arc)) <= {-1, 0}


@pytest.mark.parametrize("interval_s", [0.1, 30.0])
@pytest.mark.parametrize("cycles", [0.5, 1.0, -3.0, 5000.0])
@pytest.mark.parametrize("antenna", [0, 2])
def test_a_slip_is_found_on_its_antenna_and_channel_at_its_epoch(interval_s, cycles, antenna):
    flight = spinning(interval_s)
    (channel,) = high(flight)
    phase = flight.observations.phase_cycles.copy()
    phase[12:, antenna, channel] += cycles
    found = arcs(changed(flight, phase_cycles=phase))
    assert lost(found) == {(f"a{antenna + 1} phase continuity", TEST): 1}
    expected = np.zeros(len(found.arc))
    expected[12:] = 1
    np.testing.assert_array_equal(found.arc[:, antenna, channel], expected)


def test_two_slips_at_once_are_told_apart():
    flight = spinning()
    first, second = high(flight, 2)
    phase = flight.observations.phase_cycles.copy()
    phase[30:, 1, first] += 1
    phase[30:, 1, second] -= 2
    found = arcs(changed(flight, phase_cycles=phase))
    assert lost(found) == {("a2 phase continuity", TEST): 2}


@cache
def eight_channels(seed: int) -> tuple[Flight, list[int]]:
    return few_channels(replace(SPINNING, rng=np.random.default_rng(seed)).flight(), 8)


def two_slips(
    channels: tuple[int, int], cycles: tuple[float, float], seed: int
) -> tuple[set[int], int]:
    """Return the channels of the first antenna that break, among eight, and breaks elsewhere."""
    flight, kept = eight_channels(seed)
    phase = flight.observations.phase_cycles.copy()
    for channel, size in zip(channels, cycles, strict=True):
        phase[30:, 0, kept[channel]] += size
    found = arcs(changed(flight, phase_cycles=phase))
    breaks = lost(found)
    breaks.pop(("a1 phase continuity", TEST))
    broken = found.arc[30, 0, kept] != found.arc[29, 0, kept]
    return {int(j) for j in np.flatnonzero(broken)}, sum(breaks.values())


@pytest.mark.parametrize("channels", [(0, 1), (1, 2), (2, 4)])
@pytest.mark.parametrize("cycles", [(0.5, 0.5), (1.0, -1.0), (0.5, -3.0)])
@pytest.mark.parametrize("seed", range(4))
def test_two_slips_at_once_among_few_channels_are_both_found(channels, cycles, seed):
    broken, elsewhere = two_slips(channels, cycles, seed)
    assert set(channels) <= broken
    assert elsewhere <= 1


def test_of_two_slips_on_a_baseline_of_few_channels_the_reference_antennas_is_known():
    flight, kept = few_channels(spinning(), 8)
    phase = flight.observations.phase_cycles.copy()
    phase[30:, 0, kept[2]] += 4
    phase[30:, 2, kept[5]] -= 2
    found = arcs(changed(flight, phase_cycles=phase))
    assert lost(found) == {("a1 phase continuity", TEST): 1, ("a3 phase continuity", TEST): 7}


def test_clock_jumps_of_a_millisecond_are_no_slips():
    def jumping(t_s: FloatArray) -> FloatArray:
        return np.where(t_s > 2.05, 1e-3, 0.0)

    found = arcs(replace(SPINNING, clock_s=(0.0, jumping, 0.0, jumping)).flight())
    assert found.unused == ()
    assert found.arc.max() == 0


def test_a_jump_of_the_code_alone_is_no_slip_either():
    # Some receivers steer their code and tag clock by whole milliseconds, and their phase not.
    flight = spinning()
    code_m = flight.observations.code_m.copy()
    tag_s = flight.observations.tag_s.copy()
    code_m[30:, 1] += 299_792.458
    tag_s[30:, 1] += 1e-3
    found = arcs(changed(flight, code_m=code_m, tag_s=tag_s))
    assert found.unused == ()


def test_with_one_baseline_the_second_antenna_is_blamed():
    flight = replace(SPINNING, arms_b_m=ARMS[:2], clock_s=()).flight()
    (channel,) = high(flight)
    phase = flight.observations.phase_cycles.copy()
    phase[20:, 0, channel] += 1
    assert lost(arcs(changed(flight, phase_cycles=phase))) == {("a2 phase continuity", TEST): 1}


def few_channels(flight: Flight, count: int) -> tuple[Flight, list[int]]:
    kept = high(flight, count)
    phase = np.full_like(flight.observations.phase_cycles, np.nan)
    phase[:, :, kept] = flight.observations.phase_cycles[:, :, kept]
    return changed(flight, phase_cycles=phase), kept


def test_five_channels_show_a_slip_but_not_whose():
    flight, kept = few_channels(replace(SPINNING, phase_sigma_m=0.001).flight(), 5)
    phase = flight.observations.phase_cycles.copy()
    phase[20:, 1, kept[1]] += 100
    found = arcs(changed(flight, phase_cycles=phase))
    assert lost(found) == {("a2 phase continuity", TEST): 5}
    assert (found.arc[20:, 1, kept] == 1).all()


def test_four_channels_leave_nothing_to_test_and_it_is_said():
    flight, _ = few_channels(spinning(), 4)
    found = arcs(flight)
    assert found.untested == found.steps == 3 * 4 * (len(FAST_S) - 1)


def test_flags_and_gaps_break_arcs():
    flight = spinning()
    first, second = high(flight, 2)
    flags = flight.observations.lock_flags.copy()
    flags[10, 1, first] = LOST_LOCK
    phase = flight.observations.phase_cycles.copy()
    phase[20, 2, second] = np.nan
    found = arcs(changed(flight, lock_flags=flags, phase_cycles=phase))
    assert lost(found) == {
        ("a2 phase continuity", "loss of lock flagged by the receiver"): 1,
        ("a3 phase continuity", "gap"): 1,
    }
    np.testing.assert_array_equal(found.arc[[9, 10], 1, first], [0, 1])
    np.testing.assert_array_equal(found.arc[[19, 20, 21], 2, second], [0, -1, 1])


def test_doubtful_half_cycles_are_no_phase_and_end_the_arc():
    flight = spinning()
    (channel,) = high(flight)
    flags = flight.observations.lock_flags.copy()
    flags[10:15, 1, channel] = HALF_CYCLE
    found = arcs(changed(flight, lock_flags=flags))
    np.testing.assert_array_equal(found.arc[[9, 10, 14, 15], 1, channel], [0, -1, -1, 1])


def test_a_long_silence_ends_all_arcs():
    t_s = np.concatenate([FAST_S[:20], FAST_S[20:] + 1.0])
    found = arcs(replace(SPINNING, t_s=t_s).flight())
    there = found.arc[20] >= 0
    assert (found.arc[20][there & (found.arc[19] >= 0)] == 1).all()


def test_real_phases_keep_their_integers_within_each_arc(shared):
    found = arcs(recordings.wettzell(shared))
    assert not any(reason == TEST for _, reason in lost(found))
    assert found.untested < 0.05 * found.steps


def test_a_slip_of_one_cycle_shows_in_real_phases_at_thirty_seconds(shared):
    flight = recordings.wettzell(shared)
    single = single_differences(flight)
    column = flight.observations.satellites.index(single.satellites[high(flight)[0]])
    phase = flight.observations.phase_cycles.copy()
    phase[60:, 1, column] += 1.0
    assert lost(arcs(changed(flight, phase_cycles=phase)))["WTZZ phase continuity", TEST] == 1
