"""Satellites by precise tables: polynomials through positions, lines through clocks."""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.earth import EARTH_RATE_RADPS
from fgnav.gnss.orbits.turning import turned
from fgnav.types.orbits import PreciseOrbits

_NODES = 11  # of the interpolating polynomial, order 10
_BEYOND_TABLE_S = 60.0  # transmission may precede the first epoch of a table


@dataclass(frozen=True, eq=False, slots=True)
class InertialTable:
    """A precise table in axes that stand still: those of the Earth at its first epoch."""

    t_s: FloatArray
    satellites: tuple[str, ...]
    p_i_m: FloatArray  # (k, s, 3)
    clock_s: FloatArray  # (k, s)
    weights: FloatArray  # (k - _NODES + 1, _NODES): denominators of Lagrange's polynomials

    @classmethod
    def of(cls, orbits: PreciseOrbits) -> "InertialTable":
        """Turn a table into inertial axes; of fewer than 11 epochs it knows no satellite."""
        t = orbits.t_s
        p_i_m = turned(orbits.p_e_m, EARTH_RATE_RADPS * (t - t[:1])[:, None])
        if len(t) < _NODES:
            return cls(t, (), p_i_m, orbits.clock_s, np.empty((0, _NODES)))
        nodes = np.lib.stride_tricks.sliding_window_view(t, _NODES)
        gaps = nodes[:, :, None] - nodes[:, None, :] + np.eye(_NODES)
        return cls(t, orbits.satellites, p_i_m, orbits.clock_s, 1 / gaps.prod(axis=2))

    def covers(self, t_s: FloatArray) -> BoolArray:
        """Return True at times that the table covers, (n,)."""
        after, before = t_s >= self.t_s[0] - _BEYOND_TABLE_S, t_s <= self.t_s[-1] + _BEYOND_TABLE_S
        return np.asarray(after & before)

    def at(self, satellite: str, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions (n, 3) and clocks (n,) without relativity; NaN if a node is missing."""
        column = self.satellites.index(satellite)
        before = np.searchsorted(self.t_s, t_s) - 1
        first = np.clip(before - _NODES // 2, 0, len(self.t_s) - _NODES)
        nodes = first[:, None] + np.arange(_NODES)  # (n, nodes)
        u = t_s[:, None] - self.t_s[nodes]
        ones = np.ones((len(t_s), 1))
        left = np.cumprod(np.hstack([ones, u[:, :-1]]), axis=1)
        right = np.cumprod(np.hstack([ones, u[:, :0:-1]]), axis=1)[:, ::-1]
        p_i_m = np.einsum(
            "nk,nki->ni", left * right * self.weights[first], self.p_i_m[nodes, column]
        )
        lower = np.clip(before, 0, len(self.t_s) - 2)
        share = (t_s - self.t_s[lower]) / (self.t_s[lower + 1] - self.t_s[lower])
        share = share.clip(0.0, 1.0)
        c = self.clock_s[:, column]
        clock = c[lower] * (1 - share) + c[lower + 1] * share
        return turned(p_i_m, -EARTH_RATE_RADPS * (t_s - self.t_s[0])), clock
