"""Baselines of receivers, brought to the keyframes."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, Loss
from fgnav.frontend.matching import nearest, unused
from fgnav.types.flight import Baseline, Flight

_DIMENSIONS = {"vector": 3, "direction": 2, "heading": 1}
_SHORTEST_M = 0.01  # between antennas: nothing tells a direction of less


class BaselineRows(NamedTuple):
    """A receiver's baselines at keyframes, (k,); see ``BaselineVector``."""

    row: IntArray
    value_n_m: FloatArray
    white: FloatArray
    baseline_b_m: FloatArray
    dimensions: int


def baselines(flight: Flight, t_s: FloatArray) -> tuple[tuple[BaselineRows, ...], tuple[Loss, ...]]:
    """Return the baselines of a flight's receivers at keyframes, (n,).

    Raises
    ------
    BadInputError
        If both antennas of one are at the same place.
    """
    parts: list[BaselineRows] = []
    losses: list[Loss] = []
    for one in flight.baselines:
        at, same = nearest(one.t_s, t_s)
        row = np.flatnonzero(same)
        parts.append(_rows(one, at[row], row, baseline_b_m(flight, one)))
        losses += unused(f"baseline {' to '.join(one.antennas)}", len(one.t_s), same)
    return tuple(parts), tuple(losses)


def baseline_b_m(flight: Flight, of: Baseline) -> FloatArray:
    """Return the vector from the first antenna to the second in body axes, (3,).

    Raises
    ------
    BadInputError
        If it is zero.
    """
    first, second = (flight.antenna(name).position_b_m for name in of.antennas)
    vector: FloatArray = second - first
    if np.linalg.norm(vector) < _SHORTEST_M:
        raise BadInputError(
            f"baseline {' to '.join(of.antennas)}: both antennas have position_b_m "
            f"{first.tolist()}; state where each of them sits"
        )
    return vector


def _rows(of: Baseline, at: IntArray, row: IntArray, vector_b_m: FloatArray) -> BaselineRows:
    """Return rows that whiten a baseline's samples ``at``, (k,)."""
    value, dimensions = of.vector_n_m[at], _DIMENSIONS[of.measured]
    if dimensions < 3:
        vector_b_m = vector_b_m / np.linalg.norm(vector_b_m)
    if dimensions == 1:
        right = np.stack([-value[:, 1], value[:, 0]], axis=1)
        white = np.zeros((len(row), 3, 3))
        white[:, 0, :2] = right / of.heading_sigma_rad[at, None]
    else:
        white = np.linalg.inv(np.linalg.cholesky(of.covariance_m2[at]))
    return BaselineRows(row, value, white, vector_b_m, dimensions)
