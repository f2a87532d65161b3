"""Format of a scenario file, with every default and rule."""

import math
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

import msgspec
import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import GravityModel
from fgnav.io.gps_time import GPS_EPOCH
from fgnav.io.strict_toml import NotNegative, Positive, Table, Vector, as_table, read_toml
from fgnav.shipped import file_or_shipped
from fgnav_sim.dispersions import check_spreads
from fgnav_sim.gnss.tables import (
    BaselineTable,
    GnssTable,
    Height,
    Latitude,
    Longitude,
    Point,
    SpanTable,
    check_names,
)
from fgnav_sim.motion import Motion, Trajectory
from fgnav_sim.sensors.surroundings_tables import BarometerTable, MagnetometerTable
from fgnav_sim.vehicle.flown_table import FlownTable
from fgnav_sim.vehicle.planet import WGS84
from fgnav_sim.vehicle.tables import Vehicle, load_vehicle

if TYPE_CHECKING:  # a file's table; in a program anything that knows the motion
    AnyMotion: TypeAlias = Trajectory
else:
    AnyMotion = Motion

# The source paper's array (its section 2.3.2): reference at the origin, two beside it, nose, tail,
# three near the fins.
PAPER_ANTENNAS_B_M: tuple[Vector, ...] = (
    (0.0, 0.0, 0.0),
    (0.0, 0.1, 0.0),
    (0.0, -0.1, 0.0),
    (1.0, 0.0, 0.0),
    (-1.0, 0.0, 0.0),
    (-0.8, 0.1, 0.1),
    (-0.8, -0.1, 0.1),
    (-0.8, 0.0, -0.1),
)
_GPS_EPOCH: datetime = GPS_EPOCH.item()  # GPS time has no time zone
_ON_EARTH = ("gnss", "imu", "photodetector", "barometer")  # sensors that know the WGS-84 Earth
_LONGEST_S = 7 * 86400.0  # a flight stays within what week numbers and double precision carry


class Place(Point, frozen=True):
    """A point; Madrid where nothing is said."""

    latitude_deg: Latitude = 40.33
    longitude_deg: Longitude = -3.88
    height_m: Height = 700.0


class ImuTable(Table, frozen=True):
    """Accelerometer triad, and a gyroscope where its three figures are given."""

    rate_hz: Positive = 100.0
    position_b_m: Vector = (0.0, 0.0, 0.0)
    # as in the flight format: noise density, 1-sigma of the constant bias, its random walk
    accelerometer_noise_mps2_per_sqrt_hz: Positive = 1e-3
    accelerometer_bias_mps2: Positive = 3e-2
    accelerometer_bias_walk_mps2_per_sqrt_s: Positive = 1e-4
    # B of flicker noise: an Allan deviation of ``0.664 B`` at any averaging time
    accelerometer_bias_instability_mps2: NotNegative = 0.0
    accelerometer_scale: NotNegative = 0.0  # 1-sigma of scale factors against 1
    accelerometer_misalignment_rad: NotNegative = 0.0  # 1-sigma of the angles between axes
    accelerometer_range_mps2: Positive | None = None  # samples are cut there
    gyroscope_noise_radps_per_sqrt_hz: Positive | None = None
    gyroscope_bias_radps: Positive | None = None
    gyroscope_bias_walk_radps_per_sqrt_s: Positive | None = None
    gyroscope_bias_instability_radps: NotNegative = 0.0
    gyroscope_scale: NotNegative = 0.0
    gyroscope_misalignment_rad: NotNegative = 0.0
    gyroscope_range_radps: Positive | None = None

    def __post_init__(self) -> None:
        """Require the gyroscope's figures together."""
        names = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")
        missing = [name for name in names if getattr(self, f"gyroscope_{name}") is None]
        finer = ("bias_instability_radps", "scale", "misalignment_rad", "range_radps")
        has_gyroscope = len(missing) < len(names) or any(
            getattr(self, f"gyroscope_{n}") for n in finer
        )
        if missing and has_gyroscope:
            raise ValueError(f"gyroscope_{missing[0]}: goes with the other gyroscope keys")


class FixesTable(Table, frozen=True):
    """A receiver's own position and velocity of antennas, white noise per axis."""

    antennas: tuple[str, ...] = ("a1",)  # each with a receiver of its own
    rate_hz: Positive = 1.0
    position_noise_m: Positive = 1.0
    velocity_noise_mps: Positive = 0.05


class OpticsTable(Table, frozen=True):
    """From a beacon's light to photocurrents."""

    beacon_w_per_sr: Positive = 1000.0  # radiant intensity toward the detector
    attenuation_per_m: NotNegative = 0.0  # of the air; 0 in vacuum
    # aperture_radius_m, spot_radius_m: of the lens, and of the spot of even light it makes on the
    # detector, whose part beyond the rim is lost
    aperture_radius_m: Positive = 1e-2
    spot_radius_m: Positive = 1e-3
    responsivity_a_per_w: Positive = 0.5
    noise_a: Positive = 2e-11  # standard deviation of each current's samples
    threshold_sigmas: NotNegative = 3.0  # a current below so many of them reads zero
    saturation_a: Positive | None = None  # no current is larger


class OcclusionTable(SpanTable, frozen=True):
    """A quadrant, 1 to 4, in the dark during a span of time: its current reads zero."""

    quadrant: Annotated[int, msgspec.Meta(ge=1, le=4)]


class PhotodetectorTable(Table, frozen=True):
    """Quadrant photodetector that sees a beacon within its range and field of view."""

    landmark: Place  # the beacon
    rate_hz: Positive = 10.0
    range_m: Positive = 3000.0
    # half-angle of the cone about +x_b within which the beacon is seen
    field_of_view_deg: Annotated[float, msgspec.Meta(gt=0, lt=90)] = 10.0
    position_b_m: Vector = (1.0, 0.0, 0.0)
    detector_radius_m: Positive = 5e-3
    focal_length_m: Positive = 2e-2
    # what the noise of the currents amounts to, per axis, with the spot at the centre; where optics
    # are given, they say how large it is
    line_of_sight_noise_rad: Positive = 1e-3
    # 1-sigma of the angles, about each body axis, by which the detector is turned
    misalignment_rad: NotNegative = 0.0
    optics: OpticsTable | None = None  # None: automatic gain keeps the sum of the currents at one
    occlusions: tuple[OcclusionTable, ...] = ()

    def __post_init__(self) -> None:
        """Keep the spot on the calibrated part of the detector."""
        rim_m = self.focal_length_m * math.tan(math.radians(self.field_of_view_deg))
        if rim_m > 0.98 * self.detector_radius_m:
            widest = math.degrees(math.atan(0.98 * self.detector_radius_m / self.focal_length_m))
            raise ValueError(
                f"field_of_view_deg: the spot must stay on the detector, within {widest:.1f}"
            )


class Scenario(Table, frozen=True):
    """A flight to be made: a sensor is on board where its table is in the file."""

    name: str = ""
    # GPS time of ``t_s = 0``
    start: Annotated[datetime, msgspec.Meta(tz=False)] = datetime(2020, 6, 25)
    # samples lie at multiples of their interval from 0 up to, and without, the duration
    duration_s: Annotated[float, msgspec.Meta(gt=0, le=_LONGEST_S)] = 60.0
    gravity: GravityModel = "wgs84-normal"
    truth_rate_hz: Positive = 10.0
    origin: Place = Place()
    motion: AnyMotion = Motion()
    flown: FlownTable | None = None  # a rigid body in place of the commanded motion
    # by which spread keys of this scenario are drawn anew for every flight: see ``dispersions``
    dispersions: dict[str, Any] = msgspec.field(default_factory=dict)
    # phase centres in body axes; the first is the reference. The paper's eight by default.
    antennas_b_m: tuple[Vector, ...] = PAPER_ANTENNAS_B_M
    # 1-sigma, per axis, of where antennas really sit beside that, which the flight states
    antenna_misplacement_m: NotNegative = 0.0
    gnss: GnssTable | None = None
    imu: ImuTable | None = None
    fixes: FixesTable | None = None
    baseline: BaselineTable | None = None
    photodetector: PhotodetectorTable | None = None
    barometer: BarometerTable | None = None
    magnetometer: MagnetometerTable | None = None

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        if not self.antennas_b_m:
            raise ValueError("antennas_b_m: must hold one antenna or more")
        if self.start < _GPS_EPOCH:
            raise ValueError(f"start: must not lie before {_GPS_EPOCH.isoformat()}")
        if self.gnss is not None:
            self.gnss.check_antennas(len(self.antennas_b_m))
        if self.fixes is not None:
            check_names("fixes.antennas", self.fixes.antennas, len(self.antennas_b_m))
        if self.baseline is not None:
            check_names("baseline.antennas", self.baseline.antennas, len(self.antennas_b_m))
        if self.flown is not None:
            self._check_flown(self.flown)

    def _check_flown(self, flown: FlownTable) -> None:
        """Check a flown scenario: where it starts, and that its sensors know its Earth."""
        if self.motion != Motion():
            raise ValueError("motion: a flown scenario has none; remove it, or table flown")
        height_m = self.origin.height_m - flown.start.position_n_m[2]
        if height_m < flown.ground_m:
            raise ValueError(
                f"origin.height_m: the flight must start above flown.ground_m {flown.ground_m:g}, "
                f"got {height_m:g}"
            )
        aboard = [n for n in _ON_EARTH if getattr(self, n) is not None]
        if aboard and flown.earth is not None:
            raise ValueError(
                f"flown.earth: table {aboard[0]} knows the WGS-84 Earth only; remove one of both"
            )
        gravity = flown.gravity or self.gravity
        if gravity == "wgs84-normal" and flown.earth not in (None, WGS84):
            raise ValueError(
                "flown.gravity: wgs84-normal is the WGS-84 Earth's; take j2, spherical or constant"
            )
        if self.imu is not None and flown.gravity not in (None, self.gravity):
            raise ValueError(
                f"flown.gravity: an inertial unit feels gravity = '{self.gravity}'; remove one"
            )

    @property
    def start_gps_s(self) -> float:
        """GPS time of the start."""
        return gps_s(self.start)

    def epochs_s(self, rate_hz: float) -> FloatArray:
        """Return the sample times of a sensor, (n,)."""
        # The small part keeps 60 s at 10 Hz at 600 samples whatever the rounding of the product.
        return np.arange(max(1, math.ceil(self.duration_s * rate_hz - 1e-6))) / rate_hz


def gps_s(date: datetime) -> float:
    """Return seconds from the GPS epoch to a date of GPS time, leap seconds not counted."""
    return (date - _GPS_EPOCH).total_seconds()


def load_scenario(scenario: Path | str) -> Scenario:
    """Return a scenario: a TOML file's, or that of a name that comes with the simulator.

    Files that it names are resolved against its folder; a vehicle may be a name, too.

    Raises
    ------
    BadInputError
        One line that names file, key, rule and value.
    """
    path = file_or_shipped(scenario, "fgnav_sim", "scenarios")
    table = as_table(path, read_toml(path), Scenario)
    changes: dict[str, object] = {}
    if not table.name:
        changes["name"] = path.stem
    if table.flown is not None:
        changes["flown"] = _with_vehicle(path, table.flown)
    if table.gnss is not None:
        changes["gnss"] = msgspec.structs.replace(
            table.gnss,
            navigation=resolved(path, "gnss.navigation", table.gnss.navigation),
            orbits=resolved(path, "gnss.orbits", table.gnss.orbits),
        )
    table = msgspec.structs.replace(table, **changes)
    try:
        check_spreads(table, table.dispersions)
    except BadInputError as error:
        raise BadInputError(f"{path}: key {error}") from None
    return table


def _with_vehicle(path: Path, flown: FlownTable) -> FlownTable:
    """Return the table with its vehicle's tables in place of their file."""
    if isinstance(flown.vehicle, Vehicle):
        return flown
    if len(Path(flown.vehicle).parts) == 1 and not Path(flown.vehicle).suffix:
        vehicle = load_vehicle(flown.vehicle)
    else:
        vehicle = load_vehicle(Path(resolved(path, "flown.vehicle", (flown.vehicle,))[0]))
    try:
        return msgspec.structs.replace(flown, vehicle=vehicle)
    except ValueError as error:
        raise BadInputError(f"{path}: key flown.{error}") from None


def resolved(path: Path, key: str, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return files that a scenario at ``path`` names, against its folder."""
    files = [path.parent / name for name in names]
    for file in files:
        if not file.is_file():
            raise BadInputError(f"{path}: {key}: no such file, got '{file}'")
    return tuple(str(file) for file in files)
