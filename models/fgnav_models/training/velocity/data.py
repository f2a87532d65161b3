"""Training data of velocity networks: inertial records of simulated vehicles, cut anywhere."""

from dataclasses import dataclass, replace

import numpy as np
import torch

from fgnav.checks import FloatArray, IntArray
from fgnav_models.training.train import Batch
from fgnav_models.training.velocity.vehicles.world import (
    KINDS,
    VehiclesWorld,
    drawn_kind,
    vehicle_scenario,
)
from fgnav_sim.scenario import ImuTable
from fgnav_sim.sensors.inertial import sense

SCALE = (10.0, 1.0)  # of inputs: m/s2, rad/s


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Records:
    """Flights, m, of n samples each."""

    kind: IntArray  # (m,); a place in ``KINDS``
    sensed: tuple[torch.Tensor, ...]  # (m, n, 3); specific force and rate, over ``SCALE``
    v_b_mps: torch.Tensor  # (m, n, 3)
    rate_hz: float

    def windows(self, flight: IntArray, last: IntArray, window: int) -> Batch:
        """Return windows that end with samples, (k, window, 3) each, and velocities, (k, 3)."""
        device = self.v_b_mps.device
        flights, end = (torch.from_numpy(x).to(device) for x in (flight, last))
        rows = end[:, None] + torch.arange(1 - window, 1, device=device)
        return *(x[flights[:, None], rows] for x in self.sensed), self.v_b_mps[flights, end]

    def on(self, device: str) -> "Records":
        """Return the records on a device."""
        sensed = tuple(x.to(device) for x in self.sensed)
        return replace(self, sensed=sensed, v_b_mps=self.v_b_mps.to(device))

    def every(self, step: int, window: int) -> tuple[IntArray, IntArray]:
        """Return flight and last sample of windows ``step`` apart, of one flight after another."""
        last = np.arange(window - 1, self.v_b_mps.shape[1], step)
        flights = len(self.kind)
        return np.repeat(np.arange(flights), len(last)), np.tile(last, flights)


def records(world: VehiclesWorld, count: int, *, rng: np.random.Generator) -> Records:
    """Return flights of a world."""
    kinds, forces, rates, velocities = [], [], [], []
    for own in rng.spawn(count):
        kind = drawn_kind(world, own)
        scenario = vehicle_scenario(world, kind, own)
        imu = sense(scenario.imu or ImuTable(), scenario, rng=own)
        state = scenario.motion(imu.t_s)
        v_b_mps: FloatArray = np.einsum("nij,ni->nj", state.R_nb, state.v_n_mps)
        kinds.append(KINDS.index(kind))
        forces.append((imu.f_b_mps2 / SCALE[0]).astype(np.float32))
        rates.append((np.asarray(imu.w_b_radps) / SCALE[1]).astype(np.float32))
        velocities.append(v_b_mps.astype(np.float32))
    sensed, (v,) = (
        tuple(torch.from_numpy(np.stack(x)) for x in group)
        for group in ((forces, rates), (velocities,))
    )
    return Records(kind=np.array(kinds), sensed=sensed, v_b_mps=v, rate_hz=world.rate_hz)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """Batches of windows, anywhere in any flight, by seed and step."""

    flights: Records
    window: int
    batch: int
    seed: int

    def __call__(self, step: int) -> Batch:
        """Return the batch of a step."""
        rng = np.random.default_rng([self.seed, step])
        count, samples = self.flights.v_b_mps.shape[:2]
        flight = rng.integers(0, count, self.batch)
        last = rng.integers(self.window - 1, samples, self.batch)
        return self.flights.windows(flight, last, self.window)
