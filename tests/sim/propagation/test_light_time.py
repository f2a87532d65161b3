"""Light time against a brute-force solution in inertial axes."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fgnav.geometry.earth import C_MPS, EARTH_RATE_RADPS, Origin
from fgnav.gnss.orbits.satellites import satellite_states
from fgnav_sim.gnss.constellation import built_in_orbits
from fgnav_sim.propagation.light_time import links

MICROMETRE = 1e-6
ORIGIN = Origin(latitude_rad=0.7, longitude_rad=-0.07, height_m=700.0)
SATELLITES = ("G01", "G12", "E05", "C27")
START_GPS_S = 1_277_078_400.0


@pytest.fixture(scope="module")
def orbits():
    return built_in_orbits(("G", "E", "C"), START_GPS_S, 600.0)


def antennas_e_m(t_s):
    """Two antennas 5 m apart on a vehicle at 300 m/s, (n, 2, 3)."""
    v_n_mps = np.array([200.0, 220.0, -30.0])
    levers_n_m = np.array([[0.0, 0.0, 0.0], [3.0, -4.0, 0.5]])
    p_n_m = t_s[..., None] * v_n_mps + levers_n_m
    p_e_m = ORIGIN.to_e(p_n_m.reshape(-1, 3)).reshape(p_n_m.shape)
    return p_e_m, np.broadcast_to(v_n_mps @ ORIGIN.R_ne, p_e_m.shape)


def turned(p_m, angle_rad):
    s, c = np.sin(angle_rad), np.cos(angle_rad)
    return np.array([c * p_m[0] - s * p_m[1], s * p_m[0] + c * p_m[1], p_m[2]])


def brute_force_range_m(orbits, satellite, t_s, p_e_m):
    """Root of ``|p_i(t) - s_i(t - travel)| = c travel`` in axes fixed at reception."""

    def excess_m(travel_s):
        state = satellite_states(orbits, (satellite,), np.array([[t_s - travel_s]]))
        s_i_m = turned(state.p_e_m[0, 0], -EARTH_RATE_RADPS * travel_s)
        return np.linalg.norm(s_i_m - p_e_m) - C_MPS * travel_s

    return C_MPS * brentq(excess_m, 0.05, 0.2, xtol=1e-16, rtol=1e-15)


def test_ranges_solve_the_light_time_equation(orbits):
    t_s = np.array([[10.0, 10.0 + 1e-3], [400.0, 400.0 - 2e-7]])  # one clock 1 ms off
    p_e_m, v_e_mps = antennas_e_m(t_s)
    found = links(orbits, SATELLITES, t_s, p_e_m, v_e_mps)
    for k, i in np.ndindex(2, 2):
        for j, satellite in enumerate(SATELLITES):
            expected = brute_force_range_m(orbits, satellite, t_s[k, i], p_e_m[k, i])
            assert found.range_m[k, i, j] == pytest.approx(expected, rel=0, abs=1.0 * MICROMETRE)


def test_range_rate_is_the_derivative_of_the_range(orbits):
    h = 0.01
    t_s = np.array([[100.0, 100.0], [300.0, 300.0]])
    rate_mps = links(orbits, SATELLITES, t_s, *antennas_e_m(t_s)).range_rate_mps
    before, after = (
        links(orbits, SATELLITES, t_s + d, *antennas_e_m(t_s + d)).range_m for d in (-h, h)
    )
    assert np.abs((after - before) / (2 * h) - rate_mps).max() < 5e-6  # m/s


def test_clocks_are_those_of_the_time_of_transmission(orbits):
    t_s = np.array([[100.0, 100.5], [300.0, 300.5]])
    found = links(orbits, SATELLITES, t_s, *antennas_e_m(t_s))
    for i in range(2):
        left_s = t_s[:, i, None] - found.range_m[:, i] / C_MPS
        state = satellite_states(orbits, SATELLITES, left_s)
        assert np.abs(found.clock_s[:, i] - state.clock_s).max() < 1e-15
