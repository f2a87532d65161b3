"""Barometer and magnetometer: the truth, and errors of the size that the scenario states."""

import numpy as np
import pytest

from fgnav.geometry.earth import geodetic
from fgnav.geometry.rotations import transpose
from fgnav_sim.motion import Arc, Motion, Sine
from fgnav_sim.scenario import Scenario
from fgnav_sim.sensors.surroundings import point, press
from fgnav_sim.sensors.surroundings_tables import BarometerTable, MagnetometerTable

SWING = Motion(path=Arc(climb_mps=5.0), roll=Sine(amplitude_deg=30.0), yaw=Sine(amplitude_deg=60.0))
LONG = Scenario(duration_s=2000.0, motion=SWING)
SMALL = 1e-9


def heights_m(lever_b_m):
    p_n_m, _, _ = LONG.motion(LONG.epochs_s(10.0)).at(np.array(lever_b_m))
    return geodetic(LONG.origin.frame.to_e(p_n_m))[:, 2]


def test_a_quiet_barometer_tells_the_height_of_its_port():
    port_b_m = (1.0, 0.5, -2.0)
    quiet = BarometerTable(position_b_m=port_b_m, noise_m=SMALL, offset_m=SMALL, wander_m=0.0)
    told = press(quiet, LONG, rng=np.random.default_rng(1))
    np.testing.assert_allclose(told.height_m, heights_m(port_b_m), rtol=0, atol=1e-7)
    assert np.ptp(heights_m(port_b_m) - heights_m((0.0, 0.0, 0.0))) > 0.5  # roll moves the port


def test_a_barometer_errs_by_offset_drift_and_noise():
    table = BarometerTable(noise_m=0.5, offset_m=20.0, wander_m=3.0, wander_time_s=10.0)
    errors = np.array(
        [
            press(table, LONG, rng=np.random.default_rng(seed)).height_m - heights_m((0, 0, 0))
            for seed in range(12)
        ]
    )
    assert np.std(np.diff(errors)) == pytest.approx(
        np.sqrt(2 * 0.5**2 + 2 * 3.0**2 * (1 - np.exp(-0.01))), rel=0.02
    )
    about_its_offset = errors - errors.mean(axis=1, keepdims=True)
    assert np.std(about_its_offset) == pytest.approx(np.hypot(0.5, 3.0), rel=0.06)
    assert 8.0 < np.std(errors.mean(axis=1)) < 40.0


def test_a_magnetometer_sees_both_fields():
    table = MagnetometerTable(field_n_ut=(20.0, 3.0, 40.0), noise_ut=0.2, hard_iron_ut=5.0)
    told = point(table, LONG, rng=np.random.default_rng(3))
    earth_b_ut = transpose(LONG.motion(told.t_s).R_nb) @ np.array([20.0, 3.0, 40.0])
    rest = told.field_b_ut - earth_b_ut
    own = rest.mean(axis=0)
    assert (np.abs(own) > 0.1).all()
    assert (np.abs(own) < 20.0).all()
    np.testing.assert_allclose((rest - own).std(axis=0), 0.2, rtol=0.03)


def test_a_field_of_zero_is_refused():
    with pytest.raises(ValueError, match="field_n_ut: must not be zero"):
        MagnetometerTable(field_n_ut=(0.0, 0.0, 0.0))
