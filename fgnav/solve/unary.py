"""Factors of one's own that touch one keyframe, in the chain's normal equations."""

from collections.abc import Iterable

import numpy as np

from fgnav.checks import FloatArray
from fgnav.graph import keys
from fgnav.graph.build import Layout, insert_variables
from fgnav.graph.types.states import States
from fgnav.optional_gtsam import gtsam


def add_unary(
    factors: Iterable[gtsam.NonlinearFactor],
    layout: Layout,
    number: int,
    at: States,
    node: FloatArray,
) -> None:
    """Add factors of keyframe ``number`` and constants to its augmented information.

    Parameters
    ----------
    factors : iterable of gtsam.NonlinearFactor
    layout : Layout
    number : int
    at : States
        Where it is linearised, (1,).
    node : ndarray, shape (D + b + 1, D + b + 1)
        See ``chain.kernel``.
    """
    values, D = gtsam.Values(), layout.width
    factors = list(factors)
    touched = [key for factor in factors for key in factor.keys()]  # noqa: SIM118  # not a dict
    insert_variables(values, layout, touched, at, {number: 0})
    x, v, aux = layout.keyframe(number)
    columns = {x: slice(0, 6), v: slice(6, 9), aux: slice(9, D)}
    if any(map(keys.is_constant, touched)):
        columns |= _of_constants(layout)
    for factor in factors:
        linear = factor.linearize(values)
        if linear is None:  # a factor that is not active is none
            continue
        A, right = linear.jacobian()
        rows, begin = np.zeros((len(right), len(node))), 0
        for key in linear.keys():  # noqa: SIM118  # not a dict
            own = columns[key]
            rows[:, own] = A[:, begin : begin + own.stop - own.start]
            begin += own.stop - own.start
        rows[:, -1] = right
        node += rows.T @ rows


def _of_constants(layout: Layout) -> dict[int, slice]:
    of_parts = zip(layout.constant_keys, layout.constants.parts, strict=True)
    return {
        key: slice(layout.width + first, layout.width + first + part.size)
        for (key, part), first in zip(of_parts, layout.constants.first, strict=True)
    }
