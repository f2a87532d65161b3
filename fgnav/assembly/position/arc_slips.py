"""Slips that nobody flagged, along arcs against a base: detected, identified, adapted [1]_.

A slip shows in the innovation of an epoch's phases before the update: rows without the place of the
antenna are known to millimetres. The arc whose shift explains most of it is the one, if that is by
half a cycle or more, and what is left is noise. A new arc begins there.

References
----------
.. [1] P. J. G. Teunissen, "Quality control in integrated navigation systems", IEEE Aerospace and
   Electronic Systems Magazine 5, 1990.
"""

from typing import NamedTuple

import numpy as np

from fgnav.assembly.position.ambiguity_filter import Ambiguities, ArcNames
from fgnav.checks import FloatArray

_FALSE_ALARM = 1e-4  # of the test of an epoch's innovation
_STEP_CYCLES = 0.5  # half of one, where the sign of the carrier is not resolved
_UNTESTABLE = 1e-9  # of what another arc's shift shows by


class Slip(NamedTuple):
    """A phase that jumped."""

    arc: int  # of its block's
    cycles: float


def slips(state: Ambiguities, H: FloatArray, z: FloatArray, names: ArcNames) -> tuple[Slip, ...]:
    """Return the slips that an epoch's innovation shows; none where they do not explain it."""
    if not len(z):
        return ()
    A, P = state.solved()
    r, S = z - H @ A, np.eye(len(z)) + H @ P @ H.T
    weighted = np.linalg.solve(S, np.c_[r, H[:, : len(names.arc)] * names.wavelength_m])
    if r @ weighted[:, 0] <= largest(len(z)):
        return ()
    shift, W = H[:, : len(names.arc)] * names.wavelength_m, weighted[:, 1:]
    chosen: list[int] = []
    while len(chosen) < len(z) - 1:
        left = _explained_by(shift, W, r, chosen)
        a = int(left.argmax())
        chosen.append(a)
        normal = shift[:, chosen].T @ W[:, chosen]
        cycles = np.linalg.solve(normal, W[:, chosen].T @ r)
        if np.abs(cycles).min() < _STEP_CYCLES / 2:
            return ()
        rest = r @ weighted[:, 0] - cycles @ (W[:, chosen].T @ r)
        if rest <= largest(len(z) - len(chosen)):
            return tuple(map(Slip, chosen, cycles.tolist()))
    return ()


def _explained_by(shift: FloatArray, W: FloatArray, r: FloatArray, chosen: list[int]) -> FloatArray:
    """Return by how much each arc's shift lowers the cost, (c,), beside those chosen."""
    normal, pull = shift.T @ W, W.T @ r
    if chosen:
        gain = np.linalg.solve(normal[np.ix_(chosen, chosen)], normal[chosen])
        pull = pull - gain.T @ pull[chosen]
        normal = normal - normal[:, chosen] @ gain
    squares = np.diag(normal)
    testable = squares > _UNTESTABLE * np.diag(shift.T @ W).max()  # a new arc shows no slip
    return np.where(testable, pull**2 / np.where(testable, squares, 1.0), 0.0)


def largest(freedom: int) -> float:
    """Return the sum of squares that noise exceeds next to never."""
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: keeps the command line quick

    return float(chdtri(freedom, _FALSE_ALARM))
