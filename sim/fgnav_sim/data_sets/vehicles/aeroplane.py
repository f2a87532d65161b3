"""Small aeroplanes: coordinated turns, lift that asks for an angle of attack, wind."""

import numpy as np

from fgnav.geometry.rotations import from_euler
from fgnav_sim.data_sets.vehicles.commands import (
    followed,
    integral,
    leaning,
    log_uniform,
    smooth,
    targets,
    wander,
)
from fgnav_sim.data_sets.vehicles.track import Track, knots_s, track

_GRAVITY_MPS2 = 9.81  # of the bank alone


def aeroplane(duration_s: float, rng: np.random.Generator) -> Track:
    """Return a flight of straights and coordinated turns in moving air.

    The course turns by ``g tan(bank) / V``; the angle of attack goes with the load factor and
    inversely with the square of the airspeed [1]_.

    References
    ----------
    .. [1] Beard, McLain: Small Unmanned Aircraft, Princeton, 2012, equations 9.14 and 4.7.
    """
    n = len(knots_s(duration_s))
    cruise = log_uniform(12.0, 60.0, rng)
    airspeed = cruise * (1 + np.clip(wander(n, rng.uniform(0.02, 0.12), 8.0, rng), -0.3, 0.3))
    steepest = np.radians(rng.uniform(10.0, 50.0))

    def bank(rng: np.random.Generator) -> float:
        return 0.0 if rng.random() < 0.4 else float(rng.uniform(-1.0, 1.0) * steepest)

    pace = rng.uniform(0.3, 1.2)
    roll = smooth(followed(targets(n, (3.0, 20.0), bank, rng), pace, pace), 0.4)
    heading = rng.uniform(-np.pi, np.pi) + integral(_GRAVITY_MPS2 * np.tan(roll) / airspeed)
    slope = np.radians(rng.uniform(1.0, 8.0))
    climb = smooth(targets(n, (4.0, 15.0), lambda r: float(r.uniform(-slope, slope)), rng), 1.5)
    load = 1 / np.cos(roll)
    attack = np.radians(rng.uniform(1.0, 6.0)) * load * (cruise / airspeed) ** 2
    slip = wander(n, np.radians(rng.uniform(0.2, 2.5)), 1.5, rng)
    air_n_mps = airspeed[:, None] * np.stack(
        [np.cos(climb) * np.cos(heading), np.cos(climb) * np.sin(heading), -np.sin(climb)], axis=1
    )
    wind = np.concatenate([rng.uniform(0.0, 4.0) * rng.standard_normal(2), [0.0]])
    gusts = np.stack([wander(n, rng.uniform(0.0, 1.0), 3.0, rng) for _ in range(3)], axis=1)
    path = from_euler(np.zeros(n), climb, heading)
    banked = from_euler(roll, np.zeros(n), np.zeros(n))
    leant = from_euler(np.zeros(n), attack, -slip)
    jolts = np.full(n, log_uniform(0.05, 2.0, rng))
    turns = np.full(n, log_uniform(2e-3, 5e-2, rng))
    R_nb = path @ banked @ leant @ leaning(2.0, rng)
    return track(integral(air_n_mps + wind + gusts), R_nb, (jolts, turns), rng)
