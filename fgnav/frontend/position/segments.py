"""Stretches of positions that phase connects: all of one are off by the same, which is estimated.

Phase tells to millimetres how an antenna moves while its arcs last. Where all of them break, in an
outage, positions before and after are off by decimetres of their own. As noise of every epoch that
would average out over a stretch; it does not, so each stretch has an offset among the constants.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.frontend.position.series import VectorSeries
from fgnav.graph.types.constants import FlightConstant

NAME = "phase segment biases"
_MOST = 8  # stretches with an offset: three dimensions of each travel through the whole chain
_NOTHING_M = 1e-4  # 1-sigma: integers against a base are known


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Segments:
    """Positions as a smoother is to take them.

    Attributes
    ----------
    position : VectorSeries
        With stretches numbered as the offsets are, or without any.
    constants : tuple of FlightConstant
        Their offsets; none where phase connects all positions, which are then off alike.
    common_m2 : ndarray, shape (n, 3, 3)
        What all positions share beside what they are said to share.
    """

    position: VectorSeries
    constants: tuple[FlightConstant, ...]
    common_m2: FloatArray


def segmented(position: VectorSeries, arcs_m2: FloatArray) -> Segments:
    """Return positions of which each stretch has an offset of its own, if there are several.

    Parameters
    ----------
    position : VectorSeries
    arcs_m2 : ndarray, shape (n, 3, 3)
        Variance that positions of a stretch share, at keyframes.
    """
    segment, there = position.segment, np.isfinite(position.value[:, 0])
    if segment is None:
        return Segments(position=position, constants=(), common_m2=arcs_m2)
    told = there & (segment >= 0) & arcs_m2.any(axis=(1, 2))
    numbers, counts = np.unique(segment[told], return_counts=True)
    largest_first = np.argsort(-counts, kind="stable")
    numbers, counts = numbers[largest_first], counts[largest_first]
    if len(numbers) < 2:
        return Segments(position=replace(position, segment=None), constants=(), common_m2=arcs_m2)
    shared_m2 = np.array([arcs_m2[told & (segment == number)].mean(axis=0) for number in numbers])
    kept = np.linalg.eigvalsh(shared_m2)[:, -1] > _NOTHING_M**2
    kept &= np.arange(len(numbers)) < _MOST
    covariance, own = position.covariance.copy(), np.full_like(segment, -1)
    for k, number in enumerate(numbers):
        rows = segment == number
        if kept[k]:
            own[rows] = kept[:k].sum()
        else:
            covariance[rows] += counts[k] * shared_m2[k]
    return Segments(
        position=replace(position, covariance=covariance, segment=own if kept.any() else None),
        constants=_constants(shared_m2[kept]),
        common_m2=0 * arcs_m2,
    )


def _constants(shared_m2: FloatArray) -> tuple[FlightConstant, ...]:
    """Return the offsets of stretches of covariances, (c, 3, 3), as one constant."""
    c = len(shared_m2)
    if not c:
        return ()
    covariance = np.zeros((3 * c, 3 * c))
    for k in range(c):
        own = slice(3 * k, 3 * k + 3)
        covariance[own, own] = shared_m2[k] + _NOTHING_M**2 * np.eye(3)
    return (
        FlightConstant(
            name=NAME,
            axes=tuple(f"segment {k} {axis}" for k in range(c) for axis in "ned"),
            unit="m",
            mean=np.zeros(3 * c),
            covariance=covariance,
            start=np.zeros(3 * c),
            linear=True,
            reported=False,
        ),
    )
