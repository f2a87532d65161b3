"""Azimuth and elevation of baselines by an estimate: what two antennas determine of an attitude.

With u the baseline's unit vector in ``n`` and t the attitude's error in body axes, u changes by
``-R_nb [u_b]x t``. What turns about the baseline moves neither angle, however open it is.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import skew
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

_SHORTEST_M, _ALIGNED = 0.01, 1e-6  # between antennas; second over first singular value


class BaselineAngles(NamedTuple):
    """Azimuth and elevation at n epochs, rad, and their covariance; None where none is stated."""

    t_s: FloatArray
    angles_rad: FloatArray  # (n, 2)
    covariance_rad2: FloatArray | None  # (n, 2, 2)

    @property
    def sigma_rad(self) -> FloatArray | None:
        """1-sigma, (n, 2)."""
        P = self.covariance_rad2
        return None if P is None else np.sqrt(np.einsum("nii->ni", P))


def reported_baselines(flight: Flight) -> Mapping[str, FloatArray]:
    """Return unit vectors in body axes: of receivers' baselines, and of antennas in a line."""
    position_of = {antenna.name: antenna.position_b_m for antenna in flight.antennas}
    pairs = {frozenset(baseline.antennas): baseline.antennas for baseline in flight.baselines}
    if len(position_of) > 1:
        names = list(position_of)
        from_first = np.stack([position_of[name] - position_of[names[0]] for name in names])
        size = np.linalg.svd(from_first, compute_uv=False)
        if (size[1:] <= _ALIGNED * size[0]).all():
            ends = names[0], names[int(np.abs(from_first).sum(axis=1).argmax())]
            pairs.setdefault(frozenset(ends), ends)
    vectors = {
        " to ".join(ends): position_of[ends[1]] - position_of[ends[0]] for ends in pairs.values()
    }
    lengths = {name: float(np.linalg.norm(vector)) for name, vector in vectors.items()}
    return {name: v / lengths[name] for name, v in vectors.items() if lengths[name] > _SHORTEST_M}


def baseline_angles(estimate: Estimate, unit_b: FloatArray) -> BaselineAngles:
    """Return the angles of a unit vector in body axes, (3,), by an estimate."""
    u_n = estimate.R_nb @ unit_b
    attitude_rad2, covariance_rad2 = estimate.attitude_covariance_rad2, None
    if attitude_rad2 is not None:
        by_turn = -estimate.R_nb @ skew(unit_b[None])
        north, east = u_n[:, 0], u_n[:, 1]
        level = np.hypot(north, east).clip(1e-9)
        zero = np.zeros_like(level)
        rows = np.array([[-east / level**2, north / level**2, zero], [zero, zero, -1 / level]])
        J = np.moveaxis(rows, 2, 0) @ by_turn
        covariance_rad2 = J @ attitude_rad2 @ J.swapaxes(1, 2)
    return BaselineAngles(estimate.t_s, azimuth_elevation(u_n), covariance_rad2)


def azimuth_elevation(u_n: FloatArray) -> FloatArray:
    """Return the angles of unit vectors, (n, 3), as (n, 2)."""
    north, east, down = u_n.T
    return np.stack([np.arctan2(east, north), np.arctan2(-down, np.hypot(north, east))], axis=1)
