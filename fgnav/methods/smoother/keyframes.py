"""What a flight says at each keyframe: measurements and a start, ready to become factors."""

from dataclasses import dataclass
from math import isfinite

import numpy as np

from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray
from fgnav.methods.smoother.preintegration import Preintegrator


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArrayForm:
    """What the array's phases say of the attitude at keyframes.

    Attributes
    ----------
    there : ndarray of bool, shape (n,)
        Keyframes whose phases take part.
    root, minimum : ndarray, shape (n, 9, 9) and (n, 3, 3)
        ``RotationQuadratic.square_root``.
    """

    there: BoolArray
    root: FloatArray
    minimum: FloatArray

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
    """

    value: FloatArray
    covariance: FloatArray
    arm_b_m: FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Directions:
    """Unit vectors at keyframes, body axes; NaN rows where there is none.

    Attributes
    ----------
    e_b : ndarray, shape (n, 3)
    sigma_rad : ndarray, shape (n,)
    """

    e_b: FloatArray
    sigma_rad: FloatArray


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
        Variance of an error that all positions share, and the way to the landmark with them.
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


def there(values: FloatArray, k: int) -> bool:
    """Return whether a keyframe has a measurement."""
    return isfinite(values[k, 0])  # a row is NaN as a whole
