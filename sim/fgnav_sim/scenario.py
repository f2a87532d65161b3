"""What a scenario file may say, with every default and rule."""

import math
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import field

from fgnav.checks import BadInputError, FloatArray
from fgnav.earth import GravityModel, Origin
from fgnav.gnss.signals import CONSTELLATIONS, known
from fgnav.io.strict_toml import NotNegative, Positive, Table, Vector, as_table, read_toml
from fgnav_sim.motion import Motion

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
_GPS_EPOCH = datetime(1980, 1, 6)  # GPS time has no time zone
_LONGEST_S = 7 * 86400.0  # a flight stays within what week numbers and double precision carry

Angle = Annotated[float, msgspec.Meta(ge=0, lt=90)]


class Place(Table, frozen=True):
    """A point on or above the ellipsoid; Madrid where nothing is said."""

    latitude_deg: Annotated[float, msgspec.Meta(ge=-90, le=90)] = 40.33
    longitude_deg: Annotated[float, msgspec.Meta(ge=-360, le=360)] = -3.88
    height_m: Annotated[float, msgspec.Meta(gt=-1e4, lt=1e5)] = 700.0

    @property
    def frame(self) -> Origin:
        """The frame ``n`` at this place."""
        return Origin(
            latitude_rad=math.radians(self.latitude_deg),
            longitude_rad=math.radians(self.longitude_deg),
            height_m=self.height_m,
        )


class ClockTable(Table, frozen=True):
    """Receiver clocks: standard deviations of offset and drift at the start, and the drift's walk.

    Attributes
    ----------
    oscillator : {"common", "separate"}
        One oscillator for all receivers, each with its own constant offset; or one each.
    offset_s, drift_sps, drift_walk_sps_per_sqrt_s : float
    """

    oscillator: Literal["common", "separate"] = "common"
    offset_s: Annotated[float, msgspec.Meta(ge=0, le=1e-3)] = 1e-7
    drift_sps: NotNegative = 1e-10
    drift_walk_sps_per_sqrt_s: NotNegative = 1e-11


class GnssTable(Table, frozen=True):
    """Receivers, one per antenna, and satellites.

    Attributes
    ----------
    rate_hz : float
    signals : dict
        RINEX 3 signals by constellation letter: ``{ G = ["1C"], E = ["1C", "5Q"] }``.
    navigation : tuple of str
        Broadcast files, relative to the scenario; none: the built-in almanac.
    receiver_mask_deg, elevation_mask_deg : float
        Below the first nothing is tracked; the second is written to the flight for estimators.
    code_noise_m, phase_noise_m, doppler_noise_mps : float
        White noise of one link at the zenith.
    elevation_weights : {"sine", "uniform"}
        ``sine`` divides the noise by the sine of the elevation.
    atmosphere : bool
        Delay the signals by the broadcast ionosphere and a standard troposphere.
    clock : ClockTable
    """

    rate_hz: Positive = 10.0
    signals: dict[str, tuple[str, ...]] = field(default_factory=lambda: {"G": ("1C",)})
    navigation: tuple[str, ...] = ()
    receiver_mask_deg: Angle = 5.0
    elevation_mask_deg: Angle = 10.0
    code_noise_m: Positive = 0.5
    phase_noise_m: Positive = 0.003
    doppler_noise_mps: Positive = 0.05
    elevation_weights: Literal["sine", "uniform"] = "sine"
    atmosphere: bool = True
    clock: ClockTable = ClockTable()

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        for letter, signals in self.signals.items():
            if letter not in CONSTELLATIONS:
                choice = ", ".join(f"{key} ({name})" for key, name in CONSTELLATIONS.items())
                raise ValueError(f"signals.{letter}: the constellation must be one of {choice}")
            if len(set(signals)) != len(signals) or not signals:
                raise ValueError(f"signals.{letter}: must name one signal or more, each once")
            for signal in signals:
                if not (len(signal) == 2 and known(letter, signal)):
                    raise ValueError(f"signals.{letter}: {signal!r} is not a RINEX 3 signal of it")
        if not self.signals:
            raise ValueError("signals: must name one constellation or more")


class ImuTable(Table, frozen=True):
    """Accelerometer triad, and a gyroscope where its three figures are given.

    Units are those of the flight format: noise density, 1-sigma of the constant bias, random walk.
    """

    rate_hz: Positive = 100.0
    position_b_m: Vector = (0.0, 0.0, 0.0)
    accelerometer_noise_mps2_per_sqrt_hz: Positive = 1e-3
    accelerometer_bias_mps2: Positive = 3e-2
    accelerometer_bias_walk_mps2_per_sqrt_s: Positive = 1e-4
    gyroscope_noise_radps_per_sqrt_hz: Positive | None = None
    gyroscope_bias_radps: Positive | None = None
    gyroscope_bias_walk_radps_per_sqrt_s: Positive | None = None

    def __post_init__(self) -> None:
        """Require the gyroscope's figures together."""
        names = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")
        missing = [name for name in names if getattr(self, f"gyroscope_{name}") is None]
        if 0 < len(missing) < len(names):
            raise ValueError(f"gyroscope_{missing[0]}: goes with the other gyroscope keys")


class FixesTable(Table, frozen=True):
    """A receiver's own position and velocity of the reference antenna, white noise per axis."""

    rate_hz: Positive = 1.0
    position_noise_m: Positive = 1.0
    velocity_noise_mps: Positive = 0.05


class SeekerTable(Table, frozen=True):
    """Quadrant photodetector that sees a beacon within its range and field of view.

    Attributes
    ----------
    landmark : Place
        The beacon.
    rate_hz, range_m : float
    field_of_view_deg : float
        Half-angle of the cone about +x_b within which the beacon is seen.
    position_b_m : vector
    detector_radius_m, focal_length_m : float
    line_of_sight_noise_rad : float
        What the noise of the currents amounts to, per axis, with the spot at the centre.
    """

    landmark: Place
    rate_hz: Positive = 10.0
    range_m: Positive = 3000.0
    field_of_view_deg: Annotated[float, msgspec.Meta(gt=0, lt=90)] = 10.0
    position_b_m: Vector = (1.0, 0.0, 0.0)
    detector_radius_m: Positive = 5e-3
    focal_length_m: Positive = 2e-2
    line_of_sight_noise_rad: Positive = 1e-3

    def __post_init__(self) -> None:
        """Keep the spot on the calibrated part of the detector."""
        rim_m = self.focal_length_m * math.tan(math.radians(self.field_of_view_deg))
        if rim_m > 0.98 * self.detector_radius_m:
            widest = math.degrees(math.atan(0.98 * self.detector_radius_m / self.focal_length_m))
            raise ValueError(
                f"field_of_view_deg: the spot must stay on the detector, within {widest:.1f}"
            )


class Scenario(Table, frozen=True):
    """A flight to be made: a sensor is on board where its table is in the file.

    Attributes
    ----------
    name : str
    start : datetime
        GPS time of ``t_s = 0``.
    duration_s : float
        Samples lie at multiples of their interval from 0 up to, and without, the duration.
    gravity : {"wgs84-normal", "j2", "constant"}
    truth_rate_hz : float
    origin : Place
    motion : Motion
    antennas_b_m : tuple of vectors
        Phase centres in body axes; the first is the reference. The paper's eight by default.
    gnss, imu, fixes, seeker : their tables, or None
    """

    name: str = ""
    start: Annotated[datetime, msgspec.Meta(tz=False)] = datetime(2020, 6, 25)
    duration_s: Annotated[float, msgspec.Meta(gt=0, le=_LONGEST_S)] = 60.0
    gravity: GravityModel = "wgs84-normal"
    truth_rate_hz: Positive = 10.0
    origin: Place = Place()
    motion: Motion = Motion()
    antennas_b_m: tuple[Vector, ...] = PAPER_ANTENNAS_B_M
    gnss: GnssTable | None = None
    imu: ImuTable | None = None
    fixes: FixesTable | None = None
    seeker: SeekerTable | None = None

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        if not self.antennas_b_m:
            raise ValueError("antennas_b_m: must hold one antenna or more")
        if self.start < _GPS_EPOCH:
            raise ValueError(f"start: must not lie before {_GPS_EPOCH.isoformat()}")

    @property
    def start_gps_s(self) -> float:
        """Seconds from the GPS epoch to the start, leap seconds not counted."""
        return (self.start - _GPS_EPOCH).total_seconds()

    def epochs_s(self, rate_hz: float) -> FloatArray:
        """Return the sample times of a sensor, (n,)."""
        # The small part keeps 60 s at 10 Hz at 600 samples whatever the rounding of the product.
        return np.arange(max(1, math.ceil(self.duration_s * rate_hz - 1e-6))) / rate_hz


def load_scenario(path: Path) -> Scenario:
    """Return the scenario in a TOML file, its navigation files resolved against the file's folder.

    Raises
    ------
    BadInputError
        One line that names file, key, rule and value.
    """
    scenario = as_table(path, read_toml(path), Scenario)
    changes: dict[str, object] = {}
    if not scenario.name:
        changes["name"] = path.stem
    if scenario.gnss is not None:
        files = [path.parent / name for name in scenario.gnss.navigation]
        for file in files:
            if not file.is_file():
                raise BadInputError(f"{path}: gnss.navigation: no such file, got '{file}'")
        changes["gnss"] = msgspec.structs.replace(
            scenario.gnss, navigation=tuple(str(file) for file in files)
        )
    return msgspec.structs.replace(scenario, **changes)
