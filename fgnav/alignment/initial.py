"""The attitude before any motion: level by gravity, heading of the magnetic field, or as stated."""

from typing import TypeGuard

import numpy as np

from fgnav.alignment.in_motion.windows import levelled
from fgnav.alignment.matching import SAME_S
from fgnav.attitude.imu_rotation import ImuRotation
from fgnav.attitude.receiver_baselines import KNOWN_RAD, BodyBaseline, heading_baselines
from fgnav.checks import FloatArray
from fgnav.geometry.rotations import euler_jacobian, exp, from_euler, to_euler
from fgnav.graph.types.problem import ROTATION_PRIOR_RAD, AttitudePrior
from fgnav.types.flight import Flight, Imu, InitialAttitude
from fgnav.types.surroundings import Magnetometer

LEVEL_S = 1.0  # of specific force whose mean points up: a body at rest shakes faster


def level_start(flight: Flight, imu: Imu, rotation: ImuRotation, at_s: float) -> FloatArray:
    """Return R_nu, (3, 3), by which specific force up to a time points up.

    Over a second, or as much of it as there is. The heading is that of a baseline, else of the
    magnetic field, or zero; angles that the flight states are as stated.
    """
    end = max(int(np.searchsorted(imu.t_s, at_s, side="right")), 1)
    begin = min(int(np.searchsorted(imu.t_s, at_s - LEVEL_S)), end - 1)
    f_u = np.einsum("nij,nj->ni", rotation.R_ub[begin:end], imu.f_b_mps2[begin:end]).mean(axis=0)
    R_ub = rotation.at(np.array([at_s]))[0]
    R_nb = levelled(f_u[None])[0] @ R_ub if np.any(f_u) else np.eye(3)
    R_nb = from_euler(*(to_euler(R_nb[None]) * [1, 1, 0]).T)[0]
    sensor = flight.magnetometer
    baselines = [
        baseline for baseline in heading_baselines(flight) if baseline.of.t_s[0] <= at_s + SAME_S
    ]
    if baselines:
        R_nb = _heading_by_baseline(baselines[0], rotation, R_nb @ R_ub.T, at_s) @ R_ub
    elif _field_determines_heading(sensor) and sensor.t_s[0] <= at_s + SAME_S:
        R_nb = _heading_by_field(sensor, rotation, R_nb @ R_ub.T, at_s) @ R_ub
    return np.asarray(stated_attitude(flight.initial, R_nb) @ R_ub.T)


def heading_without_motion_s(flight: Flight, first_s: float) -> float:
    """Return since when a heading is known without motion; infinite where it is not.

    That it was before the first epoch is minus infinity.
    """
    initial = flight.initial
    sigma_rad = None if initial is None else initial.heading_sigma_rad
    if sigma_rad is not None and sigma_rad < KNOWN_RAD:  # so well that the search starts there
        return -np.inf
    sensor = flight.magnetometer
    begins_s = [float(baseline.of.t_s[0]) for baseline in heading_baselines(flight)]
    begins_s += [float(sensor.t_s[0])] if _field_determines_heading(sensor) else []
    from_s = min(begins_s, default=np.inf)
    return -np.inf if from_s <= first_s + SAME_S else from_s


def _field_determines_heading(sensor: Magnetometer | None) -> TypeGuard[Magnetometer]:
    """Return True if a magnetometer's heading is good enough for the search to start there."""
    if sensor is None or not len(sensor.t_s):
        return False
    across_ut = float(np.hypot(*sensor.field_n_ut[:2]))
    return float(np.hypot(sensor.hard_iron_ut, sensor.noise_ut)) < KNOWN_RAD * across_ut


def _heading_by_field(
    sensor: Magnetometer, rotation: ImuRotation, R_lu: FloatArray, at_s: float
) -> FloatArray:
    """Return R_nu, (3, 3), level as R_lu is, with the heading of the samples by then."""
    rows = _last_second(sensor.t_s, at_s)
    R_lb = R_lu @ rotation.at(sensor.t_s[rows])
    north, east, _ = np.einsum("nij,nj->i", R_lb, sensor.field_b_ut[rows])
    return _with_yaw(R_lu, np.arctan2(*sensor.field_n_ut[1::-1]) - np.arctan2(east, north))


def _heading_by_baseline(
    between: BodyBaseline, rotation: ImuRotation, R_lu: FloatArray, at_s: float
) -> FloatArray:
    """Return R_nu, (3, 3), level as R_lu is, with the heading of a baseline by then."""
    rows = _last_second(between.of.t_s, at_s)
    north, east, _ = (R_lu @ rotation.at(between.of.t_s[rows]) @ between.vector_b_m).T
    turn = np.exp(1j * (between.of.heading_rad[rows] - np.arctan2(east, north)))
    return _with_yaw(R_lu, float(np.angle(turn.sum())))


def _last_second(t_s: FloatArray, at_s: float) -> slice:
    """Return the samples of the second up to a time, the last one at least."""
    end = max(int(np.searchsorted(t_s, at_s + SAME_S)), 1)
    return slice(min(int(np.searchsorted(t_s, at_s - LEVEL_S)), end - 1), end)


def _with_yaw(R_lu: FloatArray, yaw_rad: float) -> FloatArray:
    return np.asarray(exp(np.array([[0.0, 0.0, yaw_rad]]))[0] @ R_lu)


def stated_attitude(initial: InitialAttitude | None, R_nb: FloatArray) -> FloatArray:
    """Return an attitude, (3, 3), its angles as stated where they are."""
    if initial is None:
        return R_nb
    angles = to_euler(R_nb[None])[0]
    stated = [
        old if new is None else new for old, new in zip(angles, initial.angles_rad, strict=True)
    ]
    return np.asarray(from_euler(*np.array(stated)[:, None])[0])


def attitude_prior(
    initial: InitialAttitude | None, R_nb: FloatArray, heading_sigma_rad: float | None = None
) -> AttitudePrior | None:
    """Return the nominal prior of the first attitude; None where the flight gives none.

    Parameters
    ----------
    initial : InitialAttitude or None
    R_nb : ndarray, shape (3, 3)
        Where the search starts: of angles that are not stated next to nothing is known about it.
    heading_sigma_rad : float, optional
        Of the heading there, as alignment has it.
    """
    if initial is None and heading_sigma_rad is None:
        return None
    mean = stated_attitude(initial, R_nb)
    J = euler_jacobian(mean[None])[0]
    information = np.eye(3) / ROTATION_PRIOR_RAD**2
    stated = (None, None, None) if initial is None else initial.sigmas_rad
    for row, sigma in zip(J, stated, strict=True):
        if sigma is not None:
            information += np.outer(row, row) / sigma**2
    if heading_sigma_rad is not None:
        information += np.outer(mean[2], mean[2]) / heading_sigma_rad**2
    return AttitudePrior(R_nb=mean, covariance_rad2=np.linalg.inv(information))
