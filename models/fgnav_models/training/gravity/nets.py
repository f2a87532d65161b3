"""Networks that tell gravity in body axes: the source paper's, and one that says how sure it is."""

from itertools import pairwise

import torch
from torch import nn

from fgnav_models.training.ambiguity.nets import Architecture, StackedDense, StackedRecurrent
from fgnav_models.training.gravity.features import SAMPLES

_GRAVITY_MPS2 = 9.81  # scale, and first guess of what the velocities' acceleration lacks
_MOTION_SCALE = (0.01, 0.02, 0.1, 0.1, 0.1)  # of ``course_motion``: speeds, accelerations
_FIRST_LOG_SIGMA = -2.5  # about 5 degrees
_LOG_SIGMA_RANGE = (-8.0, 2.0)
_TINY = 1e-6


class PaperGravity(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """The paper's regression: accelerations in, three components of gravity out.

    Inputs and outputs are scaled to 0 … 1 by the training set's extremes; the output is a sigmoid.

    Parameters
    ----------
    architecture : Architecture
        An MLP sees the newest sample, a recurrent network the window.
    seen, wanted : tensor, shape (n, k, 3) and (n, 3)
        The training set: specific force and gravity, m/s2.
    seed : int
        Of the first weights.
    """

    def __init__(
        self, architecture: Architecture, seen: torch.Tensor, wanted: torch.Tensor, seed: int
    ) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        for name, values in (("input", seen.reshape(-1, 3)), ("output", wanted)):
            low, high = values.amin(dim=0), values.amax(dim=0)
            self.register_buffer(f"{name}_low", low)
            self.register_buffer(f"{name}_range", (high - low).clamp_min(_TINY))
        self.recurrent: StackedRecurrent | None = None
        width = 3
        if architecture.kind != "mlp":
            self.recurrent = StackedRecurrent(1, 3, architecture, generator)
            width = architecture.recurrent
        self.dense = nn.ModuleList(
            StackedDense(1, i, o, generator) for i, o in pairwise((width, *architecture.dense, 3))
        )
        self.dropout = nn.Dropout(architecture.dropout)

    def forward(self, f_b_mps2: torch.Tensor) -> torch.Tensor:
        """Return gravity scaled to 0 … 1, (n, 3), of windows, (n, k, 3)."""
        x = (f_b_mps2 - self.input_low) / self.input_range
        h = x[None, :, -1] if self.recurrent is None else self.dropout(self.recurrent(x))
        for k, layer in enumerate(self.dense):
            h = layer(h) if k == 0 else layer(self.dropout(torch.relu(h)))
        return torch.sigmoid(h[0])

    def scaled(self, gravity_b_mps2: torch.Tensor) -> torch.Tensor:
        """Return gravity, (n, 3), as ``forward`` does."""
        return (gravity_b_mps2 - self.output_low) / self.output_range

    def gravity_b_mps2(self, f_b_mps2: torch.Tensor) -> torch.Tensor:
        """Return gravity, (n, 3), m/s2."""
        return self(f_b_mps2) * self.output_range + self.output_low


class GravityNet(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A correction of what physics says, with a covariance across it.

    Physics is minus the newest specific force; with a receiver's motion, the attitude that brings
    the specific force to the acceleration less gravity, the nose as near the velocity as that
    leaves it.

    Parameters
    ----------
    aided : bool
        Whether it sees ``course_motion``.
    width, seed : int
        Of the three hidden layers; of the first weights.
    """

    def __init__(self, *, aided: bool, width: int, seed: int) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        self.aided = aided
        inputs = 3 * SAMPLES + 4 + (9 if aided else 0)
        sizes = pairwise((inputs, width, width, width, 9))
        self.dense = nn.ModuleList(StackedDense(1, i, o, generator) for i, o in sizes)
        self.register_buffer("motion_scale", torch.tensor(_MOTION_SCALE))
        self.register_buffer("variance_scale", torch.ones(()))
        with torch.no_grad():
            self.dense[-1].weight.mul_(0.0)
            self.dense[-1].bias[..., 3:6] = _FIRST_LOG_SIGMA

    def forward(
        self, f_b_mps2: torch.Tensor, motion: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return unit vectors, (n, 3), and their covariance, (n, 3, 3), rank two.

        Takes windows, (n, SAMPLES, 3), and ``course_motion``, (n, 5).
        """
        force = f_b_mps2[:, -1]
        size = force.norm(dim=1, keepdim=True)
        physics = -_unit(force)
        parts = [f_b_mps2.flatten(1) / _GRAVITY_MPS2, physics, size / _GRAVITY_MPS2 - 1.0]
        if motion is not None:
            force_c = motion[:, 2:] - motion.new_tensor([0.0, 0.0, _GRAVITY_MPS2])
            physics = _down_by_pair(force, force_c, motion)
            parts += [
                motion * self.motion_scale,
                physics,
                size - force_c.norm(dim=1, keepdim=True),
            ]
        h = torch.cat(parts, dim=1)[None]
        for layer in self.dense[:-1]:
            h = nn.functional.silu(layer(h))
        answer = self.dense[-1](h)[0]
        g_b = _unit(physics + answer[:, :3])
        across = torch.eye(3) - g_b[:, :, None] * g_b[:, None, :]
        root = across @ _triangle(answer[:, 3:]) * self.variance_scale.sqrt()
        return g_b, root @ root.transpose(1, 2)


def deviation(
    answer: tuple[torch.Tensor, torch.Tensor], true_b: torch.Tensor
) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
    """Return the error on the tangent plane, its normalised square, and log det of the covariance.

    ``answer`` is what ``GravityNet`` returns, ``true_b`` unit vectors, (n, 3).

    Returns
    -------
    error_rad, squared, log_determinant : tensor, shape (n, 2), (n,), (n,)
        By the sphere's logarithm, in two axes across the answer.
    """
    g_b, covariance = answer
    axes = _axes_across(g_b)
    cosine = (g_b * true_b).sum(dim=1, keepdim=True)
    apart = torch.einsum("nij,nj->ni", axes, true_b)
    sine = apart.norm(dim=1, keepdim=True).clamp_min(_TINY)
    error = apart * torch.atan2(sine, cosine) / sine
    C = axes @ covariance @ axes.transpose(1, 2)
    determinant = C[:, 0, 0] * C[:, 1, 1] - C[:, 0, 1] ** 2
    first, second = error[:, 0], error[:, 1]
    squared = C[:, 1, 1] * first**2 - 2 * C[:, 0, 1] * first * second + C[:, 0, 0] * second**2
    return error, squared / determinant, determinant.log()


def negative_log_likelihood(module: nn.Module, batch: tuple[torch.Tensor, ...]) -> torch.Tensor:
    """Return the mean, constants left out, over a batch whose last tensor is the truth."""
    *inputs, true_b = batch
    _, squared, log_determinant = deviation(module(*inputs), true_b)
    return 0.5 * (squared + log_determinant).mean()


def _unit(vector: torch.Tensor) -> torch.Tensor:
    return vector / vector.norm(dim=-1, keepdim=True).clamp_min(_TINY)


def _frame(first: torch.Tensor, second: torch.Tensor) -> torch.Tensor:
    """Return axes as columns, (n, 3, 3): the first vector, then across both."""
    x, y = _unit(first), _unit(_cross(first, second))
    return torch.stack([x, y, _cross(x, y)], dim=2)


def _cross(a: torch.Tensor, b: torch.Tensor) -> torch.Tensor:
    return torch.stack(
        [a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], 1
    )


def _down_by_pair(
    force_b: torch.Tensor, force_c: torch.Tensor, motion: torch.Tensor
) -> torch.Tensor:
    """Return down in body axes from one vector in both frames and the nose along the velocity."""
    still = torch.zeros_like(motion[:, 0])
    velocity_c = torch.stack([motion[:, 0], still, -motion[:, 1]], dim=1)
    nose_b = torch.stack([still + 1.0, still, still], dim=1)
    R_cb = _frame(force_c, velocity_c) @ _frame(force_b, nose_b).transpose(1, 2)
    return R_cb[:, 2]


def _triangle(numbers: torch.Tensor) -> torch.Tensor:
    """Return lower triangles, (n, 3, 3): three logarithms of scales, three shears."""
    scale = torch.exp(numbers[:, :3].clamp(*_LOG_SIGMA_RANGE))
    none = torch.zeros_like(scale[:, 0])
    a, b, c = scale.unbind(dim=1)
    p, q, r = numbers[:, 3:].unbind(dim=1)
    rows = [(a, none, none), (p * a, b, none), (q * a, r * b, c)]
    return torch.stack([torch.stack(row, dim=1) for row in rows], dim=1)


def _axes_across(g_b: torch.Tensor) -> torch.Tensor:
    """Return two unit vectors across each unit vector, (n, 2, 3)."""
    least = torch.eye(3)[g_b.abs().argmin(dim=1)]
    first = _unit(_cross(g_b, least))
    return torch.stack([first, _cross(g_b, first)], dim=1)
