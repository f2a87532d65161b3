"""The gyroscope's bias by one attitude of axes that do not turn, over minutes.

An uncalibrated unit's bias of 3 deg/s turns the axes ``u`` of a window of 30 s by a right angle. So
it is estimated coarsely by a short stretch, and better by longer ones: Gauss-Newton of

    alpha_i = R_nb(m) R_bu(m; b) beta_i(b, a)

in attitude at the stretch's middle ``m`` and in the biases ``b`` of the gyroscope and ``a`` of the
accelerometer, with the pairs of ``force_pairs`` and the biases' stated sigmas. The white noise is
that of the residuals.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.in_motion.force_pairs import Integrated, Pairs, specific_forces
from fgnav.attitude.flight_vectors import Track
from fgnav.attitude.imu_rotation import ImuRotation, imu_rotation
from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp, skew
from fgnav.types.flight import Imu

LONGEST_S = 120.0  # of a stretch: a bias walks on
_SPANS_S = (2.0, 4.0)  # T of velocities, and of positions good to metres
_STEP = 1e-4  # of differences, rad/s and m/s2: a hundredth of a radian in a stretch
_MOST_STEPS = 10
_SETTLED = 1e-3  # of a step over its sigma


class GyroscopeBias(NamedTuple):
    """Attitude at the middle of a stretch, (3, 3), and biases by its pairs."""

    R_nb: FloatArray
    biases: FloatArray  # (6,), of the gyroscope, then of the accelerometer
    sigma_radps: float  # the gyroscope's largest


def gyroscope_bias(
    imu: Imu,
    track: Track,
    gravity_n_mps2: FloatArray,
    R_nb: FloatArray,
    within_s: tuple[float, float],
) -> GyroscopeBias | None:
    """Return the bias by stretches that grow about a span whose attitude is known.

    Each is twice as long as the one before, so that no turn is taken for another.

    Parameters
    ----------
    imu : Imu
        With a gyroscope.
    track : Track
    gravity_n_mps2 : ndarray, shape (3,)
    R_nb : ndarray, shape (3, 3)
        Attitude in the middle of the span.
    within_s : (float, float)
        The span.

    Returns
    -------
    GyroscopeBias or None
        None where no stretch determines it.
    """
    middle_s, length_s = sum(within_s) / 2, within_s[1] - within_s[0]
    start, bias = GyroscopeBias(R_nb, np.zeros(6), np.inf), None
    while True:
        length_s = min(length_s, LONGEST_S)
        near = np.abs(imu.t_s - middle_s) <= length_s / 2
        inside = np.abs(track.t_s - middle_s) <= length_s / 2
        if near.any() and inside.any():
            fit = _fitted(imu[near], track[inside], gravity_n_mps2, middle_s, bias or start)
            bias = fit or bias
        if length_s >= LONGEST_S or near.all():
            return bias
        length_s *= 2


def _fitted(
    imu: Imu, track: Track, gravity_n_mps2: FloatArray, middle_s: float, start: GyroscopeBias
) -> GyroscopeBias | None:
    """Return the fit of a stretch; None where it does not settle."""
    sigmas = (np.inf, imu.gyroscope_bias_radps or np.inf, imu.accelerometer_bias_mps2 or np.inf)
    information = np.diag(np.repeat(sigmas, 3) ** -2.0)  # of attitude and biases
    R_nb, biases = start.R_nb, start.biases
    for _ in range(_MOST_STEPS):
        rotation = _rotation(imu, biases)
        pairs = _forces(imu, track, gravity_n_mps2, middle_s, biases, rotation)
        if pairs is None or pairs.f_n_mps2.size <= len(information):
            return None
        columns = []
        for k, step in enumerate(_STEP * np.eye(6)):
            rotated = _rotation(imu, biases + step) if k < 3 else rotation  # by the gyroscope alone
            moved = _forces(imu, track, gravity_n_mps2, middle_s, biases + step, rotated)
            if moved is None:
                return None
            columns.append((moved.f_u_mps2 - pairs.f_u_mps2) @ R_nb.T / _STEP)
        felt = pairs.f_u_mps2 @ R_nb.T
        r = (pairs.f_n_mps2 - felt).ravel()
        A = np.concatenate([-skew(felt), np.stack(columns, axis=2)], axis=2).reshape(len(r), 9)
        free, _, rank, _ = np.linalg.lstsq(A, r)
        variance = float(np.sum((r - A @ free) ** 2)) / (len(r) - rank)
        if not (rank == len(information) and variance > 0.0):
            return None
        H = A.T @ A / variance + information
        h = A.T @ r / variance - information @ np.append(np.zeros(3), biases)
        P = np.linalg.inv(H)
        x = P @ h
        R_nb, biases = exp(x[None, :3])[0] @ R_nb, biases + x[3:]
        if x @ h < len(x) * _SETTLED**2:
            sigma_radps = float(np.sqrt(np.linalg.eigvalsh(P[3:6, 3:6])[-1]))
            return GyroscopeBias(R_nb, biases, sigma_radps)
    return None


def _rotation(imu: Imu, biases: FloatArray) -> ImuRotation | None:
    """Integrate the gyroscope's rates less its bias; None if there are too few samples."""
    if imu.w_b_radps is None:
        return None
    return imu_rotation(replace(imu, w_b_radps=imu.w_b_radps - biases[:3]))


def _forces(
    imu: Imu,
    track: Track,
    gravity_n_mps2: FloatArray,
    middle_s: float,
    biases: FloatArray,
    rotation: ImuRotation | None,
) -> Pairs | None:
    """Return specific forces in ``n`` and in the body's axes at the middle."""
    if rotation is None:
        return None
    unbiased = replace(imu, f_b_mps2=imu.f_b_mps2 - biases[3:])
    integrated = Integrated(unbiased, rotation, track.arm_b_m - imu.position_b_m)
    span_s = _SPANS_S[0 if track.v_n_mps is not None else 1]
    pairs = next(specific_forces(integrated, track, span_s, gravity_n_mps2), None)
    if pairs is None:
        return None
    return pairs._replace(f_u_mps2=pairs.f_u_mps2 @ rotation.at(np.array([middle_s]))[0])
