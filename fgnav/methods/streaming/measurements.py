"""Configuration of a stream's vehicle, and its measurements up to each keyframe."""

from dataclasses import dataclass
from pathlib import Path

import gtsam

from fgnav.assembly.calibration_request import calibration_requests
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.earth import Origin
from fgnav.graph.custom import NamedFactor
from fgnav.process.hyperparameters import RatePrior
from fgnav.types.flight import Imu
from fgnav.types.surroundings import Barometer, Magnetometer


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class StreamConfig:
    """Configuration of a vehicle for a stream.

    Attributes
    ----------
    origin : Origin
    antenna_b_m : ndarray, shape (3,)
        The antenna of positions.
    rate_prior : RatePrior or None
        How the body turns, needed without a gyroscope; ``process.rate_prior`` identifies it from
        attitudes recorded before.
    landmark_n_m : ndarray, shape (3,), or None
    barometer : Barometer or None
        Where its port is and how it errs; its record is not read. One offset holds for as long as
        the stream runs: no drift.
    magnetometer : Magnetometer or None
        The field where the vehicle is, and how the instrument errs; its record is not read.
    calibrate : tuple of str
        What else to estimate, such as ``("boresight", "lever-arm=0.2")``, see
        ``assembly.calibration_request``: all but antennas. It is linearised where it is stated:
        angles off by more than a few degrees want a flight's batch first.
    sub_steps : int
        Integration steps per inertial sample.
    networks : tuple of Path
        Manifests of networks whose factors the vehicle brings, such as ``flight.networks``.
    """

    origin: Origin
    antenna_b_m: FloatArray
    rate_prior: RatePrior | None = None
    landmark_n_m: FloatArray | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None
    calibrate: tuple[str, ...] = ()
    sub_steps: int = 1
    networks: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        """Reject what a stream cannot estimate."""
        for word in calibration_requests(self.calibrate):
            if word.kind == "antenna":
                raise BadInputError(
                    "calibrate: antennas cannot be, phases come reduced by their "
                    "stated places; run a recorded flight with --calibrate antennas"
                )
            if word.kind in ("clock", "velocity-delay"):
                raise BadInputError(
                    f"calibrate: {word.kind} cannot be, correct the time tags; a "
                    "recorded flight identifies what they are off by"
                )
            if word.kind in ("landmark", "boresight") and self.landmark_n_m is None:
                raise BadInputError(f"calibrate: {word.kind} needs a landmark_n_m")
        if self.barometer is not None and self.barometer.wander_m:
            raise BadInputError(
                "stream set-up barometer: wander_m must be 0, one offset holds for the whole "
                "stream; state the drift as noise_m"
            )


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Measured:
    """A value with its covariance, (3,) and (3, 3)."""

    value: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Direction:
    """A unit vector in body axes, (3,), with its covariance, (3, 3), rad2.

    Only what it says of the two angles across the vector counts: ``sigma_rad**2 * np.eye(3)`` is
    right for one as well known about either axis.
    """

    e_b: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Measurements:
    """Measurements since the previous keyframe.

    Attributes
    ----------
    t_s : float
        Of the keyframe.
    imu : Imu
        Of the same instrument in the same place every time: samples from the keyframe before, or
        earlier, to this one, or later. A few more on either side, and the curve through them is
        that of the whole record. Tags are taken as exact.
    array : RotationQuadratic or None
        Of the array's phases, one epoch.
    R_nb : ndarray, shape (3, 3), or None
        Where the search for the first attitude starts; needed only without an array.
    position, velocity : Measured or None
        Of the antenna, frame ``n``.
    gravity, sight : Direction or None
        Of gravity, and from the accelerometer to the landmark.
    height_m : float or None
        By the barometer, above whatever it counts from.
    field_b_ut : ndarray, shape (3,), or None
        By the magnetometer.
    factors : tuple
        Custom factors that enter with the keyframe, ``Stream.keyframe`` by number.
    """

    t_s: float
    imu: Imu
    array: RotationQuadratic | None = None
    R_nb: FloatArray | None = None
    position: Measured | None = None
    velocity: Measured | None = None
    gravity: Direction | None = None
    sight: Direction | None = None
    height_m: float | None = None
    field_b_ut: FloatArray | None = None
    factors: tuple[gtsam.NonlinearFactor | NamedFactor, ...] = ()
