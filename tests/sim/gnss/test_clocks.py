"""Receiver clocks spread, drift and walk as the scenario states."""

import numpy as np
import pytest

from fgnav_sim.gnss.clocks import clocks
from fgnav_sim.gnss.tables import ClockTable

T_S = np.arange(0.0, 100.0, 0.5)


def test_one_oscillator_moves_all_receivers_alike():
    offset_s, drift_sps = clocks(ClockTable(), T_S, 8, rng=np.random.default_rng(1))
    apart_s = offset_s - offset_s[:, :1]
    assert np.ptp(apart_s, axis=0).max() < 1e-18
    assert np.unique(apart_s[0]).size == 8
    assert np.array_equal(drift_sps[:, 0], drift_sps[:, 7])


def test_separate_oscillators_move_apart():
    clock = ClockTable(oscillator="separate")
    offset_s, _ = clocks(clock, T_S, 3, rng=np.random.default_rng(1))
    assert np.ptp(offset_s[:, 1] - offset_s[:, 0]) > 1e-10


def test_the_offset_is_the_integral_of_the_drift():
    offset_s, drift_sps = clocks(ClockTable(), T_S, 1, rng=np.random.default_rng(1))
    by_trapezoids = 0.25 * (drift_sps[1:] + drift_sps[:-1])
    assert np.allclose(np.diff(offset_s, axis=0), by_trapezoids, rtol=0, atol=1e-18)


def test_sizes_are_those_of_the_scenario():
    clock = ClockTable(
        oscillator="separate", offset_s=3e-6, drift_sps=2e-9, drift_walk_sps_per_sqrt_s=1e-9
    )
    offset_s, drift_sps = clocks(clock, T_S, 4000, rng=np.random.default_rng(1))
    assert np.std(offset_s[0]) == pytest.approx(3e-6, rel=0.04)
    assert np.std(drift_sps[0]) == pytest.approx(2e-9, rel=0.04)
    assert np.std(drift_sps[-1] - drift_sps[0]) == pytest.approx(1e-9 * np.sqrt(99.5), rel=0.04)
