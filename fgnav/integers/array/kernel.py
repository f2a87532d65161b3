"""The search for the integers of least constrained cost, compiled: one epoch after the other.

Of every integer vector within a bound the constrained cost is taken and the best few are held. The
bound shrinks to the least cost found plus a reach within which others still count; where there is
nothing below the first one it is doubled.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.array.nearest import log_volume, nearest, weak_axis
from fgnav.integers.array.relaxation import relaxation
from fgnav.integers.array.volume import log_likelihood
from fgnav.integers.array.walk import (
    AT_LIMIT,
    AT_VECTOR,
    LOOK,
    Walk,
    begin,
    least_distance,
    next_vector,
    walk_of,
)
from fgnav.integers.ils.array_model import LinkArrays, Spans
from fgnav.integers.ils.decorrelation import decorrelate
from fgnav.integers.ils.float_solution import FloatSolution, solve_symmetric
from fgnav.kernels.compiled import kernel

PROVEN, NOTHING, UNPROVEN, UNFINISHED, ILL = range(5)  # how an epoch can end

_COMPLETE = 100  # nodes: what the attitude of a complete vector takes, 1 to 10 us
_DOUBLINGS = 12  # of the bound, until an integer vector is below it
_WIDENED = _DOUBLINGS  # that many tries, and no more


class Found(NamedTuple):
    """Results of the search of every epoch: the best k, by rising cost, and their evidence.

    Of as many as ``cycles`` has room for the integers are written. Costs are infinite, and weights
    minus infinity, where nothing was found.
    """

    cycles: IntArray  # (n, k or fewer, b, m)
    columns: FloatArray  # (n, k, 9): the first 3 r count
    costs: FloatArray  # (n, k)
    log_weights: FloatArray  # (n, k)
    wrong_probability: FloatArray  # (n,): of the best, among all that were found
    log_evidence: FloatArray  # (n,): of all
    status: IntArray  # (n,)
    nodes: IntArray  # (n,)


class _Model(NamedTuple):
    """Data of a complete integer vector's cost, besides its columns."""

    constant: float
    information: FloatArray  # (3 r, 3 r)
    covariance: FloatArray  # (3 r, 3 r): its inverse
    weak_axis: FloatArray  # (3,)


class _Best(NamedTuple):
    """The best decorrelated integers so far."""

    integers: FloatArray  # (k, q)
    columns: FloatArray  # (k, 3 r)
    costs: FloatArray  # (k,)
    log_weights: FloatArray  # (k + 1,): the last of all others together


def nothing_found(shape: tuple[int, ...], *, held: int, written: int) -> Found:
    """Return room for what a search finds.

    Parameters
    ----------
    shape : tuple of int
        Epochs, baselines and channels.
    held, written : int
        How many of an epoch, and of how many with their integers.
    """
    n, b, m = shape
    return Found(
        np.zeros((n, written, b, m), dtype=np.int64),
        np.zeros((n, held, 9)),
        np.full((n, held), np.inf),
        np.full((n, held), -np.inf),
        np.ones(n),
        np.full(n, -np.inf),
        np.full(n, NOTHING),
        np.zeros(n, dtype=np.int64),
    )


@kernel
def search_epochs(
    epochs: LinkArrays,
    arrays: Spans,
    first_bound: FloatArray,
    result: Found,
    reach: float,
    limit: int,
    listed: bool,
) -> None:
    """Search every epoch.

    Parameters
    ----------
    first_bound : ndarray, shape (n,)
    result : Found
        Written.
    reach : float
        Above the least cost.
    limit : int
        Nodes of an epoch.
    listed : bool
        Who wants a list looks for as many as there is room for, up to the reach even beyond the
        first bound, and weighs them by ``log_volume``; who wants a probability weighs all within
        the first bound by ``log_likelihood``.
    """
    for k in range(len(first_bound)):
        relaxed = relaxation(epochs, arrays, k)
        if len(relaxed.links) > 0:
            _search_epoch(relaxed, k, first_bound[k], result, reach, limit, listed)


@kernel
def _search_epoch(
    relaxed: FloatSolution,
    k: int,
    bound: float,
    result: Found,
    reach: float,
    limit: int,
    listed: bool,
) -> None:
    q, u, held = len(relaxed.cycles), len(relaxed.columns), result.costs.shape[1]
    rounded, z_float = np.empty(q), np.empty((q, 1))
    for i in range(q):
        rounded[i] = np.floor(relaxed.cycles[i] + 0.5)
        z_float[i, 0] = relaxed.cycles[i] - rounded[i]
    positive, L, d, T = decorrelate(relaxed.covariance, z_float)
    if not positive:
        result.status[k] = ILL
        return
    model, gain = _model(relaxed, T)
    walk = walk_of(L, d, z_float.reshape(q), relaxed.columns, gain, model.covariance)
    best = _Best(np.zeros((held, q)), np.zeros((held, u)), np.zeros(held), np.zeros(held + 1))
    best.costs[:], best.log_weights[:] = np.inf, -np.inf
    tries, nodes = 0, limit
    begin(walk)
    while True:
        end, norm = next_vector(walk, bound - model.constant, nodes)
        if end == AT_VECTOR:
            walk.place[1] += _enter(walk, model, best, norm, bound, listed)
            bound = min(bound, best.costs[0] + reach)
            if listed:
                bound = min(bound, best.costs[held - 1])
            continue
        if end == AT_LIMIT or tries > _WIDENED:
            break
        if not np.isfinite(best.costs[0]) and tries < _DOUBLINGS - 1:
            bound, tries = 2.0 * bound, tries + 1
        elif listed and best.costs[0] + reach > bound and not np.isfinite(best.costs[held - 1]):
            bound, tries, nodes = best.costs[0] + reach, _WIDENED + 1, limit + walk.place[1]
            best.costs[:] = np.inf
        else:
            break
        begin(walk)
    result.nodes[k] = walk.place[1]
    result.status[k] = UNPROVEN if end == AT_LIMIT else PROVEN
    if not np.isfinite(best.costs[0]):
        result.status[k] = UNFINISHED
    _write(best, rounded, T, relaxed.links, result, k)


@kernel
def _model(relaxed: FloatSolution, T: FloatArray) -> tuple[_Model, FloatArray]:
    """Return the model of complete vectors, and the gain by decorrelated integers, (3 r, q)."""
    u, q = relaxed.gain.shape
    gain, identity = np.zeros((u, q)), np.zeros((u, u))
    for i in range(q):
        for j in range(q):
            if T[i, j] != 0.0:
                for c in range(u):
                    gain[c, i] += relaxed.gain[c, j] * T[i, j]
    for c in range(u):
        identity[c, c] = 1.0
    covariance = solve_symmetric(relaxed.information, identity)
    variance = 0.0
    for c in range(u):
        variance += covariance[c, c]
    axis = weak_axis(relaxed.information, variance)
    return _Model(relaxed.constant, relaxed.information, covariance, axis), gain


@kernel
def _enter(walk: Walk, model: _Model, best: _Best, norm: float, bound: float, listed: bool) -> int:
    """Take the walk's complete vector into account; return its nodes."""
    cost = model.constant + norm
    columns = walk.columns[0]
    if cost + least_distance(columns, model.covariance) > bound:
        return LOOK
    distance, M = nearest(columns, model.information, model.weak_axis)
    if cost + distance > bound:
        return _COMPLETE
    if listed:
        weight = log_volume(M, model.information) - 0.5 * (cost + distance)
    else:
        weight = log_likelihood(columns, model.information, M, distance) - 0.5 * cost
    _insert(best, walk.z, M, cost + distance, weight)
    return _COMPLETE


@kernel
def _insert(best: _Best, z: FloatArray, M: FloatArray, cost: float, weight: float) -> None:
    """Enter a candidate among the best; what is not among them adds to the weight of the others."""
    held = len(best.costs)
    k = held
    while k > 0 and best.costs[k - 1] > cost:
        k -= 1
    dropped = weight if k == held else best.log_weights[held - 1]
    best.log_weights[held] = np.logaddexp(best.log_weights[held], dropped)
    for to in range(held - 1, k - 1, -1):
        best.costs[to] = cost if to == k else best.costs[to - 1]
        best.log_weights[to] = weight if to == k else best.log_weights[to - 1]
        for i in range(len(z)):
            best.integers[to, i] = z[i] if to == k else best.integers[to - 1, i]
        for i in range(len(M)):
            best.columns[to, i] = M[i] if to == k else best.columns[to - 1, i]


@kernel
def _write(
    best: _Best, rounded: FloatArray, T: FloatArray, links: IntArray, result: Found, k: int
) -> None:
    """Turn decorrelated integers back into those of the links; sum up what speaks for them."""
    others = best.log_weights[len(best.costs)]
    for c in range(len(best.costs)):
        if not np.isfinite(best.costs[c]):
            break
        result.costs[k, c], result.log_weights[k, c] = best.costs[c], best.log_weights[c]
        if c > 0:
            others = np.logaddexp(others, best.log_weights[c])
        for i in range(best.columns.shape[1]):
            result.columns[k, c, i] = best.columns[c, i]
        if c < result.cycles.shape[1]:
            for j in range(len(rounded)):
                total = rounded[j]
                for i in range(len(rounded)):
                    total += best.integers[c, i] * T[i, j]
                result.cycles[k, c, links[j, 0], links[j, 1]] = np.int64(total)
    if np.isfinite(best.costs[0]):
        result.wrong_probability[k] = 1.0 / (1.0 + np.exp(best.log_weights[0] - others))
        result.log_evidence[k] = np.logaddexp(best.log_weights[0], others)
