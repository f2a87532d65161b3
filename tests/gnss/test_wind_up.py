"""Phase wind-up against the simulator's, which follows rates instead of attitudes."""

import numpy as np

from fgnav.geometry.rotations import from_euler
from fgnav.gnss.wind_up import wind_up_cycles
from fgnav_sim.propagation.wind_up import wind_up

POLE_N = np.array([np.cos(0.7), 0.0, -np.sin(0.7)])
E_N = np.array([[0.0, 0.0, -1.0], [0.8, 0.0, -0.6], [-0.3, 0.9, -np.sqrt(0.1)]])
T_S = np.arange(0.0, 20.0, 0.1)


def test_it_is_what_the_simulator_adds_to_the_phase():
    swing = np.radians(40) * np.sin(T_S)
    R_nb = from_euler(swing, 0.5 * swing, swing + 0.3 * T_S)
    e_n = np.tile(E_N, (len(T_S), 1, 1))
    w = np.gradient(np.unwrap(0.3 * T_S), T_S)  # any rate near enough: it only counts turns
    rates = np.stack([np.gradient(swing, T_S), np.gradient(0.5 * swing, T_S), w], axis=1)
    theirs, _ = wind_up(E_N @ R_nb, POLE_N @ R_nb, rates, T_S)
    np.testing.assert_allclose(wind_up_cycles(e_n, R_nb, POLE_N), theirs, rtol=0, atol=1e-9)


def test_a_satellite_that_sets_leaves_the_others_as_they_are():
    e_n = np.tile(E_N, (len(T_S), 1, 1))
    e_n[50:60, 1] = np.nan
    R_nb = from_euler(0 * T_S, 0 * T_S, 0.4 * T_S)
    whole = wind_up_cycles(np.tile(E_N, (len(T_S), 1, 1)), R_nb, POLE_N)
    cycles = wind_up_cycles(e_n, R_nb, POLE_N)
    np.testing.assert_array_equal(cycles[:, [0, 2]], whole[:, [0, 2]])
    assert np.isnan(cycles[50:60, 1]).all()
    apart = cycles[60:, 1] - whole[60:, 1]
    np.testing.assert_allclose(apart, np.rint(apart), rtol=0, atol=1e-9)
