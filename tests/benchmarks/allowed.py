"""How much better a smoother may be than a filter: errors drawn from the model that both have."""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.methods.smoother.batch import solve_batch
from fgnav.methods.smoother.chain import STATE, Chain
from fgnav.methods.smoother.collect import Collected
from fgnav.methods.smoother.linear import blocks_of, eliminated

_ROUNDING = 1e-12  # of information in units of its own; noise of a link's motion is above


def allowed_peaks(
    collected: Collected, during: BoolArray, draws: int, rng: np.random.Generator
) -> FloatArray:
    """Return mean peaks of errors at some keyframes, (2, 2): of the smoother, then the filter.

    Of rotation, rad, and position, m. Measurements and motion err as their own noise says, linear
    at the batch's solution: a link of information ``J'J`` has its right-hand side shifted by
    ``J'e``, which has that very covariance. The error that all positions share is in both.

    Parameters
    ----------
    collected : Collected
    during : ndarray of bool, shape (n,)
        Keyframes to look at.
    draws : int
    rng : Generator
    """
    solution = solve_batch(collected.keyframes)
    there = replace(
        collected.keyframes,
        R_nb=solution.R_nb,
        p_n_m=solution.p_n_m,
        v_n_mps=solution.v_n_mps,
        slot=solution.slot,
    )
    chain = eliminated(next(blocks_of(there, [0], len(during))), 1.0)
    root = _roots(chain.link[:, :-1, :-1])
    rows = np.flatnonzero(during)
    common = np.linalg.cholesky(collected.common_position_m2[rows].mean(axis=0))
    peaks = []
    for _ in range(draws):
        errors = _errors(chain, root, rows, rng)
        common_n_m = common @ rng.standard_normal(3)
        errors[:, :, 3:] += common_n_m @ solution.R_nb[rows]  # the chain has positions in body axes
        sizes = np.linalg.norm(errors.reshape(2, len(rows), 2, 3), axis=3)
        peaks.append(sizes.max(axis=1))
    return np.asarray(np.mean(peaks, axis=0))


def _roots(information: FloatArray) -> FloatArray:
    """Return square roots, (n, k, k), of what links say; what is rounding of it is nothing."""
    size = np.sqrt(np.einsum("nii->ni", information)).clip(np.finfo(float).tiny)
    value, vectors = np.linalg.eigh(information / size[:, :, None] / size[:, None, :])
    value[value < _ROUNDING] = 0.0
    return np.asarray(size[:, :, None] * vectors * np.sqrt(value)[:, None])


def _errors(chain: Chain, root: FloatArray, rows: IntArray, rng: np.random.Generator) -> FloatArray:
    """Return errors of one draw, (2, m, 6): of states given all links, and given those before."""
    last = len(root) - 1
    e = rng.standard_normal(root.shape[:2])
    chain.link[:, :-1, -1] = chain.link[:, -1, :-1] = np.einsum("nij,nj->ni", root, e)
    chain.link[:, -1, -1] = (e**2).sum(axis=1)
    chain.begin(0)
    chain.eliminate(0, last)
    smoothed = chain.step(0, last)[0][rows, :STATE]
    filtered = np.stack([chain.step(k, k)[0][0, :STATE] for k in rows])
    return np.stack([smoothed, filtered])[:, :, :6]
