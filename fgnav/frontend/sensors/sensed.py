"""What instruments beside the antennas measured at keyframes."""

from dataclasses import dataclass

from fgnav.checks import FloatArray, Loss
from fgnav.frontend.sensors.aerodynamics import Airflow, airflow
from fgnav.frontend.sensors.baselines import BaselineRows, baselines
from fgnav.frontend.sensors.directional import gravity, sight
from fgnav.frontend.sensors.resting_rates import RestingRates
from fgnav.frontend.sensors.standstill import Standing
from fgnav.frontend.sensors.surroundings import Heights, MagneticField, heights, magnetic_field
from fgnav.frontend.sensors.wheels import Wheels, wheels
from fgnav.graph.factors.directions import Directions
from fgnav.graph.types.constants import FlightConstant
from fgnav.gravity import GravityDirection
from fgnav.types.flight import Flight, Imu
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Sensed:
    """Measurements at keyframes, each None where the flight has no such instrument."""

    baselines: tuple[BaselineRows, ...] = ()
    sight: Directions | None = None  # from the accelerometer to the landmark
    gravity: Directions | None = None
    heights: Heights | None = None
    field: MagneticField | None = None
    wheels: Wheels | None = None
    airflow: Airflow | None = None
    standing: Standing | None = None
    resting: RestingRates | None = None
    losses: tuple[Loss, ...] = ()

    @property
    def constants(self) -> tuple[FlightConstant, ...]:
        """What the instruments bring with them to be estimated: offset, hard iron, wheels, wind."""
        offset = () if self.heights is None else (self.heights.offset,)
        iron = () if self.field is None else (self.field.iron,)
        wheels = () if self.wheels is None else (self.wheels.axes, self.wheels.axle)
        air = () if self.airflow is None else (self.airflow.wind, self.airflow.mean)
        return (*offset, *iron, *wheels, *air)


def sense(
    flight: Flight,
    imu: Imu,
    direction: GravityDirection | None,
    t_s: FloatArray,
    p_n_m: FloatArray,
    v_n_mps: FloatArray,
    *,
    causal: bool = False,
) -> Sensed:
    """Return what the instruments of a flight measure at keyframes, (n,).

    Parameters
    ----------
    flight : Flight
    imu : Imu
    direction : GravityDirection or None
        Of a gravity estimator.
    t_s : ndarray, shape (n,)
    p_n_m, v_n_mps : ndarray, shape (n, 3)
        Approximate places and velocities of keyframes.
    causal : bool
        Whether each keyframe may have samples up to it alone.
    """
    between, baseline_losses = baselines(flight, t_s)
    seen, sight_losses = sight(flight.photodetector, imu, t_s, p_n_m, causal=causal)
    down, gravity_losses = gravity(direction, t_s, causal=causal)
    high, height_losses = heights(flight, imu, t_s, p_n_m, causal=causal)
    vehicle = flight.vehicle
    field, field_losses = magnetic_field(flight.magnetometer, t_s, causal=causal)
    return Sensed(
        baselines=between,
        sight=seen,
        gravity=down,
        heights=high,
        field=field,
        wheels=wheels(vehicle, imu, t_s) if isinstance(vehicle, WheeledVehicle) else None,
        airflow=airflow(vehicle, t_s, v_n_mps) if isinstance(vehicle, FinnedVehicle) else None,
        losses=(*baseline_losses, *sight_losses, *gravity_losses, *height_losses, *field_losses),
    )
