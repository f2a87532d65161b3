"""Estimates of the constants of a flight, for its results and notes."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph.types.parameters import Parameters
from fgnav.graph.types.solution import Solution
from fgnav.messages import Note, note
from fgnav.types.estimate import CalibratedParameter

_LISTED = 3  # axes


def calibrated_parameters(
    constants: Parameters, solution: Solution
) -> tuple[CalibratedParameter, ...]:
    """Return the constants asked for, as far from what the flight states as the solution has them.

    Of a window they are what was known at its end.
    """
    reported = []
    for parameter, first in zip(constants.parts, constants.first, strict=True):
        if not parameter.reported:
            continue
        columns = slice(first, first + parameter.size)
        value: FloatArray = solution.states.constants[columns] - parameter.origin
        P: FloatArray = solution.constant_covariance[-1, columns, columns]
        reported.append(
            CalibratedParameter(
                name=parameter.name,
                axes=parameter.axes,
                unit=parameter.unit,
                value=value,
                covariance=P,
            )
        )
    return tuple(reported)


def constant_note(constant: CalibratedParameter) -> Note:
    """Return a message with the difference of a constant from its nominal value."""
    axes, P = constant.axes, constant.covariance
    if len(axes) > _LISTED:
        first, last = (
            f"{axes[k]} {constant.value[k]:+.2f} ± {np.sqrt(P[k, k]):.2f}" for k in (0, -1)
        )
        name = constant.name.capitalize()
        return note("I407", constant=name, values=f"{first}, {last}", unit=constant.unit)
    degrees = constant.unit == "rad"
    scale, unit = (np.degrees(1.0), "deg") if degrees else (1.0, constant.unit)
    sigma = np.sqrt(np.diag(P))
    values = ", ".join(
        f"{axis} {scale * v:+.4f} ± {scale * s:.4f}"
        for axis, v, s in zip(axes, constant.value, sigma, strict=True)
    )
    name = constant.name[:1].upper() + constant.name[1:]
    return note("I407", constant=name, values=values, unit=unit)
