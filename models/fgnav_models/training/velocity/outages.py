"""Outages of GNSS that nothing ends: flights to learn from, and what a posterior loses in them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import msgspec
import numpy as np
import torch

from fgnav import Batch as BatchSmoother
from fgnav.checks import NoSolutionError
from fgnav.evaluation.reference import truth_at
from fgnav.io.strict_toml import NotNegative, Positive, Table
from fgnav.methods.smoothing.custom_sources import custom_constants
from fgnav.neural.factor import NeuralFactor
from fgnav.types.flight import Flight, Imu, Truth
from fgnav_models import learn
from fgnav_models.training.train import Batch
from fgnav_models.training.velocity.vehicles.track import Track
from fgnav_models.training.velocity.vehicles.world import (
    VehiclesWorld,
    drawn_kind,
    vehicle_scenario,
)
from fgnav_sim.ranges import Count, Range
from fgnav_sim.scenario import FixesTable
from fgnav_sim.simulate import simulate

SMOOTHER = BatchSmoother(factors=(), noise="nominal")
_FIXES = FixesTable(rate_hz=4.0, position_noise_m=0.05)
# The last fix, that keyframes reach to the end of the record: in SI, far more than any drift.
_UNINFORMATIVE = 1e3


class Outages(Table, frozen=True):
    """How a network that was trained alone goes on through the smoother, and is judged."""

    # flights, held_out: to learn from, and to judge on
    flights: Count = 60
    held_out: Count = 60
    gnss_s: Positive = 14.0  # with fixes, four times a second
    outage_s: Range = (5.0, 20.0)  # without any, until the end of the record
    steps: Count = 150
    batch: Count = 6  # flights of a step
    learning_rate: Positive = 5e-4
    # half_life_s, lasting: of the errors' correlation, as the factor counts them; an answer comes
    # every two half-lives
    half_life_s: Positive = 1.0
    lasting: NotNegative = 0.3


def outage_flights(
    world: VehiclesWorld, outages: Outages, count: int, *, rng: np.random.Generator
) -> list[Flight]:
    """Return flights of a world without GNSS in their last seconds.

    The inertial unit's noise is that of its data sheet and of the vehicle's shaking, as a data
    sheet of the mounted unit would have it.
    """
    return [_flight(world, outages, own) for own in rng.spawn(count)]


def _flight(world: VehiclesWorld, outages: Outages, rng: np.random.Generator) -> Flight:
    kind, span_s = drawn_kind(world, rng), outages.gnss_s + rng.uniform(*outages.outage_s)
    world = msgspec.structs.replace(world, flight_s=span_s)
    scenario = vehicle_scenario(world, kind, rng, fixes=_FIXES)
    flight = simulate(scenario, rng)
    (fixes,) = flight.fixes
    is_last = fixes.t_s == fixes.t_s[-1]
    weak = np.where(is_last[:, None], _UNINFORMATIVE, 0.0)
    fixes = replace(
        fixes,
        position_sigma_m=fixes.position_sigma_m + weak,
        velocity_sigma_mps=np.full(3, _FIXES.velocity_noise_mps) + weak,
    )[(fixes.t_s < outages.gnss_s) | is_last]
    if flight.imu is not None and isinstance(scenario.motion, Track):
        flight = replace(flight, imu=_with_shaking(flight.imu, scenario.motion))
    return replace(flight, fixes=(fixes,))


def _with_shaking(imu: Imu, motion: Track) -> Imu:
    """Return a record whose noise densities hold the shaking, which is white at its rate."""
    rate_hz = 1 / float(np.median(np.diff(imu.t_s)))
    force, rate = np.sqrt((motion.shaking**2).reshape(-1, 2, 3).mean(axis=(0, 2)) / rate_hz)
    return replace(
        imu,
        accelerometer_noise_mps2_per_sqrt_hz=float(
            np.hypot(imu.accelerometer_noise_mps2_per_sqrt_hz, force)
        ),
        gyroscope_noise_radps_per_sqrt_hz=float(
            np.hypot(imu.gyroscope_noise_radps_per_sqrt_hz or 0.0, rate)
        ),
    )


class OutageFlight(NamedTuple):
    """A flight to train on or to judge by, and the truth in its outage."""

    flight: learn.TrainingFlight
    outage: Truth

    @classmethod
    def of(cls, flight: Flight) -> "OutageFlight":
        """Return a flight with its problem; the outage is between its last two fixes."""
        training, (begin_s, end_s) = (
            learn.training_flight(flight, SMOOTHER),
            flight.fixes[0].t_s[-2:],
        )
        t_s = training.truth.t_s
        return cls(training, training.truth[(t_s > begin_s) & (t_s < end_s)])

    def posterior(self, factors: Sequence[NeuralFactor]) -> learn.Posterior:
        """Return the posterior given factors; the first search of a kind begins at the truth.

        From an alignment it takes ten times as long, and may end at another minimum.
        """
        flight, problem = self.flight, self.flight.prepared.problem
        width = problem.with_constants(custom_constants(factors)).constants.width
        if flight.states is None or len(flight.states.constants) != width:
            truth = truth_at(flight.truth, problem.t_s)
            flight.states = problem.start._replace(
                R_nb=truth.R_nb,
                p_n_m=truth.p_n_m,
                v_n_mps=truth.v_n_mps,
                constants=np.zeros(width),
            )
        return learn.posterior(flight, factors)


@dataclass(frozen=True, slots=True)
class OutageLoss:
    """Negative log-likelihood of attitude, position and velocity in outages, over some flights.

    ``source`` is the factor of the live module that is trained.
    """

    flights: tuple[OutageFlight, ...]
    source: NeuralFactor

    def __call__(self, _: torch.nn.Module, batch: Batch) -> torch.Tensor:
        """Return the mean over the flights of a batch that are solved.

        Raises
        ------
        NoSolutionError
            If none is.
        """
        losses, failures = [], []
        for flight in (self.flights[k] for k in batch[0].tolist()):
            try:
                losses.append(learn.nll(flight.posterior([self.source]), flight.outage))
            except NoSolutionError as error:
                failures.append(str(error))
        if not losses:
            raise NoSolutionError(f"none of {len(failures)} flights: {failures[0]}")
        return torch.stack(losses).mean()


@dataclass(frozen=True, slots=True)
class ShuffledFlights:
    """Batches of flights, each flight once an epoch, by seed and step."""

    count: int
    batch: int
    seed: int

    def __call__(self, step: int) -> Batch:
        """Return the numbers of the flights of a step."""
        epoch, place = divmod(step, max(1, self.count // self.batch))
        order = np.random.default_rng([self.seed, epoch]).permutation(self.count)
        return (torch.from_numpy(order[place * self.batch :][: self.batch]),)
