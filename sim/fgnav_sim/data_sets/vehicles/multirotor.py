"""Multirotors: thrust along one axis, drag of the rotors, wind."""

import numpy as np

from fgnav.geometry.rotations import exp
from fgnav_sim.data_sets.vehicles.commands import (
    followed,
    integral,
    leaning,
    log_uniform,
    smooth,
    targets,
    wander,
)
from fgnav_sim.data_sets.vehicles.track import STEP_S, Track, knots_s, track

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
    fastest, climbs, pace = rng.uniform(2.0, 16.0), rng.uniform(0.2, 3.0), rng.uniform(1.5, 8.0)

    def velocity(limit: float) -> np.ndarray:
        def one(rng: np.random.Generator) -> float:
            return 0.0 if rng.random() < 0.25 else float(rng.uniform(-1.0, 1.0) * limit)

        return followed(targets(n, (1.0, 8.0), one, rng), pace, pace)

    v = np.stack([velocity(fastest), velocity(fastest), velocity(climbs)], axis=1)
    v = smooth(v, rng.uniform(0.15, 0.6))
    v += np.stack([wander(n, rng.uniform(0.0, 0.4), 1.5, rng) for _ in range(3)], axis=1)
    wind = np.concatenate([rng.uniform(0.0, 3.0) * rng.standard_normal(2), [0.0]])
    wind = wind + np.stack([wander(n, rng.uniform(0.0, 1.0), 4.0, rng) for _ in range(3)], axis=1)
    a = np.gradient(v, STEP_S, axis=0)
    drag = log_uniform(0.05, 0.5, rng)
    thrust = a - np.array([0.0, 0.0, _GRAVITY_MPS2]) + drag * (v - wind)
    down = -thrust / np.linalg.norm(thrust, axis=1, keepdims=True)
    heading = _heading(v, rng)
    nose = np.stack([np.cos(heading), np.sin(heading), np.zeros(n)], axis=1)
    right = np.cross(down, nose)
    right /= np.linalg.norm(right, axis=1, keepdims=True)
    R_nv = np.stack([np.cross(right, down), right, down], axis=2)
    shivers = np.stack(
        [wander(n, log_uniform(1e-3, 2e-2, rng), 0.4, rng) for _ in range(3)], axis=1
    )
    R_nv = R_nv @ exp(shivers)
    throttle = np.linalg.norm(thrust, axis=1) / _GRAVITY_MPS2
    jolts, turns = log_uniform(0.1, 4.0, rng) * throttle, log_uniform(5e-3, 0.15, rng) * throttle
    return track(integral(v), R_nv @ leaning(1.5, rng), (jolts, turns), rng)


def _heading(v_n_mps: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return where the nose points: along the course, or where it is told to, at some pace."""
    n = len(v_n_mps)
    fixed = targets(n, (3.0, 20.0), lambda rng: float(rng.uniform(-np.pi, np.pi)), rng)
    wanted = np.unwrap(fixed)
    if rng.random() < 0.5:
        fast = np.hypot(v_n_mps[:, 0], v_n_mps[:, 1]) > 1.0
        course = np.arctan2(v_n_mps[:, 1], v_n_mps[:, 0])
        row = np.maximum.accumulate(np.where(fast, np.arange(n), 0))
        wanted = np.unwrap(course[row])
    pace = rng.uniform(0.5, 2.0)
    return smooth(followed(wanted, pace, pace), 0.4)
