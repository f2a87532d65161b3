"""Flown flights seen otherwise, and integrated by scipy on the same right-hand side."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from pymap3d import Ellipsoid, ecef2geodetic
from scipy.integrate import solve_ivp

import fgnav_sim
from fgnav.geometry.earth import Origin, ned_axes
from fgnav.geometry.rotations import to_euler
from fgnav_sim.vehicle.flown_table import FlownTable, StartTable
from fgnav_sim.vehicle.forces import COEFFICIENTS, FINS, PATH, SIZE, P, Q, V, W
from fgnav_sim.vehicle.model import NO_GUST, pack
from fgnav_sim.vehicle.rigid_body import fly_body, rotations_of
from fgnav_sim.vehicle.rigid_body_kernel import derivative
from fgnav_sim.vehicle.tables import load_vehicle

VEHICLES = Path(fgnav_sim.__file__).parent / "vehicles"
ROCKET = load_vehicle(VEHICLES / "rocket.toml")


def launch(
    latitude_rad=0.7, longitude_rad=-0.07, height_m=1000.0, origin=None, *,
    v_n_mps=(0.0, 0.0, 0.0), euler_rad=(0.0, 0.0, 0.0), w_ib_b_radps=(0.0, 0.0, 0.0),
    spin_radps=0.0,
):  # fmt: skip
    """Return an origin and a start there: at rest, level, nose north, but for the changes."""
    place = {"latitude_rad": latitude_rad, "longitude_rad": longitude_rad, "height_m": height_m}
    start = StartTable(
        v_n_mps=tuple(v_n_mps),
        euler_deg=tuple(np.degrees(euler_rad)),
        rate_b_degps=tuple(np.degrees(w_ib_b_radps)),
        rate_against="inertial",
        rear_spin_degps=np.degrees(spin_radps),
    )
    return origin or Origin(**place), start


def fly(vehicle, launched, duration_s=10.0, *, row_interval_s=0.01, gust_mps=NO_GUST, **table):
    """Fly a vehicle from a launch; ``table`` holds other fields of a flown scenario."""
    origin, start = launched
    whole = FlownTable(vehicle=vehicle, start=start, **table)
    return fly_body(whole, origin, duration_s, gust_mps=gust_mps, row_interval_s=row_interval_s)


def geodetic_on(planet, p_e_m):
    """Return latitude rad, longitude rad, height m over a planet's ellipsoid, (n, 3)."""
    shape = Ellipsoid(planet.semi_major_axis_m, planet.semi_minor_axis_m)
    place = ecef2geodetic(*p_e_m.T, shape, deg=False)
    return np.stack([np.reshape(x, len(p_e_m)) for x in place], axis=-1)


def position_e_m(flown):
    """Return ECEF positions of the centre of mass, (m, 3)."""
    turn = flown.planet.R_ei(flown.t_s)
    return np.einsum("mij,mj->mi", turn, flown.y[:, P : P + 3])


def places(flown):
    """Return latitude rad, longitude rad, ellipsoidal height m, (m, 3)."""
    return geodetic_on(flown.planet, position_e_m(flown))


def rotation_eb(flown):
    """Return R_eb, (m, 3, 3)."""
    return flown.planet.R_ei(flown.t_s) @ rotations_of(flown.y[:, Q : Q + 4])


def euler_rad(flown):
    """Return roll, pitch, yaw against north, east, down where the body is, (m, 3)."""
    return to_euler(ned_axes(*places(flown)[:, :2].T) @ rotation_eb(flown))


def velocity_e_mps(flown):
    """Return velocities against the Earth in ECEF axes, (m, 3)."""
    p_i_m, v_i_mps = flown.y[:, P : P + 3], flown.y[:, V : V + 3]
    v_i_mps = v_i_mps - np.cross(flown.planet.rate_i_radps, p_i_m)
    return np.einsum("mij,mj->mi", flown.planet.R_ei(flown.t_s), v_i_mps)


def rate_ib_b_radps(flown):
    """Return angular rates against inertial space, body axes, (m, 3)."""
    return flown.y[:, W : W + 3]


def deflections_rad(flown):
    """Return the deflections of the four canards, (m, 4)."""
    return flown.y[:, FINS : FINS + 4]


def fly_reference(vehicle, launched, steps, **table):
    """Integrate a flight with DOP853 to the times of another; the ground is not looked for."""
    table = FlownTable(vehicle=vehicle, start=launched[1], **table)
    model, scratch = pack(vehicle, table, steps.t_s[-1]), np.zeros(COEFFICIENTS)

    def right_hand_side(t_s, y):
        dy = np.empty(SIZE)
        derivative(t_s, model.body, model.tables, model.air, y, dy, scratch)
        assert np.isfinite(dy).all()  # scipy would shorten its step for ever
        return dy

    absolute = np.full(SIZE, 1e-13)
    absolute[P : P + 3] = absolute[PATH] = 1e-8
    absolute[V : V + 3] = 1e-11
    solved = solve_ivp(
        right_hand_side, (0.0, steps.t_s[-1]), steps.y[0], method="DOP853",
        t_eval=steps.t_s, rtol=1e-13, atol=absolute, max_step=0.1,
    )  # fmt: skip
    assert solved.success, solved.message
    return replace(steps, y=np.ascontiguousarray(solved.y.T))
