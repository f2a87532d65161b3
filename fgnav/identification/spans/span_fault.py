"""A fault of the inertial unit over a span of time: what it is, and a flight without it."""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.rotations import exp
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.span_offsets import LATE, UNIT
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.errors import DRIFT, SAMPLES, sensors_of, without
from fgnav.types.flight import Imu

_UNITS = {"accelerometer": "m/s2", "gyroscope": "rad/s", UNIT: "s"}
_BIASES = {"accelerometer": "accelerometer_bias_mps2", "gyroscope": "gyroscope_bias_radps"}


class SpanFault(NamedTuple):
    """What a sensor's samples have from one time to another, and when it may begin and end."""

    sensor: str
    shape: str  # of ``span_offsets.SHAPES``
    from_s: float  # infinite where there is no such time
    until_s: float
    begins_s: tuple[float, float]
    ends_s: tuple[float, float]
    value: FloatArray  # (3,), of late samples (1,)
    sigma: FloatArray
    variance: FloatArray  # (6,), of what it adds to the samples, times its probability
    size: float
    share: float  # probability

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
            "turn": "axes are turned, as if by",
            DRIFT: "bias drifts, all in all as if by",
            LATE: "tags are off by",
        }[self.shape]
        is_out = bool(self.value.any())
        return (
            f"{'The' if is_out else 'As likely the'} {self.sensor}'s {what} {self.size:.2g} "
            f"{_UNITS[self.sensor]}, {when}: {'taken out, and ' if is_out else ''}its bias is "
            f"estimated as another there{'' if is_out else ' as well'}."
        )

    def undone(self, imu: Imu) -> Imu:
        """Return a unit without it."""
        if self.shape == "turn":
            name = SAMPLES[self.sensor]
            changed: dict[str, Any] = {name: getattr(imu, name) @ exp(self.value[None])[0].T}
            right = replace(imu, **changed)
        else:
            right = without(imu, self.sensor, self.shape, self.value)
        inside = self.strikes(imu.t_s)[:, None]
        names = [SAMPLES[one] for one in sensors_of(self.sensor, imu)]
        return replace(
            imu,
            **{one: np.where(inside, getattr(right, one), getattr(imu, one)) for one in names},
        )

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
        for begin_s, end_s in (self.begins_s, self.ends_s):
            inside = (t_s[:-1] >= begin_s - 1e-9) & (t_s[1:] <= end_s + 1e-9)
            if end_s > begin_s:
                density[inside] += self.variance / (end_s - begin_s)
        if self.shape == DRIFT:
            # Of u t / T from -T/2 to T/2 the mean square is u^2 / 12.
            density += 12 * self.variance / (t_s[-1] - t_s[0])
        imu = motion.imu
        if self.from_s == -np.inf:
            sigma = np.sqrt(self.variance.reshape(2, 3).max(axis=1))
            widened = {
                _BIASES[one]: float(np.hypot(getattr(imu, _BIASES[one]) or 0.0, more))
                for one, more in zip(WHITE, sigma, strict=True)
                if more > 0.0
            }
            imu = replace(imu, **widened)  # type: ignore[arg-type]  # each is a number
        return replace(problem, motion=replace(motion, imu=imu, bias_steps=density))
