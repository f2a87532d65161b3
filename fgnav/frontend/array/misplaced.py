"""Antennas that are not where the flight states, by the fixed phases of the array alone.

Each epoch's phases have the cost ``|u - minimum|^2`` by J of baselines u in ``n`` (``shape``); the
attitude that fits best takes part of a misplacement c of some antennas, the same in body axes all
along. What is left of it are a score g = dL/dc and its information N, summed over epochs: g' N^-1 g
is chi-square where all antennas are at their stated places.
"""

from typing import NamedTuple

import numpy as np

from fgnav.attitude.array import AttitudeSolution
from fgnav.checks import FloatArray
from fgnav.frontend.array.shape import AT_ONCE, baseline_information
from fgnav.geometry.rotations import skew
from fgnav.graph.correlation import correlated
from fgnav.types.differences import DoubleDifferences

_SQUARES = 22.1  # chi-square of three beyond what is no chance, 6e-5: as of the lever arm
TOLERATED = 1.5**2  # of a variance: a standard deviation off by half
_FEWEST = 30  # epochs, as of noise
_OPEN = 1e-6  # relative eigenvalue: what the attitude takes wholly


class Misplaced(NamedTuple):
    """An antenna, the reference being 0, and by what it is off its place."""

    antenna: int
    off_b_m: FloatArray  # (3,)
    sigma_m: FloatArray  # (3,)


def misplaced(
    differences: DoubleDifferences, ranges_m: FloatArray, attitude: AttitudeSolution
) -> tuple[Misplaced, ...]:
    """Return the antennas that are off, found one by one, the surest first.

    Parameters
    ----------
    differences : DoubleDifferences
    ranges_m : ndarray, shape (n, b, m)
        Without integers; NaN where there are none.
    attitude : AttitudeSolution
        The likeliest by these ranges.
    """
    scores = _scores(differences, ranges_m, attitude)
    if scores is None:
        return ()
    antennas, fit = len(differences.baselines_b_m) + 1, None
    antennas_off: list[int] = []
    while len(antennas_off) < antennas - 1:
        fits = [_fit(scores, [*antennas_off, a]) for a in range(antennas) if a not in antennas_off]
        best = max(fits, key=lambda one: one.squares)
        if best.squares - (0.0 if fit is None else fit.squares) <= _SQUARES * best.noise:
            break
        antennas_off, fit = list(best.antennas), best
    if fit is None or fit.noise > TOLERATED:  # something else is wrong, too
        return ()
    return tuple(
        Misplaced(a, fit.off_m[3 * i : 3 * i + 3], fit.sigma_m[3 * i : 3 * i + 3])
        for i, a in enumerate(fit.antennas)
    )


class _Scores(NamedTuple):
    """Scores of all antennas' misplacements by epoch."""

    g: FloatArray  # (n, 3 a)
    N: FloatArray  # (n, 3 a, 3 a)
    squares: float  # of all residuals
    freedom: int


class _Fit(NamedTuple):
    """Misplacements of some antennas that fit best."""

    antennas: tuple[int, ...]
    off_m: FloatArray
    sigma_m: FloatArray
    squares: float  # that they take of the residuals
    noise: float  # variance factor of what is left, correlated as it is


def _scores(
    differences: DoubleDifferences, ranges_m: FloatArray, attitude: AttitudeSolution
) -> _Scores | None:
    rows = np.flatnonzero(attitude.solved & (attitude.degrees_of_freedom > 0))
    if len(rows) < _FEWEST:
        return None
    a = 3 * len(differences.baselines_b_m) + 3
    g, N = np.empty((len(rows), a)), np.empty((len(rows), a, a))
    for first in range(0, len(rows), AT_ONCE):
        part = slice(first, first + AT_ONCE)
        at = rows[part]
        g[part], N[part] = _of_places(differences[at], ranges_m[at], attitude.R_nb[at])
    return _Scores(
        g=g,
        N=N,
        squares=float(attitude.chi_square[rows].sum()),
        freedom=int(attitude.degrees_of_freedom[rows].sum()),
    )


def _of_places(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return score, (n, 3 a), and information, (n, 3 a, 3 a), beside attitudes of every epoch."""
    J, h = baseline_information(differences, ranges_m)
    arms_b_m = differences.baselines_b_m
    b, n = len(arms_b_m), len(R_nb)
    u = (R_nb @ arms_b_m.T).swapaxes(1, 2).reshape(n, -1)
    slope = h - np.einsum("nij,nj->ni", J, u)
    by_turn = -(R_nb[:, None] @ skew(arms_b_m)).reshape(n, -1, 3)
    by_place = np.zeros((n, 3 * b, 3 * b + 3))
    for k in range(b):
        columns = slice(3 * k, 3 * k + 3)
        by_place[:, columns, :3], by_place[:, columns, 3 * k + 3 : 3 * k + 6] = -R_nb, R_nb
    turned = by_turn.swapaxes(1, 2) @ J
    taken = np.linalg.pinv(turned @ by_turn, hermitian=True) @ (turned @ by_place)
    remainder = by_place - by_turn @ taken
    return np.einsum("nji,nj->ni", remainder, slope), remainder.swapaxes(1, 2) @ J @ remainder


def _fit(scores: _Scores, antennas: list[int]) -> _Fit:
    columns = np.concatenate([3 * a + np.arange(3) for a in antennas])
    g, N = scores.g[:, columns], scores.N[:, columns[:, None], columns]
    covariance = np.linalg.pinv(N.sum(axis=0), rcond=_OPEN, hermitian=True)
    off_m = covariance @ g.sum(axis=0)
    squares = float(g.sum(axis=0) @ off_m)
    remainder = g - N @ off_m
    freedom = max(scores.freedom - len(columns), 1)
    noise = (scores.squares - squares) / freedom
    noise *= correlated(remainder / np.sqrt(np.einsum("nii->ni", N).mean(axis=0).clip(1e-30)))
    return _Fit(
        tuple(antennas), off_m, np.sqrt(noise * np.diag(covariance).clip(0)), squares, noise
    )
