"""Scenarios that a rigid body flies: from their tables to motion."""

from dataclasses import replace
from typing import TypeAlias

import msgspec
import numpy as np

from fgnav.checks import BadInputError, Unused
from fgnav.geometry.rotations import from_euler
from fgnav_sim.scenario import Scenario
from fgnav_sim.vehicle.atmosphere import Air, dryden
from fgnav_sim.vehicle.flown_motion import flown_motion
from fgnav_sim.vehicle.flown_table import FlownTable
from fgnav_sim.vehicle.forces import PATH
from fgnav_sim.vehicle.planet import WGS84, Planet
from fgnav_sim.vehicle.rigid_body import Launch, Plan, fly_body
from fgnav_sim.vehicle.tables import Vehicle

ROW_INTERVAL_S = 0.01  # quintics in between are within 1e-9 of the attitude at 5 turns a second
GUST_INTERVAL_M = 5.0

Airborne: TypeAlias = tuple[Scenario, tuple[Unused, ...]]  # with known motion; parts not flown


def take_off(scenario: Scenario, rng: np.random.Generator) -> Airborne:
    """Fly the rigid body of a scenario; what is commanded stays as it is.

    A flight that meets the ground ends there: its duration becomes shorter, and says so.

    Parameters
    ----------
    rng : Generator
        For gusts.

    Raises
    ------
    BadInputError
        If a step is too long, or the flight meets the ground at once.
    """
    table = scenario.flown
    if table is None:
        return scenario, ()
    vehicle, planet = _vehicle(table), table.earth or WGS84
    launch = _launch(scenario, table, planet)
    air = _air(table, launch, rng)
    try:
        flown = fly_body(vehicle, launch, air, _plan(scenario, table, planet))
    except BadInputError as error:
        raise BadInputError(f"flown.{error}") from None
    motion = flown_motion(flown, scenario.origin.frame, vehicle)
    last_s, path_m = float(flown.t_s[-1]), float(flown.y[-1, PATH])
    unused = []
    if last_s < scenario.duration_s:
        reason = f"the body met the ground after {last_s:.2f} s"
        unused.append(Unused(what="landing", reason=reason, count=1))
    if table.gusts is not None and path_m > table.gusts.length_m:
        reason = f"gusts end after {table.gusts.length_m:g} of {path_m:.0f} m through the air"
        unused.append(Unused(what="gusts", reason=reason, count=1))
    changes = {"motion": motion, "flown": None, "duration_s": min(last_s, scenario.duration_s)}
    return msgspec.structs.replace(scenario, **changes), tuple(unused)


def _vehicle(table: FlownTable) -> Vehicle:
    """Return the vehicle as it flies: lit at its time; canards that are told nothing rest."""
    if isinstance(table.vehicle, str):
        raise BadInputError(f"flown.vehicle: '{table.vehicle}' must be loaded; use load_scenario")
    changes: dict[str, object] = {}
    if table.attitude is None:
        changes["autopilot"] = None
    motor = table.vehicle.motor
    if motor is not None:
        time_s = tuple(table.ignition_s + t_s for t_s in motor.time_s)
        changes["motor"] = msgspec.structs.replace(motor, time_s=time_s)
    return msgspec.structs.replace(table.vehicle, **changes)


def _plan(scenario: Scenario, table: FlownTable, planet: Planet) -> Plan:
    """Return a plan that lasts two rows longer than the scenario: receivers' clocks err."""
    commanded = table.attitude
    interval_s = max(ROW_INTERVAL_S, table.step_s)
    rows = np.ceil(scenario.duration_s / interval_s - 1e-9) + 2
    return Plan(
        duration_s=float(rows * interval_s),
        step_s=table.step_s,
        row_interval_s=interval_s,
        gravity=table.gravity or scenario.gravity,
        ground_m=table.ground_m,
        commands=(commanded.roll, commanded.pitch, commanded.yaw) if commanded else None,
        planet=planet,
    )


def _launch(scenario: Scenario, table: FlownTable, planet: Planet) -> Launch:
    """Return the start, its rates counted from inertial space."""
    start, origin = table.start, scenario.origin.frame
    euler_rad = np.radians(start.euler_deg)
    R_nb = from_euler(*euler_rad[:, None])[0]
    w_b, rear = np.radians(start.rate_b_degps), float(np.radians(start.rear_spin_degps))
    if start.rate_against == "earth":
        earth_b = R_nb.T @ origin.R_ne @ planet.rate_i_radps
        w_b, rear = w_b + earth_b, rear + float(earth_b[0])
    return Launch(
        origin=origin,
        position_n_m=np.array(start.position_n_m),
        v_n_mps=np.array(start.v_n_mps) + R_nb @ np.array(start.v_b_mps),
        euler_rad=euler_rad,
        w_ib_b_radps=w_b,
        spin_radps=rear,
    )


def _air(table: FlownTable, launch: Launch, rng: np.random.Generator) -> Air:
    """Return the air, its gusts along the way at the start, or along the nose."""
    wind, gusts = table.wind, table.gusts
    wind_mps = np.empty((len(wind.height_m), 2))
    wind_mps[:, 0], wind_mps[:, 1] = wind.north_mps, wind.east_mps
    steady = Air(present=table.air, wind_height_m=np.array(wind.height_m), wind_mps=wind_mps)
    if gusts is None:
        return steady
    nose_n = from_euler(*launch.euler_rad[:, None])[0][:, 0]
    gust_mps = dryden(
        rng,
        sigma_mps=gusts.sigma_mps,
        direction_n=launch.v_n_mps if launch.v_n_mps.any() else nose_n,
        length_m=gusts.length_m,
        scale_m=gusts.scale_m,
        interval_m=GUST_INTERVAL_M,
    )
    return replace(steady, gust_mps=gust_mps, gust_interval_m=GUST_INTERVAL_M)
