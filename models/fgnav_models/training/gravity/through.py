"""A gravity network trained through the smoother, its errors counted as its factor counts them.

Answers are two half-lives apart, what lasts of their errors is a constant of the flight
(``fgnav.neural.correlation``); training draws where the first one stands, so that all windows of a
flight are seen.
"""

import logging
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch

from fgnav.checks import BadInputError, FloatArray, IntArray, NoSolutionError
from fgnav.geometry.rotations import skew
from fgnav.graph.correlation import inflation
from fgnav.graph.factors.directions import across
from fgnav.io.strict_toml import Positive
from fgnav.methods.smoother import Batch
from fgnav.neural import NeuralFactor
from fgnav.types.flight import Flight
from fgnav_models.training.gravity.features import course_motion, differenced, windows
from fgnav_models.training.gravity.nets import GravityNet
from fgnav_models.training.learning import Count, Steps
from fgnav_models.training.smoother.flights import TrainingFlight, training_flight
from fgnav_models.training.smoother.loss import negative_log_likelihood
from fgnav_models.training.train import Batch as Tensors
from fgnav_sim.data_sets.gravity_motions import drawn_motion
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.scenario import FixesTable, Scenario
from fgnav_sim.simulate import simulate

_LOG = logging.getLogger("fgnav")
_FIX_HZ = 10.0
_LEAST_SINE = 1e-9
_SAME = 1e-6  # of a window: times are rounded


class Through(Steps, frozen=True):
    """How a network is trained through the smoother once it is trained alone, by flights."""

    # flights, validated, held_out: to learn from; to choose the best weights on; to compare both
    # networks on
    flights: Count = 120
    validated: Count = 40
    held_out: Count = 100
    # kinds of motion, one after another. Spins are lost to a smoother without gyroscope and array,
    # whatever the network.
    phases: tuple[str, ...] = ("climb", "cruise", "descent", "turn")
    duration_s: Positive = 30.0
    steps: Count = 400
    batch: Count = 8
    learning_rate: Positive = 2e-5


def flown(
    world: GravityWorld, phases: tuple[str, ...], count: int, duration_s: float, seed: list[int]
) -> list[Flight]:
    """Return flights of the networks' world, with fixes ten times a second."""
    out = []
    for number, rng in enumerate(np.random.default_rng(seed).spawn(count)):
        kind = phases[number % len(phases)]
        motion = drawn_motion(world, kind, rng=rng)
        scenario = Scenario(
            name=f"{kind} {number}",
            duration_s=duration_s,
            motion=motion,
            imu=world.imu,
            fixes=FixesTable(rate_hz=_FIX_HZ, velocity_noise_mps=world.velocity_noise_mps),
        )
        out.append(simulate(scenario, rng))
    return out


class Errors(NamedTuple):
    """How the factor counts the errors of its answers."""

    interval_s: float
    inflation: float
    lasting: float  # share of their variance
    constant: str  # of the flight, that lasts

    @classmethod
    def of(cls, factor: NeuralFactor, half_life_s: float, lasting: float) -> "Errors":
        """Return those that a factor's manifest states."""
        constant = factor.constants[0].name if factor.constants else ""
        apart_s = factor.between_s
        return cls(apart_s, inflation(half_life_s, apart_s), lasting, constant)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GravityFlight:
    """A flight to train on, and what a network may see of it at w keyframes."""

    flight: TrainingFlight
    row: IntArray  # (w,)
    seen: tuple[torch.Tensor, ...]  # as ``GravityNet`` takes them
    down_b: FloatArray  # (w, 3); direction of gravity where the flight is linearised
    across_b: FloatArray  # (w, 2, 3); two axes across it, in which residuals are
    jacobian: FloatArray  # (w, 2, D)

    def loss(self, net: GravityNet, which: IntArray, errors: Errors) -> torch.Tensor:
        """Return the negative log-likelihood of the truth beside some answers, (k,).

        The answer's logarithm at the linearised direction u, in two axes A across it:
        ``r = -A log_u(g) + sqrt(s) P^(1/2) A c``, by a turn delta of the body ``A [u]x delta``; P
        is the answer's covariance in these axes, s the share of it that lasts, c in 1-sigmas.
        """
        g_b, covariance = net(*(tensor[which] for tensor in self.seen))
        A = torch.from_numpy(self.across_b[which])
        beside = torch.einsum("kij,kj->ki", A, g_b.double())
        sine = beside.norm(dim=1, keepdim=True).clamp_min(_LEAST_SINE)
        along = (torch.from_numpy(self.down_b[which]) * g_b.double()).sum(dim=1, keepdim=True)
        residual = -beside * torch.atan2(sine, along) / sine
        P = A @ covariance.double() @ A.transpose(1, 2)
        constants = torch.from_numpy(self.flight.states.constants)
        shared = torch.zeros(len(A), 2, len(constants), dtype=A.dtype)
        if errors.lasting:
            columns = self.flight.linearised.problem.constants.columns(errors.constant)
            shared[:, :, columns] = np.sqrt(errors.lasting) * symmetric_root(P) @ A
        return negative_log_likelihood(
            self.flight,
            self.row[which],
            self.jacobian[which],
            residual + shared @ constants,
            errors.inflation * (1 - errors.lasting) * P,
            shared,
        )


def symmetric_root(P: torch.Tensor) -> torch.Tensor:
    """Return the symmetric roots of covariances, (k, 2, 2), by Cayley and Hamilton's theorem."""
    root_det = torch.linalg.det(P).sqrt()[:, None, None]
    trace = torch.einsum("kii->k", P)[:, None, None]
    return (P + root_det * torch.eye(2, dtype=P.dtype)) / (trace + 2 * root_det).sqrt()


def gravity_flights(flights: list[Flight], method: Batch, *, aided: bool) -> list[GravityFlight]:
    """Return flights linearised with a network's answers; those it does not solve are counted.

    Raises
    ------
    BadInputError
        If none is left.
    """
    out = []
    for flight in flights:
        try:
            linearised = training_flight(flight, method)
        except NoSolutionError:
            continue
        out.append(_gravity_flight(flight, linearised, aided=aided))
    if not out:
        raise BadInputError("through the smoother: it solves none of the flights; take more")
    if len(out) < len(flights):
        _LOG.warning(
            "%d of %d flights teach nothing: the smoother does not solve them",
            len(flights) - len(out),
            len(flights),
        )
    return out


def _gravity_flight(flight: Flight, linearised: TrainingFlight, *, aided: bool) -> GravityFlight:
    fixes, imu = flight.first_fixes, flight.imu
    if fixes is None or fixes.v_n_mps is None or imu is None:
        raise BadInputError(f"flight {flight.name}: training gravity needs velocities and an [imu]")
    velocity, acceleration = differenced(fixes.t_s, fixes.v_n_mps)
    ends_s = fixes.t_s[2:]  # of windows: the newest of three velocities
    f_b_mps2, covered = windows(imu, ends_s)
    row = linearised.rows(ends_s)
    kept = np.flatnonzero(covered & (row >= 0))
    row = row[kept]
    motion = course_motion(*(torch.from_numpy(x[kept]) for x in (velocity, acceleration)))
    seen = (torch.from_numpy(f_b_mps2[kept]), motion)[: 2 if aided else 1]
    down_b = linearised.states.R_nb[row, 2]
    axes = across(down_b)
    jacobian = np.zeros((len(row), 2, linearised.states.width))
    jacobian[:, :, :3] = axes @ skew(down_b)
    return GravityFlight(
        flight=linearised,
        row=row,
        seen=tuple(x.float() for x in seen),
        down_b=down_b,
        across_b=axes,
        jacobian=jacobian,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnFlights:
    """Batches of flights and of answers, an interval apart from a first one, by step."""

    flights: list[GravityFlight]
    batch: int
    errors: Errors
    seed: int

    @property
    def _every(self) -> int:
        """Windows from answer to answer."""
        return max(1, math.ceil(_FIX_HZ * self.errors.interval_s - _SAME))

    def __call__(self, step: int) -> Tensors:
        """Return flights and first windows of a step, (batch, 2), int64."""
        rng = np.random.default_rng([self.seed, step])
        count = min(self.batch, len(self.flights))
        chosen = rng.choice(len(self.flights), count, replace=False)
        first = rng.integers(0, self._every, count)
        return (torch.from_numpy(np.stack([chosen, first], axis=1)),)

    def loss(self, module: torch.nn.Module, batch: Tensors) -> torch.Tensor:
        """Return the mean over a batch of flights."""
        return torch.stack([self._one(module, *pair) for pair in batch[0].tolist()]).mean()

    def of_all(self, module: torch.nn.Module) -> float:
        """Return the mean over all flights, their first window in the middle of what is drawn."""
        with torch.no_grad():
            losses = [self._one(module, k, self._every // 2) for k in range(len(self.flights))]
        return float(torch.stack(losses).mean())

    def _one(self, module: torch.nn.Module, flight: int, first: int) -> torch.Tensor:
        one = self.flights[flight]
        return one.loss(module, np.arange(first, len(one.row), self._every), self.errors)
