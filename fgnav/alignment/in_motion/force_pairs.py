"""Specific force in two frames, over the same spans: by a track, and as the unit measures it.

The gyroscope turns what is felt into axes ``u`` that do not turn, the body's at first [1]_. Over
spans T between fixes it is the same vector in two frames, ``alpha = R_nu beta``:

    alpha = (v(t + T) - v(t)) / T - g              beta = mean of R_ub f      (velocities)
    alpha = (p(t + T) - 2 p(t) + p(t - T)) / T2 - g     the same of the double integral (positions)

References
----------
.. [1] Wu, Pan: Velocity/position integration formula, part I: application to in-flight coarse
   alignment, IEEE Transactions on Aerospace and Electronic Systems 49(2), 2013.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from fgnav.alignment.gaps import LONGEST_GAP_S
from fgnav.attitude.flight_vectors import Track
from fgnav.attitude.imu_rotation import ImuRotation
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.interpolation import integral
from fgnav.types.flight import Imu


class Pairs(NamedTuple):
    """The same specific forces in two frames, means over spans of T, (m, 3)."""

    from_s: FloatArray
    until_s: FloatArray
    f_n_mps2: FloatArray
    f_u_mps2: FloatArray


def specific_forces(
    integrated: "Integrated",
    track: Track,
    span_s: float,
    gravity_n_mps2: FloatArray,
    first_s: float | None = None,
) -> Iterator[Pairs]:
    """Yield the pairs of velocities and of positions over spans between fixes about T apart."""
    row = np.flatnonzero(integrated.covers(track.t_s))
    row = row[_spaced(track.t_s[row], span_s, first_s)]
    t_s = track.t_s[row]
    velocity_u, place_u = integrated.at(t_s)
    if track.v_n_mps is not None and len(row) > 1:
        dt = np.diff(t_s)[:, None]
        f_n = np.diff(track.v_n_mps[row], axis=0) / dt - gravity_n_mps2
        valid = _regular(t_s[:-1], t_s[1:], span_s) & np.isfinite(f_n).all(axis=1)
        yield Pairs(
            t_s[:-1][valid], t_s[1:][valid], f_n[valid], (np.diff(velocity_u, axis=0) / dt)[valid]
        )
    if len(row) > 2:
        f_n = _second_difference(t_s, track.p_n_m[row]) - gravity_n_mps2
        valid = _regular(t_s[:-2], t_s[2:], 2 * span_s) & np.isfinite(f_n).all(axis=1)
        f_u = _second_difference(t_s, place_u)
        yield Pairs(t_s[:-2][valid], t_s[2:][valid], f_n[valid], f_u[valid])


class Integrated:
    """Velocity and place of an antenna in ``u`` that specific force alone adds up to."""

    def __init__(self, imu: Imu, rotation: ImuRotation, arm_b_m: FloatArray) -> None:
        self._rotation, self._arm_b_m, self._t_s = rotation, arm_b_m, imu.t_s
        dt = np.diff(imu.t_s)[:, None]
        self._f_u = np.einsum("nij,nj->ni", rotation.R_ub, imu.f_b_mps2)
        self._v_u = integral(imu.t_s, self._f_u)
        steps = self._v_u[:-1] * dt + (2 * self._f_u[:-1] + self._f_u[1:]) / 6 * dt**2
        self._p_u = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        self._gaps = np.concatenate([[0], np.cumsum(dt[:, 0] > LONGEST_GAP_S)])

    def covers(self, t_s: FloatArray) -> BoolArray:
        """Select the times, (n,), that the record covers outside of its gaps."""
        row = np.searchsorted(self._t_s, t_s, side="right") - 1
        age_s = t_s - self._t_s[row.clip(0)]
        return np.asarray((row >= 0) & (age_s <= LONGEST_GAP_S))

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return velocity and place, (n, 3), by samples up to each time, the last one held."""
        row = (np.searchsorted(self._t_s, t_s, side="right") - 1).clip(0)
        since_s = (t_s - self._t_s[row])[:, None]
        f_u, R_ub = self._f_u[row], self._rotation.at(t_s)
        swing_b = np.cross(self._rotation.w_b_radps[row], self._arm_b_m)
        v_u = self._v_u[row] + f_u * since_s + np.einsum("nij,nj->ni", R_ub, swing_b)
        p_u = self._p_u[row] + self._v_u[row] * since_s + f_u * since_s**2 / 2
        return v_u, p_u + R_ub @ self._arm_b_m


def _spaced(t_s: FloatArray, span_s: float, first_s: float | None = None) -> IntArray:
    """Return rows of times, (n,), that are about a span apart: the first within each.

    Spans are counted from the first time, or an earlier one.
    """
    number = np.floor((t_s - (t_s[:1] if first_s is None else first_s)) / span_s + 1e-6)
    return np.flatnonzero(np.diff(number, prepend=-np.inf) > 0)


def _regular(from_s: FloatArray, until_s: FloatArray, span_s: float) -> BoolArray:
    return np.asarray((until_s - from_s > span_s / 2) & (until_s - from_s < 2 * span_s))


def _second_difference(t_s: FloatArray, values: FloatArray) -> FloatArray:
    slopes = np.diff(values, axis=0) / np.diff(t_s)[:, None]
    return np.asarray(2 * np.diff(slopes, axis=0) / (t_s[2:] - t_s[:-2])[:, None])
