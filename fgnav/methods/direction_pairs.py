"""Directions that a flight knows in two frames: gravity by any source, the line of sight."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import numpy as np

from fgnav.alignment.matching import nearest, unmatched
from fgnav.attitude.flight_vectors import Track, measured_vectors
from fgnav.attitude.imu_rotation import imu_rotation
from fgnav.attitude.vector_pairs import VectorPairs, stacked
from fgnav.checks import Unused
from fgnav.geometry.earth import Origin
from fgnav.gravity import GravityDirection, GravityEstimator
from fgnav.methods.smoothing.custom_sources import with_networks
from fgnav.methods.smoothing.default_networks import default_networks
from fgnav.types.flight import Flight

# Who gives the direction of gravity; None: no pairs of gravity, and none of specific force.
Gravity: TypeAlias = GravityEstimator | Literal["specific force"] | None


def direction_pairs(
    flight: Flight, track: Track, gravity: Gravity, factors: tuple[Any, ...] | None
) -> tuple[VectorPairs, tuple[Unused, ...]]:
    """Return pairs of gravity, specific force and line of sight at the epochs of a track.

    An epoch has gravity once: from the first source that answers, the estimator before networks,
    and the specific force, which is gravity and what else the accelerometer feels, only where none
    does.
    """
    parts: list[VectorPairs] = []
    unused: list[Unused] = []
    has_gravity = np.zeros(len(track.t_s), dtype=np.bool_)
    for direction in _directions_of_gravity(flight, track, gravity, factors):
        pair, lost = _gravity_pair(flight.origin, track, direction)
        parts.append(pair.where(~has_gravity[:, None]))
        has_gravity |= pair.valid[:, 0]
        unused += lost
    imu = None if gravity is None else flight.imu
    rotation = None if imu is None else imu_rotation(imu)
    measured, lost = measured_vectors(replace(flight, imu=imu), track, rotation)
    is_force = np.array([source == "specific force" for source in measured.sources], dtype=np.bool_)
    parts.append(measured.where(~(has_gravity[:, None] & is_force)))
    return stacked(parts), (*unused, *lost)


def _directions_of_gravity(
    flight: Flight, track: Track, gravity: Gravity, factors: tuple[Any, ...] | None
) -> Iterator[GravityDirection]:
    if callable(gravity):
        yield gravity(flight)
    if gravity is None:
        return
    if factors is None:
        factors = default_networks(flight)[0]
    for source in with_networks(factors, flight.networks):
        answers = getattr(source, "directions", None)  # of networks
        direction = None if answers is None else answers(flight, track.t_s)
        if direction is not None:
            yield direction


def _gravity_pair(
    origin: Origin, track: Track, direction: GravityDirection
) -> tuple[VectorPairs, tuple[Unused, ...]]:
    """Return gravity at the epochs nearest to the answers, and the loss of answers far from any."""
    down_n = origin.gravity_n_mps2(track.p_n_m)
    down_n = down_n / np.linalg.norm(down_n, axis=1, keepdims=True)
    g_b, weight = np.full(down_n.shape, np.nan), np.zeros(len(down_n))
    row, _ = nearest(track.t_s, direction.t_s)
    interval_s = float(np.median(np.diff(track.t_s))) if len(row) > 1 else np.inf
    close = np.abs(track.t_s[row] - direction.t_s) <= interval_s / 2
    across = np.eye(3) - direction.g_b[:, :, None] * direction.g_b[:, None, :]
    variance = np.einsum("nij,nji->n", across, direction.covariance) / 2  # an ellipse as its circle
    g_b[row[close]], weight[row[close]] = direction.g_b[close], 1 / variance[close]
    pair = VectorPairs(
        v_n=down_n[:, None], v_b=g_b[:, None], weight=weight[:, None], sources=("gravity",)
    )
    return pair, (*direction.unused, *unmatched("gravity direction", len(row), close))
