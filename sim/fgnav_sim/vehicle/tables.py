"""Format of a vehicle file: mass, motor, aerodynamic coefficients, canards, with every rule."""

import math
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import msgspec
import numpy as np

from fgnav.io.strict_toml import NotNegative, Positive, Table, Vector, as_table, read_toml
from fgnav.shipped import file_or_shipped
from fgnav.types.vehicle import FinnedVehicle

Column: TypeAlias = float | tuple[float, ...]  # one value for every Mach number, or one for each
RateTerms: TypeAlias = Literal["d/v", "d/2v"]
_Angle: TypeAlias = Annotated[float, msgspec.Meta(gt=0, lt=90)]


class BodyTable(Table, frozen=True):
    """The vehicle without propellant; stations count from the tail towards the nose."""

    mass_kg: Positive
    # axial, about +y_b, about +z_b, at the centre of mass
    inertia_kgm2: tuple[Positive, Positive, Positive]
    # elements xy, xz, yz of the inertia matrix, the sign included
    products_kgm2: Vector = (0.0, 0.0, 0.0)
    centre_m: float = 0.0  # station of the centre of mass

    def __post_init__(self) -> None:
        """Require the inertia of a body that can exist."""
        _check_inertia("inertia_kgm2", self.inertia_kgm2, self.products_kgm2)


class MotorTable(Table, frozen=True):
    """Propellant, and the thrust along +x_b that burns it at constant exhaust speed."""

    propellant_kg: Positive
    # of the whole vehicle before ignition, as ``body.inertia_kgm2``; in between it follows the
    # propellant left
    loaded_inertia_kgm2: tuple[Positive, Positive, Positive]
    loaded_centre_m: float
    # time_s, thrust_n: thrust, a monotone cubic between its points; none outside
    time_s: tuple[NotNegative, ...]
    thrust_n: tuple[NotNegative, ...]
    nozzle_m: float = 0.0  # station of the nozzle's exit, whose jet damps pitch and yaw

    def __post_init__(self) -> None:
        """Require a curve of thrust."""
        _check_inertia("loaded_inertia_kgm2", self.loaded_inertia_kgm2, (0.0, 0.0, 0.0))
        check_grid("time_s", self.time_s, least=2)
        check_length("thrust_n", self.thrust_n, "time_s", len(self.time_s))
        if not any(self.thrust_n):
            raise ValueError("thrust_n: must rise above zero")


class _Aerodynamics(Table, frozen=True, kw_only=True, tag_field="kind"):
    """Common keys of both sets of coefficients."""

    mach: tuple[NotNegative, ...] = (0.0,)  # of the columns; the ends hold outside
    rate_terms: RateTerms = "d/2v"  # by what the coefficients expect rates to be multiplied
    # station about which moments are given; the dry centre of mass where it is left out
    reference_m: float | None = None

    def __post_init__(self) -> None:
        """Require as many values as Mach numbers."""
        check_grid("mach", self.mach, least=1)
        for name in self.coefficients():
            value = getattr(self, name)
            if isinstance(value, tuple):
                check_length(name, value, "mach", len(self.mach))

    @classmethod
    def coefficients(cls) -> tuple[str, ...]:
        """Return the names of the coefficients, in the order of the compiled code."""
        return tuple(
            name
            for name in cls.__struct_fields__
            if name[0] == "c" and name not in ("chord_m", "coefficients")
        )


class Axisymmetric(_Aerodynamics, frozen=True, kw_only=True, tag="axisymmetric"):
    """Coefficients of a body of revolution, cubic splines of Mach (the paper's Eqs. 3-13)."""

    diameter_m: Positive  # reference length; the reference area is its circle
    # drag: cd0 + cd2 a^2 of the total angle of attack
    cd0: Column = 0.0
    cd2: Column = 0.0
    # lift: cl1 + cl3 a^2 per sine of the angle
    cl1: Column = 0.0
    cl3: Column = 0.0
    cnq: Column = 0.0  # pitch-damping force
    cmf: Column = 0.0  # Magnus force
    # overturning moment, stable below zero
    cm1: Column = 0.0
    cm3: Column = 0.0
    cmq: Column = 0.0  # pitch-damping moment
    cmm: Column = 0.0  # Magnus moment
    cspin: Column = 0.0  # spin-damping moment


class Airframe(_Aerodynamics, frozen=True, kw_only=True, tag="airframe"):
    """Derivatives of a fixed-wing-like body, cubic splines of Mach, linear in both flow angles."""

    area_m2: Positive
    span_m: Positive
    chord_m: Positive
    # drag: cd0 + cdk cl^2
    cd0: Column = 0.0
    cdk: Column = 0.0
    # lift and its slope, side force by sideslip
    cl0: Column = 0.0
    cla: Column = 0.0
    cyb: Column = 0.0
    # rolling, pitching, yawing moment
    clb: Column = 0.0
    clp: Column = 0.0
    clr: Column = 0.0
    cm0: Column = 0.0
    cma: Column = 0.0
    cmq: Column = 0.0
    cnb: Column = 0.0
    cnp: Column = 0.0
    cnr: Column = 0.0


class CanardsTable(Table, frozen=True):
    """Four canards, a quarter turn apart, on a forebody that rolls freely (Eqs. 14-15)."""

    area_m2: Positive  # Of one canard
    # station_m, arm_m: of the centre of pressure: from the tail, and off the axis
    station_m: float
    arm_m: Positive
    # axial inertia of the forebody, whose axes are then those of the body; 0: no bearing
    forebody_inertia_kgm2: NotNegative = 0.0
    bearing_nms: NotNegative = 0.0  # moment of the bearing per rate between both
    slope: Column = 3.0  # normal force per radian, by the Mach numbers of the aerodynamics
    first_deg: float = 0.0  # where the first one is, from +y_b towards +z_b
    # deflection_deg, rate_degps, lag_s: limits of deflection and rate, time constant of the
    # actuator
    deflection_deg: _Angle = 15.0
    rate_degps: Positive = 300.0
    lag_s: Positive = 0.01


class AutopilotTable(Table, frozen=True):
    """Dynamics by which canards bring the attitude to the commanded one."""

    # frequency_radps, damping: natural frequency and damping ratio of the attitude's error
    frequency_radps: Positive = 6.0
    damping: Positive = 0.8


class FinsTable(Table, frozen=True):
    """Angles between nose and air, as flights state them: see ``FinnedVehicle``."""

    sideslip_sigma_deg: Positive
    attack_sigma_deg: Positive
    half_life_s: Positive
    constant_share: Annotated[float, msgspec.Meta(gt=0, lt=1)]
    crossflow_sigma_mps: Positive
    wind_sigma_mps: Positive = 5.0

    def stated(self) -> FinnedVehicle:
        """Return the vehicle model of a flight."""
        return FinnedVehicle(
            sideslip_sigma_rad=math.radians(self.sideslip_sigma_deg),
            attack_sigma_rad=math.radians(self.attack_sigma_deg),
            half_life_s=self.half_life_s,
            constant_share=self.constant_share,
            wind_sigma_mps=self.wind_sigma_mps,
            crossflow_sigma_mps=self.crossflow_sigma_mps,
        )


class Vehicle(Table, frozen=True):
    """A vehicle: a body, and what of the rest it has."""

    body: BodyTable
    name: str = ""
    motor: MotorTable | None = None
    aerodynamics: Axisymmetric | Airframe | None = None
    canards: CanardsTable | None = None
    autopilot: AutopilotTable | None = None
    fins: FinsTable | None = None

    def __post_init__(self) -> None:
        """Check what one table cannot say."""
        if self.autopilot is not None and self.canards is None:
            raise ValueError("autopilot: needs a table [canards]")
        if self.canards is None:
            return
        if self.aerodynamics is None:
            raise ValueError("canards: need a table [aerodynamics]")
        slope = self.canards.slope
        if isinstance(slope, tuple):
            check_length("canards.slope", slope, "aerodynamics.mach", len(self.aerodynamics.mach))
        axial = [self.body.inertia_kgm2[0]]
        axial += [self.motor.loaded_inertia_kgm2[0]] if self.motor else []
        if self.canards.forebody_inertia_kgm2 >= min(axial):
            raise ValueError(
                "canards.forebody_inertia_kgm2: must be below the vehicle's axial "
                f"{min(axial):g}, got {self.canards.forebody_inertia_kgm2:g}"
            )
        if self.canards.station_m == self.body.centre_m:
            raise ValueError("canards.station_m: must differ from body.centre_m, to have a lever")


def load_vehicle(vehicle: Path | str) -> Vehicle:
    """Return a vehicle: a TOML file's, or that of a name that comes with the simulator.

    Raises
    ------
    BadInputError
        Naming the file and the first key that is unknown or breaks its rule.
    """
    path = file_or_shipped(vehicle, "fgnav_sim", "vehicles")
    table = as_table(path, read_toml(path), Vehicle)
    return table if table.name else msgspec.structs.replace(table, name=path.stem)


def check_grid(name: str, grid: tuple[float, ...], least: int) -> None:
    """Raise unless a grid has enough values that increase."""
    if len(grid) < least:
        raise ValueError(f"{name}: must hold {least} values or more, got {len(grid)}")
    for row in range(1, len(grid)):
        if grid[row] <= grid[row - 1]:
            raise ValueError(
                f"{name}: must increase, row {row} has {grid[row]:g} after {grid[row - 1]:g}"
            )


def check_length(name: str, column: tuple[float, ...], grid: str, length: int) -> None:
    """Raise unless a column has a value for each one of its grid."""
    if len(column) != length:
        raise ValueError(
            f"{name}: must hold {length} values, one for each of {grid}, got {len(column)}"
        )


def _check_inertia(name: str, inertia: Vector, products: Vector) -> None:
    """Raise unless the principal moments are positive and obey the triangle inequality."""
    (xx, yy, zz), (xy, xz, yz) = inertia, products
    a, b, c = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not (a > 0 and c <= (a + b) * (1 + 1e-9)):
        raise ValueError(
            f"{name}: no body has the principal moments {a:g}, {b:g}, {c:g}; "
            "the largest must not exceed the sum of the others"
        )
