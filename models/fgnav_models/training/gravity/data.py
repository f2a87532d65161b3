"""Training data of gravity networks, and the baselines that need no learning."""

import os
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
import torch

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav_models.training.gravity.features import (
    RATE_HZ,
    SAMPLES,
    VELOCITIES,
    CourseMotion,
    directions,
)
from fgnav_models.training.train import Batch
from fgnav_sim.data_sets.gravity import GravityEpochs, gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld

BASELINES = ("newest sample", "low-pass", "physical pair")
_CHUNK = 100  # flights drawn from one generator
_FEW = 4  # chunks, below which processes are not worth their start
_MIRROR = (1.0, -1.0, 1.0)  # left and right exchanged: what is seen and gravity change alike


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Rows:
    """Inputs and truth as tensors: windows (n, k, 3), velocities (n, m, 3), unit gravity (n, 3)."""

    f_b_mps2: torch.Tensor
    v_n_mps: torch.Tensor
    g_b: torch.Tensor

    @classmethod
    def of(cls, epochs: GravityEpochs) -> "Rows":
        """Return the rows of simulated windows."""
        f_b_mps2, v_n_mps, g_b = (
            torch.from_numpy(x).float() for x in (epochs.f_b_mps2, epochs.v_n_mps, epochs.g_b)
        )
        return cls(f_b_mps2=f_b_mps2, v_n_mps=v_n_mps, g_b=g_b)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.g_b)

    def seen(self, *, aided: bool) -> tuple[torch.Tensor, ...]:
        """Return the inputs of a network."""
        return (self.f_b_mps2, self.v_n_mps) if aided else (self.f_b_mps2,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """Batches of rows, drawn with replacement by seed and step, half of them mirrored."""

    tensors: tuple[torch.Tensor, ...]  # (n, …, 3) each
    batch: int
    seed: int
    mirrored: bool = False

    def __call__(self, step: int) -> Batch:
        """Return the batch of a step."""
        rng = np.random.default_rng([self.seed, step])
        device = self.tensors[0].device
        rows = torch.from_numpy(rng.integers(0, len(self.tensors[0]), self.batch)).to(device)
        batch = tuple(tensor[rows] for tensor in self.tensors)
        if not self.mirrored:
            return batch
        half, mirror = self.batch // 2, batch[0].new_tensor(_MIRROR)
        return tuple(torch.cat([tensor[:half] * mirror, tensor[half:]]) for tensor in batch)


def draw(world: GravityWorld, count: int, *, seed: list[int]) -> GravityEpochs:
    """Return windows of a world, once it is known to make what the networks see.

    Flights are drawn by all processors at once; how many there are changes no window.

    Raises
    ------
    BadInputError
        If its windows or its rate are others.
    """
    wanted = (SAMPLES, VELOCITIES, RATE_HZ)
    given = (world.windows.samples, world.windows.velocities, world.imu.rate_hz)
    if not np.allclose(given, wanted):
        raise BadInputError(
            f"world: windows.samples, windows.velocities, imu.rate_hz must be {wanted}, got {given}"
        )
    each = _CHUNK * world.windows.per_flight
    sizes = [min(each, count - first) for first in range(0, count, each)]
    parts = partial(_part, world, seed)
    if len(sizes) < _FEW:
        drawn = [parts(k, size) for k, size in enumerate(sizes)]
    else:
        with ProcessPoolExecutor(os.cpu_count(), get_context("spawn")) as pool:
            drawn = list(pool.map(parts, range(len(sizes)), sizes))
    starts = np.cumsum([0, *(block.flight[-1] + 1 for block in drawn)])
    for block, first in zip(drawn, starts[:-1], strict=True):
        block.flight[:] += first
    return GravityEpochs.joined(drawn)


def _part(world: GravityWorld, seed: list[int], k: int, size: int) -> GravityEpochs:
    """Return the windows of one chunk of flights."""
    return gravity_epochs(world, np.random.default_rng([*seed, k]), size)


def baseline(name: str, epochs: GravityEpochs) -> FloatArray:
    """Return gravity's direction in body axes, (n, 3), as a baseline has it.

    ``newest sample``: minus the last specific force; ``low-pass``: minus the window's mean;
    ``physical pair``: the attitude by specific force in both frames, (f_b, a_n - g_n), and the nose
    along the velocity.
    """
    if name == "physical pair":
        inputs = (torch.from_numpy(x) for x in (epochs.f_b_mps2, epochs.v_n_mps))
        f_b_mps2, v_n_mps = inputs
        return np.asarray(directions(f_b_mps2, CourseMotion().double()(v_n_mps))[:, 0].numpy())
    f_b = epochs.f_b_mps2.mean(axis=1) if name == "low-pass" else epochs.f_b_mps2[:, -1]
    return np.asarray(-f_b / np.linalg.norm(f_b, axis=1, keepdims=True))


def angles_deg(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the angles between directions, (n,)."""
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    return np.asarray(np.degrees(np.arctan2(sine, np.einsum("ni,ni->n", a, b))))


def rms(values: FloatArray) -> float:
    """Return the root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def split(
    flight: IntArray, shares: tuple[float, float, float], by: str, seed: int
) -> list[IntArray]:
    """Return rows to train, to validate and to test, by ``"samples"`` or by ``"flights"``."""
    rng = np.random.default_rng(seed)
    groups = flight if by == "flights" else np.arange(len(flight))
    rank = rng.permutation(groups.max() + 1)[groups]
    edges = np.cumsum(shares)[:2] / np.sum(shares) * (groups.max() + 1)
    return [np.flatnonzero(np.searchsorted(edges, rank, side="right") == k) for k in range(3)]
