"""Failures of a solver in words: which state the data do not determine, and when."""

import re
from collections.abc import Callable

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.graph import keys
from fgnav.graph.types.constants import Constants
from fgnav.graph.types.states import AUX

_SYMBOL = re.compile(r"Symbol: (.)(\d+)\)")
_PARTS = ("attitude", "position", "velocity", "accelerometer bias")  # three columns each
_AUX_PARTS = {
    6: ("gyroscope bias",),
    12: ("angular rate", "angular acceleration", "angular jerk"),
}
_UNKNOWN = (np.pi, 1e3, 1e3, 1.0)  # rad, m, m/s, m/s2, then rad/s: as good as nothing
_FIRST_COLUMN = {"x": 0, "v": 6, "b": AUX, "m": AUX}  # of a keyframe's variables
_CONSTANT, _ARCS = keys.letter(keys.constant(0)), keys.letter(keys.arcs(0))


def in_words(
    error: RuntimeError, width: int, constants: Constants, t_s: Callable[[int], float]
) -> NoSolutionError:
    """Return what a failure of GTSAM's elimination means, by the variable that its text names.

    Parameters
    ----------
    error : RuntimeError
    width : int
        Dimensions of a keyframe.
    constants : Constants
    t_s : callable
        Time of a keyframe.
    """
    named = _SYMBOL.search(str(error))
    if named is None:
        reason = " ".join(str(error).split())
        return NoSolutionError(f"state: the data do not determine it ({reason})")
    letter, number = named[1], int(named[2])
    if letter == _ARCS:
        return open_constant(constants.width, constants)
    if letter == _CONSTANT:
        return open_constant(constants.first[number], constants)
    return open_state(_FIRST_COLUMN[letter], width, t_s(number))


def open_state(column: int, width: int, t_s: float) -> NoSolutionError:
    """Return the error that a column of a keyframe's tangent, ``width`` wide, is not determined."""
    parts = (*_PARTS, *_AUX_PARTS[min(width - AUX, 12)])
    part = parts[column // 3] if column < 3 * len(parts) else "lasting error of phases"
    return NoSolutionError(f"{part}: the data do not determine it at {t_s:.2f} s")


def open_constant(column: int, constants: Constants) -> NoSolutionError:
    """Return the error that a column of the constants, or of the arcs behind, is not determined."""
    ends = np.cumsum([part.size for part in constants.parts])
    if column >= constants.width:
        return NoSolutionError("ambiguities of phase: the data do not determine them")
    part = constants.parts[int(np.searchsorted(ends, column, side="right"))]
    return NoSolutionError(f"{part.name}: the data do not determine it")


def weakest_state(
    forward: FloatArray, width: int, constants: Constants, t_s: float
) -> NoSolutionError:
    """Return the error of a keyframe that the data leave open, by its forward information.

    Parameters
    ----------
    forward : ndarray, shape (D + b + 1, D + b + 1)
        Upper half, see ``chain.kernel``.
    width : int
        D.
    constants : Constants
    t_s : float
    """
    information = np.triu(forward[:-1, :-1]) + np.triu(forward[:-1, :-1], 1).T
    if not np.isfinite(information).all():
        return NoSolutionError(f"residuals are not finite at {t_s:.2f} s")
    unit = np.ones(len(information))
    unit[: 3 * len(_UNKNOWN)] = np.repeat(_UNKNOWN, 3)
    _, vectors = np.linalg.eigh(information * np.outer(unit, unit))
    weakest = np.abs(vectors[:, 0])
    shares = np.linalg.norm(weakest[:width].reshape(-1, 3), axis=1)
    if np.linalg.norm(weakest[width:]) > shares.max():
        return open_constant(int(weakest[width:].argmax()), constants)
    return open_state(3 * int(shares.argmax()), width, t_s)
