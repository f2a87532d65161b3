"""What a solution says of the constants that were estimated with the flight."""

from dataclasses import replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.estimate import Constant
from fgnav.methods.smoother.constants import FLOAT, HEIGHT, LANDMARK, LEVER, PIECE
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.solution import SharedSolution, Solution

_TOLD = 3  # axes


def constants_found(keyframes: Keyframes, solution: Solution) -> tuple[Constant, ...]:
    """Return the constants asked for, as far from what the flight states as the solution has them.

    Of a window they are what was known at its end.

    Parameters
    ----------
    keyframes : Keyframes
    solution : Solution
    """
    shared, found, first = solution.shared, [], 0
    if shared is None:
        return ()
    asked = {one.place: one for one in keyframes.constants}
    for one in keyframes.shared:
        rows = slice(first, first + len(one.start))
        first = rows.stop
        value, P = shared.value[rows], shared.covariance[-1, rows, rows]
        if one.place not in asked or one.place in (FLOAT, PIECE):
            continue
        value = value - keyframes.shared_mean[rows]
        if one.place in (LANDMARK, HEIGHT):
            value, P = _without_common(value, P, asked[one.place].covariance, one.covariance)
        found.append(
            Constant(name=one.name, axes=one.axes, unit=one.unit, value=value, covariance=P)
        )
    return tuple(found)


def arm_off(keyframes: Keyframes, solution: Solution) -> SharedSolution | None:
    """Return what the lever arm from accelerometer to antennas is off, if that is estimated."""
    first, shared = keyframes.columns[LEVER], solution.shared
    if first < 0 or shared is None:
        return None
    rows = slice(first, first + 3)
    return SharedSolution(
        value=shared.value[rows],
        covariance=shared.covariance[:, rows, rows],
        cross=shared.cross[:, :, rows],
    )


def started_there(keyframes: Keyframes, solution: Solution) -> Keyframes:
    """Return keyframes whose search for the constants starts where a solution has them."""
    if solution.shared is None:
        return keyframes
    off, first, constants = solution.shared.value - keyframes.shared_mean, 0, []
    asked = {one.place for one in keyframes.constants}
    for one in keyframes.shared:
        last = first + len(one.start)
        if one.place in asked:
            constants.append(replace(one, start=off[first:last]))
        first = last
    return replace(keyframes, constants=tuple(constants))


def _without_common(
    value: FloatArray, P: FloatArray, own: FloatArray, both: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return a constant's own value, (d,), out of one with the positions' common error in it.

    Both were known before the flight by covariances ``own`` and ``both - own``; by the sum, of
    which the data tell, each is told as Gaussian conditioning has it.
    """
    K = own @ np.linalg.inv(both)
    return K @ value, K @ P @ K.T + own - K @ own


def sentence(constant: Constant) -> str:
    """Return what a reader of the result should know of a constant."""
    axes, P = constant.axes, constant.covariance
    if len(axes) > _TOLD:
        first, last = (
            f"{axes[k]} {constant.value[k]:+.2f} ± {np.sqrt(P[k, k]):.2f}" for k in (0, -1)
        )
        return f"{constant.name.capitalize()}, off: {first}, {last} {constant.unit} (1 sigma)."
    degrees = constant.unit == "rad"
    scale, unit = (np.degrees(1.0), "deg") if degrees else (1.0, constant.unit)
    sigma = np.sqrt(np.diag(P))
    values = ", ".join(
        f"{axis} {scale * v:+.4f} ± {scale * s:.4f}"
        for axis, v, s in zip(axes, constant.value, sigma, strict=True)
    )
    name = constant.name[:1].upper() + constant.name[1:]
    return f"{name}, off what the flight states: {values} {unit} (1 sigma)."
