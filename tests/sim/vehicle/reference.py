"""Flown flights seen otherwise, and integrated by scipy on the same right-hand side."""

from pathlib import Path

import numpy as np
from pymap3d import Ellipsoid, ecef2geodetic
from scipy.integrate import solve_ivp

import fgnav_sim
from fgnav.geometry.earth import Origin, ned_axes
from fgnav.geometry.rotations import to_euler
from fgnav_sim.vehicle.forces import COEFFICIENTS, FINS, PATH, SIZE, P, Q, V, W
from fgnav_sim.vehicle.model import pack
from fgnav_sim.vehicle.rigid_body import Flown, Launch, rotations_of
from fgnav_sim.vehicle.rigid_body_kernel import derivative, rates
from fgnav_sim.vehicle.tables import load_vehicle

VEHICLES = Path(fgnav_sim.__file__).parent / "vehicles"
ROCKET = load_vehicle(VEHICLES / "rocket.toml")


def launch(latitude_rad=0.7, longitude_rad=-0.07, height_m=1000.0, **changes):
    """Return a start: at rest, level, nose north, but for the changes."""
    still = dict.fromkeys(("v_n_mps", "euler_rad", "w_ib_b_radps"), np.zeros(3))
    origin = Origin(latitude_rad=latitude_rad, longitude_rad=longitude_rad, height_m=height_m)
    return Launch(**{"origin": origin, **still, **changes})


def geodetic_on(planet, p_e_m):
    """Return latitude rad, longitude rad, height m over a planet's ellipsoid, (n, 3)."""
    shape = Ellipsoid(planet.semi_major_axis_m, planet.semi_minor_axis_m)
    place = ecef2geodetic(*p_e_m.T, shape, deg=False)
    return np.stack([np.reshape(x, len(p_e_m)) for x in place], axis=-1)


def position_e_m(flown):
    """Return ECEF positions of the centre of mass, (m, 3)."""
    turn = flown.planet.turn(flown.t_s)
    return np.einsum("mij,mj->mi", turn, flown.y[:, P : P + 3])


def places(flown):
    """Return latitude rad, longitude rad, ellipsoidal height m, (m, 3)."""
    return geodetic_on(flown.planet, position_e_m(flown))


def rotation_eb(flown):
    """Return R_eb, (m, 3, 3)."""
    return flown.planet.turn(flown.t_s) @ rotations_of(flown.y[:, Q : Q + 4])


def euler_rad(flown):
    """Return roll, pitch, yaw against north, east, down where the body is, (m, 3)."""
    return to_euler(ned_axes(*places(flown)[:, :2].T) @ rotation_eb(flown))


def velocity_e_mps(flown):
    """Return velocities against the Earth in ECEF axes, (m, 3)."""
    p_i_m, v_i_mps = flown.y[:, P : P + 3], flown.y[:, V : V + 3]
    v_i_mps = v_i_mps - np.cross(flown.planet.rate_i_radps, p_i_m)
    return np.einsum("mij,mj->mi", flown.planet.turn(flown.t_s), v_i_mps)


def rate_ib_b_radps(flown):
    """Return angular rates against inertial space, body axes, (m, 3)."""
    return flown.y[:, W : W + 3]


def deflections_rad(flown):
    """Return the deflections of the four canards, (m, 4)."""
    return flown.y[:, FINS : FINS + 4]


def fly_reference(vehicle, launch, air, plan):
    """Integrate one flight with DOP853; the ground is not looked for."""
    model = pack(vehicle, air, (plan.gravity, plan.planet), plan.commands, plan.t_s[-1])
    body, tables, scratch = model.body, model.tables, np.zeros(COEFFICIENTS)

    def right_hand_side(t_s, y):
        dy = np.empty(SIZE)
        derivative(t_s, body, tables, model.air, y, dy, scratch)
        assert np.isfinite(dy).all()  # scipy would shorten its step for ever
        return dy

    absolute = np.full(SIZE, 1e-13)
    absolute[P : P + 3] = absolute[PATH] = 1e-8
    absolute[V : V + 3] = 1e-11
    solved = solve_ivp(
        right_hand_side, (0.0, plan.t_s[-1]), launch.state(plan.planet), method="DOP853",
        t_eval=plan.t_s, rtol=1e-13, atol=absolute, max_step=0.1,
    )  # fmt: skip
    assert solved.success, solved.message
    y = np.ascontiguousarray(solved.y.T)
    dy = np.empty_like(y)
    rates(model, plan.t_s, y, dy)
    return Flown(t_s=plan.t_s, y=y, dy=dy, planet=plan.planet)
