"""Phase wind-up: whole turns are whole cycles, the rate is the derivative, arrays do not see it.

The field of a right-handed wave from overhead turns clockwise as seen from above. An antenna whose
heading grows turns along with it and counts fewer cycles, as if it moved away: phase grows.
"""

import msgspec
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from fgnav.geometry.rotations import from_euler
from fgnav_sim.gnss.tables import GnssTable
from fgnav_sim.motion import Hold, Motion, Rate, Sine, Straight
from fgnav_sim.propagation.wind_up import wind_up
from fgnav_sim.scenario import Scenario
from fgnav_sim.simulate import simulate

UP = np.array([0.0, 0.0, -1.0])
LOW = np.array([np.cos(0.3), 0.0, -np.sin(0.3)])
POLE_N = np.array([np.cos(0.7), 0.0, -np.sin(0.7)])


def wound(motion, t_s, e_n=(UP, LOW)):
    """Return wind-up and rate of satellites that stand still in n, (n, m)."""
    state = motion(t_s)
    e_b = np.array(e_n) @ state.R_nb
    return wind_up(e_b, POLE_N @ state.R_nb, state.w_nb_b_radps, t_s)


def test_the_rate_is_the_derivative_in_any_motion():
    motion = Motion(
        roll=Sine(amplitude_deg=40.0), pitch=Sine(amplitude_deg=30.0, phase_deg=50.0),
        yaw=Rate(rate_degps=90.0),
    )  # fmt: skip
    t_s = np.arange(0.0, 10.0, 1e-3)
    cycles, rate = wound(motion, t_s)
    numeric = (cycles[2:] - cycles[:-2]) / 2e-3
    assert_allclose(rate[1:-1], numeric, rtol=0, atol=1e-4)
    assert np.abs(rate).max() > 0.2


def test_the_angle_is_that_of_the_defining_formula():
    rng = np.random.default_rng(1)
    R_nb = from_euler(*rng.uniform(-0.5, 0.5, (3, 1)))[0]
    k = -LOW @ R_nb
    pole = POLE_N @ R_nb
    x_s = pole - k * (k @ pole)
    x_s /= np.linalg.norm(x_s)
    y_s = np.cross(k, x_s)
    x, y = np.array([1.0, 0, 0]), np.array([0, -1.0, 0])
    transmitted = x_s - k * (k @ x_s) - np.cross(k, y_s)
    received = x - k * (k @ x) + np.cross(k, y)
    cosine = transmitted @ received / np.linalg.norm(transmitted) / np.linalg.norm(received)
    angle = np.sign(k @ np.cross(transmitted, received)) * np.arccos(cosine)
    cycles, _ = wind_up(-k[None, None], pole[None], np.zeros((1, 3)), np.zeros(1))
    assert cycles[0, 0] == pytest.approx(angle / (2 * np.pi), abs=1e-12)


def test_a_satellite_that_is_away_for_a_while_harms_nobody():
    t_s = np.arange(0.0, 5.0, 0.1)
    state = Motion(yaw=Rate(rate_degps=36.0))(t_s)
    e_b = np.array([UP, LOW]) @ state.R_nb
    e_b[:10, 1] = e_b[30:40, 1] = np.nan
    cycles, _ = wind_up(e_b, POLE_N @ state.R_nb, state.w_nb_b_radps, t_s)
    assert np.isfinite(cycles).all()
    assert_allclose(np.diff(cycles[10:30], axis=0), 0.01, rtol=0, atol=1e-9)


def test_receivers_wind_up_alike_and_double_differences_see_nothing():
    still = Scenario(
        duration_s=10.0,
        motion=Motion(path=Straight(speed_mps=0.0), pitch=Hold(5.0), yaw=Rate(rate_degps=72.0)),
        antennas_b_m=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)),
        gnss=GnssTable(),
    )
    winding = msgspec.structs.replace(still, gnss=GnssTable(wind_up=True))
    plain, wound_up = (
        simulate(one, np.random.default_rng(1)).observations for one in (still, winding)
    )
    grown = wound_up.phase_cycles - plain.phase_cycles
    assert_allclose(grown[:, 1] - grown[:, 0], 0.0, atol=1e-6)
    assert_allclose(grown[-1] - grown[0], 72.0 * 9.9 / 360, rtol=0, atol=0.02)
    assert_allclose(wound_up.doppler_hz - plain.doppler_hz, -0.2, rtol=0, atol=0.02)
    assert_array_equal(wound_up.code_m, plain.code_m)
