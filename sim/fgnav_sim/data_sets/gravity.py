"""Accelerometer windows of many simulated motions, and the gravity that they hide."""

from dataclasses import dataclass, fields

import msgspec
import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav_sim.data_sets.gravity_motions import PHASES, drawn_motion
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.sensors.inertial import triad


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GravityEpochs:
    """Windows of an accelerometer, what a receiver says meanwhile, and the truth."""

    t_s: FloatArray  # (n,); last sample of each window, since its flight's start
    flight: IntArray  # (n,); from 0; split by it, for windows of one flight share motion and biases
    phase: IntArray  # (n,); kind of motion, a place in ``PHASES``
    f_b_mps2: FloatArray  # (n, k, 3); specific force, oldest sample first
    # v_n_mps, a_n_mps2: (n, 3); a receiver's velocity of the body's origin, and the difference of
    # two over their time
    v_n_mps: FloatArray
    a_n_mps2: FloatArray
    g_b: FloatArray  # (n, 3); direction of gravity in body axes at ``t_s``, true
    gravity_mps2: FloatArray  # (n,); its size
    R_nb: FloatArray  # (n, 3, 3); at ``t_s``

    def __len__(self) -> int:
        """Return the number of windows."""
        return len(self.t_s)

    def __getitem__(self, rows: slice | IntArray | BoolArray) -> "GravityEpochs":
        """Return some of the windows."""
        return GravityEpochs(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


def gravity_epochs(
    world: GravityWorld, generator: np.random.Generator, count: int
) -> GravityEpochs:
    """Return windows of flights that climb, cruise, descend, turn and spin.

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
    parts = [
        _flown(world, number, int(kind), rng=own)
        for number, (kind, own) in enumerate(zip(phase, rng.spawn(flights), strict=True))
    ]
    return GravityEpochs(
        **{
            f.name: np.concatenate([getattr(part, f.name) for part in parts])[:count]
            for f in fields(GravityEpochs)
        }
    )


def _flown(
    world: GravityWorld, number: int, phase: int, *, rng: np.random.Generator
) -> GravityEpochs:
    """Return the windows of one flight."""
    windows, origin = world.windows, world.origin.frame
    motion = drawn_motion(world, PHASES[phase], rng=rng)
    begin_s = np.sort(rng.uniform(0.0, windows.flight_s, windows.per_flight))
    t_s = begin_s[:, None] + np.arange(windows.samples) / world.imu.rate_hz
    lever_b_m = np.array(world.imu.position_b_m) + world.lever_sigma_m * rng.standard_normal(3)
    sensed = motion(t_s.ravel())
    true_b_mps2 = sensed.specific_force_b_mps2(origin, lever_b_m, "wgs84-normal")
    f_b_mps2 = triad(world.imu, "accelerometer", "mps2")(true_b_mps2, world.imu.rate_hz, rng=rng)
    half_s = 0.5 * world.velocity_step_s
    middle_s = t_s[:, -1] - world.velocity_age_s
    v_n_mps = np.stack([motion(middle_s + h).v_n_mps for h in (-half_s, half_s)])
    v_n_mps = v_n_mps + world.velocity_noise_mps * rng.standard_normal(v_n_mps.shape)
    end = motion(t_s[:, -1])
    g_n_mps2 = origin.gravity_n_mps2(end.p_n_m)
    gravity_mps2 = np.linalg.norm(g_n_mps2, axis=1)
    return GravityEpochs(
        t_s=t_s[:, -1],
        flight=np.full(len(t_s), number),
        phase=np.full(len(t_s), phase),
        f_b_mps2=f_b_mps2.reshape(*t_s.shape, 3),
        v_n_mps=v_n_mps.mean(axis=0),
        a_n_mps2=(v_n_mps[1] - v_n_mps[0]) / world.velocity_step_s,
        g_b=np.einsum("nij,ni->nj", end.R_nb, g_n_mps2) / gravity_mps2[:, None],
        gravity_mps2=gravity_mps2,
        R_nb=end.R_nb,
    )
