"""Drawn array epochs: the measurement model, term by term, and what stays the same in a run."""

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.checks import BadInputError
from fgnav_sim.data_sets.attitudes import (
    CommandedAttitudes,
    UniformAttitudes,
    uniform_rotations,
)
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.world import (
    AnySites,
    AnyTimes,
    NoiseTable,
    OutliersTable,
    RunsTable,
    SatellitesTable,
    World,
)
from fgnav_sim.gnss.tables import MultipathTable, ReflectorTable
from fgnav_sim.motion import Sine
from fgnav_sim.propagation.multipath import echoes

MM = 1e-3
HONEST = World(
    sites=AnySites(),
    times=AnyTimes(),
    satellites=SatellitesTable(
        signals={"G": ("1C", "5Q"), "E": ("1C",)}, choose=(4, 7), pick="random"
    ),
    noise=NoiseTable(code_m=(0.1, 1.0), phase_m=(0.002, 0.005), elevation_weights="sine"),
)


def drawn(world, count=600, seed=1):
    return array_epochs(world, np.random.default_rng(seed), count)


def residuals(epochs):
    """Return code and phase minus the model, (n, a, m)."""
    arms_n_m = np.einsum("nij,aj->nai", epochs.R_nb, epochs.antennas_b_m - epochs.antennas_b_m[:1])
    range_m = -np.einsum("nai,nmi->nam", arms_n_m, epochs.e_n)
    return (
        epochs.code_m - range_m,
        epochs.phase_m - range_m - epochs.wavelength_m * epochs.integers,
    )


@pytest.mark.parametrize("world", [World(), HONEST], ids=["paper", "honest"])
def test_code_and_phase_are_the_range_with_integers_and_the_stated_noise(world):
    epochs = drawn(world)
    for residual_m, sigma_m in zip(
        residuals(epochs), (epochs.code_sigma_m, epochs.phase_sigma_m), strict=True
    ):
        whitened = (residual_m / sigma_m[:, None])[np.isfinite(residual_m)]
        assert len(whitened) > 10_000
        # Variance of a sample variance: 2 / n; five standard deviations.
        assert abs(np.mean(whitened**2) - 1) < 5 * np.sqrt(2 / len(whitened))
        assert abs(np.mean(whitened)) < 5 / np.sqrt(len(whitened))


def test_what_is_not_there_is_nan_and_has_no_integer():
    epochs = drawn(HONEST)
    satellite = epochs.satellites != ""
    there = np.broadcast_to(satellite[:, None], epochs.code_m.shape)
    assert_array_equal(np.isfinite(epochs.code_m), there)
    assert_array_equal(np.isfinite(epochs.phase_m), there)
    assert not epochs.integers[~there].any()
    assert_array_equal(np.isfinite(epochs.elevation_rad), satellite)
    assert not epochs.e_n[~satellite].any()


def test_satellites_stand_in_slots_of_their_constellation_and_signal():
    epochs = drawn(HONEST)
    assert epochs.signals == ("1C",) * 7 + ("5Q",) * 7 + ("1C",) * 7
    assert_array_equal(epochs.group, np.repeat([0, 1, 2], 7))
    assert_array_equal(epochs.satellites[:, :7], epochs.satellites[:, 7:14])
    for slots, letter in ((slice(0, 14), "G"), (slice(14, 21), "E")):
        names = epochs.satellites[:, slots]
        assert {name[0] for name in names[names != ""]} == {letter}
    gps = (epochs.satellites[:, :7] != "").sum(axis=1)
    assert set(gps) == {4, 5, 6, 7}
    assert_allclose(epochs.wavelength_m[[0, 7, 14]], [0.190294, 0.254828, 0.190294], atol=1e-6)


def test_a_run_keeps_place_integers_and_noise_level():
    world = msgspec.structs.replace(HONEST, runs=RunsTable(epochs=5, step_s=1.0))
    epochs = drawn(world, 50)
    assert_array_equal(epochs.run, np.repeat(np.arange(10), 5))
    for k in range(10):
        own = epochs[epochs.run == k]
        assert_allclose(np.diff(own.t_s), 1.0, rtol=0, atol=1e-6)
        assert (own.integers == own.integers[0]).all()
        assert (own.satellites == own.satellites[0]).all()
        turned_rad = np.arccos(np.clip((own.e_n[0] * own.e_n[-1]).sum(axis=1), -1, 1))
        assert np.degrees(turned_rad[own.satellites[0] != ""]).max() < 0.1  # 4 s of flight
        level = own.phase_sigma_m * np.sin(own.elevation_rad)
        level = level[np.isfinite(level)]
        assert 0.002 <= level.min() <= level.max() <= 0.005
        assert np.ptp(level) < 1e-6 * MM


def test_an_unfinished_run_is_cut():
    epochs = drawn(World(runs=RunsTable(epochs=5760)), 6000)
    assert len(epochs) == 6000
    assert_array_equal(np.bincount(epochs.run), [5760, 240])


def test_the_papers_day_has_six_satellites_at_all_times_and_runs_that_differ_in_noise_alone():
    sway = CommandedAttitudes(roll=Sine(amplitude_deg=20.0), yaw=Sine(amplitude_deg=20.0))
    epochs = drawn(World(runs=RunsTable(epochs=5760), attitudes=sway), 2 * 5760)
    one, two = epochs[:5760], epochs[5760:]
    assert (epochs.satellites != "").all()
    assert one.t_s[0] == 0.0
    assert one.t_s[-1] == 86_385.0
    for name in ("t_s", "satellites", "e_n", "R_nb", "antennas_b_m"):
        assert_array_equal(getattr(one, name), getattr(two, name))
    assert not np.array_equal(one.code_m, two.code_m)
    assert (one.integers != two.integers).mean() > 0.99


def test_uniform_rotations_are_rotations_and_favour_no_direction():
    R = uniform_rotations(40_000, rng=np.random.default_rng(1))
    assert_allclose(R @ R.swapaxes(1, 2), np.broadcast_to(np.eye(3), R.shape), atol=1e-14)
    assert_allclose(np.linalg.det(R), 1.0, atol=1e-14)
    # Every element has mean 0, mean square 1/3 and mean fourth power 1/5.
    assert np.abs(R.mean(axis=0)).max() < 5 * np.sqrt(1 / 3 / len(R))
    assert np.abs((R**2).mean(axis=0) - 1 / 3).max() < 5 * np.sqrt((1 / 5 - 1 / 9) / len(R))


def test_attitudes_change_with_each_epoch_or_with_each_run():
    run, t_s = np.repeat([0, 1], 3), np.tile([0.0, 1.0, 2.0], 2)
    for each, distinct in (("epoch", 6), ("run", 2)):
        R_nb = UniformAttitudes(each=each)(t_s, run, rng=np.random.default_rng(1))
        assert len(np.unique(R_nb[:, 0, 0])) == distinct


def test_spread_commands_turn_alike_from_different_attitudes():
    commanded = CommandedAttitudes(pitch=Sine(amplitude_deg=30.0), spread=True)
    run, t_s = np.repeat([0, 1], 4), np.tile(np.arange(4.0), 2)
    R_nb = commanded(t_s, run, rng=np.random.default_rng(1))
    turns = R_nb[[0, 4]].swapaxes(1, 2)[run] @ R_nb
    assert_allclose(turns[:4], turns[4:], atol=1e-14)
    assert not np.allclose(R_nb[:4], R_nb[4:], atol=0.1)


def test_outliers_are_flagged_and_louder():
    world = World(outliers=OutliersTable(share=0.1, code_m=5.0, phase_m=0.05))
    epochs = drawn(world, 2000)
    assert epochs.outlier.mean() == pytest.approx(0.1, abs=0.005)
    for residual_m, quiet_m, loud_m in zip(
        residuals(epochs), (0.5, 0.003), (5.0, 0.05), strict=True
    ):
        assert residual_m[~epochs.outlier].std() == pytest.approx(quiet_m, rel=0.02)
        assert residual_m[epochs.outlier].std() == pytest.approx(
            np.hypot(quiet_m, loud_m), rel=0.03
        )
    calm = drawn(World(), 2000)
    assert_array_equal(epochs.code_m[~epochs.outlier], calm.code_m[~epochs.outlier])


def test_echoes_from_anywhere_forget_themselves_within_their_time_constant_and_are_stated():
    world = World(
        runs=RunsTable(epochs=40, step_s=1.0),
        multipath=MultipathTable(code_m=3.0, phase_m=0.03, time_constant_s=10.0),
    )
    epochs = drawn(world, 40 * 60)
    code_m, phase_m = residuals(epochs)
    for residual_m, white_m, slow_m in ((code_m, 0.5, 3.0), (phase_m, 0.003, 0.03)):
        runs = residual_m.reshape(60, 40, -1)
        slow = np.mean(runs[:, 10:] * runs[:, :-10]) / slow_m**2
        assert slow == pytest.approx(np.exp(-1), abs=0.05)
        assert np.mean(runs**2) == pytest.approx(white_m**2 + slow_m**2, rel=0.05)
        between_runs = np.mean(runs[1:, 0] * runs[:-1, -1]) / slow_m**2
        assert abs(between_runs) < 0.1
    assert_allclose(epochs.phase_sigma_m, np.hypot(0.003, 0.03))
    assert_allclose(epochs.code_sigma_m, np.hypot(0.5, 3.0))


def test_the_body_mirrors_signals_as_in_a_flight():
    mirror = ReflectorTable(point_b_m=(0.0, 0.0, 0.4), normal_b=(0.0, 0.0, -1.0))
    calm, mirrored = drawn(World(), 200), drawn(World(reflectors=(mirror,)), 200)
    e_b = np.einsum("nmi,nij->nmj", calm.e_n, calm.R_nb)
    seen = echoes((mirror,), calm.antennas_b_m, e_b, np.zeros((200, 3)), calm.wavelength_m)
    assert np.abs(seen.phase_m).max() > 5 * MM
    assert_allclose(mirrored.phase_m - calm.phase_m, seen.phase_m, rtol=0, atol=1e-6 * MM)
    assert_allclose(mirrored.code_m - calm.code_m, seen.code_m, rtol=0, atol=1e-6 * MM)


def test_a_count_below_one_is_refused():
    with pytest.raises(BadInputError, match="count: must be 1 or more, got 0"):
        drawn(World(), 0)
