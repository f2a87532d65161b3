"""Small aeroplanes: coordinated turns, lift that asks for an angle of attack, wind."""

import numpy as np

from fgnav.geometry.rotations import from_euler
from fgnav_models.training.velocity.vehicles.commands import (
    Draws,
    followed,
    integral,
    leaning,
    smooth,
)
from fgnav_models.training.velocity.vehicles.track import Track, knots_s, track

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
    draws = Draws(n, rng)
    cruise = draws.log_uniform(12.0, 60.0)
    airspeed = cruise * (1 + np.clip(draws.wander(draws.uniform(0.02, 0.12), 8.0), -0.3, 0.3))
    steepest = np.radians(draws.uniform(10.0, 50.0))

    def bank() -> float:
        return 0.0 if rng.random() < 0.4 else float(draws.uniform(-1.0, 1.0) * steepest)

    pace = draws.uniform(0.3, 1.2)
    roll = smooth(followed(draws.targets((3.0, 20.0), bank), pace, pace), 0.4)
    heading = draws.uniform(-np.pi, np.pi) + integral(_GRAVITY_MPS2 * np.tan(roll) / airspeed)
    slope = np.radians(draws.uniform(1.0, 8.0))
    climb = smooth(draws.targets((4.0, 15.0), lambda: draws.uniform(-slope, slope)), 1.5)
    load = 1 / np.cos(roll)
    attack = np.radians(draws.uniform(1.0, 6.0)) * load * (cruise / airspeed) ** 2
    slip = draws.wander(np.radians(draws.uniform(0.2, 2.5)), 1.5)
    air_n_mps = airspeed[:, None] * np.stack(
        [np.cos(climb) * np.cos(heading), np.cos(climb) * np.sin(heading), -np.sin(climb)], axis=1
    )
    wind = draws.wind(4.0)
    gusts = draws.gusts(1.0, 3.0)
    path = from_euler(np.zeros(n), climb, heading)
    banked = from_euler(roll, np.zeros(n), np.zeros(n))
    leant = from_euler(np.zeros(n), attack, -slip)
    jolts = np.full(n, draws.log_uniform(0.05, 2.0))
    turns = np.full(n, draws.log_uniform(2e-3, 5e-2))
    R_nb = path @ banked @ leant @ leaning(2.0, rng)
    return track(integral(air_n_mps + wind + gusts), R_nb, (jolts, turns), rng)
