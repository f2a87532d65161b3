"""Instruments of a vehicle and their samples: antennas, inertial unit, detector."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar, Literal, Self, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, freeze, freeze_times, positive

ElevationWeights: TypeAlias = Literal["sine", "uniform"]
# Usual noise, where a flight states none: what identification starts from.
# Data sheets of small units (TDK ICM-42688-P and MPU-6050, Bosch BMI160 and BMI270) state 7e-4 to
# 4e-3 m/s2/sqrt(Hz) and 5e-5 to 1e-4 rad/s/sqrt(Hz); in motion, with vibration, small units have
# ten times that and more. Biases and walks: consumer grade of Groves, 2nd edition, 2013, table 4.1
# and section 4.4.1.
USUAL_IMU_NOISE = {
    "accelerometer_noise_mps2_per_sqrt_hz": 1e-2,
    "accelerometer_bias_mps2": 0.3,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-3,
    "gyroscope_noise_radps_per_sqrt_hz": 5e-4,
    "gyroscope_bias_radps": 0.02,
    "gyroscope_bias_walk_radps_per_sqrt_s": 2e-5,
}
# What a receiver's own solution is good for where the file does not say: a single-frequency code
# solution under open sky.
USUAL_POSITION_SIGMA_M = (3.0, 3.0, 5.0)
USUAL_VELOCITY_SIGMA_MPS = (0.1, 0.1, 0.1)
# Fixed integers: data sheet of the u-blox ZED-F9P, .01 m, and .4 deg of a heading along 1 m.
USUAL_BASELINE_SIGMA_M = (0.01, 0.01, 0.02)


class Samples:
    """A record with a row for each of its times.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
    columns : tuple of str
        Fields that have k rows, ``t_s`` among them; such a field may be None.
    """

    __slots__ = ()
    columns: ClassVar[tuple[str, ...]]
    t_s: FloatArray

    def __repr__(self) -> str:
        """Return the number of samples and their span."""
        count, t_s = f"{len(self.t_s)} samples", self.t_s
        span = f", {t_s[0]:.3f} to {t_s[-1]:.3f} s" if len(t_s) else ""
        return f"<{type(self).__name__}: {count}{span}>"

    def __getitem__(self, rows: slice | BoolArray) -> Self:
        """Return selected samples."""
        values = {name: getattr(self, name) for name in self.columns}
        kept = {name: value[rows] for name, value in values.items() if value is not None}
        return replace(self, **kept)  # type: ignore[type-var]  # all records are dataclasses


def joined(parts: Sequence[Samples]) -> Samples:
    """Return records of one sensor, one after the other."""
    values = {name: [getattr(block, name) for block in parts] for name in parts[0].columns}
    rows = {name: np.concatenate(of) for name, of in values.items() if of[0] is not None}
    return replace(parts[0], **rows)  # type: ignore[type-var]  # all records are dataclasses


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
    atmosphere : bool
        Whether signals come through one, whose models are applied: simulated ones may not.
    wind_up : bool
        Whether turns of antennas wind up their phases: of all receivers they do, of simulated ones
        where the scenario says so.
    message_errors : bool
        Whether messages and models of the atmosphere err as they state: of all satellites they do,
        of simulated ones where the scenario says so.
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
    atmosphere: bool = True
    wind_up: bool = True
    message_errors: bool = True
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


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Imu(Samples):
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
    clock_offset_sigma_s : float
        1-sigma of what is to be added to all sample times; 0 of exact ones.
    unstated : tuple of str
        Names of noises and walks that the flight does not state: a usual figure stands there.
    """

    columns: ClassVar = ("t_s", "f_b_mps2", "w_b_radps")
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
    clock_offset_sigma_s: float = 0.0
    unstated: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k = freeze_times("imu", self)
        freeze("imu", self, {"f_b_mps2": (k, 3), "position_b_m": (3,)})
        accelerometer = ("noise_mps2_per_sqrt_hz", "bias_mps2", "bias_walk_mps2_per_sqrt_s")
        for name in accelerometer:
            positive(f"imu accelerometer_{name}", getattr(self, f"accelerometer_{name}"))
        if not 0 <= self.clock_offset_sigma_s < np.inf:
            raise BadInputError(
                f"imu clock_offset_sigma_s: must be 0 or more, got {self.clock_offset_sigma_s}"
            )
        gyroscope = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")
        for name in gyroscope:
            value = getattr(self, f"gyroscope_{name}")
            if (value is None) != (self.w_b_radps is None):
                raise BadInputError(f"imu gyroscope_{name}: goes with gyroscope samples, only then")
            if value is not None:
                positive(f"imu gyroscope_{name}", value)
        if self.w_b_radps is not None:
            freeze("imu", self, {"w_b_radps": (k, 3)})


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, repr=False)
class Photodetector(Samples):
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
    calibration : ndarray, shape (c, 2)
        Rows of r_quad (increasing, from the logarithms of currents) and r_c, the spot's distance
        from the centre as a fraction of the detector's radius (the paper's Table 3).
    line_of_sight_sigma_rad : float
        1-sigma of a direction about each of the two axes across it; files do not state it.
    """

    columns: ClassVar = ("t_s", "currents")
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
        k = freeze_times("photodetector", self)
        freeze("photodetector", self, {"calibration": (None, 2)})
        if len(self.calibration) < 2 or (np.diff(self.calibration, axis=0) <= 0).any():
            raise BadInputError(
                "photodetector calibration: needs two rows or more, columns increasing"
            )
        positive("photodetector detector_radius_m", self.detector_radius_m)
        positive("photodetector focal_length_m", self.focal_length_m)
        positive("photodetector line_of_sight_sigma_rad", self.line_of_sight_sigma_rad)
        shapes = {"currents": (k, 4), "position_b_m": (3,), "landmark_n_m": (3,)}
        freeze("photodetector", self, shapes)


def filled(stated: Mapping[str, float | None], usual: Mapping[str, float]) -> dict[str, Any]:
    """Return noise by name, the usual in the place of what is not stated; ``unstated`` with it."""
    values = {name: usual[name] if x is None else x for name, x in stated.items()}
    return values | {"unstated": tuple(name for name, x in stated.items() if x is None)}


def imu_noise(keys: object, *, gyroscope: bool) -> dict[str, Any]:
    """Return a unit's noise of keys with its names, without a gyroscope none of one."""
    stated = {name: getattr(keys, name) for name in USUAL_IMU_NOISE}
    none = {n: None for n, x in stated.items() if x is None and n.startswith("gyroscope")}
    absent = {} if gyroscope else none
    return filled({n: x for n, x in stated.items() if n not in absent}, USUAL_IMU_NOISE) | absent
