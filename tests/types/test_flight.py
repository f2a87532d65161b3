import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.geometry.earth import Origin
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Antenna, Fixes, Flight, GnssNoise, Imu, Photodetector
from fgnav.types.observations import Observations
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits, PreciseOrbits

ORIGIN = Origin(latitude_rad=0.7, longitude_rad=0.0, height_m=0.0)
T = np.array([0.0, 1.0])
ACCELEROMETER = {
    "accelerometer_noise_mps2_per_sqrt_hz": 1e-3,
    "accelerometer_bias_mps2": 1e-2,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-4,
}


def antenna(name="a1"):
    return Antenna(name=name, position_b_m=np.zeros(3))


def imu(**changes):
    return Imu(**({"t_s": T, "f_b_mps2": np.zeros((2, 3))} | ACCELEROMETER | changes))


def fixes(**changes):
    good = {
        "t_s": T,
        "antenna": "a1",
        "p_n_m": np.zeros((2, 3)),
        "v_n_mps": np.zeros((2, 3)),
        "position_sigma_m": np.ones((2, 3)),
        "velocity_sigma_mps": np.ones((2, 3)),
    }
    return Fixes(**(good | changes))


def photodetector(**changes):
    good = {
        "t_s": T,
        "currents": np.ones((2, 4)),
        "position_b_m": np.zeros(3),
        "landmark_n_m": np.zeros(3),
        "detector_radius_m": 5e-3,
        "focal_length_m": 2e-2,
        "calibration": np.array([[0.0, 0.0], [1.0, 0.5]]),
    }
    return Photodetector(**(good | changes))


def observations(**changes):
    shape = (2, 1, 1)
    good = {
        "t_s": T,
        "tag_s": T[:, None],
        "satellites": ("G01",),
        "signals": ("1C",),
        "code_m": np.full(shape, 2e7),
        "phase_cycles": np.full(shape, np.nan),
        "doppler_hz": np.full(shape, np.nan),
        "cn0_dbhz": np.full(shape, np.nan),
        "lock_flags": np.zeros(shape, dtype=int),
    }
    return Observations(**(good | changes))


def flight(**changes):
    return Flight(
        **({"name": "f", "start_gps_s": 0.0, "origin": ORIGIN, "antennas": (antenna(),)} | changes)
    )


def estimate(**changes):
    good = {"method": "m", "t_s": T, "n_epochs": 4, "R_nb": np.tile(np.eye(3), (2, 1, 1))}
    return Estimate(**(good | changes))


def test_parts_that_fit_make_a_flight():
    whole = flight(
        observations=observations(),
        broadcast=BroadcastOrbits(records=np.zeros(1, EPHEMERIS_DTYPE), klobuchar=np.zeros(8)),
        imu=imu(),
        fixes=(fixes(),),
        photodetector=photodetector(),
    )
    assert whole.antenna("a1").name == "a1"
    assert not whole.observations.tracked.any()


def test_availability_is_the_share_of_epochs_with_an_answer():
    assert estimate().available == 0.5


@pytest.mark.parametrize(
    ("make", "changes", "text"),
    [
        (imu, {"t_s": T[::-1]}, "imu t_s: time must increase, row 1"),
        (imu, {"f_b_mps2": np.zeros((3, 3))}, r"imu f_b_mps2: expected shape \(2, 3\)"),
        (imu, {"accelerometer_bias_mps2": 0.0}, "imu accelerometer_bias_mps2: must be positive"),
        (imu, {"gyroscope_bias_radps": 1.0}, "imu gyroscope_bias_radps: goes with gyroscope"),
        (imu, {"w_b_radps": np.zeros((2, 3))}, "imu gyroscope_noise_.*: goes with gyroscope"),
        (fixes, {"position_sigma_m": np.zeros((2, 3))}, "fixes position_sigma_m: must be positive"),
        (fixes, {"velocity_sigma_mps": -np.ones((2, 3))}, "velocity_sigma_mps: must be positive"),
        (fixes, {"v_n_mps": None}, "fixes velocity_sigma_mps: goes with velocities"),
        (
            photodetector,
            {"calibration": np.zeros((3, 2))},
            "photodetector calibration: needs two rows or more",
        ),
        (photodetector, {"focal_length_m": 0.0}, "photodetector focal_length_m: must be positive"),
        (observations, {"signals": ()}, "observations: 1 satellites but 0 signals"),
        (observations, {"code_m": np.zeros((2, 1, 2))}, "observations code_m: expected shape"),
        (flight, {"antennas": (antenna(), antenna())}, "antenna a1: two antennas have this name"),
        (flight, {"observations": observations()}, "gnss: observations need navigation or orbits"),
        (flight, {"observations": observations(), "antennas": ()}, "observations: of 1 antennas"),
        (flight, {"fixes": (fixes(antenna="x"),)}, "fixes antenna: 'x' is not one of"),
        (flight, {"elevation_mask_rad": 2.0}, "elevation_mask_deg: must be within 0 and 90"),
        (GnssNoise, {"code_m": 0.0}, "gnss noise code_m: must be positive"),
        (GnssNoise, {"elevation_weights": "flat"}, "elevation_weights: must be sine or uniform"),
        (estimate, {"n_epochs": 1}, "m n_epochs: 1, but 2 have an answer"),
        (estimate, {"R_nb": np.zeros((1, 3, 3))}, "m R_nb: expected shape"),
    ],
)
def test_a_part_that_breaks_a_rule_is_named(make, changes, text):
    with pytest.raises(BadInputError, match=text):
        make(**changes)


def test_an_antenna_that_is_not_there_is_named():
    with pytest.raises(BadInputError, match=r"antenna 'a9': not one of \['a1'\]"):
        flight().antenna("a9")


def test_broadcast_messages_are_sorted_and_finite():
    records = np.zeros(3, EPHEMERIS_DTYPE)
    records["satellite"], records["toe_s"] = ["G02", "G01", "G01"], [0, 7200, 0]
    kept = BroadcastOrbits(records=records, klobuchar=np.zeros(8)).records
    assert list(zip(kept["satellite"], kept["toe_s"], strict=True)) == [
        ("G01", 0),
        ("G01", 7200),
        ("G02", 0),
    ]
    records["af0_s"][0] = np.nan
    with pytest.raises(BadInputError, match="broadcast orbits af0_s: not finite"):
        BroadcastOrbits(records=records, klobuchar=np.zeros(8))


def test_precise_orbits_may_have_gaps_but_not_in_time():
    table = {
        "satellites": ("G01",),
        "p_e_m": np.full((2, 1, 3), np.nan),
        "clock_s": np.zeros((2, 1)),
    }
    assert PreciseOrbits(t_s=T, **table).t_s[1] == 1
    with pytest.raises(BadInputError, match="precise orbits t_s: time must increase"):
        PreciseOrbits(t_s=T * 0, **table)
