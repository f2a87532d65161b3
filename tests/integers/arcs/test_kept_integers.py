"""Integers kept with the truth: what the simulator gave to the phase is what the resolver says."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from fgnav.gnss.difference import double_differences
from fgnav.integers.acceptance import phase_links
from fgnav.integers.resolvers.truth import Truth, attitude_at, kept_integers, true_integers
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.types.flight import LinkIntegers
from fgnav_sim.gnss.tables import GnssTable, LossOfLockTable, OutageTable, SlipsTable
from fgnav_sim.motion import Arc, Motion, Sine
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate

ROUGH = GnssTable(
    rate_hz=2.0,
    signals={"G": ("1C", "5Q"), "E": ("1C",)},
    slips=SlipsTable(rate_per_hour=60.0),
    loss_of_lock=LossOfLockTable(rate_per_hour=60.0),
    outages=(OutageTable(from_s=10.0, until_s=15.0, azimuth_deg=(0.0, 90.0)),),
)
SCENARIO = Scenario(
    duration_s=40.0,
    motion=Motion(path=Arc(), roll=Sine(amplitude_deg=20.0), yaw=Sine(amplitude_deg=20.0)),
    antennas_b_m=((0.0, 0.0, 0.0), (0.0, 0.1, 0.0), (1.0, 0.0, 0.0)),
    gnss=ROUGH,
)


@pytest.fixture(scope="module")
def flight():
    return simulate(SCENARIO, np.random.default_rng(1))


def kept(flight, rows):
    """Return the flight with some of its kept integers only."""
    old = flight.truth.integers
    links = [link for link, row in zip(old.links, rows, strict=True) if row]
    antennas, satellites, signals = zip(*links, strict=True)
    integers = LinkIntegers(
        antennas=antennas,
        satellites=satellites,
        signals=signals,
        from_s=old.from_s[rows],
        cycles=old.cycles[rows],
    )
    return replace(flight, truth=replace(flight.truth, integers=integers))


def test_kept_integers_are_those_that_the_true_attitude_rounds_to(flight, tmp_path):
    save_flight(flight, tmp_path / "flight")
    for one in (flight, load_flight(tmp_path / "flight")):
        differences = double_differences(one)
        cycles, known = kept_integers(differences, one)
        links = phase_links(differences)
        R_nb, _ = attitude_at(one.truth, differences.t_s)
        assert known[links].all()
        assert_array_equal(cycles[links], true_integers(differences, R_nb)[links])
        found = Truth()(differences, one)
        assert_array_equal(found.fixed, links)
        assert_array_equal(found.cycles[links], cycles[links])
        assert found.resolver == "truth"


def test_slips_change_the_integers_they_hit_and_no_others(flight):
    calm_gnss = msgspec.structs.replace(ROUGH, slips=None)
    calm = simulate(msgspec.structs.replace(SCENARIO, gnss=calm_gnss), np.random.default_rng(1))
    slipped = flight.observations.phase_cycles - calm.observations.phase_cycles
    assert (np.nan_to_num(slipped) != 0).any()
    t_s = flight.observations.t_s
    channels = zip(flight.observations.satellites, flight.observations.signals, strict=True)
    for j, channel in enumerate(channels):
        for i, antenna in enumerate(flight.antennas):
            theirs = [
                np.array([0, *(one.truth.integers.cycles[k] for k in rows)])[
                    np.searchsorted(one.truth.integers.from_s[rows], t_s, side="right")
                ]
                for one in (flight, calm)
                for rows in [
                    [
                        k
                        for k, link in enumerate(one.truth.integers.links)
                        if link == (antenna.name, *channel)
                    ]
                ]
            ]
            there = np.isfinite(slipped[:, i, j])
            assert_array_equal((theirs[0] - theirs[1])[there], np.rint(slipped[there, i, j]))


def test_links_whose_integers_are_not_kept_take_those_of_the_attitude(flight):
    without = [link[0] != "a3" for link in flight.truth.integers.links]
    partly = kept(flight, np.array(without))
    differences = double_differences(partly)
    found, whole = Truth()(differences, partly), Truth()(differences, flight)
    assert_array_equal(found.cycles, whole.cycles)
    assert_array_equal(found.fixed, whole.fixed)
    count = whole.fixed.sum()
    assert found.resolver == f"truth, {whole.fixed[:, 1].sum()} of {count} of the attitude"


def test_without_kept_integers_the_attitude_says(flight):
    bare = replace(flight, truth=replace(flight.truth, integers=None))
    found = Truth()(double_differences(bare), bare)
    assert found.resolver == "truth of the attitude"
    assert_array_equal(found.cycles, Truth()(double_differences(flight), flight).cycles)


def test_kept_integers_serve_where_the_attitude_is_not_known(flight):
    truth = flight.truth
    early = truth.t_s < 20.0
    short = replace(
        flight,
        truth=replace(
            truth,
            t_s=truth.t_s[early],
            p_n_m=truth.p_n_m[early],
            v_n_mps=truth.v_n_mps[early],
            R_nb=truth.R_nb[early],
        ),
    )
    found = Truth()(double_differences(short), short)
    assert found.fixed[-1].any()
    assert not found.unused


def test_half_cycle_slips_leave_nothing_to_fix_and_are_counted():
    slips = SlipsTable(rate_per_hour=120.0, half_cycle_share=1.0)
    gnss = GnssTable(rate_hz=2.0, elevation_weights="uniform", slips=slips)
    slipped = simulate(msgspec.structs.replace(SCENARIO, gnss=gnss), np.random.default_rng(1))
    differences = double_differences(slipped)
    cycles, known = kept_integers(differences, slipped)
    halves = known & (cycles % 1 != 0) & phase_links(differences)
    found = Truth()(differences, slipped)
    assert 0.1 < halves.sum() / phase_links(differences).sum() < 0.9
    assert_array_equal(found.fixed, phase_links(differences) & ~halves)
    assert [(loss.reason, loss.count) for loss in found.unused] == [
        ("slipped by half a cycle", halves.sum())
    ]
    R_nb, _ = attitude_at(slipped.truth, differences.t_s)
    residual_m = differences.phase_m - differences.array_m(R_nb)
    left_m = residual_m - differences.wavelength_m * cycles
    # Whole or half, what is left is noise of four links: 6 mm.
    assert np.std(left_m[halves]) == pytest.approx(6e-3, rel=0.2)
    assert np.std(left_m[found.fixed]) == pytest.approx(6e-3, rel=0.2)
