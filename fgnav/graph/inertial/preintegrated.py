"""Motion with a gyroscope: specific force and rate summed up between keyframes by GTSAM.

``GalileanCombinedImuFactor`` takes increments of attitude, position and velocity as one element of
the Galilean group, exact for force and rate constant within a sub-step [1]_; both biases follow
random walks. Its 15 rows are rotation, position, velocity, accelerometer bias and gyroscope bias.
``CombinedImuFactor`` takes the attitude at the start of each sub-step: at 45 deg and 1 rad/s its
velocity is off by 2 mm/s in 0.1 s of ten samples, here by 6e-6 m/s.

References
----------
.. [1] Delama, Fornasier, Mahony, Weiss: Equivariant IMU preintegration with biases, a Galilean
   group approach, IEEE RA-L 10, 2025.
"""

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import cast

import gtsam
import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.geometry.interpolation import interpolate
from fgnav.graph import keys
from fgnav.graph.build import as_bias
from fgnav.graph.inertial.increments import Increments, at_latest, increments, parents
from fgnav.graph.types.arrays import check_shapes
from fgnav.graph.types.motion import (
    EVERY,
    INERTIAL_NOISES,
    INTEGRATION_M2,
    LinearisedMotion,
    NoiseParts,
)
from fgnav.graph.types.states import AUX, GYROSCOPE_AUX, States
from fgnav.types.flight import Imu

TURNED_RAD = 0.002  # bias times span beyond which the first-order correction errs: .02 sigma
_GRAVITY_DIGITS = 5  # 1e-5 m/s2, three metres of height: intervals alike share their parameters
_COARSE_STEPS = 10  # of an interval, where only covariances are wanted
_WIDTH = AUX + GYROSCOPE_AUX


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Inertial:
    """The motion between n keyframes of a flight with a gyroscope."""

    t_s: FloatArray  # (n,)
    imu: Imu
    sub_steps: int  # of one sample
    gravity_n_mps2: FloatArray  # (n, 3): where each keyframe is
    earth_rate_n_radps: FloatArray  # (3,)
    # Power spectral density of the specific force in each interval, (m/s2)^2/Hz.
    accelerometer_noise: FloatArray  # (n - 1,)
    gyroscope_noise: FloatArray  # (n - 1,): that of the rate, (rad/s)^2/Hz
    # By how much both biases vary in each interval beside their walks, (m/s2)^2/s, (rad/s)^2/s.
    bias_steps: FloatArray | None = None  # (n - 1, 6)
    _increments: Increments = field(init=False, repr=False)
    # Biases about which intervals are preintegrated, (n - 1, 6), NaN before that; what is released
    # is made again about the same ones, to the last bit the same. GTSAM's parameters by what is in
    # them.
    _biases: FloatArray = field(init=False, repr=False)
    _preintegrated: dict[int, gtsam.PreintegratedCombinedMeasurementsG] = field(
        init=False, repr=False, default_factory=dict
    )
    _made: dict[tuple[float, ...], gtsam.PreintegrationCombinedParams] = field(
        init=False, repr=False, default_factory=dict
    )

    def __post_init__(self) -> None:
        """Check shapes and cut the samples.

        Raises
        ------
        BadInputError
            If there is no gyroscope or an array has a wrong shape.
        """
        if self.imu.w_b_radps is None:
            raise BadInputError("inertial motion: the imu has no gyroscope")
        n = len(self.t_s)
        shapes = {
            "gravity_n_mps2": (n, 3),
            "accelerometer_noise": (n - 1,),
            "gyroscope_noise": (n - 1,),
            "bias_steps": (n - 1, GYROSCOPE_AUX),
        }
        check_shapes("inertial", self, shapes)
        object.__setattr__(self, "_increments", increments(self.imu, self.t_s, self.sub_steps))
        object.__setattr__(self, "_biases", np.full((n - 1, GYROSCOPE_AUX), np.nan))

    @property
    def aux(self) -> int:
        """Dimensions of ``States.aux``."""
        return GYROSCOPE_AUX

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,), between states, j of each."""
        j, b = len(intervals), len(before.constants)
        graph = gtsam.NonlinearFactorGraph()
        for i, k in enumerate(intervals.tolist()):
            graph.add(self._factor(k, 2 * i, 2 * i + 1, before.aux[i]))
        linear = graph.linearize(_values(before, after))
        A, right = np.empty((j, _WIDTH, 2 * _WIDTH)), np.empty((j, _WIDTH))
        for i in range(j):
            A[i], right[i] = linear.at(i).jacobian()
        # Columns: pose and velocity before, those after, biases before, biases after.
        (x, y), (u, v) = (A[:, :, :AUX], A[:, :, AUX : 2 * AUX]), np.split(A[:, :, 2 * AUX :], 2, 2)
        return LinearisedMotion(
            value=-right,
            before=np.concatenate([x, u], axis=2),
            after=np.concatenate([y, v], axis=2),
            shared=np.zeros((j, _WIDTH, b)),
        )

    def predict(self, before: States, intervals: IntArray) -> States:
        """Return the states that intervals, (j,), lead to: all 15 rows are zero there."""
        after = before.copied()
        for i, k in enumerate(intervals.tolist()):
            aux = before.aux[i]
            rotation = gtsam.Rot3(before.R_nb[i])
            state = gtsam.NavState(rotation, before.p_n_m[i], before.v_n_mps[i])
            predicted = self._sums(k, aux).predict(state, as_bias(aux))
            after.R_nb[i] = predicted.attitude().matrix()
            after.p_n_m[i], after.v_n_mps[i] = predicted.position(), predicted.velocity()
        return after

    def rates_b_radps(self, t_s: FloatArray, aux: FloatArray) -> FloatArray:
        """Return body rates against inertial space, (m, 3), at times with states' ``aux``, (m, 6).

        The gyroscope's, from samples up to each time, less its bias.
        """
        samples = cast("FloatArray", self.imu.w_b_radps)  # checked when made
        return at_latest(self.imu.t_s, samples, t_s) - aux[:, 3:]

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        """Return mean, (6,), and whitening rows, (6, 6 + b), of the first keyframe's biases."""
        imu, rows = self.imu, np.zeros((GYROSCOPE_AUX, GYROSCOPE_AUX + constants))
        sigma = np.repeat([imu.accelerometer_bias_mps2, imu.gyroscope_bias_radps or np.inf], 3)
        rows[range(GYROSCOPE_AUX), range(GYROSCOPE_AUX)] = 1 / sigma
        return np.zeros(GYROSCOPE_AUX), rows

    def factors(
        self, k: int, key_before: int, key_after: int, about: States
    ) -> tuple[gtsam.NonlinearFactor, ...]:
        """Return interval k as one factor between two keyframes, about row 0 of ``about``."""
        return (self._factor(k, key_before, key_after, about.aux[0]),)

    def with_added_noise(
        self, accelerometer_density: FloatArray, gyroscope_density: FloatArray
    ) -> "Inertial":
        """Add white noise, (n - 1,) each, (m/s2)^2/Hz and (rad/s)^2/Hz.

        Raises
        ------
        BadInputError
            If what is added has another shape.
        """
        return replace(
            self,
            accelerometer_noise=self.accelerometer_noise + accelerometer_density,
            gyroscope_noise=self.gyroscope_noise + gyroscope_density,
        )

    def at_times(self, t_s: FloatArray) -> "Inertial":
        """Build the motion between other keyframes, (m,), the present ones among them.

        An interval has the noise of the one that its middle is in.
        """
        parent = parents(self.t_s, t_s)
        return replace(
            self,
            t_s=t_s,
            gravity_n_mps2=interpolate(t_s, self.t_s, self.gravity_n_mps2),
            accelerometer_noise=self.accelerometer_noise[parent],
            gyroscope_noise=self.gyroscope_noise[parent],
            bias_steps=None if self.bias_steps is None else self.bias_steps[parent],
        )

    def release(self, before: int) -> None:
        """Keep nothing large of the intervals before one, whose keyframes have left a window."""
        for k in [k for k in self._preintegrated if k < before]:
            del self._preintegrated[k]

    def noise_parts(self, of: slice = EVERY) -> NoiseParts:
        """Compute the shares of the noises in the covariance of the whitened rows.

        One noise at a time over a few samples, for it is linear in its variance. Intervals of
        another noise than the unit's, gaps and steps, are not divided.
        """
        imu, gyroscope = self.imu, self.imu.gyroscope_noise_radps_per_sqrt_hz or 0.0
        walks = (
            imu.accelerometer_bias_walk_mps2_per_sqrt_s,
            imu.gyroscope_bias_walk_radps_per_sqrt_s or 0.0,
        )
        accelerometer = imu.accelerometer_noise_mps2_per_sqrt_hz
        of_imu = np.isclose(self.accelerometer_noise[of], accelerometer**2)
        of_imu &= np.isclose(self.gyroscope_noise[of], gyroscope**2)
        if self.bias_steps is not None:
            of_imu &= ~self.bias_steps[of].any(axis=1)
        nothing = np.zeros(GYROSCOPE_AUX)
        one_each = (
            (accelerometer**2, 0.0, nothing, 0.0),
            (0.0, gyroscope**2, nothing, 0.0),
            (0.0, 0.0, np.repeat([walks[0] ** 2, 0.0], 3), 0.0),
            (0.0, 0.0, np.repeat([0.0, walks[1] ** 2], 3), 0.0),
            (0.0, 0.0, nothing, INTEGRATION_M2),
        )
        parts = np.zeros((len(of_imu), len(one_each), _WIDTH, _WIDTH))
        for i, k in enumerate(np.arange(len(self.t_s) - 1)[of].tolist()):
            if not of_imu[i]:
                parts[i, -1] = np.eye(_WIDTH)
                continue
            about = np.nan_to_num(self._biases[k])
            model = self._factor(k, 0, 1, about).noiseModel()
            white = cast("gtsam.noiseModel.Gaussian", model).R()
            for c, noises in enumerate(one_each):
                made = self._summed(k, about, self._parameters(k, *noises), _COARSE_STEPS)
                parts[i, c] = white @ made.residualCovariance() @ white.T
        return NoiseParts(INERTIAL_NOISES, parts[:, :-1], parts[:, -1])

    def _factor(
        self, k: int, key_before: int, key_after: int, biases: FloatArray
    ) -> gtsam.GalileanCombinedImuFactor:
        return gtsam.GalileanCombinedImuFactor(
            keys.pose(key_before),
            keys.velocity(key_before),
            keys.pose(key_after),
            keys.velocity(key_after),
            keys.imu_bias(key_before),
            keys.imu_bias(key_after),
            self._sums(k, biases),
        )

    def _sums(self, k: int, biases: FloatArray) -> gtsam.PreintegratedCombinedMeasurementsG:
        """Return interval k summed up about biases near to those given, (6,).

        Near enough for a linear correction; that for the accelerometer's bias alone is exact.
        """
        about, sums = self._biases, self._preintegrated
        span_s = self.t_s[k + 1] - self.t_s[k]
        if not np.abs(biases[3:] - about[k, 3:]).max() * span_s < TURNED_RAD:
            about[k] = biases
            sums.pop(k, None)
        if k not in sums:
            steps = np.zeros(GYROSCOPE_AUX) if self.bias_steps is None else self.bias_steps[k]
            walk = self.imu.accelerometer_bias_walk_mps2_per_sqrt_s
            turning = self.imu.gyroscope_bias_walk_radps_per_sqrt_s or 0.0
            walks = np.repeat([walk**2, turning**2], 3) + steps
            noise = float(self.accelerometer_noise[k]), float(self.gyroscope_noise[k])
            sums[k] = self._summed(k, about[k], self._parameters(k, *noise, walks, INTEGRATION_M2))
        return sums[k]

    def _summed(
        self,
        k: int,
        biases: FloatArray,
        parameters: gtsam.PreintegrationCombinedParams,
        most: int | None = None,
    ) -> gtsam.PreintegratedCombinedMeasurementsG:
        """Return interval k summed up about biases, (6,); by ``most`` of its sub-steps or fewer."""
        step_s, f_b, w_b = self._increments.interval(k, most)
        made = gtsam.PreintegratedCombinedMeasurementsG(parameters, as_bias(biases))
        for f, w in zip(f_b, w_b, strict=True):
            made.integrateMeasurement(f, w, step_s)
        return made

    def _parameters(
        self, k: int, accelerometer: float, gyroscope: float, walks: FloatArray, integration: float
    ) -> gtsam.PreintegrationCombinedParams:
        """Return GTSAM's parameters of interval k by densities of noise, one object for all alike.

        Walks of both biases, (6,), among them.
        """
        gravity = np.round(self.gravity_n_mps2[k], _GRAVITY_DIGITS)
        name = (*gravity.tolist(), accelerometer, gyroscope, *walks.tolist(), integration)
        if name not in self._made:
            made = gtsam.PreintegrationCombinedParams(gravity)
            made.setOmegaCoriolis(self.earth_rate_n_radps)
            made.setAccelerometerCovariance(np.eye(3) * accelerometer)
            made.setGyroscopeCovariance(np.eye(3) * gyroscope)
            made.setIntegrationCovariance(np.eye(3) * integration)
            made.setBiasAccCovariance(np.diag(walks[:3]))
            made.setBiasOmegaCovariance(np.diag(walks[3:]))
            self._made[name] = made
        return self._made[name]


def _values(before: States, after: States) -> gtsam.Values:
    """Return states as keyframes 0, 2, 4, ... and those after them as 1, 3, 5, ..."""
    steps, count = gtsam.VectorValues(), 2 * len(before.R_nb)
    for i, states in enumerate((before, after)):
        for k, aux in zip(range(i, count, 2), states.aux, strict=True):
            steps.insert(keys.imu_bias(k), aux)
    values = _no_biases(count).retract(steps)
    for i, states in enumerate((before, after)):
        for k, R, p, v in zip(range(i, count, 2), *states[:3], strict=True):
            values.insert(keys.pose(k), gtsam.Pose3(gtsam.Rot3(R), p))
            values.insert(keys.velocity(k), v)
    return values


@lru_cache
def _no_biases(count: int) -> gtsam.Values:
    """Return biases of zero: to insert one takes 40 us, and a step from it next to nothing."""
    values = gtsam.Values()
    for k in range(count):
        values.insert(keys.imu_bias(k), gtsam.imuBias.ConstantBias())
    return values
