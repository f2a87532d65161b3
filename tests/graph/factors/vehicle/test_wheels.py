"""Wheels that roll: the factor, and what it does for a car that loses GNSS."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.geometry.interpolation import interpolate
from fgnav.graph.factors.vehicle.wheels import NAME
from fgnav.io.flight.folder import load_flight, save_flight
from fgnav.methods.smoother import Batch, Forward, Smoother
from fgnav.types.vehicle import WheeledVehicle
from fgnav_sim.motion import Arc, Hold, Motion, Rate
from fgnav_sim.scenario import FixesTable, ImuTable, Scenario
from fgnav_sim.simulate import simulate

OUTAGE_S = (20.5, 40.5)


@pytest.fixture(scope="module")
def drive():
    """A minute in a circle, nose along the course, seen from two metres before the rear axle."""
    speed_mps, radius_m = 10.0, 60.0
    turn_degps = float(np.degrees(speed_mps / radius_m))
    motion = Motion(
        path=Arc(speed_mps=speed_mps, radius_m=radius_m),
        roll=Hold(),
        pitch=Hold(),
        yaw=Rate(rate_degps=turn_degps),
    )
    imu = ImuTable(
        gyroscope_noise_radps_per_sqrt_hz=1e-3,
        gyroscope_bias_radps=1e-2,
        gyroscope_bias_walk_radps_per_sqrt_s=1e-5,
        accelerometer_noise_mps2_per_sqrt_hz=1e-2,
        accelerometer_bias_mps2=0.2,
    )
    scenario = Scenario(
        duration_s=60.0,
        motion=motion,
        antennas_b_m=((0.0, 0.0, 0.0),),
        fixes=FixesTable(rate_hz=1.0, position_noise_m=0.05, velocity_noise_mps=0.05),
        imu=imu,
    )
    flight = simulate(scenario, np.random.default_rng(7))
    fixes = flight.fixes[0]
    kept = (fixes.t_s < OUTAGE_S[0]) | (fixes.t_s > OUTAGE_S[1])
    names = ("t_s", "p_n_m", "v_n_mps", "position_sigma_m", "velocity_sigma_mps")
    fixes = replace(fixes, **{name: getattr(fixes, name)[kept] for name in names})
    # Body axes are 2 degrees off those of the wheels.
    return replace(flight, fixes=(fixes,))


@pytest.mark.parametrize("method", [Smoother(), Forward(), Batch()], ids=lambda m: m.name)
def test_wheels_hold_a_car_that_loses_gnss(drive, method):
    method = replace(method, noise="nominal")
    rms = {}
    for name, vehicle in (("free", None), ("wheels", WheeledVehicle())):
        found = method(replace(drive, vehicle=vehicle))
        lost = (found.t_s > OUTAGE_S[0]) & (found.t_s < OUTAGE_S[1])
        truth = interpolate(found.t_s, drive.truth.t_s, drive.truth.p_n_m)
        error = (found.p_n_m - truth)[lost]
        rms[name] = np.sqrt((error**2).mean())
    P = found.position_covariance_m2[lost]
    squares = np.einsum("ni,nij,nj->n", error, np.linalg.inv(P), error)
    assert rms["wheels"] < 0.7 * rms["free"]
    assert 0.05 < squares.mean() < 9
    test = next(one for one in found.consistency if one.what == NAME)
    assert test.count > 40  # a filter waits for its heading
    assert test.nis < 1.5


def test_a_flight_folder_keeps_its_vehicle(drive, tmp_path):
    vehicle = WheeledVehicle(position_b_m=np.array([-1.0, 0.0, 0.5]), slip_mps=0.2)
    save_flight(replace(drive, vehicle=vehicle), tmp_path / "flight")
    read = load_flight(tmp_path / "flight").vehicle
    np.testing.assert_array_equal(read.position_b_m, vehicle.position_b_m)
    assert read.slip_mps == vehicle.slip_mps
    assert read.axes_sigma_rad == pytest.approx(vehicle.axes_sigma_rad)
