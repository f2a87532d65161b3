"""Whitened rows without clocks, made of the few numbers that each epoch and block have of its own.

Rows of k channels and d arcs have k d numbers, nearly all of them zero before clocks are
eliminated. Kept is what they are made of, a twentieth of the memory.

Of the channels of one clock, whitened, the clock is a column along a unit vector u. Householder's
reflection turns it into the first axis [1]_: with w = u + (1, 0, ..., 0) all rows but the first of

    I - w w' / (1 + u_1)

are an orthonormal basis of what the clock leaves open.

References
----------
.. [1] Golub, Van Loan: Matrix Computations, 4th edition, 2013, section 5.1.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import ArcBlock, PhaseRows
from fgnav.kernels.compiled import kernel


class Channels(NamedTuple):
    """Indices of c channels into A = (ambiguities, errors of satellites, their rates).

    Clock after clock.
    """

    clock: IntArray  # (c,), counted from 0
    ambiguity: IntArray  # (c,); -1 of codes
    satellite: IntArray  # (c,); -1 where its errors are taken off
    ambiguities: int
    satellites: int

    @property
    def freedom(self) -> int:
        """Number of rows that are free of clocks."""
        return len(self.clock) - (1 + int(self.clock[-1]) if len(self.clock) else 0)


class Epoch(NamedTuple):
    """Measurements of the channels at an epoch."""

    channels: Channels
    seen: FloatArray  # (c, 4), direction away from the satellite, then metres
    sigma_m: FloatArray  # (c,)
    age_s: float  # since its block began

    def whitened(self) -> PhaseRows:
        """Return its rows without clocks."""
        return PhaseRows(*_whitened(*self.channels, self.age_s, self.sigma_m, self.seen))


class Transition(NamedTuple):
    """Transition from A of the previous block to A' of a block, with its first epoch's codes."""

    begin_row: int
    sigma: FloatArray  # (d',), of what is added; of A' where nothing leads to it
    source: IntArray  # (d',), place in A; -1 where nothing leads to it
    dt_s: float
    size: tuple[int, int]  # ambiguities and satellites of A
    codes: Epoch  # phase less code

    def whitened(self) -> ArcBlock:
        """Return its rows."""
        channels, code = self.codes.channels, self.codes.whitened()
        c, s = channels.ambiguities, channels.satellites
        d, m = len(self.sigma), len(code.z)
        before, after = np.zeros((d + m, self.size[0] + 2 * self.size[1])), np.zeros((d + m, d))
        goes_on = np.flatnonzero(self.source >= 0)
        before[goes_on, self.source[goes_on]] = 1 / self.sigma[goes_on]
        errors = goes_on[(goes_on >= c) & (goes_on < c + s)]
        before[errors, self.source[errors] + self.size[1]] = self.dt_s / self.sigma[errors]
        diagonal = np.arange(d)
        after[diagonal, diagonal], after[d:] = 1 / self.sigma, code.H
        return ArcBlock(self.begin_row, before, after, np.append(np.zeros(d), code.z), s)


def by_clock(*groups: IntArray) -> tuple[IntArray, IntArray]:
    """Return channels in the order of their clocks, (c,), and these, counted from 0, (c,).

    Parameters
    ----------
    *groups : ndarray of int
        Carriers of channels that share no clock with the others: of phases, of codes.
    """
    kind = np.repeat(np.arange(len(groups)), [len(one) for one in groups])
    group = np.concatenate(groups)
    order = np.lexsort((group, kind))
    changes = (np.diff(group[order]) != 0) | (np.diff(kind[order]) != 0)
    return order, np.append(np.zeros(min(len(order), 1), np.int64), np.cumsum(changes))


@kernel
def _whitened(
    clock: IntArray,
    ambiguity: IntArray,
    satellite: IntArray,
    ambiguities: int,
    satellites: int,
    age_s: float,
    sigma: FloatArray,
    seen: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    A = _derivatives(ambiguity, satellite, ambiguities, satellites, age_s)
    place = without_clocks(clock, sigma, seen)
    return place[:, :3].copy(), without_clocks(clock, sigma, A), place[:, 3].copy()


@kernel
def _derivatives(
    ambiguity: IntArray,
    satellite: IntArray,
    ambiguities: int,
    satellites: int,
    age_s: float,
) -> FloatArray:
    """Compute the derivatives of measurements by A, (c, d), at a time since their block began."""
    A = np.zeros((len(ambiguity), ambiguities + 2 * satellites))
    for i in range(len(ambiguity)):
        if ambiguity[i] >= 0:
            A[i, ambiguity[i]] = 1.0
        if satellite[i] >= 0:
            A[i, ambiguities + satellite[i]] = 1.0
            A[i, ambiguities + satellites + satellite[i]] = age_s
    return A


@kernel
def without_clocks(clock: IntArray, sigma: FloatArray, rows: FloatArray) -> FloatArray:
    """Return whitened combinations, (c - g, d), of c rows in which no clock of g is left.

    Parameters
    ----------
    clock : ndarray of int, shape (c,)
        Increasing; rows contain those as they are.
    sigma : ndarray, shape (c,)
    rows : ndarray, shape (c, d)
    """
    n, d = rows.shape
    out, common, count, first = np.empty((n, d)), np.empty(d), 0, 0
    while first < n:
        end, squared = first, 0.0
        while end < n and clock[end] == clock[first]:
            squared += 1 / sigma[end] ** 2
            end += 1
        norm = np.sqrt(squared)
        most = 1 + 1 / (sigma[first] * norm)
        for j in range(d):
            common[j] = rows[first, j] / sigma[first] * most
        for i in range(first + 1, end):
            scale = 1 / (sigma[i] ** 2 * norm)
            for j in range(d):
                common[j] += scale * rows[i, j]
        for i in range(first + 1, end):
            share = 1 / (sigma[i] * norm * most)
            for j in range(d):
                out[count, j] = rows[i, j] / sigma[i] - share * common[j]
            count += 1
        first = end
    return out[:count]
