"""Vehicle, air and commands as the arrays of the compiled code."""

from typing import TYPE_CHECKING

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry import earth
from fgnav_sim.vehicle.atmosphere import GUST_INTERVAL_M, us_1976, vacuum
from fgnav_sim.vehicle.flown_table import AttitudeTable, FlownTable
from fgnav_sim.vehicle.forces import AERODYNAMICS, BODY, CANARD, COEFFICIENTS, GRAVITY, Model
from fgnav_sim.vehicle.planet import WGS84, Planet
from fgnav_sim.vehicle.tables import Axisymmetric, CanardsTable, Column, MotorTable, Vehicle

if TYPE_CHECKING:
    from scipy.interpolate import PchipInterpolator

_COMMAND_INTERVAL_S = 0.05  # cubics between: a sine of 1 rad/s is within 2e-8 of its amplitude
NO_GUST = np.zeros((1, 3))


def pack(
    vehicle: Vehicle, table: FlownTable, duration_s: float, gust_mps: FloatArray = NO_GUST
) -> Model:
    """Return the arrays of a flight of a vehicle."""
    wind, body = table.wind, np.zeros(1, BODY)[0]
    wind_mps = np.empty((len(wind.height_m), 2))
    wind_mps[:, 0], wind_mps[:, 1] = wind.north_mps, wind.east_mps
    _write_body(body, vehicle)
    _write_field(body, table.gravity or "wgs84-normal", table.earth or WGS84)
    parts = {
        "mach": _coefficients(vehicle),
        "burn": _burn(vehicle.motor),
        "wind": (np.array(wind.height_m), wind_mps),
        "gust": (gust_mps,),
        "command": (_command_table(table.attitude, duration_s),),
    }
    return Model(body=body, tables=_joined(body, parts), air=us_1976() if table.air else vacuum())


def _joined(body: np.void, parts: dict[str, tuple[FloatArray, ...]]) -> FloatArray:
    """Return all tables as one flat array; write where each starts, and its number of rows."""
    flat: list[FloatArray] = []
    start = 0
    for name, table_parts in parts.items():
        body[name], body[f"{name}s"] = start, len(table_parts[0])
        flat += [table.ravel() for table in table_parts]
        start += sum(table.size for table in table_parts)
    return np.concatenate(flat)


def _write_field(body: np.void, gravity: str, planet: Planet) -> None:
    """Write the scalars of gravity and of the planet."""
    a, b = planet.semi_major_axis_m, planet.semi_minor_axis_m
    body["gravity"] = GRAVITY.index(gravity)
    body["axis_m"], body["polar_m"] = a, b
    body["e2"], body["bulge_m"] = 1 - (b / a) ** 2, (a**2 - b**2) / b
    body["earth_radps"], body["gm_m3ps2"] = planet.rate_radps, planet.gm_m3ps2
    body["oblateness_m2"] = 1.5 * earth.J2 * a**2 if gravity == "j2" else 0.0


def _write_body(body: np.void, vehicle: Vehicle) -> None:
    """Write the scalars of the vehicle."""
    dry, motor = vehicle.body, vehicle.motor
    body["dry_kg"], body["dry_centre_m"] = dry.mass_kg, dry.centre_m
    body["dry_kgm2"] = (*dry.inertia_kgm2, *dry.products_kgm2)
    body["loaded_kgm2"], body["loaded_centre_m"] = body["dry_kgm2"], dry.centre_m
    if motor is not None:
        body["propellant_kg"], body["nozzle_m"] = motor.propellant_kg, motor.nozzle_m
        body["loaded_kgm2"] = (*motor.loaded_inertia_kgm2, *dry.products_kgm2)
        body["loaded_centre_m"] = motor.loaded_centre_m
    shape = vehicle.aerodynamics
    if isinstance(shape, Axisymmetric):
        body["aerodynamics"] = AERODYNAMICS.index("axisymmetric")
        body["area_m2"] = np.pi / 4 * shape.diameter_m**2
        body["length_m"] = body["span_m"] = shape.diameter_m
    elif shape is not None:
        body["aerodynamics"] = AERODYNAMICS.index("airframe")
        body["area_m2"], body["span_m"] = shape.area_m2, shape.span_m
        body["length_m"] = shape.chord_m
    if shape is not None:
        body["rate_factor"] = 1.0 if shape.rate_terms == "d/v" else 0.5
        body["reference_m"] = dry.centre_m if shape.reference_m is None else shape.reference_m
    body["gust_interval_m"], body["command_interval_s"] = GUST_INTERVAL_M, _COMMAND_INTERVAL_S
    body["lag_s"] = 1.0
    if vehicle.canards is not None:
        _add_canards(body, vehicle.canards)
    if vehicle.autopilot is not None:
        body["frequency_radps"] = vehicle.autopilot.frequency_radps
        body["damping"] = vehicle.autopilot.damping


def _add_canards(body: np.void, canards: CanardsTable) -> None:
    """Write the scalars of the canards."""
    body["fore_kgm2"], body["bearing_nms"] = canards.forebody_inertia_kgm2, canards.bearing_nms
    body["canard_m2"], body["canard_arm_m"] = canards.area_m2, canards.arm_m
    body["canard_station_m"] = canards.station_m
    body["canard_clock_rad"] = np.radians(canards.first_deg)
    body["deflection_rad"] = np.radians(canards.deflection_deg)
    body["rate_radps"], body["lag_s"] = np.radians(canards.rate_degps), canards.lag_s


def _coefficients(vehicle: Vehicle) -> tuple[FloatArray, FloatArray]:
    """Return the grid of Mach, (m,), and all coefficients as cubics, (m - 1, 4, COEFFICIENTS)."""
    from scipy.interpolate import CubicSpline  # noqa: PLC0415  # lazy: keeps the command line quick

    shape = vehicle.aerodynamics
    columns: dict[int, Column] = {}
    if shape is not None:
        columns = {index: getattr(shape, name) for index, name in enumerate(shape.coefficients())}
    if vehicle.canards is not None:
        columns[CANARD] = vehicle.canards.slope
    mach = np.array(shape.mach if shape is not None else (0.0,))
    values = np.zeros((len(mach), COEFFICIENTS))
    for index, column in columns.items():
        values[:, index] = column
    if len(mach) == 1:
        table = np.zeros((1, 4, COEFFICIENTS))
        table[0, 3] = values[0]
        return np.array([mach[0], mach[0] + 1.0]), table
    return mach, CubicSpline(mach, values).c.swapaxes(0, 1)


def burning_curve(motor: MotorTable) -> "PchipInterpolator":
    """Return thrust, N, as a monotone cubic of time."""
    from scipy.interpolate import PchipInterpolator  # noqa: PLC0415  # lazy, as above

    return PchipInterpolator(motor.time_s, motor.thrust_n)


def _burn(motor: MotorTable | None) -> tuple[FloatArray, FloatArray]:
    """Return times, (k,), and thrust and fraction burnt as quartics, (k - 1, 5, 2)."""
    if motor is None:
        return np.array([0.0, 1.0]), np.zeros((1, 5, 2))
    thrust = burning_curve(motor)
    impulse = thrust.antiderivative()
    table = np.zeros((len(motor.time_s) - 1, 5, 2))
    table[:, 1:, 0] = thrust.c.T
    table[:, :, 1] = impulse.c.T / impulse(motor.time_s[-1])
    return np.array(motor.time_s), table


def _command_table(attitude: AttitudeTable | None, duration_s: float) -> FloatArray:
    """Return roll, pitch, yaw and their rates at equal intervals, (c, 6); zeros of no command."""
    if attitude is None:
        return np.zeros((2, 6))
    t_s = np.arange(int(np.ceil(duration_s / _COMMAND_INTERVAL_S)) + 2) * _COMMAND_INTERVAL_S
    angles = [command(t_s) for command in (attitude.roll, attitude.pitch, attitude.yaw)]
    return np.column_stack([angle[0] for angle in angles] + [angle[1] for angle in angles])
