"""Cars: wheels that roll, stops, turns, and a body that leans on its springs."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import from_euler
from fgnav_models.training.velocity.vehicles.commands import (
    Draws,
    followed,
    integral,
    leaning,
    smooth,
)
from fgnav_models.training.velocity.vehicles.track import Track, knots_s, track

_TIGHTEST_M = 6.0  # radius of a passenger car's turning circle
_CREEPS_MPS = 2.0


def car(duration_s: float, rng: np.random.Generator) -> Track:
    """Return a drive through town or country, seen by an inertial unit somewhere in the car.

    The rear axle goes where it points, but for some milliradians of tyre slip per m/s2 across. The
    body pitches and rolls by less than a degree per m/s2 [1]_.

    References
    ----------
    .. [1] Gillespie: Fundamentals of Vehicle Dynamics, SAE, 1992, chapters 6 and 8.
    """
    draws = Draws(len(knots_s(duration_s)), rng)
    fastest, stops = draws.uniform(8.0, 36.0), draws.uniform(0.0, 0.35)

    def speed() -> float:
        return 0.0 if rng.random() < stops else float(draws.uniform(0.1, 1.0) * fastest)

    wanted = draws.targets((3.0, 20.0), speed)
    v = smooth(
        followed(wanted, draws.uniform(1.0, 3.0), draws.uniform(1.5, 5.0)), draws.uniform(0.3, 0.8)
    )
    v = np.maximum(v, 0.0)
    turn = _curvature(v, draws) * v
    course = draws.uniform(-np.pi, np.pi) + integral(turn)
    climb = smooth(draws.wander(np.radians(draws.uniform(0.2, 4.0)), 8.0), 1.0)
    across, along = v * turn, np.gradient(v, knots_s(duration_s))
    slip = -draws.uniform(0.0, 5e-3) * across
    lean, dive = draws.uniform(2e-3, 1.2e-2), draws.uniform(2e-3, 1.2e-2)
    bank = draws.wander(np.radians(1.0), 8.0)
    R_nv = from_euler(bank - lean * across, climb + dive * along, course)
    v_n_mps = v[:, None] * np.stack(
        [
            np.cos(climb) * np.cos(course + slip),
            np.cos(climb) * np.sin(course + slip),
            -np.sin(climb),
        ],
        axis=1,
    )
    arm_v_m = rng.uniform([-0.5, -0.5, -1.0], [2.5, 0.5, 0.0])
    p_n_m = integral(v_n_mps) + R_nv @ arm_v_m
    idle, road = draws.log_uniform(5e-3, 0.1), draws.log_uniform(0.05, 0.8)
    moving = np.sqrt(v / 10.0)
    jolts = np.hypot(idle, road * moving)
    turns = np.hypot(draws.log_uniform(5e-4, 2e-2), draws.log_uniform(2e-3, 6e-2) * moving)
    return track(p_n_m, R_nv @ leaning(2.0, rng), (jolts, turns), rng)


def _curvature(v: FloatArray, draws: Draws) -> FloatArray:
    """Return the curvature of the way, 1/m: straights, bends, corners taken at a bearable pull."""
    most_mps2, turning = draws.uniform(1.5, 5.0), draws.uniform(0.2, 0.7)

    def bend() -> float:
        return draws.uniform(-1.0, 1.0) if draws.rng.random() < turning else 0.0

    limit = np.minimum(1 / _TIGHTEST_M, most_mps2 / np.maximum(v, _CREEPS_MPS) ** 2)
    wobble = draws.wander(0.02, 3.0)
    return np.asarray(smooth((draws.targets((2.0, 10.0), bend) + wobble) * limit, 0.6))
