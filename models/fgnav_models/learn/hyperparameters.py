"""Noise of a flight's problem, and the prior of its rate, by logarithms of factors."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.types.problem import Problem
from fgnav.noise.components import NoiseComponents

RATE, RATE_LENGTH = "rate", "rate length"


@dataclass(frozen=True, eq=False, slots=True)
class Hyperparameters:
    """Factors on standard deviations and lengths of correlation of a problem."""

    _noise: NoiseComponents

    @classmethod
    def of(cls, problem: Problem) -> "Hyperparameters":
        """Return all factors of a problem."""
        return cls(
            NoiseComponents.of(problem, tuple(sensor.name for sensor in problem.sensors), None)
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all, those of the rate's process where there is no gyroscope."""
        of_rate = (RATE, RATE_LENGTH) if isinstance(self._motion, GyroFree) else ()
        return (*self._noise.names, *of_rate)

    def problem_at(self, logs: Mapping[str, float]) -> Problem:
        """Return the problem, multiplied by the exponentials of logarithms, by name."""
        noise, motion = self._noise, self._motion
        if not logs:
            return noise.problem
        if isinstance(motion, GyroFree):
            sigma, length = (np.exp(logs.get(name, 0.0)) for name in (RATE, RATE_LENGTH))
            motion = replace(
                motion,
                variance_rad2ps2=sigma**2 * motion.variance_rad2ps2,
                poles_per_s=motion.poles_per_s / length,
            )
            noise = replace(noise, problem=replace(noise.problem, motion=motion))
        return noise.problem_at(np.array([logs.get(name, 0.0) for name in noise.names]))

    @property
    def _motion(self) -> object:
        return self._noise.problem.motion
