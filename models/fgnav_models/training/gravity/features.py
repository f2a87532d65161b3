"""Inputs of the gravity networks, and estimates of gravity by physics alone.

The course frame ``c`` is level: x along the horizontal velocity, y to its right, z down. Nothing of
the heading enters, which gravity does not depend on.
"""

from typing import NamedTuple

import numpy as np
import torch
from torch import nn

SAMPLES, RATE_HZ = 150, 100.0  # of specific force; the last one is the answer's time
VELOCITIES, VELOCITY_HZ = 16, 10.0  # over the same time, up to its end
GRAVITY_MPS2 = 9.81  # told to a hundredth: a first guess, and a scale
_AVERAGED = 5  # samples, to 20 Hz; the newest ones are seen one by one, too
_TINY = 1e-6
# Where small forces and large ones have to be told apart: a lateral force of a tenth shows the
# roll of a coasting rocket, its motor has a hundred.
_SMALL_MPS2, _SMALL_MPS = 0.2, 0.1


class Motion(NamedTuple):
    """Velocities at the window's end, in the course frame."""

    velocity: torch.Tensor  # (n, 3); of the fitted parabola
    acceleration: torch.Tensor  # (n, 3); of the same
    mean_acceleration: torch.Tensor  # (n, 3); slope of the fitted line
    steps: torch.Tensor  # (n, VELOCITIES, 3); velocities less the newest fitted one

    def force(self) -> torch.Tensor:
        """Return the specific force that the acceleration asks for, (n, 3)."""
        return _less_gravity(self.acceleration)

    def mean_force(self) -> torch.Tensor:
        """Return that of the mean acceleration, (n, 3)."""
        return _less_gravity(self.mean_acceleration)


class CourseMotion(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """Velocities in the course frame: least squares of a parabola and of a line."""

    def __init__(self) -> None:
        super().__init__()
        t_s = np.arange(1 - VELOCITIES, 1) / VELOCITY_HZ
        parabola = np.linalg.pinv(np.stack([np.ones_like(t_s), t_s, t_s**2], axis=1))
        line = np.linalg.pinv(np.stack([np.ones_like(t_s), t_s], axis=1))
        weights = np.stack([parabola[0], parabola[1], line[1]])
        self.register_buffer("weights", torch.from_numpy(weights))

    def forward(self, v_n_mps: torch.Tensor) -> Motion:
        """Return the motion of velocities, (n, VELOCITIES, 3).

        A vertical flight has the course north.
        """
        newest = v_n_mps[:, -1:]
        fitted = torch.einsum("wk,nkc->nwc", self.weights.to(v_n_mps.dtype), v_n_mps - newest)
        end = newest + fitted[:, :1]
        horizontal = end[:, :, :2].norm(dim=2)
        moving = horizontal > 0
        scale = torch.where(moving, horizontal, torch.ones_like(horizontal))
        north = torch.where(moving, end[:, :, 0] / scale, torch.ones_like(scale))
        east = end[:, :, 1] / scale

        def turned(vectors: torch.Tensor) -> torch.Tensor:
            along = north * vectors[:, :, 0] + east * vectors[:, :, 1]
            right = north * vectors[:, :, 1] - east * vectors[:, :, 0]
            return torch.stack([along, right, vectors[:, :, 2]], dim=2)

        velocity, fits = turned(end), turned(fitted)
        return Motion(velocity[:, 0], fits[:, 1], fits[:, 2], turned(v_n_mps - end))


def directions(f_b_mps2: torch.Tensor, motion: Motion | None) -> torch.Tensor:
    """Return each physical estimate of down in body axes, (n, 1 or 4, 3).

    Minus the newest specific force, of unit length; with velocities before it the attitude that
    brings this force to the acceleration less gravity, the nose as near the velocity as that
    leaves it (the physical pair); the nose along the velocity, its roll by the correlation of
    lateral forces in both frames over the window; and the same of no roll, the part along the
    nose alone.
    """
    newest = f_b_mps2[:, -1]
    by_force = -newest / (newest.norm(dim=1, keepdim=True) + _SMALL_MPS2)
    if motion is None:
        return by_force[:, None]
    along, lateral = _slope(motion.velocity)
    cosine, sine = _roll(f_b_mps2, motion).unbind(dim=1)
    size = (cosine.square() + sine.square()).sqrt() + _TINY
    none = torch.zeros_like(along)
    nose = torch.stack([along, none, none], dim=1)
    rolled = torch.stack([along, lateral * sine / size, lateral * cosine / size], dim=1)
    pair = _down_by_pair(newest, motion.force(), motion.velocity)
    return torch.stack([pair, rolled, nose, by_force], dim=1)


def inputs(f_b_mps2: torch.Tensor, motion: Motion | None) -> torch.Tensor:
    """Return the features of windows, (n, d), not yet scaled."""
    n = f_b_mps2.shape[0]
    averages = f_b_mps2.reshape(n, SAMPLES // _AVERAGED, _AVERAGED, 3).mean(dim=2).flatten(1)
    newest, size = f_b_mps2[:, -_AVERAGED:].flatten(1), f_b_mps2.norm(dim=2)
    physics = directions(f_b_mps2, motion).flatten(1)
    parts = [averages, _asinh(averages / _SMALL_MPS2), newest, _asinh(newest / _SMALL_MPS2)]
    parts += [physics, size[:, -1:], size.mean(dim=1, keepdim=True)]
    if motion is not None:
        steps, roll = motion.steps.flatten(1), _roll(f_b_mps2, motion)
        speed = motion.velocity.norm(dim=1, keepdim=True)
        along, lateral = _slope(motion.velocity)
        expected = (motion.force(), motion.mean_force())
        parts += [
            steps,
            _asinh(steps / _SMALL_MPS),
            *expected,
            _asinh(motion.mean_acceleration / _SMALL_MPS2),
            _asinh(roll / _SMALL_MPS2**2),
            motion.velocity,
            _asinh(speed / 10),
            torch.stack([along, lateral], dim=1),
            size[:, -1:] - expected[0].norm(dim=1, keepdim=True),
            size.mean(dim=1, keepdim=True) - expected[1].norm(dim=1, keepdim=True),
        ]
    return torch.cat(parts, dim=1)


def unit(vector: torch.Tensor) -> torch.Tensor:
    """Return vectors of length one, (…, 3)."""
    return vector / vector.norm(dim=-1, keepdim=True).clamp_min(_TINY)


def cross(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    """Return vector products, (n, 3)."""
    return torch.stack(
        [a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], 1
    )


def _less_gravity(acceleration: torch.Tensor) -> torch.Tensor:
    return acceleration - acceleration.new_tensor([0.0, 0.0, GRAVITY_MPS2])


def _asinh(x: torch.Tensor) -> torch.Tensor:
    """Return the area hyperbolic sine, which torch does not export."""
    size = x.abs()
    return torch.sign(x) * torch.log(size + (size.square() + 1).sqrt())


def _slope(velocity: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return the parts of down along a nose that follows the velocity, and across it, (n,)."""
    speed = velocity.norm(dim=1).clamp_min(_TINY)
    return velocity[:, 2] / speed, velocity[:, 0] / speed


def _roll(f_b_mps2: torch.Tensor, motion: Motion) -> torch.Tensor:
    """Return force by force times cosine and sine of the roll that both frames agree on, (n, 2).

    Lateral forces F to the right and in the vertical plane are, in body axes of roll phi,
    ``f_y = F_r cos + F_d sin``, ``f_z = F_d cos - F_r sin``; summed are their products over the
    intervals between velocities.
    """
    n = f_b_mps2.shape[0]
    each = SAMPLES // (VELOCITIES - 1)
    felt = f_b_mps2.reshape(n, VELOCITIES - 1, each, 3).mean(dim=2)
    change = (motion.steps[:, 1:] - motion.steps[:, :-1]) * VELOCITY_HZ
    down, along = _slope(motion.velocity)
    lowered = change[:, :, 2] - GRAVITY_MPS2
    right, plane = change[:, :, 1], along[:, None] * lowered - down[:, None] * change[:, :, 0]
    cosine = (felt[:, :, 1] * right + felt[:, :, 2] * plane).mean(dim=1)
    sine = (felt[:, :, 1] * plane - felt[:, :, 2] * right).mean(dim=1)
    return torch.stack([cosine, sine], dim=1)


def _frame(first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    """Return axes as columns, (n, 3, 3): the first vector, then across both."""
    x, y = unit(first), unit(cross(first, second))
    return torch.stack([x, y, cross(x, y)], dim=2)


def _down_by_pair(
    force_b: torch.Tensor, force_c: torch.Tensor, velocity_c: torch.Tensor
) -> torch.Tensor:
    """Return down in body axes from one vector in both frames and the nose along the velocity."""
    still = torch.zeros_like(force_b[:, 0])
    nose_b = torch.stack([still + 1.0, still, still], dim=1)
    R_cb = _frame(force_c, velocity_c) @ _frame(force_b, nose_b).transpose(1, 2)
    return R_cb[:, 2]
