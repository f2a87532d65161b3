"""``flight.toml``: its keys as structures, read strictly."""

import re
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from fgnav.checks import BadInputError, quoted
from fgnav.io.gps_time import GPS_EPOCH, date_to_gps_s
from fgnav.io.strict_toml import Positive, Table, Vector, as_table, read_toml
from fgnav.types.flight import ElevationWeights, GnssNoise, TruthSource

FORMAT = "fgnav-flight/1"
FORWARD_RIGHT_DOWN = ("x", "y", "z")
_START = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(\.\d{1,9})?")

_MOST_ANTENNAS = 256  # all pairs of them are held against each other
_NOISE = GnssNoise()


class Place(Table, frozen=True, kw_only=True):
    """WGS-84 coordinates."""

    latitude_deg: float
    longitude_deg: float
    height_m: float


class AntennaTable(Table, frozen=True, kw_only=True):
    """``[[antenna]]``."""

    name: str
    position_b_m: Vector
    observations: str | None = None


class BaseTable(Table, frozen=True, kw_only=True):
    """``base`` of ``[gnss]``."""

    observations: str
    position_e_m: Vector


class GnssTable(Table, frozen=True, kw_only=True):
    """``[gnss]``."""

    navigation: tuple[str, ...] = ()
    orbits: tuple[str, ...] = ()
    signals: dict[str, tuple[str, ...]] = msgspec.field(default_factory=dict)
    elevation_mask_deg: float = 10.0
    code_noise_m: float | None = None
    phase_noise_m: float | None = None
    doppler_noise_mps: float | None = None
    elevation_weights: ElevationWeights = _NOISE.elevation_weights
    atmosphere: bool = _NOISE.atmosphere
    wind_up: bool = _NOISE.wind_up
    message_errors: bool = _NOISE.message_errors
    satellite_error_rate_mps: float = _NOISE.satellite_error_rate_mps
    satellite_error_walk_m_per_sqrt_s: float = _NOISE.satellite_error_walk_m_per_sqrt_s
    base: BaseTable | None = None


class ImuKeys(Table, frozen=True, kw_only=True):
    """Keys of ``[imu]`` without its samples; ``clock_offset_s`` is added to its times."""

    position_b_m: Vector = (0.0, 0.0, 0.0)
    axes: tuple[str, str, str] = FORWARD_RIGHT_DOWN
    mounting_deg: Vector = (0.0, 0.0, 0.0)
    clock_offset_s: float = 0.0
    clock_offset_sigma_s: float | None = None
    accelerometer_noise_mps2_per_sqrt_hz: float | None = None
    accelerometer_bias_mps2: float | None = None
    accelerometer_bias_walk_mps2_per_sqrt_s: float | None = None
    gyroscope_noise_radps_per_sqrt_hz: float | None = None
    gyroscope_bias_radps: float | None = None
    gyroscope_bias_walk_radps_per_sqrt_s: float | None = None


class ImuTable(ImuKeys, frozen=True, kw_only=True):
    """``[imu]``."""

    samples: str


class FixesTable(Table, frozen=True, kw_only=True):
    """``[[fixes]]``."""

    samples: str
    antenna: str


class BaselineTable(Table, frozen=True, kw_only=True):
    """``[[baseline]]``: from the first antenna to the second.

    ``heading_offset_deg`` is what the receiver has added to the heading of that line.
    """

    samples: str
    antennas: tuple[str, str]
    heading_offset_deg: Annotated[float, msgspec.Meta(ge=-360, le=360)] | None = None


class PhotodetectorTable(Table, frozen=True, kw_only=True):
    """``[photodetector]``."""

    samples: str
    position_b_m: Vector
    landmark: Place
    detector_radius_m: float
    focal_length_m: float
    calibration: str


class BarometerKeys(Table, frozen=True, kw_only=True):
    """Keys of ``[barometer]`` without its samples, as of ``Barometer``."""

    position_b_m: Vector = (0.0, 0.0, 0.0)
    noise_m: float
    offset_m: float
    wander_m: float = 0.0
    wander_time_s: float = 300.0


class BarometerTable(BarometerKeys, frozen=True, kw_only=True):
    """``[barometer]``: t_s and height_m."""

    samples: str


class MagnetometerKeys(Table, frozen=True, kw_only=True):
    """Keys of ``[magnetometer]`` without its samples, as of ``Magnetometer``."""

    field_n_ut: Vector
    noise_ut: float
    hard_iron_ut: float


class MagnetometerTable(MagnetometerKeys, frozen=True, kw_only=True):
    """``[magnetometer]``: t_s, mx_ut, my_ut, mz_ut in body axes."""

    samples: str


class VehicleTable(Table, frozen=True, kw_only=True):
    """``[vehicle]``: what its build lets it do, as of ``types.vehicle``, and that it may stand."""

    standstill: bool = False
    kind: Literal["wheeled", "finned"] | None = None
    # on wheels
    position_b_m: Vector = (0.0, 0.0, 0.0)
    position_sigma_m: Positive = 1.0
    slip_mps: Positive = 0.1
    axes_sigma_deg: Positive = 3.0
    # with fins
    sideslip_sigma_deg: Positive = 3.0
    attack_sigma_deg: Positive = 3.0
    half_life_s: Positive = 1.0
    constant_share: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.25
    wind_sigma_mps: Positive = 3.0
    crossflow_sigma_mps: Positive = 0.5

    def __post_init__(self) -> None:
        """Reject keys of another kind of vehicle."""
        names = self.__struct_fields__[2:]
        wheels, fins = names[:4], names[4:]
        others = {"wheeled": fins, "finned": wheels, None: names}[self.kind]
        usual = dict(zip(names, self.__struct_defaults__[2:], strict=True))
        for name in others:
            if getattr(self, name) != usual[name]:
                kind = "wheeled" if name in wheels else "finned"
                raise ValueError(f'{name}: goes with kind = "{kind}"')


class InitialTable(Table, frozen=True, kw_only=True):
    """``[initial]``: attitude at the first epoch, each angle with its 1-sigma."""

    roll_deg: float | None = None
    roll_sigma_deg: Positive | None = None
    pitch_deg: float | None = None
    pitch_sigma_deg: Positive | None = None
    heading_deg: float | None = None
    heading_sigma_deg: Positive | None = None


class NetworkTable(Table, frozen=True, kw_only=True):
    """``[[network]]``: a manifest, of which the flight's methods make factors."""

    manifest: str


class TruthTable(Table, frozen=True, kw_only=True):
    """``[truth]``."""

    samples: str
    integers: str | None = None
    source: TruthSource | None = None


# Tables of records by their keys, and those that a flight has several of.
RECORDS: dict[str, type[Any]] = {
    "imu": ImuTable,
    "fixes": FixesTable,
    "baseline": BaselineTable,
    "photodetector": PhotodetectorTable,
    "barometer": BarometerTable,
    "magnetometer": MagnetometerTable,
    "truth": TruthTable,
}
SEVERAL = ("fixes", "baseline")
# Fields of ``GnssNoise`` by the keys of ``[gnss]``.
GNSS_NOISE = {
    "code_noise_m": "code_m",
    "phase_noise_m": "phase_m",
    "doppler_noise_mps": "doppler_mps",
}


class FlightTable(Table, frozen=True, kw_only=True):
    """The whole file; ``rows`` says how many rows each table of samples was written with."""

    format: str
    name: str
    start: str
    rows: dict[str, Annotated[int, msgspec.Meta(ge=0)]] = msgspec.field(default_factory=dict)
    origin: Place
    antenna: Annotated[tuple[AntennaTable, ...], msgspec.Meta(max_length=_MOST_ANTENNAS)] = ()
    network: tuple[NetworkTable, ...] = ()
    gnss: GnssTable = GnssTable()
    fixes: tuple[FixesTable, ...] = ()
    baseline: tuple[BaselineTable, ...] = ()
    imu: ImuTable | None = None
    photodetector: PhotodetectorTable | None = None
    barometer: BarometerTable | None = None
    magnetometer: MagnetometerTable | None = None
    vehicle: VehicleTable | None = None
    initial: InitialTable | None = None
    truth: TruthTable | None = None

    @property
    def sampled(self) -> list[Any]:
        """Tables of records, in the order of ``Flight.records``."""
        single = (self.photodetector, self.barometer, self.magnetometer, self.truth)
        tables = (self.imu, *self.fixes, *self.baseline, *single)
        return [table for table in tables if table is not None]


def read_flight_toml(path: Path) -> FlightTable:
    """Read and check ``flight.toml``."""
    content = read_toml(path)
    if not content:
        raise BadInputError(f"{path}: must describe a flight, the file is empty")
    got = content.get("format")
    if got != FORMAT:
        raise BadInputError(f"{path}: key format: must be {FORMAT!r}, got {quoted(got)}")
    if isinstance(content.get("fixes"), dict):  # of one receiver
        content["fixes"] = [content["fixes"]]
    return as_table(path, content, FlightTable)


def gps_seconds(path: Path, start: str) -> float:
    """Return seconds since 1980-01-06 of a GPS date and time."""
    got = quoted(start)
    rule = f"{path}: key start: must be a GPS date and time, 2020-06-25T00:00:00, got {got}"
    seconds = date_to_gps_s(re.split("[-T:]", start)) if _START.fullmatch(start) else np.nan
    if np.isnan(seconds):
        raise BadInputError(rule)
    if seconds < 0:
        raise BadInputError(f"{path}: key start: must not be before 1980-01-06, got {got}")
    return seconds


def gps_date(start_gps_s: float) -> str:
    """Return the text of a start, to the microsecond."""
    microseconds = round(start_gps_s * 1e6)
    date = str(GPS_EPOCH + np.timedelta64(microseconds, "us"))
    return date.rstrip("0").rstrip(".") if microseconds % 1_000_000 else date[:19]
