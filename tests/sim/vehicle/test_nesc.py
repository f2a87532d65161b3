"""NASA's six-degree-of-freedom check cases, TM-2015-218675, against its simulations 04 and 05.

Vehicles, starts and winds are the report's; nothing is fitted to the files.
"""

from pathlib import Path

import numpy as np
import pytest

from fgnav.geometry.earth import ned_axes
from fgnav_sim.vehicle.flown_table import WindTable
from fgnav_sim.vehicle.rigid_body import Flown
from fgnav_sim.vehicle.tables import Airframe, BodyTable, Vehicle
from tests.sim.vehicle.reference import euler_rad, fly, launch, places, velocity_e_mps

FT, SLUG, DEG = 0.3048, 14.59390294, np.pi / 180
SLUG_FT2 = SLUG * FT**2
SPHERE = BodyTable(mass_kg=SLUG, inertia_kgm2=(3.6 * SLUG_FT2,) * 3)
BRICK = BodyTable(
    mass_kg=0.155404754 * SLUG,
    inertia_kgm2=(0.001894220 * SLUG_FT2, 0.006211019 * SLUG_FT2, 0.007194665 * SLUG_FT2),
)
BALL = Airframe(area_m2=0.1963495 * FT**2, span_m=FT, chord_m=FT, cd0=0.1)
DAMPED_BRICK = Airframe(
    area_m2=0.22222 * FT**2, span_m=0.33333 * FT, chord_m=0.66667 * FT,
    clp=-1.0, cmq=-1.0, cnr=-1.0,
)  # fmt: skip
HIGH, SEA_LEVEL = 30_000 * FT, 0.0


def read(shared: Path, name: str) -> np.ndarray:
    path = shared / "nesc" / f"{name}.csv"
    if not path.is_file():
        pytest.skip(f"FGNAV_SHARED: {name}.csv is absent")
    header = path.read_text().partition("\n")[0].split(",")
    columns = [header.index(wanted) for wanted in COLUMNS]
    return np.loadtxt(path, delimiter=",", skiprows=1, usecols=columns).T


COLUMNS = (
    "time", "altitudeMsl_ft", "feVelocity_ft_s_X", "feVelocity_ft_s_Y", "feVelocity_ft_s_Z",
    "eulerAngle_deg_Roll", "eulerAngle_deg_Pitch", "eulerAngle_deg_Yaw",
    "bodyAngularRateWrtEi_deg_s_Roll", "bodyAngularRateWrtEi_deg_s_Pitch",
    "bodyAngularRateWrtEi_deg_s_Yaw", "longitude_deg", "latitude_deg",
)  # fmt: skip


def flown(
    vehicle: Vehicle,
    air: dict[str, object],
    *,
    height_m: float = HIGH,
    v_ned_fps: tuple[float, ...] = (0.0, 0.0, 0.0),
    yaw_deg: float = 0.0,
    rates_degps: tuple[float, ...] = (0.0, 0.0, 0.0),
) -> Flown:
    start = launch(
        *(0.0, 0.0, height_m),
        v_n_mps=np.array(v_ned_fps) * FT,
        euler_rad=np.array([0.0, 0.0, yaw_deg * DEG]),
        w_ib_b_radps=np.array(rates_degps) * DEG,
    )
    return fly(vehicle, start, 30.0, row_interval_s=0.1, step_s=5e-3, gravity="j2", **air)


def altitude_error_ft(flight: Flown, reference: np.ndarray) -> float:
    assert np.abs(flight.t_s - reference[0]).max() < 1e-6
    return float(np.abs(places(flight)[:, 2] / FT - reference[1]).max())


def velocity_error_fps(flight: Flown, reference: np.ndarray) -> float:
    place = places(flight)
    v_ned = np.einsum("mij,mj->mi", ned_axes(*place[:, :2].T), velocity_e_mps(flight))
    return float(np.abs(v_ned / FT - reference[2:5].T).max())


def attitude_error_deg(flight: Flown, reference: np.ndarray) -> float:
    error = np.degrees(euler_rad(flight)) - reference[5:8].T
    return float(np.abs((error + 180) % 360 - 180).max())


TUMBLING = {"rates_degps": (10.0, 20.0, 30.0)}
AT_REST_DEGPS = (0.0, -0.004178073, 0.0)  # against the Earth
LAUNCHED = {
    "height_m": SEA_LEVEL,
    "v_ned_fps": (0.0, 1000.0, -1000.0),
    "yaw_deg": 90.0,
    "rates_degps": AT_REST_DEGPS,
}
VACUUM = {"air": False}
SHEAR = {"wind": WindTable(height_m=(0.0, HIGH), east_mps=(-20 * FT, 70 * FT))}
DRAGGED = Vehicle(body=SPHERE, aerodynamics=BALL)
DAMPED = Vehicle(body=BRICK, aerodynamics=DAMPED_BRICK)


@pytest.mark.parametrize(
    ("case", "vehicle", "air", "start", "limits"),
    [
        ("01_sim_04", Vehicle(body=SPHERE), VACUUM, {}, {"altitude": 1e-3, "velocity": 1e-3}),
        ("02_sim_04", Vehicle(body=BRICK), VACUUM, TUMBLING, {"attitude": 1e-6}),
        ("03_sim_05_every_0.1s", DAMPED, {}, TUMBLING, {"attitude": 0.01}),
        ("06_sim_04", DRAGGED, {}, {}, {"altitude": 1e-3}),
        ("08_sim_04", DRAGGED, SHEAR, {}, {"altitude": 1e-3}),
        ("09_sim_04", DRAGGED, {}, LAUNCHED, {"altitude": 1e-2, "attitude": 1e-3}),
    ],
)
def test_a_body_flies_as_nasas_check_case(shared, case, vehicle, air, start, limits) -> None:
    """Limits in feet, feet a second and degrees."""
    reference, flight = read(shared, f"Atmos_{case}"), flown(vehicle, air, **start)
    errors = {
        "altitude": altitude_error_ft,
        "velocity": velocity_error_fps,
        "attitude": attitude_error_deg,
    }
    for name, limit in limits.items():
        assert errors[name](flight, reference) < limit, name
