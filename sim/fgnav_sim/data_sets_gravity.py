"""Accelerometer windows of many simulated motions, and the gravity that they hide."""

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import TypeAlias

import msgspec
import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav_sim.data_sets_gravity_world import GravityWorld, Range
from fgnav_sim.inertial import accelerometer
from fgnav_sim.motion import Arc, Command, Motion, Rate, Sine, State, Straight

_GRAVITY_MPS2 = 9.81  # for the bank of a coordinated turn alone

PHASES = ("climb", "cruise", "descent", "turn", "spin")


_Draw: TypeAlias = Callable[[Range], float]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class GravityEpochs:
    """Windows of an accelerometer, what a receiver says meanwhile, and the truth.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Last sample of each window, since its flight's start.
    flight : ndarray of int, shape (n,)
        From 0; split by it, for windows of one flight share motion and biases.
    phase : ndarray of int, shape (n,)
        Kind of motion, a place in ``PHASES``.
    f_b_mps2 : ndarray, shape (n, k, 3)
        Specific force, oldest sample first.
    v_n_mps, a_n_mps2 : ndarray, shape (n, 3)
        A receiver's velocity of the body's origin, and the difference of two over their time.
    g_b : ndarray, shape (n, 3)
        Direction of gravity in body axes at ``t_s``, true.
    gravity_mps2 : ndarray, shape (n,)
        Its size.
    R_nb : ndarray, shape (n, 3, 3)
        At ``t_s``.
    """

    t_s: FloatArray
    flight: IntArray
    phase: IntArray
    f_b_mps2: FloatArray
    v_n_mps: FloatArray
    a_n_mps2: FloatArray
    g_b: FloatArray
    gravity_mps2: FloatArray
    R_nb: FloatArray

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
    world : GravityWorld
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
    draw = _drawing(rng)
    motion = _surging(_MOTIONS[PHASES[phase]](world, draw), world, draw)
    begin_s = np.sort(rng.uniform(0.0, windows.flight_s, windows.per_flight))
    t_s = begin_s[:, None] + np.arange(windows.samples) / world.imu.rate_hz
    lever_b_m = np.array(world.imu.position_b_m) + world.lever_sigma_m * rng.standard_normal(3)
    sensed = motion(t_s.ravel())
    true_b_mps2 = sensed.specific_force_b_mps2(origin, lever_b_m, "wgs84-normal")
    f_b_mps2 = accelerometer(world.imu)(true_b_mps2, world.imu.rate_hz, rng=rng)
    half_s = 0.5 * world.velocity_step_s
    v_n_mps = np.stack([motion(t_s[:, -1] + h).v_n_mps for h in (-half_s, half_s)])
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


def _drawing(rng: np.random.Generator) -> _Draw:
    """Return what draws from a range."""
    return lambda limits: float(rng.uniform(*limits))


def _surging(motion: Motion, world: GravityWorld, draw: _Draw) -> Callable[[FloatArray], State]:
    """Return the motion with an acceleration that swings along its first course."""
    size_mps2, rate_radps = draw(world.motion.surge_mps2), draw(world.motion.wobble_radps)
    start_rad = draw((0.0, 2 * np.pi))
    first_n_mps = motion(np.zeros(1)).v_n_mps[0]
    along_n = first_n_mps / np.linalg.norm(first_n_mps)

    def surging(t_s: FloatArray) -> State:
        state = motion(t_s)
        angle_rad = rate_radps * t_s + start_rad
        swing = size_mps2 * np.stack(
            [
                -np.sin(angle_rad) / rate_radps**2,
                -np.cos(angle_rad) / rate_radps,
                np.sin(angle_rad),
            ]
        )
        p, v, a = swing[..., None] * along_n
        return replace(
            state, p_n_m=state.p_n_m + p, v_n_mps=state.v_n_mps + v, a_n_mps2=state.a_n_mps2 + a
        )

    return surging


def _straight(world: GravityWorld, draw: _Draw, slope_deg: float) -> Motion:
    """Return a straight flight along a slope, its long axis along the path but for wobbles."""
    speed, course = draw(world.motion.speed_mps), draw((-180.0, 180.0))
    slope = np.radians(slope_deg)
    return Motion(
        path=Straight(
            speed_mps=float(speed * np.cos(slope)),
            climb_mps=float(speed * np.sin(slope)),
            course_deg=course,
        ),
        roll=_wobble(world, draw, 0.0),
        pitch=_wobble(world, draw, slope_deg),
        yaw=_wobble(world, draw, course),
    )


def _climb(world: GravityWorld, draw: _Draw) -> Motion:
    return _straight(world, draw, draw(world.motion.climb_deg))


def _cruise(world: GravityWorld, draw: _Draw) -> Motion:
    return _straight(world, draw, 0.0)


def _descent(world: GravityWorld, draw: _Draw) -> Motion:
    return _straight(world, draw, -draw(world.motion.climb_deg))


def _turn(world: GravityWorld, draw: _Draw) -> Motion:
    """Return a level turn with the bank that keeps the lift in the body's plane of symmetry."""
    speed, pull_mps2 = draw(world.motion.speed_mps), draw(world.motion.turn_mps2)
    side, course = np.sign(draw((-1.0, 1.0))), draw((-180.0, 180.0))
    bank_deg = float(side * np.degrees(np.arctan(pull_mps2 / _GRAVITY_MPS2)))
    rate_degps = float(side * np.degrees(pull_mps2 / speed))
    return Motion(
        path=Arc(
            speed_mps=speed,
            radius_m=speed**2 / pull_mps2,
            course_deg=course,
            left=bool(side < 0),
        ),
        roll=_wobble(world, draw, bank_deg),
        pitch=_wobble(world, draw, 0.0),
        yaw=Rate(rate_degps=rate_degps, start_deg=course),
    )


def _spin(world: GravityWorld, draw: _Draw) -> Motion:
    """Return a straight flight on any slope that rolls steadily."""
    steepest = world.motion.climb_deg[1]
    straight = _straight(world, draw, draw((-steepest, steepest)))
    rate_degps = float(np.sign(draw((-1.0, 1.0))) * draw(world.motion.spin_degps))
    return msgspec.structs.replace(straight, roll=Rate(rate_degps=rate_degps, start_deg=0.0))


def _wobble(world: GravityWorld, draw: _Draw, middle_deg: float) -> Command:
    return Sine(
        amplitude_deg=draw(world.motion.wobble_deg),
        rate_radps=draw(world.motion.wobble_radps),
        phase_deg=draw((0.0, 360.0)),
        offset_deg=middle_deg,
    )


_MOTIONS: dict[str, Callable[[GravityWorld, _Draw], Motion]] = {
    "climb": _climb,
    "cruise": _cruise,
    "descent": _descent,
    "turn": _turn,
    "spin": _spin,
}
