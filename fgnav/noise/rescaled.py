"""Motion and measurements of a problem with other standard deviations than they were built with.

Rows that are white with the nominal noise are multiplied by what makes them white with another.
"""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.types.measurement import Linearised, Measurement
from fgnav.graph.types.motion import EVERY, LinearisedMotion, Motion, NoiseParts
from fgnav.graph.types.states import States


@dataclass(frozen=True, eq=False, slots=True)
class WrappedMotion:
    """A motion that another one is made of, for solving without GTSAM's factors."""

    motion: Motion

    @property
    def aux(self) -> int:
        """Dimensions of ``States.aux``."""
        return self.motion.aux

    @property
    def t_s(self) -> FloatArray:
        """Keyframes, (n,)."""
        return self.motion.t_s

    @property
    def gravity_n_mps2(self) -> FloatArray:
        """Gravity at keyframes, (n, 3)."""
        return self.motion.gravity_n_mps2

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,)."""
        return self.motion.linearise(before, after, intervals)

    def log_white(self, intervals: IntArray) -> float:
        """Return the log determinants of the whitening of some intervals, summed."""
        offered = getattr(self.motion, "log_white", None)
        return 0.0 if offered is None else float(offered(intervals))

    def predict(self, before: States, intervals: IntArray) -> States:
        """Return the states at the ends of intervals; see ``Motion``."""
        return self.motion.predict(before, intervals)

    def rates_b_radps(self, t_s: FloatArray, aux: FloatArray) -> FloatArray:
        """Return body rates, (m, 3)."""
        return self.motion.rates_b_radps(t_s, aux)

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        """Return mean and whitening rows of the first keyframe's ``aux``."""
        return self.motion.prior(constants)

    def release(self, before: int) -> None:
        """Release what is kept of intervals before one."""
        self.motion.release(before)

    def noise_parts(self, of: slice = EVERY) -> NoiseParts:
        """Return the nominal noise by its causes."""
        return self.motion.noise_parts(of)

    def factors(self, k: int, key_before: int, key_after: int, about: States) -> Any:  # noqa: ANN401  # GTSAM's
        """Raise: hyperparameters are identified without GTSAM's factors."""
        raise NotImplementedError

    def with_added_noise(
        self, accelerometer_density: FloatArray, gyroscope_density: FloatArray
    ) -> Motion:
        """Raise: noise is that of the components."""
        raise NotImplementedError

    def at_times(self, t_s: FloatArray) -> Motion:
        """Raise: keyframes stay as they are."""
        raise NotImplementedError


@dataclass(frozen=True, eq=False, slots=True)
class RescaledMotion(WrappedMotion):
    """A motion whose rows are multiplied by ``white``, (n - 1, D, D), in each interval."""

    white: FloatArray

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,)."""
        linear = self.motion.linearise(before, after, intervals)
        W = self.white[intervals]
        value = (W @ linear.value[:, :, None])[:, :, 0]
        return LinearisedMotion(value, W @ linear.before, W @ linear.after, W @ linear.shared)

    def log_white(self, intervals: IntArray) -> float:
        """Return the log determinants of the whitening of some intervals, summed."""
        inner = WrappedMotion.log_white(self, intervals)
        return inner + float(np.linalg.slogdet(self.white[intervals])[1].sum())


@dataclass(frozen=True, eq=False, slots=True)
class RescaledMeasurement:
    """Measurements whose standard deviations are multiplied by ``factor``, (k,)."""

    measurement: Measurement
    factor_of: FloatArray

    @property
    def name(self) -> str:
        """Name of the sensor."""
        return self.measurement.name

    @property
    def row(self) -> IntArray:
        """Keyframes, (k,)."""
        return self.measurement.row

    @property
    def freedom(self) -> IntArray:
        """Degrees of freedom, (k,)."""
        return self.measurement.freedom

    def linearise(self, at: States, which: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,); see ``Measurement``."""
        value, state, shared = self.measurement.linearise(at, which)
        f = self.factor_of[which]
        return Linearised(value / f[:, None], state / f[:, None, None], shared / f[:, None, None])

    def log_white(self, which: IntArray) -> float:
        """Return the log determinants of the whitening of some, summed."""
        return -float(self.freedom[which] @ np.log(self.factor_of[which]))

    def factor(self, i: int, key: int) -> Any:  # noqa: ANN401  # GTSAM's
        """Raise: hyperparameters are identified without GTSAM's factors."""
        raise NotImplementedError

    def on(self, row: IntArray) -> Self:
        """Raise: keyframes stay as they are."""
        raise NotImplementedError
