"""The integers of least constrained cost, epoch by epoch, with what speaks for the others.

All integer vectors whose relaxed cost is below a bound are enumerated depth first after LAMBDA's
decorrelation, nearest first; each that gets through is given its constrained cost. The first bound
is where chi-square would refuse the epoch anyway; it shrinks to the least constrained cost found
plus a reach within which candidates still count against the best. What is returned is therefore
the minimum, and the posterior misses no candidate within that reach.
"""

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.differences import DoubleDifferences
from fgnav.integers.affine import Epochs, epochs_of
from fgnav.integers.constrained_nearest import nearest, weak_axis
from fgnav.integers.constrained_prior import AttitudePrior, PriorColumns, prior_columns
from fgnav.integers.constrained_relaxation import Relaxation, Spans, relaxation, solved, spans
from fgnav.integers.constrained_volume import log_likelihood
from fgnav.integers.ils import decorrelate, kernel

PROVEN, NOTHING, UNPROVEN, UNFINISHED, ILL = range(5)  # how an epoch can end

# Chance that the true integers cost more. They are then missed, whatever is found instead: of two
# antennas under 7 satellites, 480,000 sets, 111 of those accepted were wrong with 104.0 expected
# at 1e-4, and 101 with 103.5 expected at 1e-7, which takes a sixth more nodes.
FIRST_BOUND = 1e-7

_REACH = 25.0  # above the least cost a candidate weighs below exp(-12.5) = 4e-6
_COMPLETE = 100  # nodes: what the attitude of a complete vector takes, 1 to 10 us
# Columns are looked at before the vector is complete where one is known to a third of its length,
# until two integers more than M has elements are known: beyond, phase residuals prune as well.
# Epochs proven of four antennas 2 m apart in space and six satellites, code 0.3 m: 17 in 30 instead
# of 10; three antennas 5 m and 3 m apart, code 0.5 m: 28 instead of 15.
_KNOWN, _LAST_LOOKS = 0.1, 2
_REJECTED = 5  # nodes: a complete vector whose columns cannot be orthonormal
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
    columns : ndarray, shape (n, 9)
        Those of ``R_nb V`` that the best integers lead to, V as ``spans`` has it; the first 3 r
        count.
    degrees : ndarray of int64, shape (n,)
        Degrees of freedom of the best cost.
    wrong_probability : ndarray, shape (n,)
        That the best integers are not the true ones; see ``search_constrained``.
    log_evidence : ndarray, shape (n,)
        Logarithm of the summed weights of all candidates, each ``exp(-cost / 2)`` times the volume
        of attitudes around its optimum; minus infinity where there is none.
    status : ndarray of int64, shape (n,)
        ``PROVEN`` (nothing costs less), ``NOTHING`` (no link), ``UNPROVEN`` (the search was given
        up with what it had), ``UNFINISHED`` (with nothing), or ``ILL`` (covariance).
    nodes : ndarray of int64, shape (n,)
        Visited by the search, the attitude of a complete integer vector counted as 100.
    """

    cycles: IntArray
    costs: FloatArray
    columns: FloatArray
    degrees: IntArray
    wrong_probability: FloatArray
    log_evidence: FloatArray
    status: IntArray
    nodes: IntArray

    def rows(self, at: IntArray) -> "ConstrainedSearch":
        """Return some of the epochs."""
        parts = {field.name: getattr(self, field.name)[at] for field in fields(self)}
        return ConstrainedSearch(**parts)

    def with_rows(self, at: IntArray, rows: "ConstrainedSearch") -> "ConstrainedSearch":
        """Return all epochs, some of them replaced."""
        parts = {field.name: getattr(self, field.name).copy() for field in fields(self)}
        for name, part in parts.items():
            part[at] = getattr(rows, name)
        return ConstrainedSearch(**parts)


class _Epoch(NamedTuple):
    """The relaxation after decorrelation: what a complete integer vector needs for its cost."""

    z_float: FloatArray  # (q,)
    constant: float
    columns: FloatArray  # (3 r,)
    gain: FloatArray  # (3 r, q)
    information: FloatArray  # (3 r, 3 r)
    covariance: FloatArray  # (3 r, 3 r): the inverse of the information
    weak_axis: FloatArray  # (3,)


class _Found(NamedTuple):
    """The best integers so far, and the log weights of the best and of all others together."""

    integers: FloatArray  # (2, q)
    costs: FloatArray  # (2,)
    log_weights: FloatArray  # (2,)
    columns: FloatArray  # (9,)


def search_constrained(
    differences: DoubleDifferences, nodes: int, prior: AttitudePrior | None = None
) -> ConstrainedSearch:
    """Find the integers of least constrained cost in every epoch.

    ``wrong_probability`` is one minus the share of the best integers in the posterior of all
    integers: Gaussian noise of the stated covariance, every integer vector and, without a prior,
    every attitude as likely before as any other, and integrated out as in
    ``constrained_volume``. Of two antennas 1 m apart under 7 satellites, 480,000 simulated sets,
    101 of the 103,572 accepted for a share of 1e-3 were wrong, with 103.5 expected.

    Parameters
    ----------
    differences : DoubleDifferences
    nodes : int
        What a search may visit before it is given up, 10 to 100 ns each; the attitude of
        a complete integer vector counts as 100.
    prior : AttitudePrior or None
        Its cost is part of every cost and of the posterior.

    Returns
    -------
    ConstrainedSearch

    Raises
    ------
    BadInputError
        If the prior has not as many epochs as the differences.
    """
    epochs = epochs_of(differences)
    arrays = spans(differences.baselines_b_m, epochs.resolvable)
    known = prior_columns(prior, arrays)
    rank = arrays.rank[arrays.pattern]
    links = epochs.resolvable.sum(axis=(1, 2))
    open_angles = np.where(rank == 1, 2, 3)
    if prior is not None:
        open_angles[known.information.any(axis=(1, 2))] = 0
    degrees = np.maximum(2 * links - open_angles, 0)
    first_bound = chdtri(np.maximum(degrees, 1), FIRST_BOUND)
    found = _search_epochs(epochs, arrays, known, first_bound, nodes)
    cycles, costs, columns, wrong_probability, log_evidence, status, visited = found
    return ConstrainedSearch(
        cycles=cycles,
        costs=costs,
        columns=columns,
        degrees=degrees,
        wrong_probability=wrong_probability,
        log_evidence=log_evidence,
        status=status,
        nodes=visited,
    )


@kernel
def _search_epochs(
    epochs: Epochs, arrays: Spans, prior: PriorColumns, first_bound: FloatArray, limit: int
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray]:
    n, b, m = epochs.phase_m.shape
    cycles = np.zeros((n, b, m), dtype=np.int64)
    costs, wrong_probability = np.full((n, 2), np.inf), np.ones(n)
    columns, log_evidence = np.zeros((n, 9)), np.full(n, -np.inf)
    status, nodes = np.full(n, NOTHING), np.zeros(n, dtype=np.int64)
    for k in range(n):
        relaxed = relaxation(epochs, arrays, k, prior.columns, prior.information)
        links = relaxed.links
        if len(links) == 0:
            continue
        end, integers, found, nodes[k] = _search_epoch(relaxed, first_bound[k], limit)
        status[k], costs[k], columns[k] = end, found.costs, found.columns
        if np.isfinite(found.costs[0]):
            best, others = found.log_weights
            wrong_probability[k] = 1.0 / (1.0 + np.exp(best - others))
            log_evidence[k] = np.logaddexp(best, others)
            for i in range(len(links)):
                cycles[k, links[i, 0], links[i, 1]] = integers[i]
    return cycles, costs, columns, wrong_probability, log_evidence, status, nodes


@kernel
def _search_epoch(
    relaxed: Relaxation, bound: float, limit: int
) -> tuple[int, IntArray, _Found, int]:
    q = len(relaxed.cycles)
    whole = np.floor(relaxed.cycles + 0.5)
    carried = (relaxed.cycles - whole).reshape(q, 1)
    integers = np.empty(q, dtype=np.int64)
    found = _Found(np.zeros((2, q)), np.full(2, np.inf), np.full(2, -np.inf), np.zeros(9))
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
    covariance = solved(relaxed.information, np.eye(u))
    axis = weak_axis(relaxed.information, np.trace(covariance))
    known = (relaxed.columns, gain, relaxed.information, covariance)
    return _Epoch(z_float, relaxed.constant, *known, axis)


@kernel
def _enumerate(
    L: FloatArray, d: FloatArray, epoch: _Epoch, found: _Found, bound: float, limit: int
) -> tuple[bool, int]:
    """Visit all integers whose relaxed cost is within the bound; as ``fgnav.integers.ils``.

    With the integers above a level known and those below it real, the columns are those of the
    level in its covariance: how far they are from orthonormal adds to the cost of all below.
    """
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
                effort, bound = _complete(z, norm, columns[0], epoch, found, bound)
                visited += effort
        elif k == n - 1:
            return True, visited
        else:
            k += 1
        z[k] += step[k]
        step[k] = -step[k] - (1.0 if step[k] > 0 else -1.0)
    return False, visited


@kernel
def _levels(
    L: FloatArray, d: FloatArray, epoch: _Epoch
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return what each level tells of the columns before the integers below it are known.

    How they move with a level's own gap, (3 r, n); their covariance, (n, 3 r, 3 r), with the
    integers below it real; and whether that is small enough for a look.
    """
    u, n = epoch.gain.shape
    turned, covariances = np.zeros((u, n)), np.zeros((n, u, u))
    useful = np.zeros(n, dtype=np.bool_)
    covariance = epoch.covariance.copy()
    for k in range(n):
        covariances[k] = covariance
        for v in range(0, u, 3):
            if n - k <= u + _LAST_LOOKS and _trace(covariance, v) < _KNOWN:
                useful[k] = True
        for c in range(u):
            for j in range(k + 1):
                turned[c, k] += epoch.gain[c, j] * L[k, j]
        for c in range(u):
            for e in range(u):
                covariance[c, e] += turned[c, k] * d[k] * turned[e, k]
    return turned, covariances, useful


@kernel
def _complete(
    z: FloatArray,
    norm: float,
    columns: FloatArray,
    epoch: _Epoch,
    found: _Found,
    bound: float,
) -> tuple[int, float]:
    """Take a complete integer vector into account; return its nodes and the bound from now on."""
    cost = epoch.constant + norm
    if cost + _least_distance(columns, epoch.covariance) > bound:
        return _REJECTED, bound
    distance, M = nearest(columns, epoch.information, epoch.weak_axis)
    if cost + distance > bound:
        return _COMPLETE, bound
    weight = log_likelihood(columns, epoch.information, M, distance) - 0.5 * cost
    if cost + distance < found.costs[0]:
        found.columns[: len(M)] = M
    _weigh(z, cost + distance, weight, found)
    least: float = found.costs[0]
    return _COMPLETE, min(bound, least + _REACH)


@kernel
def _least_distance(columns: FloatArray, covariance: FloatArray) -> float:
    """Return a lower bound of the distance to orthonormal columns, from their products alone.

    Columns ``x = m - d`` with ``d`` within t of the covariance's ellipsoid, t the root of the
    distance, have ``1 - |x|^2 = 2 x . d + |d|^2`` and ``-x . x' = x . d' + x' . d + d . d'``, where
    the linear terms are at most t times their own standard deviation and the quadratic ones at most
    t^2 times the sum of variances. Where x is longer than 1, m lies beyond a plane across it.
    """
    least = 0.0
    for u in range(0, len(columns), 3):
        x = columns[u : u + 3]
        for v in range(0, u + 3, 3):
            y = columns[v : v + 3]
            product = x[0] * y[0] + x[1] * y[1] + x[2] * y[2]
            linear = _variance(covariance, u, v, x, y)
            if u == v and product > 1.0:
                gap = product - np.sqrt(product)
                root = gap / np.sqrt(linear)
            else:
                gap = 1.0 - product if u == v else abs(product)
                half = np.sqrt(linear) if u == v else 0.5 * np.sqrt(linear)
                square = np.sqrt(_trace(covariance, u) * _trace(covariance, v))
                root = gap / (half + np.sqrt(half * half + square * gap))
            least = max(least, root)
    return least * least


@kernel
def _variance(covariance: FloatArray, u: int, v: int, x: FloatArray, y: FloatArray) -> float:
    """Return that of ``x . d`` for one column, u = v, and of ``x . d' + y . d`` for two."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            if u == v:
                total += x[i] * covariance[u + i, u + j] * x[j]
            else:
                total += x[i] * covariance[v + i, v + j] * x[j]
                total += y[i] * covariance[u + i, u + j] * y[j]
                total += 2.0 * x[i] * covariance[v + i, u + j] * y[j]
    return total


@kernel
def _trace(covariance: FloatArray, u: int) -> float:
    total: float = covariance[u, u] + covariance[u + 1, u + 1] + covariance[u + 2, u + 2]
    return total


@kernel
def _weigh(z: FloatArray, cost: float, weight: float, found: _Found) -> None:
    """Enter a candidate among the best, and its log weight among all."""
    if cost < found.costs[0]:
        found.costs[1], found.integers[1] = found.costs[0], found.integers[0]
        found.costs[0], found.integers[0] = cost, z
        found.log_weights[0], weight = weight, found.log_weights[0]
    elif cost < found.costs[1]:
        found.costs[1], found.integers[1] = cost, z
    found.log_weights[1] = np.logaddexp(found.log_weights[1], weight)
