"""What a flight says of its own noise and times, and which of it contradicts what is stated."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.identification.tested_constants import SIGMAS, TestedVector, Times

# A standard deviation off by less leaves squared errors of 3 between 1.3 and 6.8.
TOLERATED = np.log(1.5)


def contradicted(theta: FloatArray, sigma: FloatArray) -> BoolArray:
    """Return which logarithms of factors on a stated noise contradict it, (c,)."""
    return np.asarray((np.abs(theta) > TOLERATED) & (np.abs(theta) > SIGMAS * sigma))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Identified:
    """What a flight says of its own noise and times.

    Attributes
    ----------
    names : tuple of str
        Components: ``graph.types.motion.INERTIAL_NOISES``, ``"position"``, ``"velocity"``.
    factor : ndarray, shape (c,)
        The identified noise over what the flight states or, failing that, is usual.
    sigma : ndarray, shape (c,)
        Of its logarithm.
    used : ndarray of bool, shape (c,)
        Which replace what the flight has: not stated, or contradicted.
    stated : ndarray of bool, shape (c,)
    greatest : ndarray, shape (c,)
        Factor that the unit's samples can hold; infinite of what is no white noise of the unit.
    times : Times
    arm, turn : TestedVector or None
        Lever arm and turn of the array; None where they were not tested. A turn is to be confirmed
        by a search with it taken back.
    likelihood : float
        Penalised, its logarithm.
    has_no_minimum : bool
        Whether noise is as stated for want of a chain about which to identify it.
    """

    names: tuple[str, ...]
    factor: FloatArray
    sigma: FloatArray
    used: BoolArray
    stated: BoolArray
    greatest: FloatArray
    times: Times
    arm: TestedVector | None
    turn: TestedVector | None
    likelihood: float
    has_no_minimum: bool = False

    @property
    def exceeds_noise(self) -> BoolArray:
        """Which of the unit's noises, (c,), are contradicted, and louder than any noise.

        That of what its samples can hold, as of what is stated: by the same test.
        """
        with np.errstate(divide="ignore"):
            beyond = np.log(self.factor / self.greatest)
        louder = (beyond > 0) & contradicted(beyond, self.sigma)
        return np.asarray(self.used & self.stated & louder)

    @property
    def beyond_noise(self) -> dict[str, float]:
        """Factors of the unit's stated white noises that would be louder than any noise."""
        return self._factors(self.exceeds_noise)

    @property
    def factors(self) -> dict[str, float]:
        """Factors of components that are replaced."""
        return self._factors(self.used)

    @property
    def contradicted(self) -> dict[str, float]:
        """Factors of components whose stated noise is replaced."""
        return self._factors(self.used & self.stated)

    def _factors(self, which: BoolArray) -> dict[str, float]:
        return {self.names[i]: float(self.factor[i]) for i in np.flatnonzero(which)}

    @property
    def is_turned(self) -> bool:
        """Whether the array and the inertial unit are turned against each other."""
        return self.turn is not None and self.turn.significant

    def scaled(self, by: dict[str, float], sigmas: dict[str, float] | None = None) -> "Identified":
        """Return the same with some noises times factors, of the identified, or else stated.

        ``sigmas``: of the logarithms of these, where they are known beside.
        """
        times = np.array([by.get(name, 1.0) for name in self.names])
        changed, before = times != 1.0, np.where(self.used, self.factor, 1.0)
        factor = np.where(changed, before * times, self.factor)
        pairs = zip(self.names, self.sigma.tolist(), strict=True)
        sigma = np.array([(sigmas or {}).get(name, stated) for name, stated in pairs])
        return replace(self, factor=factor, sigma=sigma, used=self.used | changed)

    def with_clock(self, value: FloatArray, sigma: FloatArray) -> "Identified":
        """Return the same with another clock: its offset and its rate, (2,), and their sigmas."""
        values = np.concatenate([value, self.times.value[2:]])
        sigmas = np.concatenate([sigma, self.times.sigma[2:]])
        return replace(self, times=replace(self.times, value=values, sigma=sigmas))

    def on_time(self) -> "Identified":
        """Return the same with the unit's clock corrected by what it is off."""
        value = np.concatenate([[0.0, 0.0], self.times.value[2:]])
        return replace(self, times=replace(self.times, value=value, squares=0.0))
