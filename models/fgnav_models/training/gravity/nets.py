"""Networks that tell gravity in body axes: the source paper's, and one that says how sure it is."""

from itertools import pairwise

import torch
from torch import nn

from fgnav_models.training.ambiguity.nets import Architecture, Layers, StackedDense
from fgnav_models.training.gravity.features import (
    SAMPLES,
    VELOCITIES,
    CourseMotion,
    Motion,
    cross,
    directions,
    inputs,
    unit,
)

_LAYERS = 4
_FAR = 10.0  # standard deviations; an input beyond is not one of training
_FIRST_LOG_SIGMA = -2.5  # about 5 degrees
_LOG_SIGMA_RANGE = (-8.0, 2.0)
_TINY = 1e-6
_ROUNDING = 1e-6  # of a determinant in single precision


class PaperGravity(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """The paper's regression: accelerations in, three components of gravity out.

    Inputs and outputs are scaled to 0 … 1 by the training set's extremes; the output is a sigmoid.

    Parameters
    ----------
    architecture : Architecture
        Of its layers.
    seen, wanted : tensor, shape (n, k, 3) and (n, 3)
        The training set: specific force and gravity, m/s2.
    seed : int
        Of the first weights.
    """

    def __init__(
        self, architecture: Architecture, tensor: torch.Tensor, wanted: torch.Tensor, seed: int
    ) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        for name, values in (("input", tensor.reshape(-1, 3)), ("output", wanted)):
            low, high = values.amin(dim=0), values.amax(dim=0)
            self.register_buffer(f"{name}_low", low)
            self.register_buffer(f"{name}_range", (high - low).clamp_min(_TINY))
        self.layers = Layers(architecture, 1, (tensor.shape[1], 3), 3, generator)

    def forward(self, f_b_mps2: torch.Tensor) -> torch.Tensor:
        """Return gravity scaled to 0 … 1, (n, 3), of windows, (n, k, 3)."""
        x = (f_b_mps2 - self.input_low) / self.input_range
        return torch.sigmoid(self.layers(x)[0])

    def scaled(self, gravity_b_mps2: torch.Tensor) -> torch.Tensor:
        """Return gravity, (n, 3), as ``forward`` does."""
        return (gravity_b_mps2 - self.output_low) / self.output_range

    def gravity_b_mps2(self, f_b_mps2: torch.Tensor) -> torch.Tensor:
        """Return gravity, (n, 3), m/s2."""
        return self(f_b_mps2) * self.output_range + self.output_low


class GravityNet(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """A correction of what physics says, with a covariance across it.

    The answer is a sum of the ``directions`` that physics has for down, weighted by the network,
    and a vector of its own. Untrained it is the first of them: the physical pair, or minus the
    newest specific force.

    Parameters
    ----------
    aided : bool
        Whether it sees velocities.
    width, seed : int
        Of the four hidden layers; of the first weights.
    """

    def __init__(self, *, aided: bool, width: int, seed: int) -> None:
        super().__init__()
        generator = torch.Generator().manual_seed(seed)
        self.aided, self.course = aided, CourseMotion()
        example = (torch.ones((1, SAMPLES, 3)), torch.ones((1, VELOCITIES, 3)))[: 2 if aided else 1]
        d, physics = inputs(example[0], self.motion(*example[1:])).shape[1], 4 if aided else 1
        sizes = pairwise((d, *[width] * _LAYERS, 9 + physics))
        self.dense = nn.ModuleList(StackedDense(1, i, o, generator) for i, o in sizes)
        self.register_buffer("offset", torch.zeros(d))
        self.register_buffer("spread", torch.ones(d))
        self.register_buffer("variance_scale", torch.ones(()))
        with torch.no_grad():
            self.dense[-1].weight.mul_(0.0)
            self.dense[-1].bias[..., 3:6] = _FIRST_LOG_SIGMA
            self.dense[-1].bias[..., 9] = 1.0

    def motion(self, v_n_mps: torch.Tensor | None = None) -> Motion | None:
        """Return the motion of velocities, None of none."""
        return None if v_n_mps is None else self.course(v_n_mps)

    def scaled(self, f_b_mps2: torch.Tensor, motion: Motion | None) -> torch.Tensor:
        """Return the inputs of windows in standard deviations of training, (n, d)."""
        return (inputs(f_b_mps2, motion) - self.offset) / self.spread

    def scale_inputs(self, *tensor: torch.Tensor) -> None:
        """Take offset and spread of the inputs from training windows, as ``forward`` takes them."""
        x = inputs(tensor[0], self.motion(*tensor[1:]))
        self.offset.copy_(x.mean(dim=0))
        self.spread.copy_(x.std(dim=0).clamp_min(_TINY))

    def forward(
        self, f_b_mps2: torch.Tensor, v_n_mps: torch.Tensor | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return unit vectors, (n, 3), and their covariance, (n, 3, 3), rank two.

        Takes windows, (n, SAMPLES, 3), and velocities, (n, VELOCITIES, 3).
        """
        motion = self.motion(v_n_mps)
        h = self.scaled(f_b_mps2, motion).clamp(-_FAR, _FAR)
        for k, layer in enumerate(self.dense[:-1]):
            change = nn.functional.silu(_sums(layer, h))
            h = change if k == 0 else h + change
        answer = _sums(self.dense[-1], h)
        physics = directions(f_b_mps2, motion)
        g_b = unit((answer[:, 9:, None] * physics).sum(dim=1) + answer[:, :3])
        across = torch.eye(3).to(g_b) - g_b[:, :, None] * g_b[:, None, :]
        root = across @ _triangle(answer[:, 3:9]) * self.variance_scale.sqrt()
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
    components = torch.einsum("nij,nj->ni", axes, true_b)
    sine = components.norm(dim=1, keepdim=True).clamp_min(_TINY)
    error = components * torch.atan2(sine, cosine) / sine
    C = axes @ covariance @ axes.transpose(1, 2)
    product = C[:, 0, 0] * C[:, 1, 1]
    determinant = torch.maximum(product - C[:, 0, 1] ** 2, _ROUNDING * product)
    first, second = error[:, 0], error[:, 1]
    squared = C[:, 1, 1] * first**2 - 2 * C[:, 0, 1] * first * second + C[:, 0, 0] * second**2
    return error, squared / determinant, determinant.log()


def negative_log_likelihood(module: nn.Module, batch: tuple[torch.Tensor, ...]) -> torch.Tensor:
    """Return the mean, constants left out, over a batch whose last tensor is the truth."""
    *inputs, true_b = batch
    _, squared, log_determinant = deviation(module(*inputs), true_b)
    return 0.5 * (squared + log_determinant).mean()


def _sums(layer: StackedDense, x: torch.Tensor) -> torch.Tensor:
    """Return a layer's sums, (n, o), in the precision of what it is given."""
    return x @ layer.weight[0].to(x.dtype) + layer.bias[0].to(x.dtype)


def _triangle(numbers: torch.Tensor) -> torch.Tensor:
    """Return lower triangles, (n, 3, 3): three logarithms of scales, three shears."""
    scale = torch.exp(numbers[:, :3].clamp(*_LOG_SIGMA_RANGE))
    none = torch.zeros_like(scale[:, 0])
    a, b, c = scale.unbind(dim=1)
    p, q, r = numbers[:, 3:].unbind(dim=1)
    rows = [(a, none, none), (p * a, b, none), (q * a, r * b, c)]
    return torch.stack([torch.stack(entries, dim=1) for entries in rows], dim=1)


def _axes_across(g_b: torch.Tensor) -> torch.Tensor:
    """Return two unit vectors across each unit vector, (n, 2, 3)."""
    axis = torch.eye(3).to(g_b)[g_b.abs().argmin(dim=1)]
    first = unit(cross(g_b, axis))
    return torch.stack([first, cross(g_b, first)], dim=1)
