"""The greatest penalised likelihood of noises, by scoring steps on one linearised chain."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.identification.likelihood.linear_chain import LinearChain, Score

_FAR = 4.0  # of squares over redundancy: beyond, theta moves by half its logarithm
_MOST_STEP = 1.2  # of theta: a factor of 3.3
_STEPS = 30
_SETTLED = 0.03  # of theta: 3 % of a standard deviation
_HALVINGS = 4


class Found(NamedTuple):
    """Where the likelihood is greatest."""

    theta: FloatArray  # (c,)
    sigma: FloatArray  # (c,), of theta; of fixed ones as if they were free
    score: Score
    settled: bool


def search(
    chain: LinearChain,
    theta: FloatArray,
    free: BoolArray,
    prior: tuple[FloatArray, FloatArray],
    least: FloatArray | None = None,
) -> Found | None:
    """Return the greatest likelihood times a normal prior of theta.

    Scoring; a step that goes too far is shortened. Far off, the fixed point
    ``exp(2 theta) *= squares / redundancy`` [1]_.

    Parameters
    ----------
    chain : LinearChain
    theta : ndarray, shape (c,)
        Where the search begins.
    free : ndarray of bool, shape (c,)
        Which to search for.
    prior : tuple of ndarray, shapes (c,), (c,)
        Mean and sigma of theta.
    least : ndarray, shape (c,), optional
        Theta is not searched below; minus infinity where there is no bound, as by default.

    References
    ----------
    .. [1] Foerstner, Ein Verfahren zur Schaetzung von Varianz- und Kovarianzkomponenten, 1979.
    """
    mean, weight = prior[0], 1 / prior[1] ** 2
    least = np.full(len(theta), -np.inf) if least is None else least
    theta = np.where(free, np.maximum(theta, least), theta)
    score = chain.score(theta)
    if score is None:
        return None
    settled = not free.any()
    for _ in range(0 if settled else _STEPS):
        uphill = score.gradient - weight * (theta - mean)
        own = np.flatnonzero(free & ((theta > least) | (uphill > 0)))
        gradient = uphill[own]
        H = score.information[np.ix_(own, own)] + np.diag(weight[own])
        step = np.linalg.solve(H, gradient)
        ratio = (score.squares / score.redundancy.clip(1e-3)).clip(1e-6)[own]
        far = (ratio > _FAR) | (ratio < 1 / _FAR)
        step = np.where(far & (score.redundancy[own] > 1), np.log(ratio) / 2, step)
        step = np.maximum(step.clip(-_MOST_STEP, _MOST_STEP), least[own] - theta[own])
        trial = _uphill(chain, theta, own, step, (score, mean, weight))
        if trial is None:
            break
        moved = np.abs(trial[0] - theta).max()
        theta, score = trial
        if moved < _SETTLED:
            settled = True
            break
    sigma = 1 / np.sqrt(np.diag(score.information) + weight)
    return Found(theta, sigma, score, settled)


def _uphill(
    chain: LinearChain,
    theta: FloatArray,
    own: IntArray,
    step: FloatArray,
    at: tuple[Score, FloatArray, FloatArray],
) -> tuple[FloatArray, Score] | None:
    """Return theta a step further where the penalised likelihood is greater; None if nowhere."""
    score, mean, weight = at

    def penalised(of: Score, theta: FloatArray) -> float:
        return of.log_likelihood - float(weight @ (theta - mean) ** 2) / 2

    here = penalised(score, theta)
    for half in range(_HALVINGS):
        trial = theta.copy()
        trial[own] += step / 3**half
        there = chain.score(trial)
        if there is not None and penalised(there, trial) >= here:
            return trial, there
    return None
