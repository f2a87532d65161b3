"""Flights of rigid bodies in six degrees of freedom."""

from dataclasses import dataclass

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import quaternion_wxyz, skew
from fgnav_sim.vehicle.flown_table import FlownTable, StartTable
from fgnav_sim.vehicle.forces import SIZE, SPIN, P, Q, V, W
from fgnav_sim.vehicle.model import NO_GUST, pack
from fgnav_sim.vehicle.planet import WGS84, Planet
from fgnav_sim.vehicle.rigid_body_kernel import fly, rates
from fgnav_sim.vehicle.tables import Vehicle

ROW_INTERVAL_S = 0.01  # quintics in between are within 1e-9 of the attitude at 5 turns a second


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Flown:
    """A flight above the ground in the inertial frame ``i``: the Earth's axes at ``t_s = 0``."""

    t_s: FloatArray  # (m,)
    y: FloatArray  # (m, 19); states of the compiled code
    dy: FloatArray  # (m, 19); their time derivatives
    vehicle: Vehicle
    planet: Planet = WGS84


def fly_body(
    table: FlownTable,
    origin: Origin,
    duration_s: float,
    *,
    gust_mps: FloatArray = NO_GUST,
    row_interval_s: float = ROW_INTERVAL_S,
) -> Flown:
    """Integrate a flight with fixed fourth-order Runge-Kutta steps, until it meets the ground.

    Parameters
    ----------
    table : FlownTable
        Its vehicle loaded; canards rest where it commands no attitude.
    origin : Origin
        Of the frame ``n`` that its start is in.
    gust_mps : ndarray, shape (g, 3)
        North, east, down, every ``GUST_INTERVAL_M`` of the distance flown through the air.
    row_interval_s : float
        Between the rows that are kept; a longer step of integration takes its place.

    Raises
    ------
    BadInputError
        If the step is too long: the canards or the integration diverge.
    """
    vehicle, step_s = _as_flown(table), table.step_s
    at_work = vehicle.canards if vehicle.autopilot is not None else None
    if at_work is not None and step_s > 2.0 * at_work.lag_s:  # RK4 is stable up to 2.8
        raise BadInputError(
            f"step_s: must be at most twice the canards' lag_s {at_work.lag_s:g}, "
            f"got {step_s:g}; take a shorter step"
        )
    interval_s, planet = max(row_interval_s, step_s), table.earth or WGS84
    t_s = np.arange(int(duration_s / interval_s + 1e-9) + 1) * interval_s
    steps = int(np.ceil(interval_s / step_s - 1e-9))
    model = pack(vehicle, table, t_s[-1], gust_mps)
    y = np.empty((len(t_s), SIZE))
    y[0] = _first_state(table.start, origin, planet)
    count = fly(model, interval_s / steps, steps, table.ground_m, y)
    if count < 0:
        raise BadInputError(
            f"step_s: the integration diverges with {step_s:g} before "
            f"t_s = {t_s[-count]:g}; take a shorter step"
        )
    t_s, y = t_s[:count], y[:count]
    dy = np.empty_like(y)
    rates(model, t_s, y, dy)
    return Flown(t_s=t_s, y=y, dy=dy, vehicle=vehicle, planet=planet)


def _as_flown(table: FlownTable) -> Vehicle:
    """Return the vehicle lit at its time; canards that are told nothing rest."""
    if isinstance(table.vehicle, str):
        raise BadInputError(f"vehicle: '{table.vehicle}' must be loaded; use load_scenario")
    changes: dict[str, object] = {}
    if table.attitude is None:
        changes["autopilot"] = None
    motor = table.vehicle.motor
    if motor is not None:
        time_s = tuple(table.ignition_s + t_s for t_s in motor.time_s)
        changes["motor"] = msgspec.structs.replace(motor, time_s=time_s)
    return msgspec.structs.replace(table.vehicle, **changes)


def _first_state(start: StartTable, origin: Origin, planet: Planet) -> FloatArray:
    """Return the state of the compiled code, (SIZE,), its rates against inertial space."""
    R_nb, R_in, y = start.R_nb, origin.R_ne.T, np.zeros(SIZE)
    w_b, rear = np.radians(start.rate_b_degps), float(np.radians(start.rear_spin_degps))
    if start.rate_against == "earth":
        earth_b = R_nb.T @ origin.R_ne @ planet.rate_i_radps
        w_b, rear = w_b + earth_b, rear + float(earth_b[0])
    y[P : P + 3] = planet.p_e_m(origin) + R_in @ np.array(start.position_n_m)
    y[V : V + 3] = R_in @ start.velocity_n_mps + np.cross(planet.rate_i_radps, y[P : P + 3])
    y[Q : Q + 4] = quaternion_wxyz((R_in @ R_nb)[None])[0]
    y[W : W + 3], y[SPIN] = w_b, rear
    return y


def rotations_of(wxyz: FloatArray) -> FloatArray:
    """Return (m, 3, 3) rotations of quaternions, (m, 4)."""
    w, v = wxyz[:, 0, None, None], wxyz[:, 1:]
    K = skew(v)
    norm = np.sum(wxyz**2, axis=1)[:, None, None]
    return np.asarray(np.eye(3) + 2 * (w * K + K @ K) / norm)
