"""Motion with a gyroscope: specific force and rate summed up between keyframes.

GTSAM's factor is ``GalileanCombinedImuFactor``: increments of attitude, position and velocity as
one element of the Galilean group, exact for force and rate constant within a sub-step [1]_; both
biases follow random walks. The chain has the same from ``galilean_kernel`` and
``preintegrated_kernel``. Its 15 rows are rotation, position, velocity, accelerometer bias and
gyroscope bias. ``CombinedImuFactor`` takes the attitude at the start of each sub-step: at 45 deg
and 1 rad/s its velocity is off by 2 mm/s in 0.1 s of ten samples, here by 6e-6 m/s.

References
----------
.. [1] Delama, Fornasier, Mahony, Weiss: Equivariant IMU preintegration with biases, a Galilean
   group approach, IEEE RA-L 10, 2025.
"""

from copy import copy
from dataclasses import dataclass, field, replace

import gtsam
import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.geometry.interpolation import interpolate
from fgnav.graph import keys
from fgnav.graph.build import as_bias
from fgnav.graph.inertial import galilean_kernel, preintegrated_kernel
from fgnav.graph.inertial.increments import Increments, at_latest, increments, parents
from fgnav.graph.types.motion import EVERY, INERTIAL_NOISES, LinearisedMotion, NoiseParts
from fgnav.graph.types.states import AUX, States
from fgnav.types.flight import Imu

INTEGRATION_M2 = 1e-7  # m2/s: a third of a millimetre in a second keeps linear systems well posed
TURNED_RAD = 0.002  # bias times span beyond which the first-order correction errs: .02 sigma
_GRAVITY_DIGITS = 5  # 1e-5 m/s2, three metres of height: intervals alike share their parameters
_COARSE_STEPS = 10  # of an interval, where only covariances are wanted
_BIASES = 6
_WIDTH = AUX + _BIASES


@dataclass(frozen=True, eq=False, slots=True)
class _Store:
    """What was summed up, by interval, and GTSAM's parameters.

    What is released is made again about the same biases, to the last bit the same.
    """

    biases: FloatArray  # (n - 1, 6); NaN where none are
    sums: dict[int, FloatArray] = field(default_factory=dict)
    parameters: dict[tuple[float, ...], gtsam.PreintegrationCombinedParams] = field(
        default_factory=dict
    )

    @classmethod
    def empty(cls, count: int) -> "_Store":
        """Return room for so many intervals."""
        return cls(np.full((count, _BIASES), np.nan))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Inertial:
    """The motion between n keyframes of a flight with a gyroscope.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    imu : Imu
    sub_steps : int
        Of one sample.
    gravity_n_mps2 : ndarray, shape (n, 3)
        Where each keyframe is.
    earth_rate_n_radps : ndarray, shape (3,)
    accelerometer_noise : ndarray, shape (n - 1,)
        Power spectral density of the specific force in each interval, (m/s2)^2/Hz.
    gyroscope_noise : ndarray, shape (n - 1,)
        That of the rate, (rad/s)^2/Hz.
    bias_steps : ndarray, shape (n - 1, 6), or None
        By how much both biases vary in each interval beside their walks, (m/s2)^2/s, (rad/s)^2/s.
    """

    t_s: FloatArray
    imu: Imu
    sub_steps: int
    gravity_n_mps2: FloatArray
    earth_rate_n_radps: FloatArray
    accelerometer_noise: FloatArray
    gyroscope_noise: FloatArray
    bias_steps: FloatArray | None = None
    _increments: Increments = field(init=False, repr=False)
    _store: _Store = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check shapes and cut the samples.

        Raises
        ------
        BadInputError
            If there is no gyroscope or an array has a wrong shape.
        """
        if self.imu.w_b_radps is None:
            raise BadInputError("inertial motion: the imu has no gyroscope")
        self._check_shapes()
        object.__setattr__(self, "_increments", increments(self.imu, self.t_s, self.sub_steps))
        object.__setattr__(self, "_store", _Store.empty(len(self.t_s) - 1))

    def _check_shapes(self) -> None:
        n = len(self.t_s)
        shapes = {
            "gravity_n_mps2": (n, 3),
            "accelerometer_noise": (n - 1,),
            "gyroscope_noise": (n - 1,),
            "bias_steps": (n - 1, _BIASES),
        }
        for name, shape in shapes.items():
            if name == "bias_steps" and self.bias_steps is None:
                continue
            got = getattr(self, name).shape
            if got != shape:
                raise BadInputError(f"inertial {name}: expected shape {shape}, got {got}")

    @property
    def aux(self) -> int:
        """Dimensions of ``States.aux``."""
        return _BIASES

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,), between states, j of each.

        As GTSAM's factor linearises itself, in an eighth of the time.
        """
        j = len(intervals)
        out = LinearisedMotion(
            value=np.empty((j, _WIDTH)),
            before=np.empty((j, _WIDTH, _WIDTH)),
            after=np.empty((j, _WIDTH, _WIDTH)),
            shared=np.zeros((j, _WIDTH, len(before.constants))),
        )
        preintegrated_kernel.linearise(
            self._sums(intervals, before.aux),
            States(*map(np.ascontiguousarray, before)),
            States(*map(np.ascontiguousarray, after)),
            np.ascontiguousarray(self.earth_rate_n_radps),
            out,
        )
        return out

    def predict(self, before: States, intervals: IntArray) -> States:
        """Return the states that intervals, (j,), lead to: all 15 rows are zero there."""
        after = before.copied()
        preintegrated_kernel.predict(
            self._sums(intervals, before.aux),
            States(*map(np.ascontiguousarray, before)),
            np.ascontiguousarray(self.earth_rate_n_radps),
            after,
        )
        return after

    def rates_b_radps(self, t_s: FloatArray, aux: FloatArray) -> FloatArray:
        """Return body rates against inertial space, (m, 3), at times with states' ``aux``, (m, 6).

        The gyroscope's, from samples up to each time, less its bias.
        """
        return at_latest(self.imu.t_s, self.rates_of_unit_b_radps, t_s) - aux[:, 3:]

    @property
    def rates_of_unit_b_radps(self) -> FloatArray:
        """Samples of the gyroscope, (k, 3)."""
        if self.imu.w_b_radps is None:
            raise BadInputError("inertial motion: the imu has no gyroscope")
        return self.imu.w_b_radps

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        """Return mean, (6,), and whitening rows, (6, 6 + b), of the first keyframe's biases."""
        imu, rows = self.imu, np.zeros((_BIASES, _BIASES + constants))
        sigma = np.repeat([imu.accelerometer_bias_mps2, imu.gyroscope_bias_radps or np.inf], 3)
        rows[range(_BIASES), range(_BIASES)] = 1 / sigma
        return np.zeros(_BIASES), rows

    def factors(
        self, k: int, key_before: int, key_after: int, about: States
    ) -> tuple[gtsam.NonlinearFactor, ...]:
        """Return interval k as one factor between two keyframes, about row 0 of ``about``."""
        measured = self._preintegrated(k, about.aux[:1])
        factor = gtsam.GalileanCombinedImuFactor(
            keys.pose(key_before),
            keys.velocity(key_before),
            keys.pose(key_after),
            keys.velocity(key_after),
            keys.imu_bias(key_before),
            keys.imu_bias(key_after),
            measured,
        )
        return (factor,)

    def with_added_noise(
        self, accelerometer_density: FloatArray, gyroscope_density: FloatArray
    ) -> "Inertial":
        """Return the same with more white noise, (n - 1,) each, (m/s2)^2/Hz and (rad/s)^2/Hz.

        Raises
        ------
        BadInputError
            If what is added has another shape.
        """
        louder = copy(self)  # its samples are cut already
        for name, noise in (
            ("accelerometer_noise", self.accelerometer_noise + accelerometer_density),
            ("gyroscope_noise", self.gyroscope_noise + gyroscope_density),
            ("_store", _Store.empty(len(self.t_s) - 1)),
        ):
            object.__setattr__(louder, name, noise)
        louder._check_shapes()
        return louder

    def at_times(self, t_s: FloatArray) -> "Inertial":
        """Return the same motion between other keyframes, (m,), the present ones among them.

        An interval has the noise of the one that its middle is in.
        """
        part = parents(self.t_s, t_s)
        return replace(
            self,
            t_s=t_s,
            gravity_n_mps2=interpolate(t_s, self.t_s, self.gravity_n_mps2),
            accelerometer_noise=self.accelerometer_noise[part],
            gyroscope_noise=self.gyroscope_noise[part],
            bias_steps=None if self.bias_steps is None else self.bias_steps[part],
        )

    def release(self, before: int) -> None:
        """Keep nothing large of the intervals before one, whose keyframes have left a window."""
        sums = self._store.sums
        for k in [k for k in sums if k < before]:
            del sums[k]

    def noise_parts(self, of: slice = EVERY) -> NoiseParts:
        """Return what each noise contributes to the covariance of the whitened rows.

        One noise at a time over a few samples, for it is linear in its variance. Intervals of
        another noise than the unit's, gaps and steps, are not divided.
        """
        imu, gyroscope = self.imu, self.imu.gyroscope_noise_radps_per_sqrt_hz or 0.0
        walks = (
            imu.accelerometer_bias_walk_mps2_per_sqrt_s,
            imu.gyroscope_bias_walk_radps_per_sqrt_s or 0.0,
        )
        accelerometer = imu.accelerometer_noise_mps2_per_sqrt_hz
        of_unit = np.isclose(self.accelerometer_noise[of], accelerometer**2)
        of_unit &= np.isclose(self.gyroscope_noise[of], gyroscope**2)
        if self.bias_steps is not None:
            of_unit &= ~self.bias_steps[of].any(axis=1)
        one_each = np.zeros((len(INERTIAL_NOISES) + 1, galilean_kernel.NOISES))
        one_each[0, 0], one_each[1, 1] = accelerometer**2, gyroscope**2
        one_each[2, 3:6], one_each[3, 6:] = walks[0] ** 2, walks[1] ** 2
        one_each[-1, 2] = INTEGRATION_M2
        parts = np.zeros((len(of_unit), len(one_each), _WIDTH, _WIDTH))
        intervals = np.arange(len(self.t_s) - 1)[of][of_unit]
        if len(intervals):
            about = np.nan_to_num(self._store.biases[intervals])
            W = self._sums(intervals, about)[:, galilean_kernel.WHITE :]
            W = W.reshape(-1, 1, _WIDTH, _WIDTH)
            steps = self._increments.of(intervals, _COARSE_STEPS)
            earth_rate = np.ascontiguousarray(self.earth_rate_n_radps)
            P = galilean_kernel.covariances(steps, about, one_each, earth_rate)
            parts[of_unit] = W @ P @ W.swapaxes(2, 3)
        parts[~of_unit, -1] = np.eye(_WIDTH)
        return NoiseParts(INERTIAL_NOISES, parts[:, :-1], parts[:, -1])

    def _about(self, intervals: IntArray, biases: FloatArray) -> FloatArray:
        """Return biases about which intervals, (j,), are summed up, (j, 6).

        Near enough to those given for a linear correction; that for the accelerometer's bias alone
        is exact.
        """
        about = self._store.biases
        span_s = self.t_s[intervals + 1] - self.t_s[intervals]
        turned_rad = np.abs(biases[:, 3:] - about[intervals, 3:]).max(axis=1) * span_s
        far = np.flatnonzero(~(turned_rad < TURNED_RAD))
        about[intervals[far]] = biases[far]
        for k in intervals[far].tolist():
            self._store.sums.pop(k, None)
        return np.asarray(about[intervals])

    def _sums(self, intervals: IntArray, biases: FloatArray) -> FloatArray:
        """Return intervals, (j,), about biases near to those given, (j, 6); (j, 316)."""
        sums, numbers = self._store.sums, intervals.tolist()
        about = self._about(intervals, biases)
        new = [row for row, k in enumerate(numbers) if k not in sums]
        if new:
            made = self._summed(intervals[new], about[new])
            sums.update(zip(intervals[new].tolist(), made, strict=True))
        return np.array([sums[k] for k in numbers])

    def _summed(self, intervals: IntArray, biases: FloatArray) -> FloatArray:
        noises = np.zeros((len(intervals), galilean_kernel.NOISES))
        noises[:, 0] = self.accelerometer_noise[intervals]
        noises[:, 1] = self.gyroscope_noise[intervals]
        noises[:, 2] = INTEGRATION_M2
        noises[:, 3:6] = self.imu.accelerometer_bias_walk_mps2_per_sqrt_s**2
        noises[:, 6:] = (self.imu.gyroscope_bias_walk_radps_per_sqrt_s or 0.0) ** 2
        if self.bias_steps is not None:
            noises[:, 3:] += self.bias_steps[intervals]
        gravity = np.round(self.gravity_n_mps2[intervals], _GRAVITY_DIGITS)
        return galilean_kernel.sums(
            self._increments.of(intervals),
            biases,
            noises,
            gravity,
            np.ascontiguousarray(self.earth_rate_n_radps),
        )

    def _preintegrated(self, k: int, bias: FloatArray) -> gtsam.PreintegratedCombinedMeasurementsG:
        """Return interval k as GTSAM sums it up, about biases near to those given, (1, 6)."""
        interval = np.array([k])
        _, step_s, f_b, w_b = self._increments.of(interval)
        (about,) = self._about(interval, bias)
        made = gtsam.PreintegratedCombinedMeasurementsG(self._parameters(k), as_bias(about))
        for f, w in zip(f_b, w_b, strict=True):
            made.integrateMeasurement(f, w, float(step_s[0]))
        return made

    def _parameters(self, k: int) -> gtsam.PreintegrationCombinedParams:
        """Return GTSAM's parameters of interval k, one object for all that are alike."""
        gravity = np.round(self.gravity_n_mps2[k], _GRAVITY_DIGITS)
        noise = float(self.accelerometer_noise[k]), float(self.gyroscope_noise[k])
        steps = np.zeros(_BIASES) if self.bias_steps is None else self.bias_steps[k]
        name = (*gravity.tolist(), *noise, *steps.tolist())
        if name not in self._store.parameters:
            made = gtsam.PreintegrationCombinedParams(gravity)
            made.setOmegaCoriolis(self.earth_rate_n_radps)
            made.setAccelerometerCovariance(np.eye(3) * noise[0])
            made.setGyroscopeCovariance(np.eye(3) * noise[1])
            made.setIntegrationCovariance(np.eye(3) * INTEGRATION_M2)
            walk = self.imu.accelerometer_bias_walk_mps2_per_sqrt_s
            made.setBiasAccCovariance(np.diag(walk**2 + steps[:3]))
            walk = self.imu.gyroscope_bias_walk_radps_per_sqrt_s or 0.0
            made.setBiasOmegaCovariance(np.diag(walk**2 + steps[3:]))
            self._store.parameters[name] = made
        return self._store.parameters[name]
