"""The sliding window fed epoch by epoch, as measurements come, for as long as they come."""

from collections import deque
from dataclasses import dataclass, field, replace

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BadInputError, FloatArray
from fgnav.earth import Origin
from fgnav.estimate import Estimate
from fgnav.flight import Imu
from fgnav.methods.smoother.constants import asked, of_vehicle
from fgnav.methods.smoother.constants_found import constants_found
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.estimates import stated
from fgnav.methods.smoother.keyframes import ArrayForm, Keyframes, Timed
from fgnav.methods.smoother.preintegration import SUB_STEPS, Preintegrator, increments
from fgnav.methods.smoother.surroundings import (
    Heights,
    MagneticField,
    field_of,
    heights_of,
    with_offsets,
)
from fgnav.methods.smoother.window import Taken, Window, solution_of
from fgnav.surroundings import Barometer, Magnetometer

# What a measurement needs to be stated of it.
_NEEDED = {"sight": "landmark_n_m", "height_m": "barometer", "field_b_ut": "magnetometer"}


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class StreamSetUp:
    """What is known of a vehicle before its measurements come.

    Attributes
    ----------
    origin : Origin
    antenna_b_m : ndarray, shape (3,)
        The antenna that positions speak of.
    slot_sigma : ndarray, shape (6,)
        1-sigma of the accelerometer's bias, then of the gyroscope's; without one, of the first
        body rate.
    angular_acceleration_density : ndarray, shape (3,)
        (rad/s2)2/Hz about the body axes; 0 with a gyroscope.
    landmark_n_m : ndarray, shape (3,), or None
    barometer : Barometer or None
        Where its port is and how it errs; its record is not read. One offset holds for as long as
        the stream runs: no drift.
    magnetometer : Magnetometer or None
        The field where the vehicle is, and how the instrument errs; its record is not read.
    estimate : tuple of str
        What else to estimate, such as ``("boresight", "lever-arm=0.2")``, see ``constants.asked``:
        all but antennas. It is linearised where it is stated: angles off by more than a few degrees
        want a flight's batch first.
    first_rate_b_radps : ndarray, shape (3,)
        Where the search for the first body rate starts; only without a gyroscope.
    sub_steps : int
        Integration steps per inertial sample.
    """

    origin: Origin
    antenna_b_m: FloatArray
    slot_sigma: FloatArray
    angular_acceleration_density: FloatArray
    landmark_n_m: FloatArray | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None
    estimate: tuple[str, ...] = ()
    first_rate_b_radps: FloatArray = field(default_factory=lambda: np.zeros(3))
    sub_steps: int = SUB_STEPS

    def __post_init__(self) -> None:
        """Reject what a stream cannot estimate."""
        for word in asked(self.estimate):
            if word.kind == "antenna":
                raise BadInputError(
                    "stream set-up estimate: antennas cannot be, phases come reduced by their "
                    "stated places; run a recorded flight with --estimate antennas"
                )
            if word.kind in ("landmark", "boresight") and self.landmark_n_m is None:
                raise BadInputError(f"stream set-up estimate: {word.kind} needs a landmark_n_m")
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
    """What came in up to a keyframe since the one before.

    Attributes
    ----------
    t_s : float
        Of the keyframe.
    imu : Imu
        Of the same instrument in the same place every time: samples from the keyframe before, or
        earlier, to this one, or later. A few more on either side, and the curve through them is
        that of the whole record.
    array : RotationQuadratic or None
        What the array's phases say, one epoch.
    R_nb : ndarray, shape (3, 3), or None
        Where the search for the first attitude starts; needed only without an array.
    position : Measured or None
        Of the antenna, frame ``n``.
    velocity : Measured or None
        Of the accelerometer, frame ``n``.
    gravity, sight : Direction or None
        Of gravity, and from the accelerometer to the landmark.
    height_m : float or None
        By the barometer, above whatever it counts from.
    field_b_ut : ndarray, shape (3,), or None
        By the magnetometer.
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


class Stream:
    """A sliding window that runs on: one update per keyframe, memory bounded by the lag.

    Parameters
    ----------
    set_up : StreamSetUp
    lag_s : float
        Keyframes leave when they are known from the measurements up to this long after them, or
        up to a second longer.
    """

    def __init__(self, set_up: StreamSetUp, lag_s: float = 5.0) -> None:
        self._set_up = set_up
        self._constants = tuple(of_vehicle(word) for word in asked(set_up.estimate))
        self._latest: Keyframes | None = None
        self._window = Window(lag_s)
        self._told: deque[FloatArray] = deque()  # rates by the gyroscope at the keyframes kept
        self._last_s = -np.inf

    def update(self, measurements: Measurements) -> Estimate:
        """Take a keyframe in; return the keyframes that leave by that, smoothed; often none.

        Raises
        ------
        BadInputError
            If it does not come after the one before, if it has what the set-up says nothing of, or
            the first has nothing to start from.
        """
        if not measurements.t_s > self._last_s:
            raise BadInputError(
                f"measurements t_s: must come after {self._last_s}, got {measurements.t_s}"
            )
        for name, needed in _NEEDED.items():
            there = getattr(measurements, name) is not None
            if there and getattr(self._set_up, needed) is None:
                raise BadInputError(f"measurements {name}: the set-up has no {needed}")
        self._latest = keyframes = self._keyframes(measurements)
        taken = self._window.update(keyframes, len(keyframes.t_s) - 1)
        self._last_s = measurements.t_s
        self._told.append(keyframes.preintegrate.told_radps(keyframes.t_s[-1:])[0])
        estimate = self._estimate(taken)
        for _ in estimate.t_s:
            self._told.popleft()
        return estimate

    def newest(self) -> Estimate:
        """Return the newest keyframe, known from what has come so far."""
        taken = self._window.newest()
        return self._estimate(taken, first=len(self._told) - 1)

    def rest(self) -> Estimate:
        """Return the keyframes that have not left, known from all that has come."""
        return self._estimate(self._window.rest())

    def _estimate(self, taken: Taken | None, first: int = 0) -> Estimate:
        if taken is None or self._latest is None:
            return Estimate(method="smoother", t_s=np.empty(0), epochs=0, R_nb=np.empty((0, 3, 3)))
        solution, n = solution_of([taken]), len(taken.t_s)
        told = np.array([self._told[k] for k in range(first, first + n)])
        return replace(
            stated("smoother", self._latest, solution, taken.t_s, told),
            constants=constants_found(self._latest, solution),
        )

    def _keyframes(self, now: Measurements) -> Keyframes:
        """Return the keyframe as the last of one or two rows; the first only lends its time."""
        set_up, is_first = self._set_up, not len(self._window)
        if is_first:
            R_nb, p_n_m = _first(now, set_up)
        else:
            told, p_n_m = _attitude(now), self._window.place_n_m()
            R_nb = np.eye(3) if told is None else told
        t_s = np.array([now.t_s] if is_first else [self._last_s, now.t_s])
        n = len(t_s)
        slot = np.concatenate([np.zeros(3), -set_up.first_rate_b_radps])
        heights, field_ = self._surroundings(now, t_s, p_n_m)
        gravity_n_mps2 = np.tile(set_up.origin.gravity_n_mps2(p_n_m[None]), (n, 1))
        v_n_mps = np.zeros(3) if now.velocity is None else now.velocity.value
        return Keyframes(
            t_s=t_s,
            array=_array(now.array, n),
            R_nb=np.tile(R_nb, (n, 1, 1)),
            p_n_m=np.tile(p_n_m, (n, 1)),
            v_n_mps=np.tile(v_n_mps, (n, 1)),
            slot=np.tile(slot if now.imu.w_b_radps is None else np.zeros(6), (n, 1)),
            slot_sigma=set_up.slot_sigma,
            position=_timed(now.position, n, _arm_b_m(now, set_up)),
            velocity=_timed(now.velocity, n, np.zeros(3)),
            gravity=_directions("gravity", now.gravity, n),
            gravity_n_mps2=gravity_n_mps2,
            sight=_directions("line of sight", now.sight, n),
            landmark_n_m=set_up.landmark_n_m,
            constants=with_offsets(self._constants, heights, field_),
            heights=heights,
            field=field_,
            preintegrate=Preintegrator(
                imu=now.imu,
                increments=increments(now.imu, t_s, set_up.sub_steps),
                gravity_n_mps2=gravity_n_mps2,
                earth_rate_n_radps=set_up.origin.earth_rate_n_radps,
                angular_acceleration_density=set_up.angular_acceleration_density,
            ),
        )

    def _surroundings(
        self, now: Measurements, t_s: FloatArray, p_n_m: FloatArray
    ) -> tuple[Heights | None, MagneticField | None]:
        """Return what barometer and magnetometer say, in the last of the rows."""
        barometer, magnetometer, n = self._set_up.barometer, self._set_up.magnetometer, len(t_s)
        heights, field_ = None, None
        if barometer is not None:
            height_m = np.full(n, np.nan)
            height_m[-1] = np.nan if now.height_m is None else now.height_m
            places_n_m, at_b_m = np.tile(p_n_m, (n, 1)), now.imu.position_b_m
            heights = heights_of(barometer, at_b_m, self._set_up.origin, t_s, places_n_m, height_m)
        if magnetometer is not None:
            field_b_ut = np.full((n, 3), np.nan)
            field_b_ut[-1] = np.nan if now.field_b_ut is None else now.field_b_ut
            field_ = field_of(magnetometer, field_b_ut)
        return heights, field_


def _attitude(now: Measurements) -> FloatArray | None:
    """Return the array's own attitude, (3, 3)."""
    if now.array is None:
        return None
    solution = maximum_likelihood(now.array)
    return solution.R_nb[0] if solution.solved[0] else None


def _first(now: Measurements, set_up: StreamSetUp) -> tuple[FloatArray, FloatArray]:
    """Return where the first keyframe's search starts."""
    R_nb = now.R_nb if now.R_nb is not None else _attitude(now)
    if R_nb is None:
        raise BadInputError("first measurements R_nb: needed where no array tells an attitude")
    if now.position is None:
        raise BadInputError("first measurements position: needed to start from")
    return R_nb, now.position.value - R_nb @ _arm_b_m(now, set_up)


def _arm_b_m(now: Measurements, set_up: StreamSetUp) -> FloatArray:
    """Return the way from the accelerometer to the antenna of positions, (3,)."""
    return set_up.antenna_b_m - now.imu.position_b_m


def _array(form: RotationQuadratic | None, n: int) -> ArrayForm:
    """Return the form in the last of n rows."""
    there = np.zeros(n, dtype=np.bool_)
    if form is None:
        return ArrayForm.of(None, there)
    there[-1] = True
    return ArrayForm.of(form[np.zeros(n, dtype=np.int64)], there)


def _timed(measured: Measured | None, n: int, arm_b_m: FloatArray) -> Timed | None:
    """Return a measurement in the last of n rows."""
    if measured is None:
        return None
    value = np.full((n, 3), np.nan)
    value[-1] = measured.value
    return Timed(value=value, covariance=np.tile(measured.covariance, (n, 1, 1)), arm_b_m=arm_b_m)


def _directions(what: str, direction: Direction | None, n: int) -> Directions | None:
    """Return a direction in the last of n rows."""
    if direction is None:
        return None
    one = Directions.of(what, direction.e_b[None], direction.covariance[None])
    return one.at(np.array([n - 1]), n)
