"""GTSAM's window built anew where its oldest keyframe is linearised at another state.

What GTSAM has marginalised stays linear where it was, and no variable that it speaks of is ever
linearised anew. So the window begins again, with the chain's marginal for a prior, which
``LinearWindow.relinearise`` has led there.
"""

from typing import NamedTuple

import numpy as np

from fgnav.graph import keys
from fgnav.graph.build import Layout, insert_constants, insert_keyframe, linear_factor
from fgnav.graph.types.states import AUX, POSITION, VELOCITY
from fgnav.optional_gtsam import gtsam
from fgnav.solve.chain.linear_window import LinearWindow


class Entered(NamedTuple):
    """What entered a window with a keyframe.

    ``block`` is that of its arcs, which ``begins`` there or before; negative before any.
    """

    factors: list[gtsam.NonlinearFactor]
    block: int
    begins: bool


def marginal_factor(linear: LinearWindow, layout: Layout, block: int) -> gtsam.NonlinearFactor:
    """Return what a window knows of its oldest keyframe, constants and arcs by that keyframe.

    Raises
    ------
    NoSolutionError
        If squares have not digits enough.
    """
    R, right = linear.marginal()
    pose, velocity, aux = layout.keyframe(linear.oldest)
    D, point = layout.width, gtsam.Values()
    insert_keyframe(point, layout, linear.oldest, linear.states)
    insert_constants(point, layout, linear.constants)
    terms = [
        (pose, R[:, : POSITION.stop]),
        (velocity, R[:, VELOCITY]),
        (aux, R[:, AUX:D]),
    ]
    column = D
    for key, part in zip(layout.constant_keys, layout.constants.parts, strict=True):
        terms.append((key, R[:, column : column + part.size]))
        column += part.size
    if block >= 0:
        terms.append((keys.arcs(block), R[:, column:]))
        point.insert(keys.arcs(block), np.zeros(R.shape[1] - column))
    return gtsam.LinearContainerFactor(linear_factor(terms, right), point)
