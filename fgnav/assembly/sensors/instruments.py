"""Sensors beside the antennas of GNSS at keyframes, and the constants that they bring with them."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fgnav.assembly.sensors.directional import gravity, sight
from fgnav.assembly.sensors.gnss import baselines
from fgnav.assembly.sensors.standstill import Standing
from fgnav.assembly.sensors.surroundings import heights, magnetic_field
from fgnav.assembly.sensors.vehicle import airflow, resting_rates, wheels
from fgnav.assembly.stages import Aligned, Tracked, approximate_motion
from fgnav.checks import FloatArray, Unused
from fgnav.graph.factors.directions import Directions
from fgnav.graph.factors.gravity import Gravity
from fgnav.graph.factors.line_of_sight import LANDMARK, LineOfSight
from fgnav.graph.factors.vehicle.standstill import Standstill
from fgnav.graph.types.parameters import Parameter
from fgnav.graph.types.sensor import Sensor
from fgnav.types.flight import Flight
from fgnav.types.vehicle import FinnedVehicle, WheeledVehicle


class Instrument(NamedTuple):
    """Measurements of one instrument at keyframes, if any."""

    sensor: Sensor | None = None
    constants: tuple[Parameter, ...] = ()
    unused: tuple[Unused, ...] = ()


class Instruments(NamedTuple):
    """Measurements of all instruments."""

    sensors: tuple[Sensor, ...]
    constants: tuple[Parameter, ...]
    unused: tuple[Unused, ...]

    @property
    def is_landmark_seen(self) -> bool:
        """True if there is a line of sight."""
        return any(LANDMARK in sensor.parameters for sensor in self.sensors)


def instruments(flight: Flight, stage: Aligned, track: Tracked, stands: Standing) -> Instruments:
    """Build the instruments' measurements at keyframes, (n,).

    Parameters
    ----------
    flight : Flight
    stage : Aligned
    track : Tracked
    stands : Standing
        When the body stands still.
    """
    every = tuple(_each(flight, stage, track, stands))
    return Instruments(
        tuple(one.sensor for one in every if one.sensor is not None and len(one.sensor.row)),
        tuple(constant for one in every for constant in one.constants),
        tuple(loss for one in every for loss in one.unused),
    )


def _each(flight: Flight, stage: Aligned, track: Tracked, stands: Standing) -> Iterator[Instrument]:
    imu, t_s, causal = stage.record.imu, track.t_s, stage.causal
    rates, earth = stage.rates if stage.gyroscope else None, flight.origin.earth_rate_n_radps
    between, unused = baselines(flight, t_s)
    yield from (Instrument(one) for one in between)
    yield Instrument(unused=unused)
    down, unused = gravity(stage.down, t_s, causal=causal)
    sensor = None if down is None else gravity_sensor(down, track.gravity_n_mps2)
    yield Instrument(sensor, (), unused)
    seen, unused = sight(flight.photodetector, imu, t_s, track.places_n_m, causal=causal)
    yield Instrument(None if seen is None else line_of_sight(seen), (), unused)
    yield Instrument(*heights(flight, imu, t_s, track.places_n_m, causal=causal))
    yield Instrument(*magnetic_field(flight.magnetometer, t_s, causal=causal))
    vehicle = flight.vehicle
    if isinstance(vehicle, WheeledVehicle):
        yield Instrument(*wheels(vehicle, imu, t_s, rates, earth))
    if isinstance(vehicle, FinnedVehicle):
        v_n_mps = approximate_motion(stage, track, stage.start.R_nb)[1]
        yield Instrument(*airflow(vehicle, t_s, v_n_mps))
    if flight.standstill:
        yield Instrument(Standstill(row=stands.row, sigma_mps=stands.sigma_mps))
    if isinstance(vehicle, WheeledVehicle):
        yield Instrument(resting_rates(imu, stands, earth))


def gravity_sensor(down: Directions, gravity_n_mps2: FloatArray) -> Gravity:
    """Return directions of gravity, whose vectors in ``n`` at keyframes, (n, 3), are known."""
    down_n = gravity_n_mps2[down.row]
    known_n = down_n / np.linalg.norm(down_n, axis=1, keepdims=True)
    return Gravity(row=down.row, known_n=known_n, across_b=down.across_b[down.row])


def line_of_sight(seen: Directions) -> LineOfSight:
    """Return directions to a landmark."""
    return LineOfSight(row=seen.row, across_b=seen.across_b[seen.row])
