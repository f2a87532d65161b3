"""Stretches of positions that phase connects: all of one are off by the same, which is estimated.

Phase tells to millimetres how an antenna moves while its arcs last. Where all of them break, in an
outage, positions before and after are off by decimetres of their own. As noise of every epoch that
would average out over a stretch; it does not, so each stretch has an offset among the constants.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import FloatArray
from fgnav.methods.smoother.constants import PIECE, FlightConstant
from fgnav.methods.smoother.keyframes import Timed

_MOST = 8  # stretches with an offset: three dimensions of each travel through the whole chain
_NOTHING_M = 1e-4  # 1-sigma: integers against a base are known


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Pieces:
    """Positions as a smoother is to take them.

    Attributes
    ----------
    position : Timed
        With stretches numbered as the offsets are, or without any.
    constants : tuple of FlightConstant
        Their offsets; none where phase connects all positions, which are then off alike.
    common_m2 : ndarray, shape (n, 3, 3)
        What all positions share beside what they are said to share.
    """

    position: Timed
    constants: tuple[FlightConstant, ...]
    common_m2: FloatArray


def in_pieces(position: Timed, arcs_m2: FloatArray, *, offsets: bool) -> Pieces:
    """Return positions of which each stretch has an offset of its own, if there are several.

    Parameters
    ----------
    position : Timed
    arcs_m2 : ndarray, shape (n, 3, 3)
        Variance that positions of a stretch share, at keyframes.
    offsets : bool
        Whether offsets may be estimated. Else the longest stretch is what the others are off, by
        noise so loud that its mean over a stretch is as uncertain as the offset.
    """
    piece, there = position.piece, np.isfinite(position.value[:, 0])
    if piece is None:
        return Pieces(position=position, constants=(), common_m2=arcs_m2)
    told = there & (piece >= 0) & arcs_m2.any(axis=(1, 2))
    numbers, counts = np.unique(piece[told], return_counts=True)
    largest_first = np.argsort(-counts, kind="stable")
    numbers, counts = numbers[largest_first], counts[largest_first]
    if len(numbers) < 2:
        return Pieces(position=replace(position, piece=None), constants=(), common_m2=arcs_m2)
    shared_m2 = np.array([arcs_m2[told & (piece == number)].mean(axis=0) for number in numbers])
    kept = np.linalg.eigvalsh(shared_m2)[:, -1] > _NOTHING_M**2
    kept &= np.arange(len(numbers)) < (_MOST if offsets else 0)
    covariance, own = position.covariance.copy(), np.full_like(piece, -1)
    for k, number in enumerate(numbers):
        rows = piece == number
        if kept[k]:
            own[rows] = kept[:k].sum()
        elif offsets or k:
            apart_m2 = shared_m2[k] if offsets else shared_m2[k] + shared_m2[0]
            covariance[rows] += counts[k] * apart_m2
    return Pieces(
        position=replace(position, covariance=covariance, piece=own if kept.any() else None),
        constants=_constants(shared_m2[kept]),
        common_m2=0 * arcs_m2 if offsets else np.broadcast_to(shared_m2[0], arcs_m2.shape),
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
            name="offsets of positions",
            place=PIECE,
            axes=tuple(f"stretch {k} {axis}" for k in range(c) for axis in "ned"),
            unit="m",
            start=np.zeros(3 * c),
            covariance=covariance,
        ),
    )
