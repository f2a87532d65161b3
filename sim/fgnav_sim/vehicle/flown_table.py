"""Format of a scenario that a rigid body flies."""

from typing import Annotated, Literal

import msgspec
import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import from_euler
from fgnav.io.strict_toml import Positive, Table, Vector
from fgnav_sim.motion import Command, Hold
from fgnav_sim.vehicle.atmosphere import FLOOR_M
from fgnav_sim.vehicle.planet import FieldModel, Planet
from fgnav_sim.vehicle.tables import Column, Vehicle, check_grid, check_length


class StartTable(Table, frozen=True):
    """Start of the flight."""

    position_n_m: Vector = (0.0, 0.0, 0.0)  # of the centre of mass, from the scenario's origin
    # v_n_mps, v_b_mps: velocity against the Earth: the sum of a part in the frame ``n`` and one in
    # body axes
    v_n_mps: Vector = (0.0, 0.0, 0.0)
    v_b_mps: Vector = (0.0, 0.0, 0.0)
    euler_deg: Vector = (0.0, 0.0, 0.0)  # roll, pitch, yaw against the frame ``n``
    rate_b_degps: Vector = (0.0, 0.0, 0.0)  # angular rate in body axes
    rate_against: Literal["earth", "inertial"] = "earth"  # what the rate is counted from
    rear_spin_degps: float = 0.0  # of a decoupled rear body about +x_b, counted as the rate is

    @property
    def R_nb(self) -> FloatArray:
        """Attitude, (3, 3)."""
        return np.asarray(from_euler(*np.radians(self.euler_deg)[:, None])[0])

    @property
    def velocity_n_mps(self) -> FloatArray:
        """Velocity against the Earth, (3,)."""
        return np.asarray(np.array(self.v_n_mps) + self.R_nb @ np.array(self.v_b_mps))


class AttitudeTable(Table, frozen=True):
    """Euler angles that the autopilot holds, against north, east, down where the body is."""

    roll: Command = Hold()
    pitch: Command = Hold()
    yaw: Command = Hold()


class WindTable(Table, frozen=True):
    """Motion of the air by ellipsoidal height: linear in between, constant outside."""

    height_m: tuple[float, ...] = (0.0,)
    # north_mps, east_mps: one value for every height, or one for each
    north_mps: Column = 0.0
    east_mps: Column = 0.0

    def __post_init__(self) -> None:
        """Require heights that increase, and a value for each."""
        if not self.height_m:
            raise ValueError("height_m: must hold one height or more")
        check_grid("height_m", self.height_m, least=1)
        for name, value in (("north_mps", self.north_mps), ("east_mps", self.east_mps)):
            if isinstance(value, tuple):
                check_length(name, value, "height_m", len(self.height_m))


class GustsTable(Table, frozen=True):
    """Dryden turbulence along the path: see ``atmosphere.dryden``."""

    sigma_mps: Positive  # of each component
    scale_m: Positive = 533.4  # of turbulence
    # distance through the air that is covered; beyond it the last gust stays
    length_m: Annotated[float, msgspec.Meta(gt=0, le=1e7)] = 20_000.0


class FlownTable(Table, frozen=True):
    """A rigid body in six degrees of freedom, in place of a commanded motion.

    The body's origin, from which lever arms count, is the vehicle's dry centre of mass.
    """

    vehicle: str | Vehicle  # a vehicle's file, relative to the scenario's, or its tables
    start: StartTable = StartTable()
    attitude: AttitudeTable | None = None  # none: canards rest
    # when the motor's curve of thrust begins; below zero it has burnt for so long, or burnt out
    ignition_s: float = 0.0
    air: bool = True  # standard atmosphere, or vacuum
    wind: WindTable = WindTable()
    gusts: GustsTable | None = None
    gravity: FieldModel | None = None  # none: that of the scenario
    earth: Planet | None = None  # for check cases: rounder, or at rest
    # ellipsoidal height at which the flight ends
    ground_m: Annotated[float, msgspec.Meta(ge=FLOOR_M)] = FLOOR_M
    step_s: Positive = 1e-3  # of the integration, at most

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        if isinstance(self.vehicle, Vehicle) and self.attitude and not self.vehicle.autopilot:
            raise ValueError("attitude: needs a vehicle with a table [autopilot]")
        if self.gusts is not None and not self.air:
            raise ValueError("gusts: need air = true")
