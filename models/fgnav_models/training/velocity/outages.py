"""Outages of GNSS that nothing ends: flights, and the likelihood of their states in them."""

from collections.abc import Sequence
from dataclasses import replace
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
    """Tuning of the correlation of a network's errors through the smoother, and its test."""

    # flights, held_out: to tune by, and to judge on
    flights: Count = 36
    held_out: Count = 180
    gnss_s: Positive = 14.0  # with fixes, four times a second
    outage_s: Range = (5.0, 20.0)  # without any, until the end of the record
    # half_life_s, constant_share: tried values; answers come every two half-lives, and a share of
    # their errors' variance is constant over a flight
    half_life_s: tuple[Positive, ...] = (0.5, 1.0, 2.0, 4.0)
    constant_share: tuple[NotNegative, ...] = (0.0, 0.3, 0.6)


def outage_flights(
    world: VehiclesWorld, outages: Outages, count: int, *, rng: np.random.Generator
) -> list[Flight]:
    """Return flights of a world without GNSS in their last seconds.

    The inertial unit's noise is that of its data sheet and of the vehicle's shaking, as a data
    sheet of the mounted unit would have it.
    """
    return [_flight(world, outages, flight_rng) for flight_rng in rng.spawn(count)]


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

    def loss(self, factors: Sequence[NeuralFactor]) -> float:
        """Return the negative log-likelihood of the states in the outage; NaN of no solution."""
        try:
            with torch.no_grad():
                return float(learn.nll(self.posterior(factors), self.outage))
        except NoSolutionError:
            return np.nan


def tuned(factors: Sequence[NeuralFactor], flights: Sequence[OutageFlight]) -> NeuralFactor:
    """Return the factor by which states in outages are likeliest, of those that solve most flights.

    Their mean losses are compared over flights that all of these solve.

    Raises
    ------
    NoSolutionError
        If there is no such flight.
    """
    losses = np.array([[flight.loss([factor]) for flight in flights] for factor in factors])
    solved = np.isfinite(losses).sum(axis=1)
    best = np.flatnonzero(solved == solved.max())
    shared = losses[best][:, np.isfinite(losses[best]).all(axis=0)]
    if not shared.size:
        raise NoSolutionError(f"none of {len(flights)} flights in outages has a solution")
    return factors[int(best[shared.mean(axis=1).argmin()])]
