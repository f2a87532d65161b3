"""What a flight says at each keyframe: measurements and a start, ready to become factors."""

from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.methods.smoother.array_shape import BaselineForm
from fgnav.methods.smoother.constants import (
    HEIGHT,
    LANDMARK,
    SURVEYED_M,
    FlightConstant,
    columns,
    constant,
)
from fgnav.methods.smoother.directions import Directions
from fgnav.methods.smoother.preintegration import Preintegrator
from fgnav.methods.smoother.surroundings import Heights, MagneticField

# Next to nothing is known before the first keyframe. Ten times less of the position, and rounding
# would leave it open where the first fix is some keyframes away.
ROTATION_PRIOR_RAD = np.pi
POSITION_PRIOR_M = 1e3
VELOCITY_PRIOR_MPS = 1e3


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArrayForm:
    """What the array's phases say of the attitude at keyframes.

    Attributes
    ----------
    there : ndarray of bool, shape (n,)
        Keyframes whose phases take part.
    root, minimum : ndarray, shape (n, 9, 9) and (n, 3, 3)
        ``RotationQuadratic.square_root``.
    floating : ndarray of int, shape (n,), or None
        Stretch of epochs without integers that a keyframe is in; -1 of the others. Its form tells
        R_nb beside nine unknown elements that the stretch shares; see ``float_arcs``.
    """

    there: BoolArray
    root: FloatArray
    minimum: FloatArray
    floating: IntArray | None = None

    @property
    def sure(self) -> BoolArray:
        """Keyframes whose form tells the attitude and nothing beside it, (n,)."""
        return self.there if self.floating is None else self.there & (self.floating < 0)

    @classmethod
    def of(cls, form: RotationQuadratic | None, there: BoolArray) -> "ArrayForm":
        """Return the square root of a form, at the keyframes whose phases are to be used."""
        if form is None:
            n = len(there)
            return cls(
                there=np.zeros(n, dtype=np.bool_),
                root=np.zeros((n, 9, 9)),
                minimum=np.zeros((n, 3, 3)),
            )
        root, minimum = form.square_root()
        return cls(there=there & (form.count > 0), root=root, minimum=minimum)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Timed:
    """Measurements at keyframes: NaN rows where there is none.

    Attributes
    ----------
    value : ndarray, shape (n, 3)
    covariance : ndarray, shape (n, 3, 3)
    arm_b_m : ndarray, shape (3,)
        From the accelerometer to where it was measured; 0 of velocities.
    partial : ndarray, shape (n, 3, 3), or None
        What whitens values known in some directions only, in place of a covariance; rows of zeros
        for the others. Zero of values that are known in all.
    piece : ndarray of int, shape (n,), or None
        Stretch of positions that a value is in: all of one are off by the same offset; -1 of
        values that are off by noise alone.
    """

    value: FloatArray
    covariance: FloatArray
    arm_b_m: FloatArray
    partial: FloatArray | None = None
    piece: IntArray | None = None

    def white(self, rows: IntArray) -> FloatArray:
        """Return what whitens the values of some keyframes, (k, 3, 3); 0 where there is none."""
        there, white = np.isfinite(self.value[rows, 0]), np.zeros((len(rows), 3, 3))
        if self.partial is not None:
            white += self.partial[rows]
            there = there & ~white.any(axis=(1, 2))
        L = np.linalg.cholesky(self.covariance[rows[there]])
        inverse = np.tile(np.eye(3), (len(L), 1, 1))
        for i in range(3):  # a tenth of LAPACK's time for matrices this small
            for j in range(i):
                inverse[:, i] -= L[:, i, j, None] * inverse[:, j]
            inverse[:, i] /= L[:, i, i, None]
        white[there] = inverse
        return white


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Keyframes:
    """Keyframes of a flight; the body point is the accelerometer.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    array : ArrayForm
        Phases of the antenna array.
    R_nb, p_n_m, v_n_mps : ndarray, shape (n, 3, 3), (n, 3), (n, 3)
        Where the search starts.
    slot : ndarray, shape (n, 6)
        Start of accelerometer bias, m/s2, and of the gyro-bias slot, rad/s.
    slot_sigma : ndarray, shape (6,)
        Prior of the slot at the first keyframe.
    position : Timed or None
        Positions of one antenna, m.
    velocity : Timed or None
        Velocities of the accelerometer, m/s.
    gravity : Directions or None
    gravity_n_mps2 : ndarray, shape (n, 3)
    sight : Directions or None
        From the body point to the landmark.
    landmark_n_m : ndarray, shape (3,), or None
    preintegrate : Preintegrator
    common_position_m2 : ndarray, shape (3, 3), or None
        Variance of an error that all positions share, and the way to the landmark and what
        heights are off with them.
    constants : tuple of FlightConstant
        What is estimated with the flight, in the order of their places.
    baselines : BaselineForm or None
        Where antennas are among the constants: phases that tell the array's shape, too; they stand
        in for ``array`` where they are.
    heights : Heights or None
    field : MagneticField or None
        Their offset and hard iron are among the constants.
    """

    t_s: FloatArray
    array: ArrayForm
    R_nb: FloatArray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    slot: FloatArray
    slot_sigma: FloatArray
    position: Timed | None
    velocity: Timed | None
    gravity: Directions | None
    gravity_n_mps2: FloatArray
    sight: Directions | None
    landmark_n_m: FloatArray | None
    preintegrate: Preintegrator
    common_position_m2: FloatArray | None = None
    constants: tuple[FlightConstant, ...] = ()
    baselines: BaselineForm | None = None
    heights: Heights | None = None
    field: MagneticField | None = None

    @property
    def shared(self) -> tuple[FlightConstant, ...]:
        """What all keyframes lean on: the constants, and the landmark in any case."""
        found, common_m2 = self.constants, self.common_position_m2
        if self.landmark_n_m is not None and not any(c.place == LANDMARK for c in found):
            axes = ("north", "east", "down")
            found = (constant("landmark", LANDMARK, axes, "m", SURVEYED_M), *found)
        if common_m2 is None:
            return found
        also = {LANDMARK: common_m2, HEIGHT: common_m2[2, 2]}
        return tuple(
            replace(one, covariance=one.covariance + also[one.place]) if one.place in also else one
            for one in found
        )

    @property
    def rigid(self) -> BoolArray:
        """Keyframes whose array is taken as the flight states it, (n,)."""
        there, shape = self.array.there, self.baselines
        return there if shape is None else there & ~shape.there

    @property
    def columns(self) -> IntArray:
        """First column of each kind of ``shared``, antennas last; -1 of what is not there."""
        antennas = 0 if self.baselines is None else len(self.baselines.baselines_b_m)
        return columns(self.shared, antennas)

    @property
    def rate_b_radps(self) -> FloatArray:
        """Body rates where the search starts, (n, 3): the gyroscope's, or the slot's own."""
        return self.preintegrate.told_radps(self.t_s) - self.slot[:, 3:]

    @property
    def shared_mean(self) -> FloatArray:
        """What is expected of ``shared`` before the flight, (b,): the landmark's place, else 0."""
        means: list[FloatArray] = [np.zeros(len(one.start)) for one in self.shared]
        if self.landmark_n_m is not None:
            means[0] = self.landmark_n_m
        return np.concatenate([np.empty(0), *means])


def there(values: FloatArray, k: int) -> bool:
    """Return whether a keyframe has a measurement."""
    return isfinite(values[k, 0])  # a row is NaN as a whole
