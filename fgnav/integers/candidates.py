"""The integer vectors of least constrained cost, several for every epoch, for whoever ranks them.

The search is that of ``fgnav.integers.constrained_search``. It keeps the best few instead of two,
and looks as far above the least cost as it is told to, whatever chi-square says of that: a bad link
can make the true integers cost more than wrong ones, and both of them more than noise would.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.affine import Epochs, epochs_of
from fgnav.integers.constrained_nearest import log_volume, nearest
from fgnav.integers.constrained_relaxation import Spans, relaxation, spans
from fgnav.integers.constrained_search import (
    FIRST_BOUND,
    ILL,
    NOTHING,
    PROVEN,
    UNFINISHED,
    UNPROVEN,
    _complete_model,
    _Epoch,
    _least_distance,
    _levels,
)
from fgnav.integers.epochs import epochs_at
from fgnav.integers.ils import decorrelate, kernel

_BLOCK = 256  # epochs whose lists are held at full length
_COMPLETE, _REJECTED = 100, 5  # nodes, as in the search for the best
_DOUBLINGS = 12  # of the bound, until an integer vector is below it


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Candidates:
    """Integer vectors that an epoch may have, those of an epoch together, the cheapest first.

    Attributes
    ----------
    epoch : ndarray of int64, shape (c,)
        To which each belongs; rising.
    cycles : ndarray of int64, shape (c, b, m)
        0 where there is no link.
    baselines_n_m : ndarray, shape (c, b, 3)
        At the candidate's own best attitude; 0 of an antenna that has no link.
    cost : ndarray, shape (c,)
        Weighted square sum of code and phase residuals.
    log_volume : ndarray, shape (c,)
        Of attitudes around the best: ``log_volume - cost / 2`` is the logarithm of a candidate's
        weight in the posterior of Gaussian noise.
    status : ndarray of int64, shape (n,)
        How each epoch's search ended, as in ``ConstrainedSearch``.
    """

    epoch: IntArray
    cycles: IntArray
    baselines_n_m: FloatArray
    cost: FloatArray
    log_volume: FloatArray
    status: IntArray


class _List(NamedTuple):
    """The best so far, by rising cost; infinite cost where there is none yet."""

    integers: FloatArray  # (k, q)
    columns: FloatArray  # (k, u)
    cost: FloatArray  # (k,)
    log_volume: FloatArray  # (k,)


class _Block(NamedTuple):
    """What the search writes of the epochs of a block."""

    cycles: IntArray  # (n, k, b, m)
    baselines_n_m: FloatArray  # (n, k, b, 3)
    cost: FloatArray  # (n, k)
    log_volume: FloatArray  # (n, k)
    status: IntArray  # (n,)


def candidates(
    differences: DoubleDifferences, *, most: int = 32, reach: float = 25.0, nodes: int = 10**6
) -> Candidates:
    """Return up to ``most`` integer vectors of each epoch.

    Parameters
    ----------
    differences : DoubleDifferences
    most : int
        Of an epoch.
    reach : float
        No candidate is missed, but for ``most`` and ``nodes``, whose cost is less than this above
        the least; dearer ones that the search came by are there as well.
    nodes : int
        What the search of an epoch may visit; the attitude of a complete vector counts as 100.

    Raises
    ------
    BadInputError
        If ``most``, ``reach`` or ``nodes`` is not positive.
    """
    for name, value in {"most": most, "reach": reach, "nodes": nodes}.items():
        if not value > 0:
            raise BadInputError(f"{name}: must be above 0, got {value}")
    n = len(differences.t_s)
    arrays = spans(differences.baselines_b_m, differences.resolvable)
    parts = []
    for start in range(0, max(n, 1), _BLOCK):
        at = np.arange(start, min(start + _BLOCK, n))
        some = differences if n <= _BLOCK else epochs_at(differences, at)
        of_block = arrays._replace(pattern=arrays.pattern[at])
        parts.append(_flat(_searched(some, of_block, most, reach, nodes), start))
    if len(parts) == 1:
        return parts[0]
    joined = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(parts[0])}
    return Candidates(**joined)


def _searched(
    differences: DoubleDifferences, arrays: Spans, most: int, reach: float, nodes: int
) -> _Block:
    n, b, m = differences.phase_m.shape
    epochs = epochs_of(differences)
    links = epochs.resolvable.sum(axis=(1, 2))
    angles = np.where(arrays.rank[arrays.pattern] == 1, 2, 3)
    first_bound = chdtri(np.maximum(2 * links - angles, 1), FIRST_BOUND)
    block = _Block(
        np.zeros((n, most, b, m), dtype=np.int64),
        np.zeros((n, most, b, 3)),
        np.full((n, most), np.inf),
        np.zeros((n, most)),
        np.full(n, NOTHING),
    )
    _search_block(epochs, arrays, block, first_bound, reach, nodes)
    return block


def _flat(block: _Block, start: int) -> Candidates:
    there = np.isfinite(block.cost)
    return Candidates(
        epoch=np.nonzero(there)[0] + start,
        cycles=block.cycles[there],
        baselines_n_m=block.baselines_n_m[there],
        cost=block.cost[there],
        log_volume=block.log_volume[there],
        status=block.status,
    )


@kernel
def _search_block(
    epochs: Epochs,
    arrays: Spans,
    block: _Block,
    first_bound: FloatArray,
    reach: float,
    limit: int,
) -> None:
    no_columns, no_information = np.zeros((0, 9)), np.zeros((0, 9, 9))
    most = block.cost.shape[1]
    for k in range(len(first_bound)):
        relaxed = relaxation(epochs, arrays, k, no_columns, no_information)
        q, u = len(relaxed.links), len(relaxed.columns)
        if q == 0:
            continue
        whole = np.floor(relaxed.cycles + 0.5)
        carried = (relaxed.cycles - whole).reshape(q, 1)
        positive, L, d, T = decorrelate(relaxed.covariance, carried)
        if not positive:
            block.status[k] = ILL
            continue
        epoch = _complete_model(relaxed, carried[:, 0].copy(), T)
        best = _List(
            np.zeros((most, q)), np.zeros((most, u)), np.full(most, np.inf), np.zeros(most)
        )
        finished = _fill(L, d, epoch, best, first_bound[k], reach, limit)
        block.status[k] = PROVEN if finished else UNPROVEN
        if not np.isfinite(best.cost[0]):
            block.status[k] = UNFINISHED
        _write(best, whole, T, relaxed.links, arrays.coordinates_m[arrays.pattern[k]], block, k)


@kernel
def _write(
    best: _List,
    whole: FloatArray,
    T: FloatArray,
    links: IntArray,
    coordinates_m: FloatArray,
    block: _Block,
    k: int,
) -> None:
    """Turn decorrelated integers and columns back into those of the links and baselines."""
    q, u = len(whole), best.columns.shape[1]
    for c in range(len(best.cost)):
        if not np.isfinite(best.cost[c]):
            break
        block.cost[k, c], block.log_volume[k, c] = best.cost[c], best.log_volume[c]
        for j in range(q):
            total = whole[j]
            for i in range(q):
                total += best.integers[c, i] * T[i, j]
            block.cycles[k, c, links[j, 0], links[j, 1]] = np.int64(total)
        for i in range(len(coordinates_m)):
            for v in range(u):
                along_m = best.columns[c, v] * coordinates_m[i, v // 3]
                block.baselines_n_m[k, c, i, v % 3] += along_m


@kernel
def _fill(
    L: FloatArray,
    d: FloatArray,
    epoch: _Epoch,
    best: _List,
    bound: float,
    reach: float,
    limit: int,
) -> bool:
    """Search up to the bound, doubled until there is something, then on to the reach above that."""
    visited, finished = 0, True
    for _ in range(_DOUBLINGS):
        finished, more = _enumerate(L, d, epoch, best, bound, reach, limit - visited)
        visited += more
        if not finished or np.isfinite(best.cost[0]):
            break
        bound *= 2.0
    wider = best.cost[0] + reach
    if finished and wider > bound and not np.isfinite(best.cost[-1]):
        best.cost[:] = np.inf
        finished, _ = _enumerate(L, d, epoch, best, wider, reach, limit)
    return bool(finished)


@kernel
def _enumerate(
    L: FloatArray,
    d: FloatArray,
    epoch: _Epoch,
    best: _List,
    bound: float,
    reach: float,
    limit: int,
) -> tuple[bool, int]:
    """Visit all integers whose relaxed cost is within the bound, nearest first."""
    n, u = len(d), len(epoch.columns)
    turned, covariances, useful = _levels(L, d, epoch)
    columns = np.zeros((n + 1, u))
    columns[n] = epoch.columns
    above = np.zeros((n, n))
    norm_above, centre, z, step = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    k = n - 1
    centre[k] = epoch.z_float[k]
    z[k] = np.floor(centre[k] + 0.5)
    step[k] = 1.0 if centre[k] >= z[k] else -1.0
    visited = 0
    while visited < limit:
        visited += 1
        gap = centre[k] - z[k]
        norm = norm_above[k] + gap * gap / d[k]
        if norm < bound - epoch.constant:
            for c in range(u):
                columns[k, c] = columns[k + 1, c] + turned[c, k] * gap
            least = norm
            if useful[k] and k > 0:
                visited += _REJECTED
                least += _least_distance(columns[k], covariances[k])
            if k > 0 and least < bound - epoch.constant:
                k -= 1
                norm_above[k] = norm
                for j in range(k + 1):
                    above[k, j] = above[k + 1, j] - gap * L[k + 1, j]
                centre[k] = epoch.z_float[k] + above[k, k]
                z[k] = np.floor(centre[k] + 0.5)
                step[k] = 1.0 if centre[k] >= z[k] else -1.0
                continue
            if k == 0:
                effort, bound = _complete(z, norm, columns[0], epoch, best, bound, reach)
                visited += effort
        elif k == n - 1:
            return True, visited
        else:
            k += 1
        z[k] += step[k]
        step[k] = -step[k] - (1.0 if step[k] > 0 else -1.0)
    return False, visited


@kernel
def _complete(
    z: FloatArray,
    norm: float,
    columns: FloatArray,
    epoch: _Epoch,
    best: _List,
    bound: float,
    reach: float,
) -> tuple[int, float]:
    """Enter a complete integer vector; return its nodes and the bound from now on."""
    cost = epoch.constant + norm
    if cost + _least_distance(columns, epoch.covariance) > bound:
        return _REJECTED, bound
    distance, M = nearest(columns, epoch.information, epoch.weak_axis)
    cost += distance
    if cost > bound:
        return _COMPLETE, bound
    place = len(best.cost) - 1
    if cost < best.cost[place]:
        while place > 0 and best.cost[place - 1] > cost:
            best.cost[place] = best.cost[place - 1]
            best.log_volume[place] = best.log_volume[place - 1]
            best.integers[place] = best.integers[place - 1]
            best.columns[place] = best.columns[place - 1]
            place -= 1
        best.cost[place], best.log_volume[place] = cost, log_volume(M, epoch.information)
        best.integers[place], best.columns[place] = z, M
    return _COMPLETE, min(bound, best.cost[0] + reach, best.cost[-1])
