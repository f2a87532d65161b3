"""Baselines that receivers know in both frames: their own, and differences of their fixes.

A heading alone leaves the pitch of its baseline to specific force, the direction of which the
track has in ``n``: both vectors have the same angle between them in both frames.
"""

from collections.abc import Iterable, Iterator
from itertools import combinations
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.types.flight import Baseline, Flight

KNOWN_RAD = 0.25  # 1-sigma of a heading that counts: half a radian is two
SHORTEST_M = 0.01  # between antennas: nothing tells a direction of less
_SAME_S = 1e-4  # fixes this close are of one time
_UP_N = np.array([0.0, 0.0, -1.0])


class BodyBaseline(NamedTuple):
    """A receiver's baseline, and the same in body axes: of length one unless all is measured."""

    of: Baseline
    vector_b_m: FloatArray

    @property
    def name(self) -> str:
        """Of the record."""
        return f"baseline {' '.join(self.of.antennas)}"

    @property
    def variance_rad2(self) -> FloatArray:
        """Mean variance of its direction about the two axes across it, (k,); of its heading."""
        of = self.of
        if of.measured == "heading":
            return of.heading_sigma_rad**2
        square = np.einsum("ki,ki->k", of.vector_n_m, of.vector_n_m)
        along = np.einsum("ki,kij,kj->k", of.vector_n_m, of.covariance_m2, of.vector_n_m) / square
        trace = np.einsum("kii->k", of.covariance_m2)
        return np.asarray((trace - along) / (2 * square))


def body_baseline(flight: Flight, of: Baseline) -> BodyBaseline:
    """Return a baseline with what it is in body axes.

    Raises
    ------
    BadInputError
        If both antennas are at the same place.
    """
    vector_b_m = stated_vector_b_m(flight, of)
    length_m = float(np.linalg.norm(vector_b_m))
    if length_m < SHORTEST_M:
        raise BadInputError(
            f"baseline {' to '.join(of.antennas)}: both antennas have position_b_m "
            f"{flight.antenna(of.antennas[0]).position_b_m.tolist()}; state where each of them is"
        )
    return BodyBaseline(of, vector_b_m / (1.0 if of.measured == "vector" else length_m))


def stated_vector_b_m(flight: Flight, of: Baseline) -> FloatArray:
    """Return the vector between the places of both antennas, (3,)."""
    first, second = (flight.antenna(name).position_b_m for name in of.antennas)
    return np.asarray(second - first)


def heading_baselines(flight: Flight) -> tuple[BodyBaseline, ...]:
    """Return baselines that determine a heading: of receivers, else by differences of fixes."""
    given = _precise(body_baseline(flight, baseline) for baseline in flight.baselines)
    if given or flight.observations is not None:
        return given
    measured = (
        body_baseline(flight, baseline)
        for baseline in fix_baselines(flight)
        if np.linalg.norm(stated_vector_b_m(flight, baseline)) > SHORTEST_M
    )
    return _precise(measured)


def _precise(baselines: Iterable[BodyBaseline]) -> tuple[BodyBaseline, ...]:
    """Return baselines with the samples alone whose direction is known."""
    left = []
    for baseline in baselines:
        precise = baseline.variance_rad2 < KNOWN_RAD**2
        if precise.any():
            left.append(baseline._replace(of=baseline.of[precise]))
    return tuple(left)


def fix_baselines(flight: Flight) -> Iterator[Baseline]:
    """Yield baselines between antennas that have fixes at the same times."""
    for first, other in combinations(flight.fixes, 2):
        k = np.searchsorted(other.t_s, first.t_s - _SAME_S).clip(max=len(other.t_s) - 1)
        vector = other.p_n_m[k] - first.p_n_m
        variance = other.position_sigma_m[k] ** 2 + first.position_sigma_m**2
        same = (np.abs(other.t_s[k] - first.t_s) < _SAME_S) & vector.any(axis=1)
        if same.any():
            yield Baseline(
                t_s=first.t_s[same],
                antennas=(first.antenna, other.antenna),
                vector_n_m=vector[same],
                covariance_m2=variance[same, None] * np.eye(3),
            )


def with_pitch(
    vector_n: FloatArray, vector_b: FloatArray, f_n: FloatArray, f_b: FloatArray
) -> FloatArray:
    """Return level unit vectors, (n, 3), raised until they are at the same angle as in the body.

    Parameters
    ----------
    vector_n : ndarray, shape (n, 3)
        Level and of length one; NaN where there is none.
    vector_b : ndarray, shape (3,)
        Of length one.
    f_n, f_b : ndarray, shape (n, 3)
        Specific force in both frames.
    """
    f_n, f_b = (f / np.linalg.norm(f, axis=1, keepdims=True) for f in (f_n, f_b))
    along, up = np.einsum("ni,ni->n", f_n, vector_n), f_n @ _UP_N
    cosine = (f_b @ vector_b) / np.hypot(along, up)
    pitch = np.arctan2(up, along) - np.arccos(cosine.clip(-1.0, 1.0))
    return np.asarray(np.cos(pitch)[:, None] * vector_n + np.sin(pitch)[:, None] * _UP_N)
