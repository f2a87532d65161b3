"""The sliding window fed epoch by epoch, as measurements come, for as long as they come."""

from collections import Counter, deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.frontend.calibration_request import (
    calibration_requests,
    mean_rate,
    of_vehicle,
    with_landmark,
)
from fgnav.frontend.measurements import Recorded, measurements_of
from fgnav.frontend.position.series import VectorSeries
from fgnav.frontend.sensors.sensed import Sensed
from fgnav.frontend.sensors.surroundings import Heights, MagneticField, field_of, heights_of
from fgnav.geometry.earth import Origin
from fgnav.graph.factors.directions import Directions
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.keys import Timeline
from fgnav.graph.sourced import Sourced
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.states import States
from fgnav.methods.smoothing.calibration_report import calibrated_constants
from fgnav.methods.smoothing.estimates import Body, stated
from fgnav.methods.smoothing.own_sources import with_networks
from fgnav.process.evidence import RatePrior
from fgnav.types.estimate import Consistency, Estimate
from fgnav.types.flight import Imu
from fgnav.types.surroundings import Barometer, Magnetometer

if TYPE_CHECKING:
    import gtsam

    from fgnav.graph.custom import OwnFactor
    from fgnav.solve.fixed_lag import Departed

# What a measurement needs to be stated of it.
_NEEDED = {"sight": "landmark_n_m", "height_m": "barometer", "field_b_ut": "magnetometer"}
_SUB_STEPS = 1
_BEFORE_S = 0.1  # of the first keyframe: an interval that nothing uses


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class StreamSetUp:
    """What is known of a vehicle before its measurements come.

    Attributes
    ----------
    origin : Origin
    antenna_b_m : ndarray, shape (3,)
        The antenna that positions speak of.
    rate_prior : RatePrior or None
        How the body turns, needed without a gyroscope; ``process.rate_prior`` identifies it from
        attitudes recorded before.
    landmark_n_m : ndarray, shape (3,), or None
    barometer : Barometer or None
        Where its port is and how it errs; its record is not read. One offset holds for as long as
        the stream runs: no drift.
    magnetometer : Magnetometer or None
        The field where the vehicle is, and how the instrument errs; its record is not read.
    estimate : tuple of str
        What else to estimate, such as ``("boresight", "lever-arm=0.2")``, see
        ``frontend.calibration_request``: all but antennas. It is linearised where it is stated:
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
    estimate: tuple[str, ...] = ()
    sub_steps: int = _SUB_STEPS
    networks: tuple[Path, ...] = ()

    def __post_init__(self) -> None:
        """Reject what a stream cannot estimate."""
        for word in calibration_requests(self.estimate):
            if word.kind == "antenna":
                raise BadInputError(
                    "stream set-up estimate: antennas cannot be, phases come reduced by their "
                    "stated places; run a recorded flight with --estimate antennas"
                )
            if word.kind in ("clock", "velocity-delay"):
                raise BadInputError(
                    f"stream set-up estimate: {word.kind} cannot be, correct the time tags; a "
                    "recorded flight identifies what they are off by"
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
    position, velocity : Measured or None
        Of the antenna, frame ``n``.
    gravity, sight : Direction or None
        Of gravity, and from the accelerometer to the landmark.
    height_m : float or None
        By the barometer, above whatever it counts from.
    field_b_ut : ndarray, shape (3,), or None
        By the magnetometer.
    factors : tuple
        Factors of one's own that enter with the keyframe, ``Stream.keyframe`` by number.
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
    factors: "tuple[gtsam.NonlinearFactor | OwnFactor, ...]" = ()


StreamSource = Callable[[Measurements, Timeline], "Iterable[gtsam.NonlinearFactor | OwnFactor]"]


class Stream:
    """A sliding window that runs on: one update per keyframe, memory bounded by the lag.

    Parameters
    ----------
    set_up : StreamSetUp
    lag_s : float
        Keyframes leave when they are known from the measurements up to this long after them.
    factors : tuple of callable
        Sources of factors of one's own, asked at every update with the measurements and the
        timeline of all keyframes so far; what touches the newest keyframe enters.
    """

    def __init__(
        self, set_up: StreamSetUp, lag_s: float = 5.0, *, factors: tuple[StreamSource, ...] = ()
    ) -> None:
        from fgnav.solve.fixed_lag import FixedLag  # noqa: PLC0415  # lazy: gtsam

        self._set_up = set_up
        self._sources = with_networks(factors, set_up.networks)
        self._times_s: list[float] = []  # of all keyframes; only for sources
        self._latest: SmoothingProblem | None = None
        self._body: Body | None = None
        self._window = FixedLag(lag_s, block_s=0.0)
        self._last_s = -np.inf
        self._count = 0
        self._measured: deque[tuple[float, FloatArray]] = deque()  # rates of keyframes kept
        self._losses: Counter[tuple[str, str]] = Counter()
        self._judged: deque[OwnFactor] = deque()  # factors of one's own of keyframes kept

    @property
    def keyframe(self) -> int:
        """Number of the keyframe that comes next, as in ``graph.pose(k)``."""
        return self._count

    def update(self, measurements: Measurements) -> Estimate:
        """Take a keyframe in; return the keyframes that leave by that, smoothed; often none.

        Raises
        ------
        BadInputError
            If it does not come after the one before, if it has what the set-up says nothing of, or
            the first has nothing to start from.
        NoSolutionError
            If the measurements so far leave a state open.
        """
        if not measurements.t_s > self._last_s:
            raise BadInputError(
                f"measurements t_s: must come after {self._last_s}, got {measurements.t_s}"
            )
        for name, needed in _NEEDED.items():
            there = getattr(measurements, name) is not None
            if there and getattr(self._set_up, needed) is None:
                raise BadInputError(f"measurements {name}: the set-up has no {needed}")
        problem = self._problem(measurements)
        own = self._own(measurements, problem)
        departed = self._window.update(problem, len(problem.t_s) - 1, own=own)
        self._latest, self._last_s = problem, measurements.t_s
        self._count += 1
        rates = problem.motion.rates_b_radps(problem.t_s[-1:], np.zeros_like(problem.start.aux[:1]))
        self._measured.append((measurements.t_s, rates[0]))
        estimate = self._estimate(departed)
        while len(estimate.t_s) and self._measured[0][0] <= estimate.t_s[-1]:
            self._measured.popleft()
        return estimate

    def newest(self) -> Estimate:
        """Return the newest keyframe, known from what has come so far."""
        return self._estimate(self._window.newest(), leaving=False)

    def rest(self) -> Estimate:
        """Return the keyframes that have not left, known from all that has come."""
        return self._estimate(self._window.rest())

    def _own(
        self, measurements: Measurements, problem: SmoothingProblem
    ) -> "tuple[gtsam.NonlinearFactor, ...]":
        """Return factors of one's own that touch the coming keyframe."""
        if not (self._sources or measurements.factors):
            return ()
        from fgnav.graph.build import Layout  # noqa: PLC0415  # lazy: gtsam
        from fgnav.graph.custom import named  # noqa: PLC0415
        from fgnav.solve.own_factors import entering_stream  # noqa: PLC0415

        layout = Layout.of(problem)
        bounds = (layout, self._window.oldest, self._count)
        factors = []
        for one in map(named, measurements.factors):
            if not entering_stream(one, *bounds):
                raise BadInputError(
                    f"factor {one.name!r}: must touch the keyframe it enters with, {self._count}"
                )
            factors.append(one)
        times_s = [*self._times_s, measurements.t_s]
        if self._sources:
            timeline = Timeline(t_s=np.array(times_s), gyroscope=layout.gyroscope, new=self._count)
            for source in self._sources:
                made = source(measurements, timeline)
                factors += [one for one in map(named, made) if entering_stream(one, *bounds)]
                if isinstance(made, Sourced):
                    self._losses.update({(one.what, one.reason): one.count for one in made.losses})
        self._times_s = times_s
        self._judged.extend(factors)
        return tuple(one.factor for one in factors)

    def _own_tests(
        self, problem: SmoothingProblem, departed: "Departed"
    ) -> tuple[Consistency, ...]:
        """Return how factors of one's own agree that leave with keyframes.

        Those that reach back to keyframes which left before have nothing to be held against.
        """
        if not self._judged:
            return ()
        from fgnav.graph.build import Layout  # noqa: PLC0415  # lazy: gtsam
        from fgnav.graph.custom import newest_keyframe, oldest_keyframe  # noqa: PLC0415  # gtsam
        from fgnav.graph.innovations import own_consistency  # noqa: PLC0415

        first = self._count - len(self._measured)
        end, leaving = first + len(departed.t_s), []
        while self._judged and newest_keyframe(self._judged[0].factor) < end:
            leaving.append(self._judged.popleft())
        alone = [one for one in leaving if oldest_keyframe(one.factor) >= first]
        return own_consistency(alone, Layout.of(problem), departed.t_s, departed.solution, first)

    def _estimate(self, departed: "Departed | None", *, leaving: bool = True) -> Estimate:
        if departed is None or self._latest is None or self._body is None:
            return Estimate(method="smoother", t_s=np.empty(0), epochs=0, R_nb=np.empty((0, 3, 3)))
        solution, constants = departed.solution, self._latest.constants
        return replace(
            stated(
                "smoother",
                constants,
                solution,
                departed.t_s,
                self._rates_b_radps(departed.t_s, solution.states.aux),
                self._body,
            ),
            constants=calibrated_constants(constants, solution),
            losses=self._lost() if leaving else (),
            consistency=self._own_tests(self._latest, departed) if leaving else (),
        )

    def _lost(self) -> tuple[Loss, ...]:
        """Return what sources have left out since keyframes left last."""
        lost = tuple(Loss(what=w, reason=r, count=n) for (w, r), n in self._losses.items())
        self._losses.clear()
        return lost

    def _rates_b_radps(self, t_s: FloatArray, aux: FloatArray) -> FloatArray:
        """Return rates at keyframes that are in the window: states, or measured less biases."""
        if self._body is None or not self._body.gyroscope:
            return aux[:, 3:6]
        measured = dict(self._measured)
        return np.array([measured[t] for t in t_s.tolist()]).reshape(-1, 3) - aux[:, 3:6]

    def _problem(self, now: Measurements) -> SmoothingProblem:
        """Return the keyframe as the second of two rows; the first only lends its time."""
        set_up, is_first = self._set_up, self._count == 0
        if is_first:
            R_nb, p_n_m, known = *_first(now, set_up), True
            self._body = Body(
                position_b_m=now.imu.position_b_m,
                earth_rate_n_radps=set_up.origin.earth_rate_n_radps,
                gyroscope=now.imu.w_b_radps is not None,
            )
        else:
            attitude, p_n_m = _attitude(now), self._window.newest().solution.states.p_n_m[0]
            R_nb, known = np.eye(3) if attitude is None else attitude, attitude is not None
        t_s = np.array([now.t_s - _BEFORE_S if is_first else self._last_s, now.t_s])
        n = len(t_s)
        gravity_n_mps2 = np.tile(set_up.origin.gravity_n_mps2(p_n_m[None]), (n, 1))
        sensed = self._sensed(now, t_s, p_n_m)
        constants = self._constants(sensed, gyroscope=now.imu.w_b_radps is not None)
        v_n_mps = np.zeros(3) if now.velocity is None else now.velocity.value
        aux = np.zeros((n, 12 if now.imu.w_b_radps is None else 6))
        return SmoothingProblem(
            t_s=t_s,
            start=States(
                R_nb=np.tile(R_nb, (n, 1, 1)),
                p_n_m=np.tile(p_n_m, (n, 1)),
                v_n_mps=np.tile(v_n_mps, (n, 1)),
                aux=aux,
                constants=constants.start,
            ),
            motion=_motion(now, set_up, t_s, gravity_n_mps2, constants),
            measurements=measurements_of(_recorded(now, set_up, sensed, gravity_n_mps2), constants),
            constants=constants,
            attitude_known=np.full(n, known),
        )

    def _constants(self, sensed: Sensed, *, gyroscope: bool) -> Constants:
        set_up = self._set_up
        parts = tuple(of_vehicle(word) for word in calibration_requests(set_up.estimate))
        if set_up.landmark_n_m is not None:
            parts = with_landmark(parts, set_up.landmark_n_m)
        parts = (*parts, *sensed.constants)
        return Constants(parts if gyroscope else (*parts, mean_rate()))

    def _sensed(self, now: Measurements, t_s: FloatArray, p_n_m: FloatArray) -> Sensed:
        """Return what instruments say, in the last of the rows."""
        n = len(t_s)
        heights, field_ = self._surroundings(now, t_s, p_n_m)
        return Sensed(
            sight=_directions("line of sight", now.sight, n),
            gravity=_directions("gravity", now.gravity, n),
            heights=heights,
            field=field_,
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


def _motion(
    now: Measurements,
    set_up: StreamSetUp,
    t_s: FloatArray,
    gravity_n_mps2: FloatArray,
    constants: Constants,
) -> Motion:
    """Return the motion to the keyframe from the one before."""
    n, earth = len(t_s) - 1, set_up.origin.earth_rate_n_radps
    noise = np.full(n, now.imu.accelerometer_noise_mps2_per_sqrt_hz**2)
    if now.imu.gyroscope_noise_radps_per_sqrt_hz is not None:
        return Inertial(
            t_s=t_s,
            imu=now.imu,
            sub_steps=set_up.sub_steps,
            gravity_n_mps2=gravity_n_mps2,
            earth_rate_n_radps=earth,
            accelerometer_noise=noise,
            gyroscope_noise=np.full(n, now.imu.gyroscope_noise_radps_per_sqrt_hz**2),
        )
    if set_up.rate_prior is None:
        raise BadInputError("stream set-up rate_prior: needed without a gyroscope")
    return GyroFree(
        t_s=t_s,
        imu=now.imu,
        sub_steps=set_up.sub_steps,
        gravity_n_mps2=gravity_n_mps2,
        earth_rate_n_radps=earth,
        length_s=np.full(n, set_up.rate_prior.length_s),
        variance_rad2ps2=np.tile(set_up.rate_prior.variance_rad2ps2, (n, 1)),
        accelerometer_noise=noise,
        rate_column=constants.column("mean rate"),
        constants=constants,
    )


def _recorded(
    now: Measurements, set_up: StreamSetUp, sensed: Sensed, gravity_n_mps2: FloatArray
) -> Recorded:
    """Return what the last of n rows measured."""
    n, rates = len(gravity_n_mps2), None
    valid = np.zeros(n, dtype=np.bool_)
    valid[-1] = now.array is not None
    if now.imu.w_b_radps is not None:
        newest = [np.interp(now.t_s, now.imu.t_s, column) for column in now.imu.w_b_radps.T]
        rates = np.tile(newest, (n, 1))
    velocity = _series(now.velocity, n, _arm_b_m(now, set_up))
    return Recorded(
        array=None if now.array is None else now.array[np.zeros(n, dtype=np.int64)],
        array_valid=valid,
        float_stretch=np.full(n, -1, dtype=np.int64),
        shape=None,
        antennas=(),
        position=_series(now.position, n, _arm_b_m(now, set_up)),
        velocities=() if velocity is None else (velocity,),
        sensed=sensed,
        gravity_n_mps2=gravity_n_mps2,
        measured_b_radps=rates,
        earth_rate_n_radps=set_up.origin.earth_rate_n_radps,
    )


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


def _series(measured: Measured | None, n: int, arm_b_m: FloatArray) -> VectorSeries | None:
    """Return a measurement in the last of n rows."""
    if measured is None:
        return None
    value = np.full((n, 3), np.nan)
    value[-1] = measured.value
    return VectorSeries(
        value=value, covariance=np.tile(measured.covariance, (n, 1, 1)), arm_b_m=arm_b_m
    )


def _directions(what: str, direction: Direction | None, n: int) -> Directions | None:
    """Return a direction in the last of n rows."""
    if direction is None:
        return None
    one = Directions.of(what, direction.e_b[None], direction.covariance[None])
    return one.at(np.array([n - 1]), n)
