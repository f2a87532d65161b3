"""Where the search for noises begins: as stated, then ever louder, one suspect after the other."""

from dataclasses import replace

import numpy as np

from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.thinned import Some
from fgnav.identification.noise.stated import INSTRUMENTS

WHITE = ("accelerometer", "gyroscope")
ABOVE = 10.0  # times the stated, where the first linearisation of what is contradicted is
_LOUDER = (1.0, 10.0, 100.0)  # times that: an axis without a signal is 1,000 times as loud


def begins(
    small: SmoothingProblem, factors: dict[str, float]
) -> tuple[tuple[dict[str, float], float], ...]:
    """Return factors on measurements' noise, and one on the inertial unit's, in turn.

    Linearised about what a faulty sensor draws the states to, a chain has no minimum: instruments
    are taken as loud as they seem, then the unit louder, then positions and velocities.

    Parameters
    ----------
    small : SmoothingProblem
        Thinned.
    factors : dict of str to float
        Of a search before.
    """
    seem = at_start(small) | factors
    noisy = seem | dict.fromkeys(("position", "velocity"), ABOVE)
    louder = tuple((seem, times) for times in _LOUDER if times > 1.0 or seem != factors)
    return ((factors, 1.0), *louder, (noisy, 1.0))


def at_start(small: SmoothingProblem) -> dict[str, float]:
    """Return factors on the noise of instruments that the start of the search shows, above 1.

    Linearised about what a sensor many sigmas off draws the states to, a chain has no minimum.
    """
    factors = {}
    for one in small.measurements:
        if one.name in INSTRUMENTS:
            value, *_ = one.linearise(small.start.at(one.row), np.arange(len(one.row)))
            squares = (value**2).sum(axis=1) / one.freedom
            factors[one.name] = float(np.sqrt(np.median(squares)))
    return {name: factor for name, factor in factors.items() if factor > 1.0}


def widened(small: SmoothingProblem, factors: dict[str, float], louder: float) -> SmoothingProblem:
    """Return a thinned problem with the noise of some measurements, and of forces, multiplied."""
    widened = tuple(
        replace(one, sigma_factor=factors[one.name])
        if isinstance(one, Some) and one.name in factors
        else one
        for one in small.measurements
    )
    motion = small.motion
    if isinstance(motion, GyroFree) and louder > 1.0:
        motion = replace(motion, accelerometer_noise=motion.accelerometer_noise * louder**2)
    return replace(small, measurements=widened, motion=motion)
