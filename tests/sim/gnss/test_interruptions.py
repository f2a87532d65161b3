"""Slips, lost lock, outages and the body's shadow: what breaks, what is said, what is found."""

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.gnss.cycle_slips.detection import phase_arcs
from fgnav.gnss.single_differences import single_differences
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav_sim.gnss.tables import (
    BodyMaskTable,
    GnssTable,
    LossOfLockTable,
    OutageTable,
    SlipsTable,
)
from fgnav_sim.motion import Hold, Motion, Straight
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate
from tests.sim.motions import STILL, SWING

ARRAY = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.5, 0.0))


def made(seed=1, *, motion=SWING, duration_s=60.0, antennas=ARRAY, **gnss):
    table = GnssTable(code_noise_m=0.3, elevation_weights="uniform", **gnss)
    scenario = Scenario(duration_s=duration_s, motion=motion, antennas_b_m=antennas, gnss=table)
    return simulate(scenario, np.random.default_rng(seed))


def steps_of_integers(interrupted, calm):
    """Return changes of the integers into each epoch, (n, a, m); 0 where phase does not go on."""
    change = interrupted.observations.phase_cycles - calm.observations.phase_cycles
    assert np.nanmax(np.abs(change - np.round(change))) < 1e-6  # nothing else differs
    steps = np.zeros(change.shape)
    steps[1:] = np.nan_to_num(np.diff(np.round(change), axis=0))
    return steps


def test_tables_that_interrupt_nothing_change_nothing():
    calm = made().observations
    idle = made(
        slips=SlipsTable(rate_per_hour=1e-9),
        loss_of_lock=LossOfLockTable(rate_per_hour=1e-9),
        outages=(OutageTable(from_s=1e6),),
        body_mask=BodyMaskTable(half_angle_deg=180.0),
    ).observations
    for name in ("code_m", "phase_cycles", "doppler_hz", "cn0_dbhz", "lock_flags"):
        assert np.array_equal(getattr(calm, name), getattr(idle, name), equal_nan=True)


def test_slips_come_at_their_rate_with_their_sizes_and_are_announced_as_often_as_asked():
    slips = SlipsTable(rate_per_hour=300.0, largest_cycles=3, flagged_share=0.25)
    calm, slipping = made(), made(slips=slips)
    steps = steps_of_integers(slipping, calm)
    links = calm.observations.tracked.sum()
    count = (steps != 0).sum()
    expected = 300.0 / 3600 * links / 10
    assert count == pytest.approx(expected, abs=4 * np.sqrt(expected))
    sizes = np.abs(steps[steps != 0])
    assert set(sizes) <= {1, 2, 3, 4, 5, 6}  # two slips may meet
    assert np.mean(sizes == 1) == pytest.approx(1 / 3, abs=0.15)
    assert np.mean(steps[steps != 0] > 0) == pytest.approx(0.5, abs=0.2)
    flagged = slipping.observations.lock_flags != 0
    assert not flagged[steps == 0].any()
    assert flagged[steps != 0].mean() == pytest.approx(0.25, abs=0.15)
    code_alike = slipping.observations.code_m - calm.observations.code_m
    assert np.nanmax(np.abs(code_alike)) == 0


@pytest.mark.parametrize(("rate_hz", "duration_s"), [(1.0, 300.0), (10.0, 60.0)])
def test_the_slip_detector_finds_every_slip_and_raises_no_false_alarm(rate_hz, duration_s):
    settings = {
        "motion": SWING,
        "duration_s": duration_s,
        "antennas": Scenario().antennas_b_m,
        "rate_hz": rate_hz,
        "signals": {"G": ("1C",), "E": ("1C",)},
    }
    slips = SlipsTable(rate_per_hour=20.0, flagged_share=0.3)
    calm, slipping = made(**settings), made(**settings, slips=slips)
    single = single_differences(slipping)
    arc = phase_arcs(single, tuple(a.name for a in slipping.antennas)).arc
    seen = slipping.observations
    channels = list(zip(seen.satellites, seen.signals, strict=True))
    pairs = zip(single.satellites, single.signals, strict=True)
    column = [channels.index(pair) for pair in pairs]
    slipped = (steps_of_integers(slipping, calm) != 0)[..., column]
    flagged = (seen.lock_flags != 0)[..., column]
    usable = np.isfinite(single.elevation_rad)  # above the estimators' mask
    on = (arc[1:] >= 0) & (arc[:-1] >= 0) & (usable[1:] & usable[:-1])[:, None]
    broken = (arc[1:] != arc[:-1]) & on
    slipped, flagged = slipped[1:] & on, flagged[1:] & on
    assert (slipped & ~flagged).sum() > 20
    assert (slipped & flagged).sum() > 8
    assert broken[slipped].all()
    assert not (broken & ~slipped & ~flagged).any()


def test_lock_is_lost_as_often_and_as_long_as_asked_and_its_end_is_announced():
    table = LossOfLockTable(rate_per_hour=60.0, mean_s=2.0)
    calm, losing = made(duration_s=300.0), made(duration_s=300.0, loss_of_lock=table)
    before, after = calm.observations.tracked, losing.observations.tracked
    assert (before | ~after).all()
    share = 1 - after.sum() / before.sum()
    assert share == pytest.approx(60.0 / 3600 * 2.0, rel=0.4)  # some 100 losses of lock
    back = after[1:] & ~after[:-1] & before[:-1]
    assert back.sum() > 50
    flags = losing.observations.lock_flags[1:]
    assert (flags[back] == 1).all()
    assert not flags[~after[1:]].any()
    constant = losing.observations.phase_cycles - calm.observations.phase_cycles
    epoch, antenna, channel = np.argwhere(back)[0] + [1, 0, 0]
    earlier = np.flatnonzero(after[:epoch, antenna, channel])[-1]
    assert abs(constant[epoch, antenna, channel] - constant[earlier, antenna, channel]) > 1000


def test_a_loss_shorter_than_the_interval_leaves_no_gap_but_a_flag_and_a_new_integer():
    table = LossOfLockTable(rate_per_hour=600.0, mean_s=1e-6)
    calm, losing = made(), made(loss_of_lock=table)
    assert np.array_equal(calm.observations.tracked, losing.observations.tracked)
    steps = steps_of_integers(losing, calm)
    flagged = losing.observations.lock_flags != 0
    assert flagged.sum() > 100
    assert np.array_equal(flagged, steps != 0)


def test_an_outage_holds_for_its_time_its_sector_and_its_antennas():
    outage = OutageTable(
        from_s=10.0,
        until_s=20.0,
        azimuth_deg=(300.0, 60.0),
        elevation_deg=(0.0, 60.0),
        antennas=("a2", "a3"),
    )
    calm, cut = made(motion=STILL), made(motion=STILL, outages=(outage,))
    gone = calm.observations.tracked & ~cut.observations.tracked
    during = (calm.observations.t_s >= 10.0) & (calm.observations.t_s < 20.0)
    assert not gone[:, 0].any()
    assert not gone[~during].any()
    single = single_differences(calm)
    azimuth_deg = np.degrees(np.arctan2(single.e_n[0, :, 1], single.e_n[0, :, 0])) % 360
    north = ((azimuth_deg - 300.0) % 360 <= 120.0) & (np.degrees(single.elevation_rad[0]) <= 60.0)
    names = cut.observations.satellites
    column = [names.index(satellite) for satellite in single.satellites]
    usable = np.isfinite(single.elevation_rad[0])
    assert 0 < north[usable].sum() < usable.sum()
    for antenna in (1, 2):
        cut_of = gone[during][:, antenna][:, column]
        assert np.array_equal(cut_of.all(axis=0)[usable], north[usable])
        assert np.array_equal(cut_of.any(axis=0)[usable], north[usable])
    returned = np.flatnonzero(during)[-1] + 1
    assert np.array_equal(
        cut.observations.lock_flags[returned] == 1,
        gone[returned - 1] & cut.observations.tracked[returned],
    )


def test_a_total_outage_is_a_gap_that_survives_the_file(tmp_path):
    flight = made(duration_s=3.0, outages=(OutageTable(from_s=1.0, until_s=2.0),))
    tracked = flight.observations.tracked
    assert tracked[:10].any(axis=(1, 2)).all()
    assert not tracked[10:20].any()
    save_flight(flight, tmp_path / "flight")
    back = load_flight(tmp_path / "flight").observations
    assert np.allclose(
        back.t_s[np.flatnonzero(back.tracked.any(axis=(1, 2)))],
        flight.observations.t_s[[*range(10), *range(20, 30)]],
        rtol=0,
        atol=1e-6,
    )
    again = np.searchsorted(back.t_s, 2.0 - 1e-3)
    assert (back.lock_flags[again][back.tracked[again]] == 1).all()


def test_an_outage_of_everything_is_refused():
    with pytest.raises(BadInputError, match="no link is ever tracked; outages or body_mask"):
        made(outages=(OutageTable(),))


def test_the_body_hides_what_is_beyond_the_cone_of_an_antenna():
    level = made(motion=STILL).observations.tracked
    up = made(motion=STILL, body_mask=BodyMaskTable()).observations.tracked
    assert np.array_equal(level, up)  # a level body with antennas on its back hides nothing
    rolled = Motion(path=Straight(speed_mps=0.0), roll=Hold(angle_deg=90.0))
    axes = ((0.0, 0.0, -1.0), (0.0, -1.0, 0.0), (0.0, 0.0, 1.0))
    flight = made(motion=rolled, body_mask=BodyMaskTable(axes_b=axes))
    free = made(motion=rolled)
    single = single_differences(free)
    names = flight.observations.satellites
    usable = np.isfinite(single.elevation_rad[0])
    east = single.e_n[0, :, 1]
    kept = {name: k for k, name in enumerate(names)}
    for satellite, eastward, there in zip(single.satellites, east, usable, strict=True):
        if there and satellite in kept:
            seen = flight.observations.tracked[0, :, kept[satellite]]
            # Rolled to the right, the back looks east, the left side up, the belly west.
            assert seen.tolist() == [eastward > 0, True, eastward < 0]
