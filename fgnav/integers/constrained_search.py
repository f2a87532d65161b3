"""The integers of least constrained cost, epoch by epoch, with what speaks for the others.

All integer vectors whose relaxed cost is below a bound are enumerated depth first after LAMBDA's
decorrelation, nearest first; each that gets through is given its constrained cost. The first bound
is where chi-square would refuse the epoch anyway; it shrinks to the least constrained cost found
plus a reach within which candidates still count against the best. What is returned is therefore
the minimum, and the posterior misses no candidate within that reach.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.affine import Epochs, epochs_of
from fgnav.integers.constrained_nearest import log_volume, nearest, weak_axis
from fgnav.integers.constrained_relaxation import Relaxation, Spans, relaxation, solved, spans
from fgnav.integers.ils import decorrelate, kernel

PROVEN, NOTHING, UNPROVEN, UNFINISHED, ILL = range(5)  # how an epoch can end

FIRST_BOUND = 1e-4  # chance that the true integers cost more

_REACH = 25.0  # above the least cost a candidate weighs below exp(-12.5) = 4e-6
_COMPLETE = 100  # nodes: what the attitude of a complete vector takes, 1 to 10 us
_DOUBLINGS = 12  # of the bound, until an integer vector is below it


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ConstrainedSearch:
    """What the rigid array makes of every epoch.

    Attributes
    ----------
    cycles : ndarray of int64, shape (n, b, m)
        Of least constrained cost; 0 where nothing was found.
    costs : ndarray, shape (n, 2)
        Weighted square sum of the code and phase residuals of the best and the second-best
        integers, each with its own best attitude; infinite where there is none within reach.
    degrees : ndarray of int64, shape (n,)
        Degrees of freedom of the best cost.
    wrong_probability : ndarray, shape (n,)
        That the best integers are not the true ones; see ``search_constrained``.
    expected : ndarray, shape (n, 2)
        Expected cost of code and of phase alone, over the posterior of all candidates.
    status : ndarray of int64, shape (n,)
        ``PROVEN`` (nothing costs less), ``NOTHING`` (no link), ``UNPROVEN`` (the search was given
        up with what it had), ``UNFINISHED`` (with nothing), or ``ILL`` (covariance).
    nodes : ndarray of int64, shape (n,)
        Visited by the search, a complete integer vector counted as 100.
    """

    cycles: IntArray
    costs: FloatArray
    degrees: IntArray
    wrong_probability: FloatArray
    expected: FloatArray
    status: IntArray
    nodes: IntArray


class _Epoch(NamedTuple):
    """The relaxation after decorrelation: what a complete integer vector needs for its cost."""

    z_float: FloatArray  # (q,)
    constant: float
    columns: FloatArray  # (3 r,)
    gain: FloatArray  # (3 r, q)
    information: FloatArray  # (3 r, 3 r)
    spread: FloatArray  # (r,): a column is off by at most this times the root of its cost
    weak_axis: FloatArray  # (3,)
    code: FloatArray  # (3 r + 1, 3 r + 1)


class _Found(NamedTuple):
    """The best integers so far, and the log weights of the best and of all others together."""

    integers: FloatArray  # (2, q)
    costs: FloatArray  # (2,)
    log_weights: FloatArray  # (2,)
    expected: FloatArray  # (2,): cost of code and of phase


def search_constrained(differences: DoubleDifferences, nodes: int) -> ConstrainedSearch:
    """Find the integers of least constrained cost in every epoch.

    ``wrong_probability`` is one minus the share of the best integers in the posterior of all
    integers: Gaussian noise of the stated covariance, every integer vector and every attitude as
    likely before as any other, the attitude integrated out around its optimum (Laplace).

    Parameters
    ----------
    differences : DoubleDifferences
    nodes : int
        What a search may visit before it is given up, 10 to 100 ns each; a complete integer
        vector counts as 100.

    Returns
    -------
    ConstrainedSearch
    """
    epochs, arrays = epochs_of(differences), spans(differences)
    rank = arrays.rank[arrays.pattern]
    links = differences.resolvable.sum(axis=(1, 2))
    degrees = np.maximum(2 * links - np.where(rank == 1, 2, 3), 0)
    first_bound = chdtri(np.maximum(degrees, 1), FIRST_BOUND)
    found = _search_epochs(epochs, arrays, first_bound, nodes)
    cycles, costs, wrong_probability, expected, status, visited = found
    return ConstrainedSearch(
        cycles=cycles,
        costs=costs,
        degrees=degrees,
        wrong_probability=wrong_probability,
        expected=expected,
        status=status,
        nodes=visited,
    )


@kernel
def _search_epochs(
    epochs: Epochs, arrays: Spans, first_bound: FloatArray, limit: int
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray]:
    n, b, m = epochs.phase_m.shape
    cycles = np.zeros((n, b, m), dtype=np.int64)
    costs, wrong_probability = np.full((n, 2), np.inf), np.ones(n)
    expected = np.zeros((n, 2))
    status, nodes = np.full(n, NOTHING), np.zeros(n, dtype=np.int64)
    for k in range(n):
        relaxed = relaxation(epochs, arrays, k)
        links = relaxed.links
        if len(links) == 0:
            continue
        end, integers, found, nodes[k] = _search_epoch(relaxed, first_bound[k], limit)
        status[k], costs[k], expected[k] = end, found.costs, found.expected
        if np.isfinite(found.costs[0]):
            best, others = found.log_weights
            wrong_probability[k] = 1.0 / (1.0 + np.exp(best - others))
            for i in range(len(links)):
                cycles[k, links[i, 0], links[i, 1]] = integers[i]
    return cycles, costs, wrong_probability, expected, status, nodes


@kernel
def _search_epoch(
    relaxed: Relaxation, bound: float, limit: int
) -> tuple[int, IntArray, _Found, int]:
    q = len(relaxed.cycles)
    whole = np.floor(relaxed.cycles + 0.5)
    carried = (relaxed.cycles - whole).reshape(q, 1)
    integers = np.empty(q, dtype=np.int64)
    found = _Found(np.zeros((2, q)), np.full(2, np.inf), np.full(2, -np.inf), np.zeros(2))
    positive, L, d, T = decorrelate(relaxed.covariance, carried)
    if not positive:
        return ILL, integers, found, 0
    epoch = _complete_model(relaxed, carried[:, 0].copy(), T)
    visited, finished = 0, True
    for _ in range(_DOUBLINGS):
        finished, more = _enumerate(L, d, epoch, found, bound, limit - visited)
        visited += more
        if not finished or np.isfinite(found.costs[0]):
            break
        bound *= 2.0
    for j in range(q):
        total = whole[j]
        for i in range(q):
            total += found.integers[0, i] * T[i, j]
        integers[j] = np.int64(total)
    if np.isfinite(found.costs[0]):
        return PROVEN if finished else UNPROVEN, integers, found, visited
    return UNFINISHED, integers, found, visited


@kernel
def _complete_model(relaxed: Relaxation, z_float: FloatArray, T: FloatArray) -> _Epoch:
    u, q = relaxed.gain.shape
    gain = np.zeros((u, q))
    for i in range(q):
        for j in range(q):
            if T[i, j] != 0.0:
                for c in range(u):
                    gain[c, i] += relaxed.gain[c, j] * T[i, j]
    inverse = solved(relaxed.information, np.eye(u))
    variance = np.zeros(u // 3)
    for c in range(u):
        variance[c // 3] += inverse[c, c]
    axis = weak_axis(relaxed.information, np.sum(variance))
    return _Epoch(
        z_float,
        relaxed.constant,
        relaxed.columns,
        gain,
        relaxed.information,
        np.sqrt(variance),
        axis,
        relaxed.code,
    )


@kernel
def _enumerate(
    L: FloatArray, d: FloatArray, epoch: _Epoch, found: _Found, bound: float, limit: int
) -> tuple[bool, int]:
    """Visit all integers whose relaxed cost is within the bound; as ``fgnav.integers.ils``."""
    n = len(d)
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
            if k > 0:
                k -= 1
                norm_above[k] = norm
                for j in range(k + 1):
                    above[k, j] = above[k + 1, j] - gap * L[k + 1, j]
                centre[k] = epoch.z_float[k] + above[k, k]
                z[k] = np.floor(centre[k] + 0.5)
                step[k] = 1.0 if centre[k] >= z[k] else -1.0
                continue
            visited += _COMPLETE
            bound = _complete(z, norm, epoch, found, bound)
        elif k == n - 1:
            return True, visited
        else:
            k += 1
        z[k] += step[k]
        step[k] = -step[k] - (1.0 if step[k] > 0 else -1.0)
    return False, visited


@kernel
def _complete(z: FloatArray, norm: float, epoch: _Epoch, found: _Found, bound: float) -> float:
    """Take a complete integer vector into account; return the bound from now on."""
    cost = epoch.constant + norm
    columns = epoch.columns.copy()
    for c in range(len(columns)):
        for i in range(len(z)):
            columns[c] += epoch.gain[c, i] * (epoch.z_float[i] - z[i])
    if cost + _least_distance(columns, epoch.spread) > bound:
        return bound
    distance, M = nearest(columns, epoch.information, epoch.weak_axis)
    cost += distance
    if cost > bound:
        return bound
    _weigh(z, cost, _code_cost(M, epoch.code), log_volume(M, epoch.information), found)
    least: float = found.costs[0]
    return min(bound, least + _REACH)


@kernel
def _least_distance(columns: FloatArray, spread: FloatArray) -> float:
    """Return a lower bound of the distance to orthonormal columns, from their products alone.

    Columns ``x = m + d`` with ``|d|`` at most ``spread * t``, t the root of the distance, have
    ``||x| - 1| <= s t`` and, pair by pair, ``|x . x'| <= (s + s') t + s s' t^2``.
    """
    least = 0.0
    for u in range(len(spread)):
        for v in range(u + 1):
            product = 0.0
            for i in range(3):
                product += columns[3 * u + i] * columns[3 * v + i]
            if u == v:
                root = abs(np.sqrt(product) - 1.0) / spread[u]
            else:
                half, across = 0.5 * (spread[u] + spread[v]), spread[u] * spread[v]
                root = (np.sqrt(half * half + across * abs(product)) - half) / across
            least = max(least, root)
    return least * least


@kernel
def _weigh(z: FloatArray, cost: float, code: float, log_volume: float, found: _Found) -> None:
    """Enter a candidate among the best, and its weight among all."""
    weight = log_volume - 0.5 * cost
    before = np.logaddexp(found.log_weights[0], found.log_weights[1])
    share = np.exp(weight - np.logaddexp(before, weight))
    found.expected[0] += share * (code - found.expected[0])
    found.expected[1] += share * (cost - code - found.expected[1])
    if cost < found.costs[0]:
        found.costs[1], found.integers[1] = found.costs[0], found.integers[0]
        found.costs[0], found.integers[0] = cost, z
        found.log_weights[0], weight = weight, found.log_weights[0]
    elif cost < found.costs[1]:
        found.costs[1], found.integers[1] = cost, z
    found.log_weights[1] = np.logaddexp(found.log_weights[1], weight)


@kernel
def _code_cost(M: FloatArray, code: FloatArray) -> float:
    u = len(M)
    total: float = code[u, u]
    for i in range(u):
        total += 2.0 * M[i] * code[i, u]
        for j in range(u):
            total += M[i] * code[i, j] * M[j]
    return total
