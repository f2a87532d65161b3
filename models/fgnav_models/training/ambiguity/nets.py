"""The paper's networks, any number of them at once.

A *member* is one network of its own: its weights are one slice of every stacked tensor, so 35
networks, or three seeds, are one module and one matrix product. A *head* is one output of a member
that shares its backbone with others. Both end in the same shape, a target per member and head.
"""

import math
from itertools import pairwise
from typing import Annotated, Literal, TypeAlias

import msgspec
import torch
from torch import nn

from fgnav.checks import BadInputError
from fgnav.io.strict_toml import Table
from fgnav_sim.ranges import Count

N_MAX = 16  # cycles: the paper's integers lie in [-16, 16]
CLASSES = 2 * N_MAX + 1
_LEAST_VARIANCE = 1e-8  # of whitened features; far below the noise of any
_FIRST_SHARPNESS = 4.0  # log; a score falls by exp(4) one cycle away
Task: TypeAlias = Literal["classification", "regression"]


class Architecture(Table, frozen=True):
    """Architecture of a network."""

    # ``"mlp"``, ``"rnn"`` (the paper's SimpleRNN) or ``"lstm"``
    kind: Literal["mlp", "rnn", "lstm"] = "mlp"
    # widths of the hidden dense layers; the paper's BA is 800, 400, 200, 100
    dense: tuple[Count, ...] = (800, 400, 200, 100)
    recurrent: Count = 100  # units of the recurrent layer
    activation: Literal["tanh", "relu"] = "tanh"  # of the recurrent layer; dense layers are ReLU
    # ``"dense"``: scores, or the sigmoid, straight from the last layer, as in the paper.
    # ``"residual"``: the last layer corrects the target's own range, and the scores fall with the
    # squared distance from it; untrained, it rounds. The first inputs must be the ranges.
    head: Literal["dense", "residual"] = "dense"
    # before each dense layer but the first of an MLP, whose inputs it would falsify
    dropout: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.0


class StackedDense(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """Dense layers of all members: (m, n, i) → (m, n, o)."""

    def __init__(self, members: int, inputs: int, outputs: int, generator: torch.Generator) -> None:
        super().__init__()
        self.weight = nn.Parameter(_glorot(members, inputs, outputs, generator))
        self.bias = nn.Parameter(torch.zeros(members, 1, outputs))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the layer's sums, before any activation."""
        if self.weight.shape[0] == 1:  # one product without a batch is twice as fast on a CPU
            return (x[0] @ self.weight[0] + self.bias[0])[None]
        return torch.baddbmm(self.bias, x, self.weight)


class StackedRecurrent(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """Recurrent layers of all members: (n, k, f) → last hidden state (m, n, h).

    The hidden state starts at zero. ``lstm`` has the usual four gates, forget bias 1.
    """

    def __init__(
        self, members: int, inputs: int, architecture: Architecture, generator: torch.Generator
    ) -> None:
        super().__init__()
        self.units, self.activation = architecture.recurrent, architecture.activation
        self.gates = 4 if architecture.kind == "lstm" else 1
        width = self.gates * self.units
        self.inward = StackedDense(members, inputs, width, generator)
        weight = torch.empty(members, self.units, width)
        for member in weight:
            nn.init.orthogonal_(member, generator=generator)
        self.own = nn.Parameter(weight)
        if self.gates == 4:
            with torch.no_grad():
                self.inward.bias[..., self.units : 2 * self.units] = 1.0

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the hidden state after the window's last sample."""
        members = self.own.shape[0]
        n, window, features = x.shape
        flat = x.reshape(1, n * window, features).expand(members, -1, -1)
        sums = self.inward(flat).reshape(members, n, window, -1)
        hidden = x.new_zeros(members, n, self.units)
        cell = hidden
        for k in range(window):
            total = sums[:, :, k] + torch.bmm(hidden, self.own)
            if self.gates == 4:
                let_in, forget, new, out = total.chunk(4, dim=2)
                cell = torch.sigmoid(forget) * cell + torch.sigmoid(let_in) * torch.tanh(new)
                hidden = torch.sigmoid(out) * torch.tanh(cell)
            else:
                hidden = torch.tanh(total) if self.activation == "tanh" else torch.relu(total)
        return hidden


class Layers(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """All layers of members: windows (n, k, f) → sums of the last layer (m, n, o).

    An MLP sees all samples of a window at once, a recurrent network one after another.
    """

    def __init__(
        self,
        architecture: Architecture,
        members: int,
        shape: tuple[int, int],
        outputs: int,
        generator: torch.Generator,
    ) -> None:
        super().__init__()
        self.members, width = members, math.prod(shape)
        self.recurrent: StackedRecurrent | None = None
        if architecture.kind != "mlp":
            self.recurrent = StackedRecurrent(members, shape[1], architecture, generator)
            width = architecture.recurrent
        self.dense = nn.ModuleList(
            StackedDense(members, i, o, generator)
            for i, o in pairwise((width, *architecture.dense, outputs))
        )
        self.dropout = nn.Dropout(architecture.dropout)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return the last layer's sums, before any activation."""
        if self.recurrent is None:
            h = x.flatten(1)[None].expand(self.members, -1, -1)
        else:
            h = self.dropout(self.recurrent(x))
        for k, layer in enumerate(self.dense):
            h = layer(h) if k == 0 else layer(self.dropout(torch.relu(h)))
        return h


class AmbiguityNet(nn.Module):  # type: ignore[misc]  # mypy skips torch
    """Networks for the integers of double differences.

    Parameters
    ----------
    task : str
        ``"classification"``: scores of the integers -16 … 16; ``"regression"``: one sigmoid, which
        ``cycles`` maps to the same range.
    window : int
        Samples that an answer sees, the last of them its own.
    offset, mix : tensor, shape (f,) and (f, f)
        Networks see ``(features - offset) @ mix``: ``min_max`` or ``whitened``.
    targets : tensor of int, shape (t,)
        Double difference that each target is.
    shared : bool
        One network with a head per target, instead of one network per target.
    seed : int
        Of the first weights.
    """

    def __init__(
        self,
        architecture: Architecture,
        *,
        task: Task,
        window: int,
        offset: torch.Tensor,
        mix: torch.Tensor,
        targets: torch.Tensor,
        shared: bool,
        seed: int,
    ) -> None:
        super().__init__()
        if window < 1:
            raise BadInputError(f"window: must be 1 or more, got {window}")
        generator = torch.Generator().manual_seed(seed)
        self.window = window
        self.task, self.residual = task, architecture.head == "residual"
        self.members, self.targets = (1, len(targets)) if shared else (len(targets), len(targets))
        self.register_buffer("offset", offset.double())
        self.register_buffer("mix", mix.double())
        self.register_buffer("ranges", targets.long())
        plain = task == "classification" and not self.residual
        outputs = self.targets // self.members * (CLASSES if plain else 1)
        shape = (window, len(offset))
        self.layers = Layers(architecture, self.members, shape, outputs, generator)
        if self.residual:
            nn.init.zeros_(self.layers.dense[-1].weight)
            self.sharpness = nn.Parameter(torch.full((self.targets, 1), _FIRST_SHARPNESS))

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return scores (n, t, 33) or sigmoids (n, t) of windows (n, k, f); t = members x heads."""
        n = x.shape[0]
        # Whitening takes cycles apart to thousandths and the scores are steep: two run-times agree
        # to 1e-5 only where both count in float64. Training does not need it.
        x = x.to(torch.float32 if self.training else torch.float64)
        guess = x[:, -1, self.ranges] if self.residual else None
        x = ((x - self.offset.to(x.dtype)) @ self.mix.to(x.dtype)).float()
        h = self.layers(x).transpose(0, 1).reshape(n, self.targets, -1)
        if guess is not None:
            return self._corrected(guess + h[:, :, 0].to(guess.dtype))
        return h if self.task == "classification" else torch.sigmoid(h[:, :, 0])

    def _corrected(self, cycles: torch.Tensor) -> torch.Tensor:
        """Return the output of ``forward`` as a real number of cycles per target, (n, t)."""
        if self.task == "regression":
            return (cycles + N_MAX) / (2 * N_MAX)
        integers = torch.arange(-N_MAX, N_MAX + 1, dtype=cycles.dtype, device=cycles.device)
        return -torch.exp(self.sharpness) * (cycles[:, :, None] - integers).square()


def loss_of(
    task: Task, answer: torch.Tensor, cycles: torch.Tensor, is_present: torch.Tensor
) -> torch.Tensor:
    """Return cross-entropy or the mean squared error of the scaled integer, summed over targets.

    The sum, not the mean, over targets: networks trained side by side each see the gradient that
    they would see alone.

    Parameters
    ----------
    answer : tensor
        Of ``AmbiguityNet``.
    cycles, is_present : tensor of int64 and bool, shape (n, t)
        The integers, and which of them exist.
    """
    if task == "classification":
        flat = answer.reshape(-1, CLASSES)
        each = nn.functional.cross_entropy(flat, cycles.reshape(-1) + N_MAX, reduction="none")
    else:
        wanted = (cycles.to(answer.dtype) + N_MAX) / (2 * N_MAX)
        each = (answer - wanted).square().reshape(-1)
    return (each * is_present.reshape(-1)).sum() / len(cycles)


def cycles_of(task: Task, answer: torch.Tensor) -> torch.Tensor:
    """Return the integers that an answer of ``AmbiguityNet`` means, (n, t)."""
    if task == "classification":
        return answer.argmax(dim=-1) - N_MAX
    return torch.round(answer * (2 * N_MAX) - N_MAX).long()


def min_max(features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return offset and mix that map each feature of a training set, (n, f), to 0 … 1."""
    low, high = features.amin(dim=0), features.amax(dim=0)
    return low, torch.diag(1.0 / (high - low).clamp_min(1e-9))


def whitened(features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Return offset and mix to mean 0 and covariance 1 (rotated: principal components).

    The ranges of an array have 35 values and 15 degrees of freedom. In the directions that are left
    there is noise alone, a hundredth of a cycle beside cycles: what corrects the ranges, and what
    min-max scaling hides from a network.
    """
    mean = features.double().mean(dim=0)
    centred = features.double() - mean
    variances, axes = torch.linalg.eigh(centred.T @ centred / len(centred))
    return mean, axes / variances.clamp_min(_LEAST_VARIANCE).sqrt()


def _glorot(members: int, inputs: int, outputs: int, generator: torch.Generator) -> torch.Tensor:
    """Return first weights, uniform within Glorot and Bengio's bound (AISTATS 2010, eq. 16)."""
    bound = math.sqrt(6.0 / (inputs + outputs))
    uniform = torch.rand(members, inputs, outputs, generator=generator)
    return (2.0 * uniform - 1.0) * bound
