"""Accelerometer windows of many simulated flights, and the gravity that they hide."""

from dataclasses import dataclass, fields

import msgspec
import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.types.flight import Flight
from fgnav_sim.data_sets.gravity_bodies import BODIES
from fgnav_sim.data_sets.gravity_motions import MOTIONS, drawn_motion
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.ranges import log_uniform, uniform
from fgnav_sim.scenario import FixesTable, Scenario
from fgnav_sim.simulate import simulate

VELOCITY_HZ = 10.0
PHASES = (*MOTIONS, *BODIES)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GravityEpochs:
    """Windows of an accelerometer, a receiver's velocities meanwhile, and the truth."""

    t_s: FloatArray  # (n,); last sample of each window, since its flight's start
    flight: IntArray  # (n,); from 0; split by it, for windows of one flight share motion and biases
    phase: IntArray  # (n,); kind of flight, a place in ``PHASES``
    f_b_mps2: FloatArray  # (n, k, 3); specific force, oldest sample first
    v_n_mps: FloatArray  # (n, m, 3); of the antenna, oldest first, the newest at ``t_s``
    g_b: FloatArray  # (n, 3); down in body axes at ``t_s``, true
    R_nb: FloatArray  # (n, 3, 3); at ``t_s``

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.t_s)

    def __getitem__(self, rows: slice | IntArray | BoolArray) -> "GravityEpochs":
        """Select windows."""
        return GravityEpochs(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})

    @classmethod
    def joined(cls, parts: list["GravityEpochs"]) -> "GravityEpochs":
        """Return all windows of parts, one after another."""
        return cls(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(cls)}
        )


def gravity_epochs(
    world: GravityWorld, generator: np.random.Generator, count: int
) -> GravityEpochs:
    """Return windows of flights of the world's kinds.

    Parameters
    ----------
    generator : numpy.random.Generator
        The same seed gives the same windows, bit by bit.
    count : int
        How many windows; the last flight has fewer where they are not whole flights.

    Raises
    ------
    BadInputError
        If the count is below one.
    """
    if count < 1:
        raise BadInputError(f"count: must be 1 or more, got {count}")
    flights = -(-count // world.windows.per_flight)
    kind_rng, rng = generator.spawn(2)
    weights = np.array(msgspec.structs.astuple(world.phases))
    phase = kind_rng.choice(len(PHASES), flights, p=weights / weights.sum())
    parts = []
    for number, (kind, flight_rng) in enumerate(zip(phase, rng.spawn(flights), strict=True)):
        flight = gravity_flight(world, PHASES[kind], rng=flight_rng)
        parts.append(_windows(world, flight, number, int(kind), rng=flight_rng))
    return GravityEpochs.joined(parts)[:count]


def gravity_flight(world: GravityWorld, phase: str, *, rng: np.random.Generator) -> Flight:
    """Return a flight of a kind with an accelerometer, velocities ten times a second, and truth.

    Parameters
    ----------
    phase : str
        One of ``PHASES``.
    """
    imu_b_m = np.array(world.accelerometer_arm_m) * rng.uniform(-1, 1, 3)
    antenna_b_m = imu_b_m + np.array(world.antenna_arm_m) * rng.uniform(-1, 1, 3)
    noise_mps, draw = log_uniform(world.velocity_noise_mps, rng), uniform(rng)
    scenario = Scenario(
        name=phase,
        duration_s=world.windows.flight_s,
        truth_rate_hz=VELOCITY_HZ,
        origin=world.origin,
        antennas_b_m=(tuple(antenna_b_m.tolist()),),
        imu=msgspec.structs.replace(world.imu, position_b_m=tuple(imu_b_m.tolist())),
        fixes=FixesTable(rate_hz=VELOCITY_HZ, velocity_noise_mps=noise_mps),
        flown=BODIES[phase](world, draw) if phase in BODIES else None,
    )
    if phase in MOTIONS:
        scenario = msgspec.structs.replace(scenario, motion=drawn_motion(world, phase, draw))
    return simulate(scenario, rng)


def _windows(
    world: GravityWorld, flight: Flight, number: int, phase: int, *, rng: np.random.Generator
) -> GravityEpochs:
    """Return windows that end at velocities drawn from a flight."""
    imu, fixes, truth, table = flight.imu, flight.first_fixes, flight.truth, world.windows
    if imu is None or fixes is None or fixes.v_n_mps is None or truth is None:
        raise BadInputError(f"flight {flight.name}: needs accelerations, velocities and truth")
    last = np.searchsorted(imu.t_s, fixes.t_s + 0.5 / world.imu.rate_hz) - 1
    complete = (last >= table.samples - 1) & (np.arange(len(last)) >= table.velocities - 1)
    ends = np.flatnonzero(complete)
    if not len(ends):
        raise BadInputError(
            f"windows.flight_s: the {flight.name} flew {imu.t_s[-1]:.2f} s, less than a window"
        )
    rows = np.sort(rng.choice(ends, table.per_flight, replace=len(ends) < table.per_flight))
    R_nb = truth.R_nb[rows]
    return GravityEpochs(
        t_s=fixes.t_s[rows],
        flight=np.full(len(rows), number),
        phase=np.full(len(rows), phase),
        f_b_mps2=imu.f_b_mps2[last[rows][:, None] + np.arange(1 - table.samples, 1)],
        v_n_mps=fixes.v_n_mps[rows[:, None] + np.arange(1 - table.velocities, 1)],
        g_b=R_nb[:, 2],
        R_nb=R_nb,
    )
