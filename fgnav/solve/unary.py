"""Factors of one's own that touch one keyframe, in the chain's normal equations."""

from collections.abc import Mapping, Sequence

import gtsam
import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout, insert_variables
from fgnav.graph.types.states import States


def add_unary(
    factors: Mapping[int, Sequence[gtsam.NonlinearFactor]],
    layout: Layout,
    rows: Mapping[int, int],
    at: States,
    node: FloatArray,
) -> None:
    """Add factors of a keyframe each, and constants, to the augmented information.

    Parameters
    ----------
    factors : mapping of int to sequence of gtsam.NonlinearFactor
        By the number of their keyframe.
    layout : Layout
    rows : mapping of int to int
        Of keyframes, among the states.
    at : States
        Where they are linearised, (n,).
    node : ndarray, shape (n, D + b + 1, D + b + 1)
        See ``chain.kernel``.
    """
    values, D = gtsam.Values(), layout.width
    each = [one for of in factors.values() for one in of]
    touched = {key for one in each for key in one.keys()}  # noqa: SIM118  # not a dict
    insert_variables(values, layout, touched, at, rows)
    constants = _of_constants(layout) if any(map(keys.is_constant, touched)) else {}
    for number, of in factors.items():
        x, v, aux = layout.keyframe(number)
        columns = constants | {x: slice(0, 6), v: slice(6, 9), aux: slice(9, D)}
        for factor in of:
            linear = factor.linearize(values)
            if linear is None:  # a factor that is not active is none
                continue
            A, right = linear.jacobian()
            whitened, begin = np.zeros((len(right), node.shape[1])), 0
            for key in linear.keys():  # noqa: SIM118  # not a dict
                own = columns[key]
                whitened[:, own] = A[:, begin : begin + own.stop - own.start]
                begin += own.stop - own.start
            whitened[:, -1] = right
            node[rows[number]] += whitened.T @ whitened


def _of_constants(layout: Layout) -> dict[int, slice]:
    of_parts = zip(layout.constant_keys, layout.constants.parts, strict=True)
    return {
        key: slice(layout.width + first, layout.width + first + part.size)
        for (key, part), first in zip(of_parts, layout.constants.first, strict=True)
    }
