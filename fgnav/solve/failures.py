"""Failures of a solver in words: which state the data do not determine, and when."""

import re
from collections.abc import Callable

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.graph import keys
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.states import AUX

_SYMBOL = re.compile(r"Symbol: (.)(\d+)\)")
_PARTS = ("attitude", "position", "velocity", "accelerometer bias")  # three columns each
_AUX_PARTS = {
    6: ("gyroscope bias",),
    12: ("angular rate", "angular acceleration", "angular jerk"),
}
_FIRST_COLUMN = {"x": 0, "v": 6, "b": AUX, "m": AUX}  # of a keyframe's variables
_CONSTANT, _ARCS = keys.letter(keys.constant(0)), keys.letter(keys.arcs(0))


def in_words(
    error: RuntimeError, width: int, constants: Parameters, t_s: Callable[[int], float]
) -> NoSolutionError:
    """Explain a failure of GTSAM's elimination by the variable that its text names.

    Parameters
    ----------
    error : RuntimeError
    width : int
        Dimensions of a keyframe.
    constants : Parameters
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
    component = parts[column // 3] if column < 3 * len(parts) else "lasting error of phases"
    return NoSolutionError(f"{component}: the data do not determine it at {t_s:.2f} s")


def open_constant(column: int, constants: Parameters) -> NoSolutionError:
    """Return the error that a column of the constants, or of the arcs behind, is not determined."""
    ends = np.cumsum([parameter.size for parameter in constants.parts])
    if column >= constants.width:
        return NoSolutionError("ambiguities of phase: the data do not determine them")
    parameter = constants.parts[int(np.searchsorted(ends, column, side="right"))]
    return NoSolutionError(f"{parameter.name}: the data do not determine it")
