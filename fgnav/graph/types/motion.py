"""Motion between keyframes, with or without a gyroscope."""

from typing import NamedTuple, Protocol

import gtsam

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.types.states import States
from fgnav.types.flight import Imu


class LinearisedMotion(NamedTuple):
    """Whitened residuals of j intervals, and their derivatives by both states and the constants."""

    value: FloatArray  # (j, D)
    before: FloatArray  # (j, D, D)
    after: FloatArray  # (j, D, D)
    shared: FloatArray  # (j, D, b)


# Noises of an inertial unit: white of accelerometer and gyroscope, random walks of their biases.
INERTIAL_NOISES = ("accelerometer", "gyroscope", "accelerometer bias", "gyroscope bias")


EVERY = slice(None)  # of the intervals
INTEGRATION_M2 = 1e-7  # m2/s: a third of a millimetre in a second keeps linear systems well posed


class NoiseParts(NamedTuple):
    """Shares of the noises in the covariance of an interval's whitened rows."""

    names: tuple[str, ...]  # c of ``INERTIAL_NOISES``
    parts: FloatArray  # (n - 1, c, D, D); with ``rest`` they add up to the identity
    rest: FloatArray  # (n - 1, D, D)


class Motion(Protocol):
    """The motion between the keyframes of a flight; interval k leads from keyframe k to k + 1."""

    @property
    def aux(self) -> int:
        """Dimensions of ``States.aux``: 6 with a gyroscope, 12 without."""
        ...

    @property
    def t_s(self) -> FloatArray:
        """Keyframes, (n,)."""
        ...

    @property
    def imu(self) -> Imu:
        """Inertial samples, of which the gyroscope's need not be used."""
        ...

    @property
    def earth_rate_n_radps(self) -> FloatArray:
        """Rotation of the Earth, (3,)."""
        ...

    @property
    def gravity_n_mps2(self) -> FloatArray:
        """Gravity at keyframes, (n, 3)."""
        ...

    def linearise(self, before: States, after: States, intervals: IntArray) -> LinearisedMotion:
        """Return whitened residuals of some intervals, (j,), between states, j of each."""
        ...

    def predict(self, before: States, intervals: IntArray) -> States:
        """Return the states that intervals, (j,), lead to from others, j of them."""
        ...

    def rates_b_radps(self, t_s: FloatArray, aux: FloatArray) -> FloatArray:
        """Return body rates, (m, 3), at times with states' ``aux``.

        With a gyroscope, against inertial space; without, against n.
        """
        ...

    def prior(self, constants: int) -> tuple[FloatArray, FloatArray]:
        """Return mean, (aux,), and whitening rows of the first keyframe's ``aux``.

        Rows, (aux, aux + b): ``rows @ (aux - mean, constants)`` is white; ``constants`` is b.
        """
        ...

    def factors(
        self, k: int, key_before: int, key_after: int, about: States
    ) -> tuple[gtsam.NonlinearFactor, ...]:
        """Return interval k as GTSAM's factors between two keyframes, about one state, row 0."""
        ...

    def release(self, before: int) -> None:
        """Keep nothing large of the intervals before one, whose keyframes have left a window."""
        ...

    def noise_parts(self, of: slice = EVERY) -> NoiseParts:
        """Return the covariance of the whitened rows of some intervals by its causes."""
        ...

    def with_added_noise(
        self, accelerometer_density: FloatArray, gyroscope_density: FloatArray
    ) -> "Motion":
        """Add white noise of the IMU in each interval.

        Power spectral densities to be added, (n - 1,), (m/s2)^2/Hz and (rad/s)^2/Hz.
        """
        ...

    def at_times(self, t_s: FloatArray) -> "Motion":
        """Build the motion between other keyframes, (m,), the present ones among them."""
        ...
