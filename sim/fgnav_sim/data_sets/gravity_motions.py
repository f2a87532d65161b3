"""Motions that hide gravity from accelerometers: each a kind of flight, drawn from a world."""

from collections.abc import Callable
from dataclasses import replace

import msgspec
import numpy as np

from fgnav.checks import FloatArray
from fgnav_sim.data_sets.gravity_world import GravityWorld
from fgnav_sim.motion import Arc, Command, Motion, Rate, Sine, State, Straight, Trajectory
from fgnav_sim.ranges import Draw

_GRAVITY_MPS2 = 9.81  # for the bank of a coordinated turn alone


def drawn_motion(world: GravityWorld, phase: str, draw: Draw) -> Trajectory:
    """Return a motion of ``MOTIONS`` with an acceleration that swings along its first course."""
    motion = MOTIONS[phase](world, draw)
    size_mps2, rate_radps = draw(world.motion.surge_mps2), draw(world.motion.wobble_radps)
    start_rad = draw((0.0, 2 * np.pi))
    first_n_mps = motion(np.zeros(1)).v_n_mps[0]
    along_n = first_n_mps / np.linalg.norm(first_n_mps)

    def surging(t_s: FloatArray) -> State:
        state = motion(t_s)
        angle_rad = rate_radps * t_s + start_rad
        surge = size_mps2 * np.stack(
            [
                -np.sin(angle_rad) / rate_radps**2,
                -np.cos(angle_rad) / rate_radps,
                np.sin(angle_rad),
            ]
        )
        p, v, a = surge[..., None] * along_n
        return replace(
            state, p_n_m=state.p_n_m + p, v_n_mps=state.v_n_mps + v, a_n_mps2=state.a_n_mps2 + a
        )

    return surging


def _straight(world: GravityWorld, draw: Draw, slope_deg: float) -> Motion:
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


def _turn(world: GravityWorld, draw: Draw) -> Motion:
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


def _spin(world: GravityWorld, draw: Draw) -> Motion:
    """Return a straight flight on any slope that rolls steadily."""
    steepest = world.motion.climb_deg[1]
    straight = _straight(world, draw, draw((-steepest, steepest)))
    rate_degps = float(np.sign(draw((-1.0, 1.0))) * draw(world.motion.spin_degps))
    return msgspec.structs.replace(straight, roll=Rate(rate_degps=rate_degps, start_deg=0.0))


def _wobble(world: GravityWorld, draw: Draw, middle_deg: float) -> Command:
    return Sine(
        amplitude_deg=draw(world.motion.wobble_deg),
        rate_radps=draw(world.motion.wobble_radps),
        phase_deg=draw((0.0, 360.0)),
        offset_deg=middle_deg,
    )


MOTIONS: dict[str, Callable[[GravityWorld, Draw], Motion]] = {
    "climb": lambda world, draw: _straight(world, draw, draw(world.motion.climb_deg)),
    "cruise": lambda world, draw: _straight(world, draw, 0.0),
    "descent": lambda world, draw: _straight(world, draw, -draw(world.motion.climb_deg)),
    "turn": _turn,
    "spin": _spin,
}
