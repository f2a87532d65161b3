"""Motion and measurements of a problem with other standard deviations than they were built with.

Rows that are white with the nominal noise are multiplied by what makes them white with another.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.sensor_rows import WrappedSensor
from fgnav.graph.types.motion import LinearisedMotion, Motion
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import States


@dataclass(frozen=True, eq=False, slots=True)
class WrappedMotion:
    """A motion that differs from ``motion`` in its residuals alone; linearised alone."""

    motion: Motion

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401  # the wrapped motion's
        """Return an attribute of the wrapped motion."""
        return getattr(self.motion, name)

    def log_white(self, intervals: IntArray) -> float:
        """Return the log determinants of the whitening of some intervals, summed."""
        offered = getattr(self.motion, "log_white", None)
        return 0.0 if offered is None else float(offered(intervals))


@dataclass(frozen=True, eq=False, slots=True)
class RescaledMotion(WrappedMotion):
    """A motion whose rows are multiplied by ``white``, (n - 1, D, D), in each interval."""

    white: FloatArray

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,); see ``Motion``."""
        linear = self.motion.linearise(before, after, intervals)
        W = self.white[intervals]
        value = (W @ linear.value[:, :, None])[:, :, 0]
        return LinearisedMotion(value, W @ linear.before, W @ linear.after, W @ linear.shared)

    def log_white(self, intervals: IntArray) -> float:
        """Return the log determinants of the whitening of some intervals, summed."""
        inner = WrappedMotion.log_white(self, intervals)
        return inner + float(np.linalg.slogdet(self.white[intervals])[1].sum())


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class RescaledSensor(WrappedSensor):
    """Measurements whose standard deviations are multiplied by ``factors``, (k,)."""

    factors: FloatArray

    def linearise(self, at: States, indices: IntArray) -> Linearised:
        """Return whitened residuals of some, (j,); see ``Sensor``."""
        value, state, shared = self.measurement.linearise(at, indices)
        f = self.factors[indices]
        return Linearised(value / f[:, None], state / f[:, None, None], shared / f[:, None, None])

    def log_white(self, indices: IntArray) -> float:
        """Return the log determinants of the whitening of some, summed."""
        return -float(self.freedom[indices] @ np.log(self.factors[indices]))

    def factor(self, i: int, key: int) -> Any:  # noqa: ANN401, ARG002  # GTSAM's
        """Raise TypeError: noise is identified by linear factors alone."""
        message = "rescaled measurements are linearised, and no factors of a nonlinear graph"
        raise TypeError(message)
