"""The border type of the project: what was measured on a flight, before any estimator sees it."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, Loss, freeze, freeze_times, positive
from fgnav.geometry.earth import Origin
from fgnav.types.observations import Observations
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits
from fgnav.types.summaries import summary, summary_html
from fgnav.types.surroundings import Barometer, Magnetometer
from fgnav.types.vehicle import WheeledVehicle

ElevationWeights: TypeAlias = Literal["sine", "uniform"]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Antenna:
    """A GNSS antenna of the vehicle: its name and phase centre in body axes, (3,)."""

    name: str
    position_b_m: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze the position."""
        freeze(f"antenna {self.name}", self, {"position_b_m": (3,)})


@dataclass(frozen=True, slots=True, kw_only=True)
class GnssNoise:
    """Standard deviations of one undifferenced link at the zenith, and how elevation weighs them.

    Attributes
    ----------
    code_m, phase_m, doppler_mps : float
        Standard deviations.
    elevation_weights : {"sine", "uniform"}
        ``sine`` divides by the sine of the elevation.
    unstated : tuple of str
        Names of those that the flight does not state: a usual figure stands there.
    wind_up : bool
        Whether turns of antennas wind up their phases: of all receivers they do, of simulated ones
        where the scenario says so.
    satellite_error_rate_mps, satellite_error_walk_m_per_sqrt_s : float
        How errors of a satellite's messages and of the atmosphere's models move: 1-sigma of a
        constant rate, and of a random walk. Defaults are those of the hour of the IGS station WTZR,
        25 June 2020, of broadcast orbits and Klobuchar's model: changes of phases of GPS, Galileo
        and BeiDou above ten degrees, less their mean, of .014 m in 30 s to .43 m in 32 min.
    """

    code_m: float = 0.5
    phase_m: float = 0.003
    doppler_mps: float = 0.05
    elevation_weights: ElevationWeights = "sine"
    unstated: tuple[str, ...] = ()
    wind_up: bool = True
    satellite_error_rate_mps: float = 2.3e-4
    satellite_error_walk_m_per_sqrt_s: float = 2.2e-3

    def __post_init__(self) -> None:
        """Reject noise that is zero or negative."""
        moving = ("satellite_error_rate_mps", "satellite_error_walk_m_per_sqrt_s")
        for name in ("code_m", "phase_m", "doppler_mps", *moving):
            positive(f"gnss noise {name}", getattr(self, name))
        if self.elevation_weights not in ("sine", "uniform"):
            raise BadInputError(
                f"elevation_weights: must be sine or uniform, got {self.elevation_weights!r}"
            )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Base:
    """A station on the ground: its ECEF position, (3,), and its observations (one antenna)."""

    position_e_m: FloatArray
    observations: Observations

    def __post_init__(self) -> None:
        """Check and freeze the position."""
        freeze("base", self, {"position_e_m": (3,)})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Imu:
    """Accelerometer triad, and gyroscope if there is one, at one point of the body.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
        Sample times, strictly increasing; values are point values at these times.
    f_b_mps2 : ndarray, shape (k, 3)
        Specific force.
    w_b_radps : ndarray, shape (k, 3), or None
        Angular rate against inertial space.
    position_b_m : ndarray, shape (3,)
        Where the accelerometer sits.
    accelerometer_noise_mps2_per_sqrt_hz, accelerometer_bias_mps2,
    accelerometer_bias_walk_mps2_per_sqrt_s : float
        White noise density, 1-sigma of the constant bias, random walk of the bias.
    gyroscope_noise_radps_per_sqrt_hz, gyroscope_bias_radps,
    gyroscope_bias_walk_radps_per_sqrt_s : float or None
        The same of the gyroscope; None without one.
    unstated : tuple of str
        Names of noises and walks that the flight does not state: a usual figure stands there.
    """

    t_s: FloatArray
    f_b_mps2: FloatArray
    w_b_radps: FloatArray | None = None
    position_b_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    accelerometer_noise_mps2_per_sqrt_hz: float
    accelerometer_bias_mps2: float
    accelerometer_bias_walk_mps2_per_sqrt_s: float
    gyroscope_noise_radps_per_sqrt_hz: float | None = None
    gyroscope_bias_radps: float | None = None
    gyroscope_bias_walk_radps_per_sqrt_s: float | None = None
    unstated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("imu", self)
        freeze("imu", self, {"f_b_mps2": (k, 3), "position_b_m": (3,)})
        accelerometer = ("noise_mps2_per_sqrt_hz", "bias_mps2", "bias_walk_mps2_per_sqrt_s")
        for name in accelerometer:
            positive(f"imu accelerometer_{name}", getattr(self, f"accelerometer_{name}"))
        gyroscope = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")
        for name in gyroscope:
            value = getattr(self, f"gyroscope_{name}")
            if (value is None) != (self.w_b_radps is None):
                raise BadInputError(f"imu gyroscope_{name}: goes with gyroscope samples, only then")
            if value is not None:
                positive(f"imu gyroscope_{name}", value)
        if self.w_b_radps is not None:
            freeze("imu", self, {"w_b_radps": (k, 3)})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Fixes:
    """A receiver's own solution of one antenna, where raw data are absent.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    antenna : str
        Name of the antenna it speaks of.
    p_n_m : ndarray, shape (k, 3)
    v_n_mps : ndarray, shape (k, 3), or None
    position_sigma_m : ndarray, shape (k, 3)
        Standard deviations north, east, down.
    velocity_sigma_mps : ndarray, shape (k, 3), or None
    unstated : tuple of str
        Those of the two sigmas that are a usual figure, not the receiver's.
    """

    t_s: FloatArray
    antenna: str
    p_n_m: FloatArray
    v_n_mps: FloatArray | None
    position_sigma_m: FloatArray
    velocity_sigma_mps: FloatArray | None
    unstated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        shape = (freeze_times("fixes", self), 3)
        freeze("fixes", self, {"position_sigma_m": shape})
        if not (self.position_sigma_m > 0).all():
            raise BadInputError("fixes position_sigma_m: must be positive")
        freeze("fixes", self, {"p_n_m": shape})
        if (self.v_n_mps is None) != (self.velocity_sigma_mps is None):
            raise BadInputError("fixes velocity_sigma_mps: goes with velocities, and only then")
        if self.v_n_mps is not None and self.velocity_sigma_mps is not None:
            freeze("fixes", self, {"velocity_sigma_mps": shape})
            if not (self.velocity_sigma_mps > 0).all():
                raise BadInputError("fixes velocity_sigma_mps: must be positive")
            freeze("fixes", self, {"v_n_mps": shape})

    def __getitem__(self, rows: slice | BoolArray) -> "Fixes":
        """Return some of the fixes."""
        return replace(
            self,
            t_s=self.t_s[rows],
            p_n_m=self.p_n_m[rows],
            v_n_mps=None if self.v_n_mps is None else self.v_n_mps[rows],
            position_sigma_m=self.position_sigma_m[rows],
            velocity_sigma_mps=(
                None if self.velocity_sigma_mps is None else self.velocity_sigma_mps[rows]
            ),
        )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Seeker:
    """Quadrant photodetector that sees one beacon at a known place.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    currents : ndarray, shape (k, 4)
        Photocurrents of quadrants 1 to 4, any unit; quadrant 4 faces +x, 2 faces -x, 1 faces +y and
        3 faces -y of the detector, whose x is along +y_b, y along +z_b, boresight along +x_b.
    position_b_m : ndarray, shape (3,)
        The detector in body axes.
    landmark_n_m : ndarray, shape (3,)
        The beacon.
    detector_radius_m, focal_length_m : float
    calibration : ndarray, shape (c, 2)
        Rows of r_quad (increasing, from the logarithms of currents) and r_c, the spot's distance
        from the centre as a fraction of the detector's radius (the paper's Table 3).
    line_of_sight_sigma_rad : float
        1-sigma of a direction about each of the two axes across it; files do not state it.
    """

    t_s: FloatArray
    currents: FloatArray
    position_b_m: FloatArray
    landmark_n_m: FloatArray
    detector_radius_m: float
    focal_length_m: float
    calibration: FloatArray
    # A choice: 20 um of spot at a focal length of 20 mm, 0.4 % of a detector of 5 mm radius.
    line_of_sight_sigma_rad: float = 1e-3

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("seeker", self)
        freeze("seeker", self, {"calibration": (None, 2)})
        if len(self.calibration) < 2 or (np.diff(self.calibration, axis=0) <= 0).any():
            raise BadInputError("seeker calibration: needs two rows or more, columns increasing")
        positive("seeker detector_radius_m", self.detector_radius_m)
        positive("seeker focal_length_m", self.focal_length_m)
        positive("seeker line_of_sight_sigma_rad", self.line_of_sight_sigma_rad)
        shapes = {"currents": (k, 4), "position_b_m": (3,), "landmark_n_m": (3,)}
        freeze("seeker", self, shapes)


@dataclass(frozen=True, slots=True, kw_only=True)
class InitialAttitude:
    """What is known of the attitude at the first epoch before any measurement.

    Each angle with its standard deviation, rad, or neither.

    Attributes
    ----------
    roll_rad, pitch_rad, heading_rad : float or None
    roll_sigma_rad, pitch_sigma_rad, heading_sigma_rad : float or None
    """

    roll_rad: float | None = None
    pitch_rad: float | None = None
    heading_rad: float | None = None
    roll_sigma_rad: float | None = None
    pitch_sigma_rad: float | None = None
    heading_sigma_rad: float | None = None

    def __post_init__(self) -> None:
        """Reject an angle without its sigma, and sigmas that are not positive."""
        for name in ("roll", "pitch", "heading"):
            angle, sigma = getattr(self, f"{name}_rad"), getattr(self, f"{name}_sigma_rad")
            if (angle is None) != (sigma is None):
                lacking = f"{name}_deg" if angle is None else f"{name}_sigma_deg"
                raise BadInputError(f"initial {lacking}: angle and sigma go together; add it")
            if sigma is not None:
                positive(f"initial {name}_sigma_deg", np.degrees(sigma))

    @property
    def angles_rad(self) -> tuple[float | None, float | None, float | None]:
        """Roll, pitch, heading."""
        return self.roll_rad, self.pitch_rad, self.heading_rad

    @property
    def sigmas_rad(self) -> tuple[float | None, float | None, float | None]:
        """Of roll, pitch, heading."""
        return self.roll_sigma_rad, self.pitch_sigma_rad, self.heading_sigma_rad


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class LinkIntegers:
    """True integers of the carrier phase: one row per arc of a link, antenna and channel.

    Phase is way over wavelength plus the integer plus what double differences remove.

    Attributes
    ----------
    antennas, satellites, signals : tuple of str, length k
        Antenna by name, channel as in ``Observations``.
    from_s : ndarray, shape (k,)
        First epoch of the arc, which lasts until the link's next row; it increases within a link.
    cycles : ndarray, shape (k,)
        Whole; after a slip of half a cycle, halves.
    """

    antennas: tuple[str, ...]
    satellites: tuple[str, ...]
    signals: tuple[str, ...]
    from_s: FloatArray
    cycles: FloatArray

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = len(self.antennas)
        if not len(self.satellites) == len(self.signals) == k:
            raise BadInputError(
                f"true integers: {k} antennas, {len(self.satellites)} satellites and "
                f"{len(self.signals)} signals must be equally many"
            )
        freeze("true integers", self, {"from_s": (k,), "cycles": (k,)})
        broken = 2 * self.cycles % 1 != 0
        if broken.any():
            row = int(np.argmax(broken))
            raise BadInputError(
                "true integers cycles: must be whole or halves, "
                f"got {self.cycles[row]} at row {row}"
            )
        last: dict[tuple[str, str, str], float] = {}
        for link, start_s in zip(self.links, self.from_s.tolist(), strict=True):
            if start_s <= last.get(link, -np.inf):
                raise BadInputError(
                    f"true integers from_s: of {' '.join(link)} must increase, "
                    f"got {start_s:.9g} after {last[link]:.9g}"
                )
            last[link] = start_s

    @property
    def links(self) -> tuple[tuple[str, str, str], ...]:
        """Antenna, satellite and signal of each row."""
        return tuple(zip(self.antennas, self.satellites, self.signals, strict=True))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Truth:
    """What really happened, of a simulated flight; or a reference taken as such.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    p_n_m, v_n_mps : ndarray, shape (k, 3)
        Of the body's origin.
    R_nb : ndarray, shape (k, 3, 3)
    integers : LinkIntegers or None
        Of the phase, where they are known.
    """

    t_s: FloatArray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    R_nb: FloatArray
    integers: LinkIntegers | None = None

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("truth", self)
        freeze("truth", self, {"p_n_m": (k, 3), "v_n_mps": (k, 3), "R_nb": (k, 3, 3)})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, weakref_slot=True)
class Flight:
    """A recorded flight, real or simulated.

    Attributes
    ----------
    name : str
    start_gps_s : float
        GPS time of ``t_s = 0``: seconds since 1980-01-06, leap seconds not counted.
    origin : Origin
        Where the frame ``n`` is fixed.
    antennas : tuple of Antenna
        The first is the reference of all baselines.
    observations : Observations or None
        Raw GNSS data; its antenna axis follows ``antennas``.
    broadcast, precise : BroadcastOrbits, PreciseOrbits or None
        Where the satellites are; precise orbits are preferred where both are present.
    elevation_mask_rad : float
        Satellites below are not used.
    gnss_noise : GnssNoise
    base : Base or None
    imu, fixes, seeker, barometer, magnetometer, truth : their types, or None
    vehicle : WheeledVehicle or None
        What it may be taken to do.
    initial : InitialAttitude or None
        Of the first epoch that is estimated.
    networks : tuple of Path
        Manifests of the networks whose factors it brings (``fgnav.neural``).
    losses : tuple of Loss
        What was in the files and is not here.
    """

    name: str
    start_gps_s: float
    origin: Origin
    antennas: tuple[Antenna, ...] = ()
    observations: Observations | None = None
    broadcast: BroadcastOrbits | None = None
    precise: PreciseOrbits | None = None
    elevation_mask_rad: float = np.radians(10.0)
    gnss_noise: GnssNoise = field(default_factory=GnssNoise)
    base: Base | None = None
    imu: Imu | None = None
    fixes: Fixes | None = None
    seeker: Seeker | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None
    vehicle: WheeledVehicle | None = None
    initial: InitialAttitude | None = None
    truth: Truth | None = None
    networks: tuple[Path, ...] = ()
    losses: tuple[Loss, ...] = ()

    def __post_init__(self) -> None:
        """Check what the parts owe each other."""
        names = [antenna.name for antenna in self.antennas]
        for name in names:
            if names.count(name) > 1:
                raise BadInputError(f"antenna {name}: two antennas have this name")
        if self.observations is not None:
            if self.observations.tag_s.shape[1] != len(self.antennas):
                raise BadInputError(
                    f"observations: of {self.observations.tag_s.shape[1]} antennas, "
                    f"but the flight has {len(self.antennas)}"
                )
            if self.broadcast is None and self.precise is None:
                raise BadInputError("gnss: observations need navigation or orbits files")
        if self.fixes is not None and self.fixes.antenna not in names:
            raise BadInputError(f"fixes antenna: {self.fixes.antenna!r} is not one of {names}")
        if not 0 <= self.elevation_mask_rad < np.pi / 2:
            raise BadInputError(
                "elevation_mask_deg: must be within 0 and 90, "
                f"got {np.degrees(self.elevation_mask_rad):g}"
            )

    def __repr__(self) -> str:
        """Return five lines: where it is, what was measured, what is lost."""
        return summary(self)

    def _repr_html_(self) -> str:
        """Return the same for a notebook."""
        return summary_html(self)

    def antenna(self, name: str) -> Antenna:
        """Return the antenna of that name.

        Raises
        ------
        BadInputError
            If there is none.
        """
        for antenna in self.antennas:
            if antenna.name == name:
                return antenna
        raise BadInputError(f"antenna {name!r}: not one of {[a.name for a in self.antennas]}")
