"""A fault of the inertial unit over a span of time: what its samples are without it."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.frontend.matching import SAME_S
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.geometry.rotations import exp
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.span_offsets import TURN
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.errors import DRIFT, MIX, SAMPLES, added
from fgnav.types.flight import Imu

_UNITS = {"accelerometer": "m/s2", "gyroscope": "rad/s"}
_BIASES = {"accelerometer": "accelerometer_bias_mps2", "gyroscope": "gyroscope_bias_radps"}


class SpanFault(NamedTuple):
    """What a sensor's samples have from one time to another, and when it may begin and end."""

    sensor: str
    shape: str  # of ``span_offsets.SHAPES``, or a drift
    from_s: float  # infinite where there is no such time
    until_s: float
    begins_s: tuple[float, float]
    ends_s: tuple[float, float]
    value: FloatArray  # (g,)
    sigma: FloatArray  # (g,)
    variance: FloatArray  # (3,), of what it adds to the samples, times its probability
    size: float
    share: float  # probability
    cut_s: float = np.nan  # when a record ends in which it does not: it may at once
    doubt: AttitudeDoubt | None = None  # of what is left of it

    @property
    def is_likely(self) -> bool:
        """Whether it is likelier than all as stated."""
        return self.share > 0.5

    @property
    def sentence(self) -> str:
        """What is to be said of it, if it is likely."""
        when = "throughout"
        if self.from_s > -np.inf and self.until_s < np.inf:
            when = f"from {self.from_s:.1f} to {self.until_s:.1f} s"
        elif self.from_s > -np.inf:
            when = f"from {self.from_s:.1f} s on"
        elif self.until_s < np.inf:
            when = f"up to {self.until_s:.1f} s"
        what = {
            "offset": "bias is another, by",
            "scale": "scales are others, as if by",
            TURN: "axes are turned, as if by",
            MIX: "axes are exchanged, reversed or turned far, as if by",
            DRIFT: "bias drifts, all in all as if by",
        }[self.shape]
        if not self.value.any():
            return f"As likely it is the {self.sensor}, {when}: its bias is another there as well."
        return (
            f"The {self.sensor}'s {what} {self.size:.2g} {_UNITS[self.sensor]}, {when}: taken out, "
            "and its bias is estimated as another there."
        )

    def undone(self, imu: Imu) -> Imu:
        """Return a unit without it."""
        name = SAMPLES[self.sensor]
        x = getattr(imu, name)
        if self.shape == TURN:
            right = x @ exp(self.value[None])[0].T
        else:
            right = x - added(self.shape, x, self.value, imu.t_s)
        inside = self.strikes(imu.t_s)[:, None]
        changed: dict[str, Any] = {name: np.where(inside, right, x)}
        return replace(imu, **changed)

    def up_to(self, until_s: float) -> "SpanFault":
        """Return what is known of it at the end of a record: what has begun there may end."""
        if self.from_s == -np.inf or self.until_s < np.inf:
            return self
        return self._replace(until_s=until_s, cut_s=until_s)

    def strikes(self, t_s: FloatArray) -> BoolArray:
        """Return which samples have it."""
        return np.asarray((t_s > self.from_s) & (t_s <= self.until_s))

    def stepping(self, problem: SmoothingProblem) -> SmoothingProblem:
        """Return a problem whose bias may step where the span begins and ends."""
        motion = problem.motion
        if not isinstance(motion, Inertial):
            return problem
        t_s = motion.t_s
        density = np.zeros((len(t_s) - 1, 6))
        if motion.bias_steps is not None:
            density += motion.bias_steps
        first, imu = 3 * WHITE.index(self.sensor), motion.imu
        for begin_s, end_s in (self.begins_s, self.ends_s):
            inside = (t_s[:-1] >= begin_s - 1e-9) & (t_s[1:] <= end_s + 1e-9)
            if end_s > begin_s:
                density[inside, first : first + 3] += self.variance / (end_s - begin_s)
        next_ = np.flatnonzero((t_s[:-1] <= self.cut_s + SAME_S) & (t_s[1:] > self.cut_s + SAME_S))
        density[next_, first : first + 3] += self.variance / np.diff(t_s)[next_, None]
        if self.shape == DRIFT and not self.is_likely:  # else a walk of what is left is identified
            # Of u t / T from 0 to T the mean square is u^2 / 3.
            density[:, first : first + 3] += 3 * self.variance / (t_s[-1] - t_s[0])
        if self.from_s == -np.inf:
            name = _BIASES[self.sensor]
            sigma = np.hypot(getattr(imu, name) or 0.0, np.sqrt(self.variance.max()))
            changed: dict[str, Any] = {name: float(sigma)}
            imu = replace(imu, **changed)
        return replace(problem, motion=replace(motion, imu=imu, bias_steps=density))
