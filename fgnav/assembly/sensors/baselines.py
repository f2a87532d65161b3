"""Baselines of receivers, brought to the keyframes."""

import numpy as np

from fgnav.alignment.matching import nearest, unmatched
from fgnav.attitude.receiver_baselines import BodyBaseline, body_baseline
from fgnav.checks import FloatArray, IntArray, Unused
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.types.flight import Flight

_DIMENSIONS = {"vector": 3, "direction": 2, "heading": 1}


def baselines(
    flight: Flight, t_s: FloatArray
) -> tuple[tuple[BaselineVector, ...], tuple[Unused, ...]]:
    """Return the baselines of a flight's receivers at keyframes, (n,).

    Raises
    ------
    BadInputError
        If both antennas of one are at the same place.
    """
    parts: list[BaselineVector] = []
    unused: list[Unused] = []
    for baseline in flight.baselines:
        if not len(baseline.t_s):
            continue
        at, same = nearest(baseline.t_s, t_s)
        row = np.flatnonzero(same)
        parts.append(_rows(body_baseline(flight, baseline), at[row], row))
        unused += unmatched(f"baseline {' to '.join(baseline.antennas)}", len(baseline.t_s), same)
    return tuple(parts), tuple(unused)


def _rows(between: BodyBaseline, at: IntArray, row: IntArray) -> BaselineVector:
    """Return rows that whiten a baseline's samples ``at``, (k,)."""
    of = between.of
    value, dimensions = of.vector_n_m[at], _DIMENSIONS[of.measured]
    if dimensions == 1:
        right = np.stack([-value[:, 1], value[:, 0]], axis=1)
        white = np.zeros((len(row), 3, 3))
        white[:, 0, :2] = right / of.heading_sigma_rad[at, None]
    else:
        white = np.linalg.inv(np.linalg.cholesky(of.covariance_m2[at]))
    return BaselineVector(
        row=row,
        value_n_m=value,
        white=white,
        baseline_b_m=between.vector_b_m,
        dimensions=dimensions,
    )
