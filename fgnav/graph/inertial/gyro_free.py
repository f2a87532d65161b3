"""Motion without a gyroscope: attitude by a Gaussian process, velocity by the accelerometer.

The body rate is a constant m of the flight plus, about each axis, a Matern-5/2 process. A keyframe
has the accelerometer's bias b and, about each axis, ``x = (w, T0 a, T0^2 j)``. An interval of
length T has 21 rows; in them ``theta = Log(R_0' R_1)``, and ``x - m`` is short for
``x - (m, 0, 0)``. Rates are those against the frame n, as attitudes tell them that identify the
process:

    rotation    theta - T^2/12 w_0 x w_1 - m T - H (x_0 - m)            second order, [1]_
    position    p_1 - p_0 - v_0 T - (g/2 - w_earth x v_0) T^2
                - R_0 sum (T - t_i) Exp(theta_i) f_i dt
    velocity    v_1 - v_0 - (g - 2 w_earth x v_0) T - R_0 sum Exp(theta_i) f_i dt
    bias        b_1 - b_0
    process     x_1 - m - F (x_0 - m)
    multipath   z_1 - F z_0, of an array whose phases err lastingly (``multipath``), q rows more

``f_i`` is the specific force less b_0 in the middle of sub-step i, and ``theta_i`` the cubic
Hermite path from 0 with slope w_0 to theta with slope ``J_r^-1(theta) w_1``. Rotation and process
are whitened together, and so are position and velocity.

References
----------
.. [1] Blanes, Casas, Oteo, Ros: The Magnus expansion and some of its applications, Physics Reports
   470, 2009.
"""

from dataclasses import dataclass, field, replace
from functools import cache

import gtsam
import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.geometry.interpolation import interpolate
from fgnav.graph import keys
from fgnav.graph.inertial import gyro_free_kernel as kernel
from fgnav.graph.inertial.gyro_free_kernel import ROWS, Filled, Rows
from fgnav.graph.inertial.increments import increments, parents
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.inertial.path_kernel import Intervals
from fgnav.graph.types.arrays import check_shapes
from fgnav.graph.types.motion import EVERY, INTEGRATION_M2, LinearisedMotion, NoiseParts
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.states import AUX, States
from fgnav.process import matern
from fgnav.types.flight import Imu

MEAN_RATE = "mean rate"  # the constant about which rates wander, rad/s
_VECTOR = 12  # accelerometer bias, rate, its two derivatives


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GyroFree:
    """The motion between n keyframes of a flight without a gyroscope.

    A caller splits intervals such that the rate times their length stays below 0.7 rad.
    """

    t_s: FloatArray  # (n,)
    imu: Imu  # without a gyroscope, or with one that is not used
    sub_steps: int  # of one sample of the accelerometer
    gravity_n_mps2: FloatArray  # (n, 3): where each keyframe is
    earth_rate_n_radps: FloatArray  # (3,)
    # Of the rate's process in each interval, about each body axis.
    poles_per_s: FloatArray  # (n - 1, 3, 3)
    variance_rad2ps2: FloatArray  # (n - 1, 3): its variance about each body axis
    # Power spectral density of the specific force, (m/s2)^2/Hz.
    accelerometer_noise: FloatArray  # (n - 1,)
    constants: Parameters  # the mean rate among them
    multipath: Multipath | None = None  # correlated error of the array's phases
    _intervals: Intervals = field(init=False, repr=False)
    _buffer: "_Buffer" = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check shapes; cut the samples and prepare noise and process of each interval.

        Raises
        ------
        BadInputError
            If an array has a wrong shape or the mean rate is not among the constants.
        """
        n = len(self.t_s)
        shapes = {
            "gravity_n_mps2": (n, 3),
            "poles_per_s": (n - 1, 3, 3),
            "variance_rad2ps2": (n - 1, 3),
            "accelerometer_noise": (n - 1,),
        }
        check_shapes("gyro-free", self, shapes)
        if not self.mean_rate.stop:
            raise BadInputError(f"gyro-free constants: {MEAN_RATE} is not among them")
        object.__setattr__(self, "_intervals", self._prepared())
        object.__setattr__(self, "_buffer", _Buffer.empty(self._correlated))

    def _prepared(self) -> Intervals:
        cut = increments(self.imu, self.t_s, self.sub_steps)
        span_s = np.diff(self.t_s)
        F, H, W = matern.intervals(span_s, self.poles_per_s)
        none = np.zeros((len(span_s), 0, 0))
        correlated, white = (none, none) if self.multipath is None else self.multipath.transition()
        walk = self.imu.accelerometer_bias_walk_mps2_per_sqrt_s
        return Intervals(
            span_s=span_s,
            step_s=cut.step_s,
            first=cut.first,
            f_b_mps2=cut.f_b_mps2,
            gravity_n_mps2=_contiguous(self.gravity_n_mps2),
            earth_rate_n_radps=_contiguous(self.earth_rate_n_radps),
            transition=_contiguous(F),
            turn=_contiguous(H),
            white=_contiguous(W),
            sigma_radps=np.sqrt(self.variance_rad2ps2),
            force_white=_force_white(span_s, self.accelerometer_noise),
            walk_white=1 / (walk * np.sqrt(span_s)),
            correlated=_contiguous(correlated),
            correlated_white=_contiguous(white),
        )

    @property
    def _correlated(self) -> int:
        """Dimensions of the array's time-correlated error, q."""
        return 0 if self.multipath is None else self.multipath.size

    @property
    def aux(self) -> int:
        """Dimensions of ``States.aux``."""
        return _VECTOR + self._correlated

    @property
    def mean_rate(self) -> slice:
        """Columns of the mean rate among the constants."""
        return self.constants.columns(MEAN_RATE)

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,), between states, j of each."""
        out = _empty_rows(len(intervals), self._correlated)
        mean = before.constants[self.mean_rate].copy()
        kernel.linearise(
            _indices(intervals), self._intervals, _rows(before), _rows(after), mean, out
        )
        shared = np.zeros((len(intervals), ROWS + self._correlated, len(before.constants)))
        shared[:, :, self.mean_rate] = out.by_mean
        return LinearisedMotion(out.value[:, :, 0], out.before, out.after, shared)

    def predict(self, before: States, intervals: IntArray) -> States:
        """Return the states that intervals, (j,), lead to: all rows are zero there."""
        after = Rows(*(np.empty(part.shape) for part in before[:4]))
        mean = before.constants[self.mean_rate].copy()
        kernel.predict(_indices(intervals), self._intervals, _rows(before), mean, after)
        return States(*after, constants=before.constants)

    def rates_b_radps(self, t_s: FloatArray, aux: FloatArray) -> FloatArray:  # noqa: ARG002
        """Return body rates against inertial space, (m, 3), of states' ``aux``, (m, 12 + q)."""
        return aux[:, 3:6]

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        """Return mean, (a,), and whitening rows, (a, a + b), of the first keyframe's ``aux``.

        The bias by its 1-sigma; rate less mean rate, and derivatives, by the process's stationary
        covariance. The mean rate has a prior of its own.
        """
        aux = self.aux
        rows = np.eye(aux, aux + constants)
        rows[range(3), range(3)] = 1 / self.imu.accelerometer_bias_mps2
        for i in range(3):
            first = matern.stationary(self.poles_per_s[0, i])
            white = np.linalg.inv(np.linalg.cholesky(first))
            columns = [3 + i, 6 + i, 9 + i]
            weighted = white / np.sqrt(self.variance_rad2ps2[0, i])
            rows[np.ix_(columns, columns)] = weighted
            rows[columns, aux + self.mean_rate.start + i] = -weighted[:, 0]
        return np.zeros(aux), rows

    def log_white(self, intervals: IntArray) -> float:
        """Return the log determinants of the process's whitening in some intervals, summed.

        Those of the specific force do not depend on what is identified.
        """
        of = self._intervals
        log_det = np.log(np.einsum("naii->nai", of.white[intervals])).sum()
        return float(log_det - 4 * np.log(of.sigma_radps[intervals]).sum())

    def release(self, before: int) -> None:
        """Nothing of an interval is kept."""

    def noise_parts(self, of: slice = EVERY) -> NoiseParts:
        """Compute the shares of the accelerometer's noise and bias walk in the whitened rows.

        Of the position's rows the integration's noise is the rest; intervals of another noise than
        the accelerometer's, gaps, are not divided.
        """
        span_s, noise = np.diff(self.t_s)[of], self.accelerometer_noise[of]
        of_imu = np.isclose(noise, self.imu.accelerometer_noise_mps2_per_sqrt_hz**2)
        third = self._intervals.force_white[of, 2] ** 2 * noise * span_s**3 / 12
        share: FloatArray = np.zeros((len(span_s), 2, ROWS + self._correlated))
        share[of_imu, 0, 3:6], share[of_imu, 0, 6:9], share[:, 1, 9:12] = (
            third[of_imu, None],
            1.0,
            1.0,
        )
        parts = share[..., None] * np.eye(ROWS + self._correlated)
        return NoiseParts(
            ("accelerometer", "accelerometer bias"),
            parts,
            np.eye(ROWS + self._correlated) - parts.sum(axis=1),
        )

    def factors(
        self, k: int, key_before: int, key_after: int, about: States
    ) -> tuple[gtsam.NonlinearFactor, ...]:
        """Return interval k as one factor between two keyframes; ``about`` does not matter."""
        del about
        symbols = (keys.pose, keys.velocity, keys.angular_motion)
        names = [symbol(key) for key in (key_before, key_after) for symbol in symbols]
        mean = keys.constant(self.constants.first.index(self.mean_rate.start))
        intervals, index, buffer = self._intervals, np.array([k]), self._buffer

        def error(
            _: gtsam.CustomFactor, values: gtsam.Values, H: list[FloatArray] | None
        ) -> NDArray[np.float64]:
            _read(buffer.before, values, names[:3])
            _read(buffer.after, values, names[3:])
            buffer.mean[:] = values.atVector(mean)
            kernel.linearise(index, intervals, buffer.before, buffer.after, buffer.mean, buffer.out)
            if H is not None:
                for i, block in enumerate(buffer.blocks):
                    H[i] = block
            return np.array(buffer.out.value[0, :, 0], dtype=np.float64)

        return (gtsam.CustomFactor(_unit(ROWS + self._correlated), [*names, mean], error),)

    def with_added_noise(
        self, accelerometer_density: FloatArray, gyroscope_density: FloatArray
    ) -> "GyroFree":
        """Add white noise of the accelerometer, (n - 1,), (m/s2)^2/Hz; there is no gyroscope."""
        del gyroscope_density
        noise = self.accelerometer_noise + accelerometer_density
        return replace(self, accelerometer_noise=noise)

    def at_times(self, t_s: FloatArray) -> "GyroFree":
        """Build the motion between other keyframes, (m,), the present ones among them.

        An interval has the process and the noise of the one that its middle is in.
        """
        parent = parents(self.t_s, t_s)
        return replace(
            self,
            t_s=t_s,
            gravity_n_mps2=interpolate(t_s, self.t_s, self.gravity_n_mps2),
            poles_per_s=self.poles_per_s[parent],
            variance_rad2ps2=self.variance_rad2ps2[parent],
            accelerometer_noise=self.accelerometer_noise[parent],
            multipath=None if self.multipath is None else self.multipath.at_times(t_s),
        )


@dataclass(frozen=True, eq=False, slots=True)
class _Buffer:
    """Buffer of states and derivatives that all factors share: GTSAM copies both."""

    before: Rows
    after: Rows
    mean: FloatArray  # (3,)
    out: Filled
    blocks: tuple[FloatArray, ...]  # derivatives by each of the factor's keys

    @classmethod
    def empty(cls, correlated: int) -> "_Buffer":
        """Return room for one interval."""
        before, after = (
            Rows(np.empty((1, 3, 3)), *(np.empty((1, m)) for m in (3, 3, _VECTOR + correlated)))
            for _ in range(2)
        )
        out, parts = _empty_rows(1, correlated), (slice(0, 6), slice(6, AUX), slice(AUX, None))
        blocks = [E[0][:, part] for E in (out.before, out.after) for part in parts]
        return cls(before, after, np.empty(3), out, (*blocks, out.by_mean[0]))


def _read(into: Rows, values: gtsam.Values, names: list[int]) -> None:
    """Copy a keyframe's variables into a row."""
    matrix = values.atPose3(names[0]).matrix()
    into.R_nb[0], into.p_n_m[0] = matrix[:3, :3], matrix[:3, 3]
    into.v_n_mps[0], into.aux[0] = values.atVector(names[1]), values.atVector(names[2])


def _empty_rows(j: int, correlated: int) -> Filled:
    """Return room for the residuals and derivatives of j intervals."""
    D = ROWS + correlated
    square = (j, D, D)
    return Filled(np.empty((j, D, 1)), np.empty(square), np.empty(square), np.empty((j, D, 3)))


def _rows(states: States) -> Rows:
    return Rows(*(_contiguous(state) for state in states[:4]))


def _contiguous(values: FloatArray) -> FloatArray:
    """Return values as the kernel was compiled for: a read-only array would be another type."""
    # np.require alone takes five times as long.
    return values if values.flags.carray else np.require(values, np.float64, ["C", "W"])


def _indices(indices: IntArray) -> IntArray:
    return indices if indices.flags.carray else np.require(indices, np.int64, ["C", "W"])


def _force_white(span_s: FloatArray, noise: FloatArray) -> FloatArray:
    """Compute the whitening of velocity and position of intervals, (n - 1, 3).

    White specific force of density q leaves the covariance ``q (T, T^2/2, T^3/3)``: of velocity, of
    both, of position, which has the integration's own noise beside. Velocity v is multiplied by the
    first column; position p becomes ``third (p - second v)``.
    """
    velocity, both = noise * span_s, noise * span_s**2 / 2
    position = noise * span_s**3 / 3 + INTEGRATION_M2 * span_s
    gain = both / velocity
    return np.stack([velocity**-0.5, gain, (position - gain * both) ** -0.5], axis=1)


@cache
def _unit(rows: int) -> gtsam.noiseModel.Unit:
    """Return the noise of whitened rows, one for all intervals."""
    return gtsam.noiseModel.Unit.Create(rows)
