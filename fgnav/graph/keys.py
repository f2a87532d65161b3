"""Names of the graph's variables, as GTSAM's symbols: a letter and a number in one integer."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, FloatArray, frozen, increasing

_INDEX_BITS = 56  # gtsam::Symbol: the letter stands in the highest byte
_CONSTANT = ord("c")


def pose(k: int) -> int:
    """Return the key of a keyframe's pose: the accelerometer in ``n``, ``gtsam.Pose3``.

    Parameters
    ----------
    k : int
        Number of the keyframe.

    Returns
    -------
    int

    Raises
    ------
    BadInputError
        If the number is negative.

    Examples
    --------
    >>> from fgnav.graph import pose
    >>> import gtsam
    >>> gtsam.Symbol(pose(3)).string()
    'x3'
    """
    return _symbol("x", k)


def velocity(k: int) -> int:
    """Return the key of a keyframe's velocity: of the accelerometer, (3,), m/s, in ``n``."""
    return _symbol("v", k)


def imu_bias(k: int) -> int:
    """Return the key of a keyframe's biases, ``gtsam.imuBias.ConstantBias``; with a gyroscope."""
    return _symbol("b", k)


def angular_motion(k: int) -> int:
    """Return the key of a keyframe's vector, (12 + q,), of a flight without a gyroscope.

    Accelerometer bias, body rate w, then ``T0`` times its first and ``T0**2`` times its second
    derivative, ``T0`` 0.1 s; then the array's time-correlated error, where it has one (q, else 0).
    """
    return _symbol("m", k)


def arcs(j: int) -> int:
    """Return the key of a block of carrier-phase arcs, a vector."""
    return _symbol("a", j)


def constant(i: int) -> int:
    """Return the key of a constant of the flight, a vector."""
    return _symbol("c", i)


def letter(key: int) -> str:
    """Return the letter of a key."""
    return chr(key >> _INDEX_BITS)


def is_constant(key: int) -> bool:
    """Return True if a key is that of a flight's constant."""
    return key >> _INDEX_BITS == _CONSTANT


def index(key: int) -> int:
    """Return the number of a key."""
    return key & ((1 << _INDEX_BITS) - 1)


def _symbol(name: str, number: int) -> int:
    if not 0 <= number < 1 << _INDEX_BITS:
        raise BadInputError(f"key {name}({number}): the number must be 0 or more")
    return ord(name) << _INDEX_BITS | int(number)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Timeline:
    """Times of a graph's keyframes, the argument of a source of custom factors.

    Keyframe k stands at ``t_s[k]``; its variables are ``pose(k)``, ``velocity(k)`` and, with a
    gyroscope, ``imu_bias(k)``, else ``angular_motion(k)``.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
        Strictly increasing.
    gyroscope : bool
        Whether the flight has one.
    new : int
        First keyframe that is new: 0 of a recorded flight; of a stream, which asks at every update
        with all keyframes so far, the newest. Factors of earlier ones alone are not taken again.
    constants : tuple of int
        Keys of the constants that the source has in its attribute ``constants``, in that order.
    """

    t_s: FloatArray
    gyroscope: bool
    new: int = 0
    constants: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze the times."""
        t_s = frozen("timeline t_s", self.t_s, (None,))
        increasing("timeline t_s", t_s)
        object.__setattr__(self, "t_s", t_s)

    def nearest(self, t_s: float) -> int:
        """Return the keyframe nearest to a time."""
        return int(np.abs(self.t_s - t_s).argmin())
