"""Double differences of drawn epochs, in the library's own conventions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav_sim.data_sets.differences import double_differences_of, true_cycles
from fgnav_sim.data_sets.epochs import array_epochs
from fgnav_sim.data_sets.world import (
    AnySites,
    AnyTimes,
    NoiseTable,
    RunsTable,
    SatellitesTable,
    World,
)
from tests.sim.statistics import whitened_square

WORLD = World(
    sites=AnySites(),
    times=AnyTimes(),
    runs=RunsTable(epochs=3, step_s=1.0),
    satellites=SatellitesTable(signals={"G": ("1C",), "E": ("1C",)}, choose=(1, 6), pick="random"),
    noise=NoiseTable(elevation_weights="sine"),
)


def drawn(world=WORLD, count=300):
    epochs = array_epochs(world, np.random.default_rng(1), count)
    return epochs, double_differences_of(epochs)


def test_double_differences_are_those_of_the_links():
    epochs, differences = drawn()
    for k in (0, 100, 299):
        for j in range(len(epochs.signals)):
            r = differences.reference[k, epochs.group[j]]
            if r < 0 or not epochs.satellites[k, j]:
                assert np.isnan(differences.phase_m[k, :, j]).all()
                continue
            single = epochs.phase_m[k, 1:] - epochs.phase_m[k, 0]
            assert_allclose(differences.phase_m[k, :, j], single[:, j] - single[:, r], atol=1e-9)


def test_residuals_of_the_true_integers_fill_the_stated_covariance():
    epochs, differences = drawn()
    residual_m = differences.phase_m - differences.array_m(epochs.R_nb)
    residual_m -= differences.wavelength_m * true_cycles(epochs, differences)
    square, freedom = whitened_square(differences, residual_m, differences.phase_variance_m2)
    assert freedom > 5000
    assert square == pytest.approx(freedom, abs=4 * np.sqrt(2 * freedom))


def test_the_reference_is_the_highest_satellite_and_a_group_of_one_has_none():
    epochs, differences = drawn()
    for g in (0, 1):
        own = np.flatnonzero(epochs.group == g)
        height = np.nan_to_num(epochs.elevation_rad[:, own], nan=-1.0)
        few = (height >= 0).sum(axis=1) < 2
        assert few.any()
        expected = np.where(few, -1, own[height.argmax(axis=1)])
        assert_array_equal(differences.reference[:, g], expected)


def test_times_increase_and_arcs_end_with_runs():
    epochs, differences = drawn()
    assert (np.diff(differences.t_s) > 0).all()
    assert_allclose(np.diff(differences.t_s)[:2], 1.0, rtol=0, atol=1e-6)
    there = differences.arc >= 0
    assert_array_equal(there, np.isfinite(differences.phase_m))
    same_run = (epochs.run[1:] == epochs.run[:-1])[:, None, None]
    both = there[1:] & there[:-1]
    same_arc = (differences.arc[1:] == differences.arc[:-1]) & both
    assert not (same_arc & ~same_run).any()
    cycles = true_cycles(epochs, differences)
    assert not (np.diff(cycles, axis=0) != 0)[same_arc].any()
    assert same_arc[np.broadcast_to(same_run, both.shape) & both].mean() > 0.9


def test_slots_have_the_name_of_a_satellite_that_stays():
    _, one = drawn(World(runs=RunsTable(epochs=10)), 10)
    assert all(name[0] == "G" and name[1:].isdigit() for name in one.satellites)
    _, many = drawn(World(), 200)
    assert many.satellites == tuple(f"G#{k}" for k in range(1, 7))
