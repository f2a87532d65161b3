"""Format of a scenario's receivers, satellites and disturbances."""

import math
from typing import Annotated, Literal, TypeAlias

import msgspec
import numpy as np
from msgspec import field

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.gnss.signals import CONSTELLATIONS, known
from fgnav.io.rinex.writer import RinexVersion
from fgnav.io.strict_toml import NotNegative, Positive, Table, Vector
from fgnav.types.flight import GnssNoise
from fgnav.types.receiver import Measured

Angle = Annotated[float, msgspec.Meta(ge=0, lt=90)]
_Azimuth = Annotated[float, msgspec.Meta(ge=0, le=360)]
_Elevation = Annotated[float, msgspec.Meta(ge=-90, le=90)]
Latitude: TypeAlias = Annotated[float, msgspec.Meta(ge=-90, le=90)]
Longitude: TypeAlias = Annotated[float, msgspec.Meta(ge=-360, le=360)]
Height: TypeAlias = Annotated[float, msgspec.Meta(gt=-1e4, lt=1e5)]
Choice: TypeAlias = Literal["all"] | Annotated[int, msgspec.Meta(ge=4)]


class ClockTable(Table, frozen=True):
    """Receiver clocks: 1-sigma of offset and drift at the start, and the drift's random walk."""

    # one oscillator for all receivers, each with its own constant offset; or one each
    oscillator: Literal["common", "separate"] = "common"
    offset_s: Annotated[float, msgspec.Meta(ge=0, le=1e-3)] = 1e-7
    drift_sps: NotNegative = 1e-10
    drift_walk_sps_per_sqrt_s: NotNegative = 1e-11


class SlipsTable(Table, frozen=True):
    """Cycle slips, at random times, of every link (antenna and channel) for itself."""

    rate_per_hour: Positive  # of one link
    # a slip is of 1 up to so many cycles, either way, all alike likely
    largest_cycles: Annotated[int, msgspec.Meta(ge=1, le=1_000_000)] = 10
    # share of slips that the receiver announces
    flagged_share: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.5
    # share of slips that are half a cycle larger, as those of Costas loops may be
    half_cycle_share: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.0


class LossOfLockTable(Table, frozen=True):
    """Links that are lost at random times for a time drawn from an exponential distribution.

    Afterwards the integer is another one, and the receiver says so.
    """

    rate_per_hour: Positive
    mean_s: Positive = 1.0


class SpanTable(Table, frozen=True, kw_only=True):
    """A span of time, up to and without its end; until the flight's where none is given."""

    from_s: NotNegative = 0.0
    until_s: Positive | None = None

    def __post_init__(self) -> None:
        """Require a span that is not empty."""
        if self.until_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"until_s: must lie after from_s, got {self.until_s:g}")

    def holds(self, t_s: FloatArray) -> BoolArray:
        """Select the times, (n,), in the span."""
        until_s = np.inf if self.until_s is None else self.until_s
        return np.asarray((t_s >= self.from_s) & (t_s < until_s))


class OutageTable(SpanTable, frozen=True):
    """Links that are not there during a span of time, in a sector of the sky, of some antennas."""

    # the sector reaches clockwise from the first to the second; all around where they are equal
    azimuth_deg: tuple[_Azimuth, _Azimuth] = (0.0, 360.0)
    elevation_deg: tuple[_Elevation, _Elevation] = (-90.0, 90.0)
    antennas: tuple[str, ...] = ()  # ``"a1"`` is the reference; all where none is named

    def __post_init__(self) -> None:
        """Require spans that are not empty."""
        super().__post_init__()
        if self.elevation_deg[0] >= self.elevation_deg[1]:
            raise ValueError(f"elevation_deg: must increase, got {list(self.elevation_deg)}")


class BodyMaskTable(Table, frozen=True):
    """View past the body: a cone about each antenna's axis."""

    axes_b: tuple[Vector, ...] = ((0.0, 0.0, -1.0),)  # one for all antennas, or one each
    half_angle_deg: Annotated[float, msgspec.Meta(gt=0, le=180)] = 90.0

    def __post_init__(self) -> None:
        """Require directions."""
        if not self.axes_b or not all(any(axis) for axis in self.axes_b):
            raise ValueError("axes_b: must hold one vector or more, none of them zero")


class MultipathTable(Table, frozen=True):
    """Echoes from anywhere: a first-order Gauss-Markov process of every link for itself."""

    # code_m, phase_m: standard deviations, weighted by elevation as the noise is. Estimators are
    # told of noise and echoes together.
    code_m: NotNegative
    phase_m: NotNegative
    time_constant_s: Positive


class ReflectorTable(Table, frozen=True):
    """A flat piece of the body that mirrors signals into antennas in front of it."""

    point_b_m: Vector  # its middle
    normal_b: Vector  # out of its front; any length
    radius_m: Positive | None = None  # of the disc that it is; None: of any size
    # of the echo against the direct signal
    amplitude: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.3
    phase_deg: float = 180.0  # what the reflection adds to the echo's phase; 180 on metal

    def __post_init__(self) -> None:
        """Require a direction."""
        if not any(self.normal_b):
            raise ValueError("normal_b: must not be zero")


class Cn0Table(Table, frozen=True):
    """Carrier-to-noise density: from the horizon's to the zenith's with the elevation's sine."""

    horizon_dbhz: Annotated[float, msgspec.Meta(ge=0, le=80)] = 35.0
    zenith_dbhz: Annotated[float, msgspec.Meta(ge=0, le=80)] = 50.0
    # noise follows C/N0 in place of ``elevation_weights``: 6 dB less double it
    sets_noise: bool = False


class Point(Table, frozen=True):
    """A point on or above the ellipsoid."""

    latitude_deg: Latitude
    longitude_deg: Longitude
    height_m: Height

    @property
    def frame(self) -> Origin:
        """The frame ``n`` at this point."""
        return Origin(
            latitude_rad=math.radians(self.latitude_deg),
            longitude_rad=math.radians(self.longitude_deg),
            height_m=self.height_m,
        )


class GnssTable(Table, frozen=True):
    """Receivers, one per antenna, and satellites."""

    rate_hz: Positive = 10.0
    # RINEX 3 signals by constellation letter: ``{ G = ["1C"], E = ["1C", "5Q"] }``
    signals: dict[str, tuple[str, ...]] = field(default_factory=lambda: {"G": ("1C",)})
    # broadcast files, relative to the scenario; none: the built-in almanac
    navigation: tuple[str, ...] = ()
    # SP3 files, relative to the scenario: how satellites truly fly. Messages are then what
    # navigation says, if anything, and wrong as they are.
    orbits: tuple[str, ...] = ()
    # all in view, or so many, those of best geometry (see ``fgnav_sim.gnss.selection``)
    choose: Choice = "all"
    # receiver_mask_deg, elevation_mask_deg: below the first nothing is tracked; the second is
    # written to the flight for estimators
    receiver_mask_deg: Angle = 5.0
    elevation_mask_deg: Angle = 10.0
    # code_noise_m, phase_noise_m, doppler_noise_mps: white noise of one link at the zenith
    code_noise_m: Positive = 0.5
    phase_noise_m: Positive = 0.003
    doppler_noise_mps: Positive = 0.05
    # ``sine`` divides the noise by the sine of the elevation
    elevation_weights: Literal["sine", "uniform"] = "sine"
    # a factor to the noise of each antenna; none: all alike. Estimators are not told.
    antenna_noise: tuple[Positive, ...] = ()
    cn0: Cn0Table = Cn0Table()
    # delay the signals by the broadcast ionosphere and a standard troposphere
    atmosphere: bool = True
    # give every satellite an error in its ranges as large as estimators expect of messages and of
    # models of the atmosphere; else both are perfect
    message_errors: bool = False
    # satellite_error_rate_mps, satellite_error_walk_m_per_sqrt_s: how those errors move, see
    # ``fgnav.types.flight.GnssNoise``; written to the flight
    satellite_error_rate_mps: Positive = GnssNoise().satellite_error_rate_mps
    satellite_error_walk_m_per_sqrt_s: Positive = GnssNoise().satellite_error_walk_m_per_sqrt_s
    # turns of the antennas, all of which look along -z_b, wind up the phase; in double differences
    # of a rigid body nothing of it is left
    wind_up: bool = False
    clock: ClockTable = ClockTable()
    rinex: RinexVersion = "3.04"  # version of the files that ``fgnav simulate`` writes
    # where a receiver of the same make and rate stands on the ground and records, too
    base: Point | None = None
    slips: SlipsTable | None = None
    loss_of_lock: LossOfLockTable | None = None
    outages: tuple[OutageTable, ...] = ()
    body_mask: BodyMaskTable | None = None
    multipath: MultipathTable | None = None
    reflectors: tuple[ReflectorTable, ...] = ()

    def __post_init__(self) -> None:
        """Check what one key's type cannot say."""
        check_signals(self.signals)

    def check_antennas(self, antennas: int) -> None:
        """Raise unless what is said of antennas fits their number."""
        if len(self.antenna_noise) not in (0, antennas):
            raise ValueError(
                f"gnss.antenna_noise: must hold a factor for each of {antennas} antennas, "
                f"got {len(self.antenna_noise)}"
            )
        if self.body_mask is not None and len(self.body_mask.axes_b) not in (1, antennas):
            raise ValueError(
                f"gnss.body_mask.axes_b: must hold one vector, or one for each of {antennas} "
                f"antennas, got {len(self.body_mask.axes_b)}"
            )
        names = antenna_names(antennas)
        for row, outage in enumerate(self.outages):
            for name in outage.antennas:
                if name not in names:
                    raise ValueError(
                        f"gnss.outages[{row}].antennas: must be among {names[0]} to {names[-1]}, "
                        f"got {name!r}"
                    )


class BaselineTable(Table, frozen=True):
    """The vector between two antennas as a receiver has it, white noise per axis."""

    antennas: tuple[str, str] = ("a1", "a2")  # from the first to the second
    rate_hz: Positive = 5.0
    measures: Measured = "vector"  # all of it, its direction, or its heading
    noise_m: Positive = 0.01
    gaps_s: tuple[tuple[NotNegative, Positive], ...] = ()  # spans in which it is not solved


def antenna_names(antennas: int) -> tuple[str, ...]:
    """Return the names of the antennas of a simulated flight: ``a1`` is the reference."""
    return tuple(f"a{k}" for k in range(1, antennas + 1))


def check_names(key: str, used: tuple[str, ...], antennas: int) -> None:
    """Raise unless names of antennas are among those of a flight, each used once."""
    names = antenna_names(antennas)
    for name in used:
        if name not in names or used.count(name) > 1:
            raise ValueError(f"{key}: must be among {names[0]} to {names[-1]}, once, got {name!r}")


def check_signals(of: dict[str, tuple[str, ...]]) -> None:
    """Raise unless RINEX 3 signals are named by constellation, each once."""
    for letter, signals in of.items():
        if letter not in CONSTELLATIONS:
            choice = ", ".join(f"{key} ({name})" for key, name in CONSTELLATIONS.items())
            raise ValueError(f"signals.{letter}: the constellation must be one of {choice}")
        if len(set(signals)) != len(signals) or not signals:
            raise ValueError(f"signals.{letter}: must name one signal or more, each once")
        for signal in signals:
            if not (len(signal) == 2 and known(letter, signal)):
                raise ValueError(f"signals.{letter}: {signal!r} is not a RINEX 3 signal of it")
    if not of:
        raise ValueError("signals: must name one constellation or more")
