"""A turning flight whose truth is known, as a smoothing problem: without a file or a receiver."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fgnav.alignment.rates import angular_rates
from fgnav.assembly.calibration_request import mean_rate
from fgnav.assembly.position.series import VectorSeries
from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import FloatArray
from fgnav.geometry import rotations
from fgnav.geometry.earth import Origin
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.motion import Motion
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.states import States
from fgnav.process.hyperparameters import RatePrior
from fgnav.types.flight import Imu, Truth
from tests.attitude.arrays import synthetic

ORIGIN = Origin(latitude_rad=np.radians(40.3), longitude_rad=np.radians(-3.9), height_m=700.0)
SKY = [(0, 1.57), (0.3, 0.4), (1.6, 0.6), (2.9, 0.5), (4.1, 0.35), (5.3, 0.8)]  # azimuth, elevation
E_N = np.array([[np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), -np.sin(e)] for a, e in SKY])
ACCELEROMETER = {
    "accelerometer_noise_mps2_per_sqrt_hz": 1e-3,
    "accelerometer_bias_mps2": 3e-2,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-4,
}
GYROSCOPE = {
    "gyroscope_noise_radps_per_sqrt_hz": 1e-4,
    "gyroscope_bias_radps": 2e-3,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-6,
}
POSITION_M, VELOCITY_MPS = 1.0, 0.05
SUB_STEPS = 2


@dataclass(frozen=True, eq=False)
class TurningFlight:
    """What a solver is given, what it is made of, and the truth."""

    problem: Problem
    truth: Truth
    imu: Imu
    form: RotationQuadratic  # of the array's phases
    position: VectorSeries
    velocity: VectorSeries
    rate_prior: RatePrior
    sub_steps: int = SUB_STEPS

    @property
    def true_states(self) -> States:
        """Where the keyframes are, but for the biases of the inertial unit."""
        truth, start = self.truth, self.problem.start
        return start._replace(R_nb=truth.R_nb, p_n_m=truth.p_n_m, v_n_mps=truth.v_n_mps)


def motion(t_s: FloatArray, amplitude_rad: float) -> tuple[FloatArray, ...]:
    """Return sine Euler angles in a 100 m/s turn of 800 m radius: attitude, p, v, a."""
    angle = amplitude_rad * np.sin(t_s)
    turn = t_s / 8
    zero = 0 * t_s
    p = 800 * np.stack([np.sin(turn), 1 - np.cos(turn), zero], axis=1)
    v = 100 * np.stack([np.cos(turn), np.sin(turn), zero], axis=1)
    a = 12.5 * np.stack([-np.sin(turn), np.cos(turn), zero], axis=1)
    return rotations.from_euler(angle, angle, angle), p, v, a


def turning(
    rng: np.random.Generator,
    *,
    span_s: float = 60.0,
    amplitude_deg: float = 20.0,
    rate_hz: int = 10,
    imu_hz: int = 100,
    gyro: bool = False,
) -> TurningFlight:
    """Return keyframes with an array, positions and velocities of its reference, and the truth."""
    amplitude_rad = np.radians(amplitude_deg)
    imu = inertial_record(rng, np.arange(round(span_s * imu_hz) + 1) / imu_hz, amplitude_rad, gyro)
    t_s = imu.t_s[:: imu_hz // rate_hz]
    R_nb, p_n_m, v_n_mps, _ = motion(t_s, amplitude_rad)
    differences, integers = synthetic(R_nb, E_N, rng)
    form = RotationQuadratic.of_double_differences(differences, integers)
    position = _series(p_n_m, POSITION_M, rng)
    velocity = _series(v_n_mps, VELOCITY_MPS, rng)
    constants = Parameters(() if gyro else (mean_rate(),))
    gravity_n_mps2 = ORIGIN.gravity_n_mps2(position.value)
    prior = sine_prior(amplitude_rad)
    R_start = maximum_likelihood(form).R_nb
    aux = np.zeros((len(t_s), 6 if gyro else 12))
    if not gyro:
        aux[:, 3:6] = angular_rates(t_s, R_start)
    problem = Problem(
        t_s=t_s,
        start=States(
            R_nb=R_start,
            p_n_m=position.value,
            v_n_mps=velocity.value,
            aux=aux,
            constants=constants.start,
        ),
        motion=_motion(imu, t_s, gravity_n_mps2, constants, None if gyro else prior),
        sensors=_measurements(form, position, velocity, imu, constants),
        constants=constants,
        attitude_known=np.ones(len(t_s), dtype=np.bool_),
    )
    truth = Truth(t_s=t_s, p_n_m=p_n_m, v_n_mps=v_n_mps, R_nb=R_nb)
    return TurningFlight(problem, truth, imu, form, position, velocity, prior)


def sine_prior(amplitude_rad: float) -> RatePrior:
    """Return the rate prior with the variances of the sine's rate and of its derivative.

    The derivative of a Matern-5/2 process of variance s2 has the variance ``s2 k^2 / 3``,
    ``k = sqrt(5) / length``; that of a sine of one radian a second has its own, s2.
    """
    variance = np.full(3, amplitude_rad**2 / 2)
    return RatePrior(length_s=np.sqrt(5 / 3), variance_rad2ps2=variance, evidence=0.0)


def inertial_record(
    rng: np.random.Generator, t_s: FloatArray, amplitude_rad: float, gyro: bool
) -> Imu:
    """Return what an inertial unit measures of the motion: biases constant, noise white."""
    R_nb, p_n_m, v_n_mps, a_n_mps2 = motion(t_s, amplitude_rad)
    earth_n, rate_hz = ORIGIN.earth_rate_n_radps, 1 / (t_s[1] - t_s[0])
    f_n = a_n_mps2 + 2 * np.cross(earth_n, v_n_mps) - ORIGIN.gravity_n_mps2(p_n_m)
    noise = ACCELEROMETER["accelerometer_noise_mps2_per_sqrt_hz"] * np.sqrt(rate_hz)
    bias = ACCELEROMETER["accelerometer_bias_mps2"] * rng.standard_normal(3)
    f_b = np.einsum("nji,nj->ni", R_nb, f_n) + bias + noise * rng.standard_normal((len(t_s), 3))
    gyroscope: dict[str, Any] = {}
    if gyro:
        step_s = 1e-4
        ahead, behind = (motion(t_s + s, amplitude_rad)[0] for s in (step_s, -step_s))
        w_b = rotations.log(rotations.transpose(behind) @ ahead) / (2 * step_s)
        w_b += np.einsum("nji,j->ni", R_nb, earth_n)
        w_b += GYROSCOPE["gyroscope_bias_radps"] * rng.standard_normal(3)
        noise = GYROSCOPE["gyroscope_noise_radps_per_sqrt_hz"] * np.sqrt(rate_hz)
        w_b += noise * rng.standard_normal(w_b.shape)
        gyroscope = {"w_b_radps": w_b, **GYROSCOPE}
    return Imu(t_s=t_s, f_b_mps2=f_b, **ACCELEROMETER, **gyroscope)


def _series(true: FloatArray, sigma: float, rng: np.random.Generator) -> VectorSeries:
    return VectorSeries(
        value=true + sigma * rng.standard_normal(true.shape),
        covariance=np.tile(sigma**2 * np.eye(3), (len(true), 1, 1)),
        arm_b_m=np.zeros(3),
    )


def _motion(
    imu: Imu,
    t_s: FloatArray,
    gravity_n_mps2: FloatArray,
    constants: Parameters,
    prior: RatePrior | None,
) -> Motion:
    n = len(t_s) - 1
    noise = np.full(n, imu.accelerometer_noise_mps2_per_sqrt_hz**2)
    common: dict[str, Any] = {
        "t_s": t_s,
        "imu": imu,
        "sub_steps": SUB_STEPS,
        "gravity_n_mps2": gravity_n_mps2,
        "earth_rate_n_radps": ORIGIN.earth_rate_n_radps,
        "accelerometer_noise": noise,
    }
    if prior is None:
        gyroscope_noise = np.full(n, GYROSCOPE["gyroscope_noise_radps_per_sqrt_hz"] ** 2)
        return Inertial(gyroscope_noise=gyroscope_noise, **common)
    return GyroFree(
        poles_per_s=np.tile(prior.poles_per_s, (n, 1, 1)),
        variance_rad2ps2=np.tile(prior.variance_rad2ps2, (n, 1)),
        constants=constants,
        **common,
    )


def _measurements(
    form: RotationQuadratic,
    position: VectorSeries,
    velocity: VectorSeries,
    imu: Imu,
    constants: Parameters,
) -> tuple[ArrayPhase, Position, Velocity]:
    row = np.arange(len(position.value))
    none = np.full(len(row), -1)
    root, minimum = form.square_root()
    step = (len(imu.t_s) - 1) // (len(row) - 1)
    return (
        ArrayPhase(row=row, root=root, minimum=minimum, stretch=none, constants=constants),
        Position(
            row=row,
            value_n_m=position.value,
            white=position.white(row),
            arm_b_m=position.arm_b_m,
            constants=constants,
        ),
        Velocity(
            row=row,
            value_n_mps=velocity.value,
            white=velocity.white(row),
            arm_b_m=velocity.arm_b_m,
            measured_b_radps=None if imu.w_b_radps is None else imu.w_b_radps[::step],
            earth_rate_n_radps=ORIGIN.earth_rate_n_radps,
            constants=constants,
        ),
    )


def attitude_errors_rad(R_nb: FloatArray, truth: Truth) -> FloatArray:
    """Return body tangents from attitudes to the truth, (n, 3)."""
    return rotations.log(rotations.transpose(R_nb) @ truth.R_nb)


def euler_rmse_deg(R_nb: FloatArray, truth: Truth) -> FloatArray:
    """Return root mean square errors of roll, pitch and yaw."""
    change = rotations.to_euler(R_nb) - rotations.to_euler(truth.R_nb)
    return np.degrees(np.sqrt((rotations.wrap(change) ** 2).mean(axis=0)))


def nees(error: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return normalised squares of errors, (n,)."""
    return np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
