"""Multirotors: thrust along one axis, drag of the rotors, wind."""

import numpy as np

from fgnav.geometry.rotations import exp
from fgnav_models.training.velocity.vehicles.commands import (
    Draws,
    followed,
    integral,
    leaning,
    smooth,
)
from fgnav_models.training.velocity.vehicles.track import STEP_S, Track, knots_s, track

_GRAVITY_MPS2 = 9.81  # of the thrust alone


def multirotor(duration_s: float, rng: np.random.Generator) -> Track:
    """Return a flight from hover to hover, the nose along the course or wherever.

    Drag of the rotors is in proportion to the airspeed across the thrust, so that an accelerometer
    across it feels the airspeed [1]_.

    References
    ----------
    .. [1] Martin, Salaün: The true role of accelerometer feedback in quadrotor control, ICRA 2010,
       equations 10 to 13.
    """
    n = len(knots_s(duration_s))
    draws = Draws(n, rng)
    fastest, climbs, pace = (
        draws.uniform(2.0, 16.0),
        draws.uniform(0.2, 3.0),
        draws.uniform(1.5, 8.0),
    )

    def velocity(limit: float) -> np.ndarray:
        def one() -> float:
            return 0.0 if rng.random() < 0.25 else float(draws.uniform(-1.0, 1.0) * limit)

        return followed(draws.targets((1.0, 8.0), one), pace, pace)

    v = np.stack([velocity(fastest), velocity(fastest), velocity(climbs)], axis=1)
    v = smooth(v, draws.uniform(0.15, 0.6))
    v += draws.gusts(0.4, 1.5)
    wind = draws.wind(3.0)
    wind = wind + draws.gusts(1.0, 4.0)
    a = np.gradient(v, STEP_S, axis=0)
    drag = draws.log_uniform(0.05, 0.5)
    thrust = a - np.array([0.0, 0.0, _GRAVITY_MPS2]) + drag * (v - wind)
    down = -thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    heading = _heading(v, draws)
    nose = np.stack([np.cos(heading), np.sin(heading), np.zeros(n)], axis=1)
    right = np.cross(down, nose)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    R_nv = np.stack([np.cross(right, down), right, down], axis=2)
    shivers = np.stack([draws.wander(draws.log_uniform(1e-3, 2e-2), 0.4) for _ in range(3)], axis=1)
    R_nv = R_nv @ exp(shivers)
    throttle = np.linalg.norm(thrust, axis=1) / _GRAVITY_MPS2
    jolts, turns = draws.log_uniform(0.1, 4.0) * throttle, draws.log_uniform(5e-3, 0.15) * throttle
    return track(integral(v), R_nv @ leaning(1.5, rng), (jolts, turns), rng)


def _heading(v_n_mps: np.ndarray, draws: Draws) -> np.ndarray:
    """Return where the nose points: along the course, or where it is told to, at some pace."""
    fixed = draws.targets((3.0, 20.0), lambda: draws.uniform(-np.pi, np.pi))
    wanted = np.unwrap(fixed)
    if draws.rng.random() < 0.5:
        fast = np.hypot(v_n_mps[:, 0], v_n_mps[:, 1]) > 1.0
        course = np.arctan2(v_n_mps[:, 1], v_n_mps[:, 0])
        row = np.maximum.accumulate(np.where(fast, np.arange(draws.n), 0))
        wanted = np.unwrap(course[row])
    pace = draws.uniform(0.5, 2.0)
    return smooth(followed(wanted, pace, pace), 0.4)
