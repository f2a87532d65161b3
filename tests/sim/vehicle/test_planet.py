"""Other Earths than ours: closed forms of a round one, at rest and turning."""

import numpy as np
import pytest
from scipy.optimize import brentq

from fgnav.checks import BadInputError
from fgnav.geometry.earth import GM_M3PS2, Origin, geodetic
from fgnav_sim.vehicle.flown_table import WindTable
from fgnav_sim.vehicle.planet import WGS84, Planet
from fgnav_sim.vehicle.rigid_body import Flown
from fgnav_sim.vehicle.tables import Airframe, BodyTable, Vehicle
from tests.sim.vehicle.reference import fly, geodetic_on, launch, places, velocity_e_mps

RADIUS_M, RATE = 6_371_007.0, 7.2921151467e-5
STILL = Planet(semi_major_axis_m=RADIUS_M, flattening=0.0, rate_radps=0.0)
TURNING = Planet(semi_major_axis_m=RADIUS_M, flattening=0.0)
STONE = Vehicle(body=BodyTable(mass_kg=10.0, inertia_kgm2=(0.5, 0.5, 0.5)))
HEIGHT_M = 9144.0


def dropped(
    planet: Planet,
    *,
    vehicle: Vehicle = STONE,
    latitude_rad: float = 0.0,
    v_n_mps: tuple[float, ...] = (0.0, 0.0, 0.0),
    duration_s: float = 30.0,
    height_m: float = HEIGHT_M,
    **table: object,
) -> Flown:
    start = launch(latitude_rad, 0.0, height_m, v_n_mps=np.array(v_n_mps))
    table = {"air": False, "gravity": "spherical", "step_s": 5e-3, "earth": planet, **table}
    return fly(vehicle, start, duration_s, row_interval_s=0.1, **table)


def kepler(p_m: np.ndarray, v_mps: np.ndarray, t_s: float) -> np.ndarray:
    """Return the position after a time on a Kepler ellipse, by Lagrange's coefficients."""
    r = np.linalg.norm(p_m)
    a = 1 / (2 / r - v_mps @ v_mps / GM_M3PS2)
    n, s = np.sqrt(GM_M3PS2 / a**3), p_m @ v_mps / np.sqrt(GM_M3PS2 * a)

    def late(x: float) -> float:
        return x - (1 - r / a) * np.sin(x) + s * (1 - np.cos(x)) - n * t_s

    x = brentq(late, -1.0, 8.0, xtol=1e-15, rtol=1e-15)
    f = 1 - a / r * (1 - np.cos(x))
    return f * p_m + (t_s + (np.sin(x) - x) / n) * v_mps


@pytest.mark.parametrize("planet", [WGS84, STILL, Planet(flattening=0.01)])
def test_places_come_back(planet: Planet) -> None:
    for latitude_rad in (-1.2, 0.0, 0.7):
        origin = Origin(latitude_rad=latitude_rad, longitude_rad=2.0, height_m=12345.0)
        back = geodetic_on(planet, planet.p_e_m(origin)[None])[0]
        assert back == pytest.approx([latitude_rad, 2.0, 12345.0], abs=1e-8)


def test_our_earth_is_the_librarys() -> None:
    origin = Origin(latitude_rad=0.7, longitude_rad=-0.07, height_m=700.0)
    assert WGS84.p_e_m(origin) == pytest.approx(origin.p_e_m, abs=1e-8)
    there = origin.p_e_m[None]
    assert geodetic_on(WGS84, there) == pytest.approx(geodetic(there), abs=1e-9)


@pytest.mark.parametrize("planet", [STILL, TURNING])
@pytest.mark.parametrize("v_n_mps", [(0.0, 0.0, 0.0), (304.8, 0.0, -304.8), (0.0, 304.8, -304.8)])
def test_in_vacuum_a_body_follows_its_kepler_ellipse(
    planet: Planet, v_n_mps: tuple[float, ...]
) -> None:
    flight = dropped(planet, v_n_mps=v_n_mps, latitude_rad=0.6)
    y, end_s = flight.y, flight.t_s[-1]
    assert y[-1, :3] == pytest.approx(kepler(y[0, :3], y[0, 3:6], end_s), abs=1e-6)


def test_in_a_steady_wind_a_light_body_ends_up_at_the_winds_speed() -> None:
    feather = Vehicle(
        body=BodyTable(mass_kg=0.1, inertia_kgm2=(0.1, 0.1, 0.1)),
        aerodynamics=Airframe(area_m2=0.1, span_m=0.3, chord_m=0.3, cd0=1.0),
    )
    wind = WindTable(north_mps=3.0, east_mps=6.0)
    flight = dropped(STILL, vehicle=feather, air=True, wind=wind)
    v_n = velocity_e_mps(flight)[-1]  # at the equator north is z, east is y
    assert v_n[[2, 1]] == pytest.approx([3.0, 6.0], abs=0.01)
    density = 1.225 * (1 - 2.25577e-5 * places(flight)[-1, 2]) ** 4.2559  # US-1976, troposphere
    fall = np.sqrt(2 * 0.1 * 9.8 / (density * 0.1))
    assert -v_n[0] == pytest.approx(fall, rel=5e-3)


def test_planets_that_cannot_be_are_named() -> None:
    for wrong, text in (
        ({"flattening": 0.2}, r"flattening: must be from 0 to below 0\.1, got 0\.2"),
        ({"rate_radps": 1.0}, r"rate_radps: must be within \+-1e-3, got 1"),
    ):
        with pytest.raises(BadInputError, match=text):
            Planet(**wrong)
