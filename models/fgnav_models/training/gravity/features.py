"""What the gravity networks see: windows of specific force, and motion told in the course's frame.

The course frame ``c`` is level: x along the horizontal velocity, y to its right, z down. Nothing of
the heading enters, which gravity does not depend on.
"""

import numpy as np
import torch

from fgnav.checks import BoolArray, FloatArray
from fgnav.types.flight import Imu

SAMPLES, STEP_S = 10, 0.01  # a window: its last sample is the answer's time
SPAN_S = 0.2  # between the two velocities whose difference is the acceleration
_WIDEST_STEP_S = 1.5 * STEP_S
_ROUNDING_S = 1e-6


def windows(imu: Imu, t_s: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the accelerometer's windows that end at given times, and which of them it covers.

    Parameters
    ----------
    t_s : ndarray, shape (n,)

    Returns
    -------
    f_b_mps2 : ndarray, shape (n, SAMPLES, 3)
        Specific force, interpolated between samples, oldest first.
    covered : ndarray of bool, shape (n,)
        Samples on both sides of each time, no further apart than one and a half steps.
    """
    wanted = t_s[:, None] + STEP_S * np.arange(1 - SAMPLES, 1)
    inside = (wanted >= imu.t_s[0] - _ROUNDING_S) & (wanted <= imu.t_s[-1] + _ROUNDING_S)
    if len(imu.t_s) < 2:
        return np.zeros((*wanted.shape, 3)), np.zeros(len(t_s), dtype=np.bool_)
    after = np.searchsorted(imu.t_s, wanted - _ROUNDING_S).clip(1, len(imu.t_s) - 1)
    close = np.diff(imu.t_s)[after - 1] <= _WIDEST_STEP_S
    f_b_mps2 = np.stack([np.interp(wanted, imu.t_s, axis) for axis in imu.f_b_mps2.T], axis=2)
    return f_b_mps2, (inside & close).all(axis=1)


def course_motion(v_n_mps: torch.Tensor, a_n_mps2: torch.Tensor) -> torch.Tensor:
    """Return a receiver's velocity and acceleration in the course frame, (n, 5).

    Columns: horizontal and upward speed, m/s; acceleration along the course, to its right, and
    down, m/s2. Inputs are (n, 3), north-east-down; a vertical flight has the course north.
    """
    horizontal = v_n_mps[:, :2].norm(dim=1)
    moving = horizontal > 0
    scale = torch.where(moving, horizontal, torch.ones_like(horizontal))
    north = torch.where(moving, v_n_mps[:, 0] / scale, torch.ones_like(scale))
    east = v_n_mps[:, 1] / scale
    along = north * a_n_mps2[:, 0] + east * a_n_mps2[:, 1]
    right = north * a_n_mps2[:, 1] - east * a_n_mps2[:, 0]
    return torch.stack([horizontal, -v_n_mps[:, 2], along, right, a_n_mps2[:, 2]], dim=1)


def differenced(t_s: FloatArray, v_n_mps: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return velocity and acceleration at inner epochs, (n - 2, 3) each, from their neighbours.

    Half the sum and the difference of the velocities before and after, as in training.
    """
    span_s = (t_s[2:] - t_s[:-2])[:, None]
    before, after = v_n_mps[:-2], v_n_mps[2:]
    return (before + after) / 2, (after - before) / span_s
