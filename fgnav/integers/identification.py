"""Which links contradict the others of their epoch: w-tests, and their exclusion [1]_.

An epoch whose residuals are no noise loses the link, of one antenna to one satellite, that explains
them best, is solved again and tested again. Searches of integers and arrays with given integers go
the same way.

References
----------
.. [1] W. Baarda, "A testing procedure for use in geodetic networks", Netherlands Geodetic
   Commission 2 (5), 1968.
"""

from collections.abc import Sequence
from typing import NamedTuple, Protocol, Self, TypeVar

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.clock_free import clock_free
from fgnav.types.differences import DoubleDifferences

_EXCLUDED_AT_MOST = 0.2  # of an epoch's differences
# That stay at least: three take the attitude, and wrong integers fit the others, 8 mm within 190,
# in one of 1e5 epochs or fewer.
_LEFT_AT_LEAST = 10
_UNTESTABLE = 1e-9  # of a residual's weight: nothing else checks the link
_OPEN = 1e-9  # relative information: an array in a line leaves the turn about itself open


class Residuals(NamedTuple):
    """Double differences less what an array and its integers make of them, of code or of phase."""

    off_m: FloatArray  # (n, b, m): NaN of what takes no part, 0 at references
    variance_m2: FloatArray  # (n, m), of undifferenced links


class Solution(Protocol):
    """Epochs solved by least squares, whose links can be left out."""

    def fails(self) -> BoolArray:
        """Return the mask of epochs that fail the chi-square test of their residuals, (n,)."""

    def w_tests(self, rows: IntArray) -> FloatArray:
        """Return the squared w-test of each link of some epochs, (k, b + 1, m)."""

    def without(self, rows: IntArray, links: BoolArray) -> Self:
        """Return a copy, some epochs solved without links, (k, b + 1, m), and no others."""


Solved = TypeVar("Solved", bound=Solution)


def exclude_links(solved: Solved, links: BoolArray, rounds: int) -> tuple[Solved, BoolArray]:
    """Leave the worst link of each failing epoch out and solve it again, until it passes.

    An antenna that loses more than half of its links loses all of them. An epoch that does not
    pass, or would lose more than a fifth or keep fewer than ten, is left with all of them.

    Parameters
    ----------
    solved : Solution
    links : ndarray of bool, shape (n, b, m)
        Double differences that it is of.
    rounds : int
        How often at most.

    Returns
    -------
    Solution
    ndarray of bool, shape (n, b + 1, m)
        Links left out, the reference antenna's first.
    """
    n, b, m = links.shape
    count, half = links.sum(axis=(1, 2)), links.sum(axis=2) / 2
    allowed = np.minimum(_EXCLUDED_AT_MOST * count, (count - _LEFT_AT_LEAST).clip(0))
    out, given_up = np.zeros((n, b + 1, m), dtype=np.bool_), allowed < 1
    for _ in range(rounds):
        rows = np.flatnonzero(solved.fails() & ~given_up)
        if not len(rows):
            break
        tests = np.where(out[rows], -np.inf, solved.w_tests(rows)).reshape(len(rows), -1)
        out.reshape(n, -1)[rows, tests.argmax(axis=1)] = True
        lost = links[rows] & (out[rows, 1:] | out[rows, :1])
        lost |= links[rows] & (lost.sum(axis=2) > half[rows])[:, :, None]
        out[rows, 1:] |= lost & ~out[rows, :1]
        given_up[rows] = lost.sum(axis=(1, 2)) > allowed[rows]
        solved = solved.without(rows, out[rows])
    rows = np.flatnonzero((solved.fails() | given_up) & out.any(axis=(1, 2)))
    out[rows] = False
    return solved.without(rows, out[rows]), out


def w_tests(
    differences: DoubleDifferences, measured: Sequence[Residuals], baselines_n_m: FloatArray
) -> FloatArray:
    """Return the squared w-test of each link, (n, b + 1, m), the reference antenna's first.

    What the weighted square sum of residuals falls by when the link's own error becomes an unknown
    [1]_, the attitude and clocks of satellites and receivers adjusted along; of code and phase
    together the sum of both. Of two antennas, whose errors are one and the same, the second's.

    Parameters
    ----------
    differences : DoubleDifferences
    measured : sequence of Residuals
        All of the same links.
    baselines_n_m : ndarray, shape (n, b, 3)
        Where residuals are taken.
    """
    n, b, m = measured[0].off_m.shape
    finite = np.isfinite(measured[0].off_m)
    present = np.concatenate([finite.any(axis=1, keepdims=True), finite], axis=1)
    values = np.zeros((n, b + 1, m, 4))  # the range's derivatives by three turns, and the residual
    values[:, 1:, :, :3] = -np.cross(baselines_n_m[:, :, None], differences.e_n[:, None])
    parts, normal = [], np.zeros((n, 4, 4))
    for kind in measured:
        values[:, 1:, :, 3] = np.where(finite, kind.off_m, 0.0)
        residuals = clock_free(differences.group, present, kind.variance_m2, values)
        normal += residuals.normal
        parts.append(residuals)
    attitude = np.linalg.pinv(normal[:, :3, :3], rcond=_OPEN, hermitian=True)
    turn = attitude @ normal[:, :3, 3:]
    total = np.zeros(present.shape)
    for residuals, kind in zip(parts, measured, strict=True):
        J = residuals.weighted[..., :3]
        pull = residuals.weighted[..., 3] - np.einsum("najc,nc->naj", J, turn[:, :, 0])
        redundancy = residuals.certain - np.einsum(
            "najc,ncd,najd->naj", J, attitude, J, optimize=True
        )
        testable = redundancy > _UNTESTABLE / kind.variance_m2[:, None]
        total += np.where(testable, pull**2 / np.where(testable, redundancy, 1.0), 0.0)
    if b == 1:
        total[:, 0] = 0.0
    return total


def touched(differences: DoubleDifferences, links: BoolArray) -> BoolArray:
    """Return the double differences, (n, b, m), that links, (n, b + 1, m), take part in.

    Each is made of four: of its channel and of the group's reference, at its antenna and at the
    reference antenna.
    """
    of_reference = differences.reference[:, differences.group].clip(0)[:, None, :]
    either = links | np.take_along_axis(links, of_reference, axis=2)
    return np.asarray(either[:, 1:] | either[:, :1])
