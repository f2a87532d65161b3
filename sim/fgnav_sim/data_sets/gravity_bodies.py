"""Flights of rigid bodies for learning gravity: each a kind of flight, drawn from a world."""

from collections.abc import Callable
from functools import cache

import msgspec
import numpy as np

from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.motion import Command, Rate, Sine
from fgnav_sim.ranges import Draw
from fgnav_sim.vehicle.flown_table import (
    AttitudeTable,
    FlownTable,
    GustsTable,
    StartTable,
    WindTable,
)
from fgnav_sim.vehicle.tables import Column, MotorTable, Vehicle, load_vehicle

_BURNT_OUT_S = -60.0  # ignition; longer ago than any shipped motor burns
_STEP_S = 2e-3  # of the integration; five to a row of 10 ms
_WIND_HEIGHTS_M = (0.0, 3000.0)
_CALMER = 1 / 3  # wind and gusts of a glider by those of a rocket
# Thrust of a motorised glider by its weight: 0.06 holds the height, 0.3 climbs at 15 degrees.
_GLIDER_THRUST = (0.05, 0.35)
_LIFT, _MOMENT = ("cl0", "cl1", "cl3", "cla", "cyb"), ("cm1", "cm3", "cma", "cmq", "clp", "cnb")


def _rocket(world: GravityWorld, draw: Draw) -> FlownTable:
    """Return a rocket with fins from its rail, or after burnout at any slope; canards rest."""
    ranges, vehicle = world.bodies, _varied("rocket", world, draw)
    if draw((0, 1)) < 0.5:  # one body, without the forebody that rolls freely
        vehicle = msgspec.structs.replace(vehicle, canards=None, autopilot=None)
    boosts = draw((0, 1)) < 0.5
    speed = draw(ranges.rail_mps if boosts else ranges.coast_mps)
    pitch = draw((50.0, 89.0) if boosts else (-60.0, 89.0))
    spin = draw(ranges.spin_degps) if draw((0, 1)) < 0.5 else 0.0
    flown = FlownTable(
        vehicle=vehicle,
        start=_start(world, draw, speed, pitch, 180.0, spin),
        ignition_s=0.0 if boosts else _BURNT_OUT_S,
        step_s=_STEP_S,
    )
    return _in_air(flown, world, draw)


def _guided(world: GravityWorld, draw: Draw) -> FlownTable:
    """Return a rocket from its rail or after burnout, its attitude commanded by canards."""
    boosts = draw((0, 1)) < 0.5
    pitch, yaw = draw((45.0, 85.0) if boosts else (10.0, 85.0)), draw((-180.0, 180.0))
    speed = draw(world.bodies.rail_mps if boosts else (120.0, world.bodies.coast_mps[1]))
    roll = draw((-180.0, 180.0))
    start = _start(world, draw, speed, pitch, 0.0, 0.0)
    start = msgspec.structs.replace(
        start,
        euler_deg=(roll, pitch, yaw),
        rate_b_degps=(0.0, 0.0, 0.0),
        rear_spin_degps=0.0 if boosts else draw(world.bodies.spin_degps),
    )
    rolls, pitches = draw((0, 1)) < 0.3, draw((0, 1)) < 0.5
    flown = FlownTable(
        vehicle=_varied("rocket", world, draw),
        start=start,
        ignition_s=0.0 if boosts else _BURNT_OUT_S,
        attitude=AttitudeTable(
            roll=Rate(rate_degps=draw((-120.0, 120.0)), start_deg=roll)
            if rolls
            else _swing(world, draw, roll, 6.0),
            pitch=Rate(rate_degps=draw((-5.0, 0.0)), start_deg=pitch + draw((-3.0, 3.0)))
            if pitches
            else _swing(world, draw, pitch - draw((0.0, 4.0))),
            yaw=_swing(world, draw, yaw + draw((-2.0, 2.0))),
        ),
        step_s=_STEP_S,
    )
    return _in_air(flown, world, draw)


def _glider(world: GravityWorld, draw: Draw) -> FlownTable:
    """Return a glider off its trim, half of them with a motor that climbs or holds the height."""
    vehicle = _varied("glider", world, draw)
    if draw((0, 1)) < 0.5:
        body = vehicle.body
        thrust = 9.81 * body.mass_kg * draw(_GLIDER_THRUST)
        motor = MotorTable(
            propellant_kg=1e-3 * body.mass_kg,
            loaded_inertia_kgm2=body.inertia_kgm2,
            loaded_centre_m=body.centre_m,
            time_s=(0.0, 0.5, 1e4),
            thrust_n=(0.0, thrust, thrust),
        )
        vehicle = msgspec.structs.replace(vehicle, motor=motor)
    flown = FlownTable(
        vehicle=vehicle,
        start=_start(world, draw, draw(world.bodies.glide_mps), draw((-35.0, 15.0)), 45.0, 0.0),
        step_s=_STEP_S,
    )
    return _in_air(flown, world, draw, _CALMER)


def _vacuum(world: GravityWorld, draw: Draw) -> FlownTable:
    """Return a body that tumbles without air."""
    spin = draw(world.bodies.spin_degps) * draw((0, 1)) ** 2
    pitch, speed = draw((-89.0, 89.0)), draw(world.bodies.coast_mps)
    return FlownTable(
        vehicle=load_vehicle("rigid_body"),
        start=_start(world, draw, speed, pitch, 180.0, spin),
        step_s=_STEP_S,
        air=False,
    )


def _start(
    world: GravityWorld, draw: Draw, speed: float, pitch: float, bank: float, spin: float
) -> StartTable:
    """Return a start along the nose, its bank up to a limit, its spin either way."""
    across = world.bodies.tumble_degps[1]
    return StartTable(
        v_b_mps=(speed, 0.0, 0.0),
        euler_deg=(draw((-bank, bank)), pitch, draw((-180.0, 180.0))),
        rate_b_degps=(
            float(np.sign(draw((-1.0, 1.0)))) * (spin + draw(world.bodies.tumble_degps)),
            draw((-across, across)),
            draw((-across, across)),
        ),
    )


def _in_air(flown: FlownTable, world: GravityWorld, draw: Draw, share: float = 1.0) -> FlownTable:
    """Return a flight in wind, from two directions at two heights, and gusts."""
    limits = (world.bodies.wind_mps, world.bodies.wind_aloft_mps)
    size = np.array([share * draw(limit) for limit in limits])
    angle = np.array([draw((-np.pi, np.pi)) for _ in _WIND_HEIGHTS_M])
    wind = WindTable(
        height_m=_WIND_HEIGHTS_M,
        north_mps=tuple((size * np.cos(angle)).tolist()),
        east_mps=tuple((size * np.sin(angle)).tolist()),
    )
    gusts = GustsTable(sigma_mps=share * draw(world.bodies.gusts_mps))
    return msgspec.structs.replace(flown, wind=wind, gusts=gusts)


def _swing(world: GravityWorld, draw: Draw, middle_deg: float, times: float = 1.0) -> Command:
    return Sine(
        amplitude_deg=times * draw(world.bodies.swing_deg),
        rate_radps=draw(world.bodies.swing_radps),
        phase_deg=draw((0.0, 360.0)),
        offset_deg=middle_deg,
    )


_shipped = cache(load_vehicle)


def _varied(name: str, world: GravityWorld, draw: Draw) -> Vehicle:
    """Return a shipped vehicle with figures multiplied by what is drawn for each group."""
    ranges, vehicle = world.bodies, _shipped(name)
    mass, thrust = draw(ranges.mass), draw(ranges.thrust)
    body = msgspec.structs.replace(
        vehicle.body,
        mass_kg=mass * vehicle.body.mass_kg,
        inertia_kgm2=tuple(mass * x for x in vehicle.body.inertia_kgm2),
    )
    motor, shape, canards = vehicle.motor, vehicle.aerodynamics, vehicle.canards
    if motor is not None:
        motor = msgspec.structs.replace(
            motor,
            propellant_kg=mass * motor.propellant_kg,
            loaded_inertia_kgm2=tuple(mass * x for x in motor.loaded_inertia_kgm2),
            thrust_n=tuple(thrust * x for x in motor.thrust_n),
        )
    if canards is not None:
        canards = msgspec.structs.replace(
            canards, forebody_inertia_kgm2=mass * canards.forebody_inertia_kgm2
        )
    groups = {("cd0", "cd2", "cdk"): ranges.drag, _LIFT: ranges.lift, _MOMENT: ranges.moment}
    if shape is not None:
        changes = {
            field: _times(draw(limits), getattr(shape, field))
            for fields, limits in groups.items()
            for field in fields
            if hasattr(shape, field)
        }
        shape = msgspec.structs.replace(shape, **changes)
    return msgspec.structs.replace(
        vehicle, body=body, motor=motor, aerodynamics=shape, canards=canards
    )


def _times(factor: float, column: Column) -> Column:
    if isinstance(column, tuple):
        return tuple(factor * value for value in column)
    return factor * column


BODIES: dict[str, Callable[[GravityWorld, Draw], FlownTable]] = {
    "rocket": _rocket,
    "guided": _guided,
    "glider": _glider,
    "vacuum": _vacuum,
}
