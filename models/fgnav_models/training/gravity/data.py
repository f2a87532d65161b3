"""What gravity networks learn from, and the baselines that need no learning."""

from dataclasses import dataclass

import numpy as np
import torch

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav_models.training.gravity.features import SAMPLES, SPAN_S, STEP_S, course_motion
from fgnav_models.training.train import Batch
from fgnav_sim.data_sets.gravity import GravityEpochs, gravity_epochs
from fgnav_sim.data_sets.gravity_world import GravityWorld

BASELINES = ("newest sample", "low-pass", "physical pair")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Rows:
    """Inputs and truth as tensors: windows (n, k, 3), motion (n, 5), unit gravity (n, 3)."""

    f_b_mps2: torch.Tensor
    motion: torch.Tensor
    g_b: torch.Tensor

    @classmethod
    def of(cls, epochs: GravityEpochs) -> "Rows":
        """Return the rows of simulated windows."""
        motion = course_motion(*map(torch.from_numpy, (epochs.v_n_mps, epochs.a_n_mps2)))
        f_b_mps2, g_b = (torch.from_numpy(x).float() for x in (epochs.f_b_mps2, epochs.g_b))
        return cls(f_b_mps2=f_b_mps2, motion=motion.float(), g_b=g_b)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.g_b)

    def seen(self, *, aided: bool) -> tuple[torch.Tensor, ...]:
        """Return what a network sees."""
        return (self.f_b_mps2, self.motion) if aided else (self.f_b_mps2,)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """Batches of rows, drawn with replacement by seed and step."""

    tensors: tuple[torch.Tensor, ...]
    batch: int
    seed: int

    def __call__(self, step: int) -> Batch:
        """Return the batch of a step."""
        rng = np.random.default_rng([self.seed, step])
        rows = torch.from_numpy(rng.integers(0, len(self.tensors[0]), self.batch))
        return tuple(tensor[rows] for tensor in self.tensors)


def draw(world: GravityWorld, count: int, *, rng: np.random.Generator) -> GravityEpochs:
    """Return windows of a world, once it is known to make what the networks see.

    Raises
    ------
    BadInputError
        If its windows, its rate or the step of its velocities are others.
    """
    wanted = (SAMPLES, 1 / STEP_S, SPAN_S)
    given = (world.windows.samples, world.imu.rate_hz, world.velocity_step_s)
    if not np.allclose(given, wanted):
        raise BadInputError(
            f"world: windows.samples, imu.rate_hz, velocity_step_s must be {wanted}, got {given}"
        )
    return gravity_epochs(world, rng, count)


def baseline(name: str, epochs: GravityEpochs) -> FloatArray:
    """Return gravity's direction in body axes, (n, 3), as a baseline has it.

    ``newest sample``: minus the last specific force; ``low-pass``: minus the window's mean;
    ``physical pair``: the attitude by specific force in both frames, (f_b, a_n - g_n), and the nose
    along the velocity.
    """
    if name != "physical pair":
        f_b = epochs.f_b_mps2.mean(axis=1) if name == "low-pass" else epochs.f_b_mps2[:, -1]
        return -_unit(f_b)
    down_n = _unit(np.einsum("nij,nj->ni", epochs.R_nb, epochs.g_b))  # known with the position
    force_n = epochs.a_n_mps2 - down_n * epochs.gravity_mps2[:, None]
    nose_b = np.tile([1.0, 0.0, 0.0], (len(epochs), 1))
    body = _frame(epochs.f_b_mps2[:, -1], nose_b)
    R_nb = _frame(force_n, epochs.v_n_mps) @ np.swapaxes(body, 1, 2)
    return np.asarray(np.einsum("nij,ni->nj", R_nb, down_n))


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
    place = rng.permutation(groups.max() + 1)[groups]
    edges = np.cumsum(shares)[:2] / np.sum(shares) * (groups.max() + 1)
    return [np.flatnonzero(np.searchsorted(edges, place, side="right") == k) for k in range(3)]


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector, axis=1, keepdims=True))


def _frame(first: FloatArray, second: FloatArray) -> FloatArray:
    x, y = _unit(first), _unit(np.cross(first, second))
    return np.stack([x, y, np.cross(x, y)], axis=2)
