"""Float solution of an epoch under the affine array model, and the integers nearest to it.

A body array with baselines L of rank r has ``L = C V^T``, V an orthonormal basis, (3, r), of the
space it spans. Leaving ``M = R_nb V`` free of the rotation's constraints, 3 r real unknowns, makes
all double differences of the epoch linear in it: ``-(e_j - e_r) . (M c_i)``. One baseline gives
r = 1: the ordinary float solution. Code alone determines M; phase then gives the float ambiguities,
with the full covariance of unequal variances, missing links and several groups [1]_.

References
----------
.. [1] P. J. G. Teunissen, "The affine constrained GNSS attitude model and its multivariate integer
   least-squares solution", J. Geodesy 86, 2012.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, NoSolutionError, frozen
from fgnav.integers.ils.search import OK, UNFINISHED, solve_subset
from fgnav.integers.ils.threads import in_blocks
from fgnav.kernels.compiled import inlined, inner, kernel
from fgnav.types.differences import DoubleDifferences

NOTHING, WEAK, ILL = range(10, 13)  # how an epoch can end besides OK and UNFINISHED

_NODES = 10**7  # 0.15 s; realistic searches take 1e2 to 1e5, and beyond the answer is seldom right
_BLOCK = 32  # epochs a thread takes at once, 1 us each or more
_FLAT_M = 1e-3  # an array is flat in a direction it leaves by less: below phase noise
_SINGULAR = 1e-9  # of a pivot to its diagonal: beyond, satellites lie in a plane or are too few


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FloatSolution:
    """Float ambiguities of one epoch, in the order of ``np.nonzero(links)``.

    Attributes
    ----------
    cycles : ndarray, shape (q,)
    covariance_cycles2 : ndarray, shape (q, q)
    links : ndarray of bool, shape (b, m)
    """

    cycles: FloatArray
    covariance_cycles2: FloatArray
    links: BoolArray

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        q = len(self.cycles)
        covariance = frozen("covariance_cycles2", self.covariance_cycles2, (q, q))
        links = frozen("float solution links", self.links, (None, None), dtype=np.bool_)
        object.__setattr__(self, "cycles", frozen("float solution cycles", self.cycles, (q,)))
        object.__setattr__(self, "covariance_cycles2", covariance)
        object.__setattr__(self, "links", links)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ArraySearch:
    """The nearest integers of every epoch.

    Attributes
    ----------
    cycles : ndarray of int64, shape (n, b, m)
        0 where nothing was resolved.
    fixed : ndarray of bool, shape (n, b, m)
        Links that the search, of all integers or of a subset, determined.
    success : ndarray, shape (n, b)
        Bootstrapped success rate of what was searched, by the stated noise: a lower bound of the
        chance that it is right. NaN where nothing was resolved.
    squared_norms : ndarray, shape (n, b, 2)
        Of the best and the second-best vector of the search a baseline took part in; NaN without.
    status : ndarray of int64, shape (n, b)
        ``OK``, ``NOTHING`` (no link), ``WEAK`` (geometry), ``ILL`` (covariance) or ``UNFINISHED``
        (the search was given up).
    """

    cycles: IntArray
    fixed: BoolArray
    success: FloatArray
    squared_norms: FloatArray
    status: IntArray


class Epochs(NamedTuple):
    """The arrays of ``DoubleDifferences`` a kernel reads."""

    code_m: FloatArray
    phase_m: FloatArray
    e_n: FloatArray
    code_variance_m2: FloatArray
    phase_variance_m2: FloatArray
    resolvable: BoolArray
    of_reference: IntArray  # (n, m): the reference channel of each channel
    wavelength_m: FloatArray


class _Arrays(NamedTuple):
    """Which baselines are searched together, and where they lie in the space they span."""

    blocks: BoolArray  # (s, b)
    pattern: IntArray  # (n, s)
    coordinates_m: FloatArray  # (p, b, 3): the first r columns count
    rank: IntArray  # (p,)


class _Found(NamedTuple):
    """What the search writes: the fields of ``ArraySearch``."""

    cycles: IntArray
    fixed: BoolArray
    success: FloatArray
    squared_norms: FloatArray
    status: IntArray


def search_array(
    differences: DoubleDifferences, *, joint: bool, success_min: float = 0.0
) -> ArraySearch:
    """Resolve every epoch by integer least squares, epochs in parallel.

    Parameters
    ----------
    differences : DoubleDifferences
    joint : bool
        All baselines of an epoch in one search; otherwise every baseline on its own.
    success_min : float
        Least success rate of a search: as many decorrelated integers are searched as reach it, and
        the links they determine are fixed. 0 searches all.

    Returns
    -------
    ArraySearch
    """
    n, b, m = differences.phase_m.shape
    blocks = np.ones((min(b, 1), b), dtype=np.bool_) if joint else np.eye(b, dtype=np.bool_)
    epochs = epochs_of(differences)
    arrays = _arrays(differences, epochs, blocks)
    found = _Found(
        np.zeros((n, b, m), dtype=np.int64),
        np.zeros((n, b, m), dtype=np.bool_),
        np.full((n, b), np.nan),
        np.full((n, b, 2), np.nan),
        np.full((n, b), NOTHING),
    )

    def search_block(block: slice) -> None:
        _search_epochs(epochs, arrays, found, block.start, block.stop, success_min)

    in_blocks(search_block, n, least=_BLOCK)
    return ArraySearch(**found._asdict())


def float_solution(
    differences: DoubleDifferences, k: int, baselines: BoolArray | None = None
) -> FloatSolution:
    """Return the float ambiguities of one epoch under the affine array model.

    Parameters
    ----------
    differences : DoubleDifferences
    k : int
        Epoch.
    baselines : ndarray of bool, shape (b,), or None
        Those that take part; all by default.

    Raises
    ------
    BadInputError
        If the epoch does not exist.
    NoSolutionError
        If the epoch's code does not determine the array.
    """
    n, b = differences.phase_m.shape[:2]
    if not 0 <= k < n:
        raise BadInputError(f"epoch {k}: not one of the {n} there are")
    block = np.ones((1, b), dtype=np.bool_) if baselines is None else np.array([baselines])
    epochs = epochs_of(differences)
    arrays = _arrays(differences, epochs, block)
    status, links, cycles, covariance = _float_epoch(epochs, arrays, k, 0)
    if status != OK:
        what = "has no link" if status == NOTHING else "its satellites do not determine the array"
        raise NoSolutionError(f"float ambiguities: epoch at {differences.t_s[k]:.3f} s {what}")
    chosen = np.zeros(differences.phase_m.shape[1:], dtype=np.bool_)
    chosen[links[:, 0], links[:, 1]] = True
    return FloatSolution(cycles=cycles, covariance_cycles2=covariance, links=chosen)


def code_residuals(differences: DoubleDifferences) -> tuple[float, int]:
    """Return the normalised squared residuals of all code under the affine array model.

    Parameters
    ----------
    differences : DoubleDifferences

    Returns
    -------
    squares : float
        Sum over the epochs; if code noise is as stated its mean is ``degrees``.
    degrees : int
        Of freedom.
    """
    epochs = epochs_of(differences)
    blocks = np.ones((1, differences.phase_m.shape[1]), dtype=np.bool_)
    squares, degrees = _code_squares(epochs, _arrays(differences, epochs, blocks))
    return float(squares), int(degrees)


def epochs_of(differences: DoubleDifferences) -> Epochs:
    """Return the arrays of double differences as kernels take them."""
    return Epochs(
        differences.code_m,
        differences.phase_m,
        differences.e_n,
        differences.code_variance_m2,
        differences.phase_variance_m2,
        differences.resolvable,
        np.ascontiguousarray(differences.reference[:, differences.group]),
        differences.wavelength_m,
    )


def _arrays(differences: DoubleDifferences, epochs: Epochs, blocks: BoolArray) -> _Arrays:
    """Find the basis of the antennas present, once for every pattern of presence."""
    present = np.any(epochs.resolvable, axis=2)[:, None, :] & blocks  # (n, s, b)
    flat = present.reshape(-1, blocks.shape[1])
    patterns, inverse = np.unique(flat, axis=0, return_inverse=True)
    coordinates = np.zeros((*patterns.shape, 3))
    rank = np.zeros(len(patterns), dtype=np.int64)
    for p, there in enumerate(patterns):
        baselines = differences.baselines_b_m * np.asarray(there)[:, None]
        size, V_T = np.linalg.svd(baselines)[1:] if there.any() else (np.zeros(3), np.eye(3))
        rank[p] = (size > _FLAT_M).sum()
        coordinates[p] = baselines @ V_T.T
    return _Arrays(blocks, inverse.reshape(present.shape[:2]), coordinates, rank)


@kernel
def _search_epochs(
    epochs: Epochs, arrays: _Arrays, found: _Found, first: int, last: int, success_min: float
) -> None:
    for k in range(first, last):
        for s in range(len(arrays.blocks)):
            end, links, float_cycles, covariance = _float_epoch(epochs, arrays, k, s)
            if end == OK:
                end, integers, norms, fixed, success = solve_subset(
                    float_cycles, covariance, 2, _NODES, success_min
                )
                end = end if end in (OK, UNFINISHED) else ILL
                for q in range(len(links)):
                    if end == OK:
                        i, j = links[q, 0], links[q, 1]
                        found.cycles[k, i, j], found.fixed[k, i, j] = integers[0, q], fixed[q]
                        found.success[k, i] = success
                        for c in range(len(norms)):
                            found.squared_norms[k, i, c] = norms[c]
            for q in range(len(links)):
                found.status[k, links[q, 0]] = end


@kernel
def _code_squares(epochs: Epochs, arrays: _Arrays) -> tuple[float, int]:
    squares, degrees = 0.0, 0
    for k in range(len(epochs.code_m)):
        pattern = arrays.pattern[k, 0]
        unknowns = 3 * arrays.rank[pattern]
        links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], arrays.blocks[0])
        if len(links) > unknowns:
            A = link_design(epochs.e_n[k], arrays.coordinates_m[pattern], links, unknowns)
            variance = epochs.code_variance_m2[k]
            status, _, _, residual = _of_code(A, epochs.code_m[k], variance, links)
            if status == OK:
                squares += residual
                degrees += len(links) - unknowns
    return squares, degrees


@kernel
def _float_epoch(
    epochs: Epochs, arrays: _Arrays, k: int, s: int
) -> tuple[int, IntArray, FloatArray, FloatArray]:
    """Return status, links (q, 3: baseline, channel, reference), float cycles and covariance."""
    pattern = arrays.pattern[k, s]
    unknowns = 3 * arrays.rank[pattern]
    links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], arrays.blocks[s])
    q = len(links)
    cycles, covariance = np.zeros(q), link_covariance(links, epochs.phase_variance_m2[k])
    if q == 0:
        return NOTHING, links, cycles, covariance
    A = link_design(epochs.e_n[k], arrays.coordinates_m[pattern], links, unknowns)
    status, H, range_m, _ = _of_code(A, epochs.code_m[k], epochs.code_variance_m2[k], links)
    for i in range(q):
        j = links[i, 1]
        cycles[i] = (epochs.phase_m[k, links[i, 0], j] - range_m[i]) / epochs.wavelength_m[j]
        for u in range(unknowns):
            for c in range(i + 1):
                covariance[i, c] += H[u, i] * H[u, c]
    for i in range(q):
        for c in range(i + 1):
            scale = epochs.wavelength_m[links[i, 1]] * epochs.wavelength_m[links[c, 1]]
            covariance[i, c] /= scale
            covariance[c, i] = covariance[i, c]
    return status, links, cycles, covariance


@kernel
def epoch_links(resolvable: BoolArray, of_reference: IntArray, block: BoolArray) -> IntArray:
    """Return baseline, channel and reference channel, (q, 3), of an epoch's resolvable links."""
    links = np.empty((resolvable.size, 3), dtype=np.int64)
    q = 0
    for i in range(resolvable.shape[0]):
        for j in range(resolvable.shape[1]):
            if block[i] and resolvable[i, j]:
                links[q, 0], links[q, 1], links[q, 2] = i, j, of_reference[j]
                q += 1
    return links[:q]


@kernel
def link_covariance(links: IntArray, variance: FloatArray) -> FloatArray:
    """Return that of double differences, as ``DoubleDifferences.covariance`` does."""
    q = len(links)
    C = np.zeros((q, q))
    for i in range(q):
        for c in range(q):
            if links[i, 2] == links[c, 2]:
                C[i, c] = variance[links[i, 2]]
                if links[i, 1] == links[c, 1]:
                    C[i, c] += variance[links[i, 1]]
                if links[i, 0] == links[c, 0]:
                    C[i, c] *= 2.0
    return C


@kernel
def link_design(
    e_n: FloatArray, coordinates_m: FloatArray, links: IntArray, unknowns: int
) -> FloatArray:
    """Return the design, (q, unknowns), of links (q, 3) by the elements of the affine array."""
    A = np.empty((len(links), unknowns))
    for i in range(len(links)):
        for u in range(unknowns):
            across = e_n[links[i, 2], u % 3] - e_n[links[i, 1], u % 3]
            A[i, u] = across * coordinates_m[links[i, 0], u // 3]
    return A


@inner
def _of_code(
    A: FloatArray, code_m: FloatArray, variance: FloatArray, links: IntArray
) -> tuple[int, FloatArray, FloatArray, float]:
    """Return status, H with ``A C_M A^T = H^T H``, ranges ``A M`` by code, squared residuals."""
    q, unknowns = A.shape
    W = _observed(A, code_m, variance, links)
    _eliminate(W)
    normal = np.zeros((unknowns, unknowns + 1 + q))
    squares = 0.0
    for i in range(q):
        squares += W[i, -1] * W[i, -1] / W[i, i]
        for u in range(unknowns):
            weighted = W[i, q + u] / W[i, i]
            for c in range(unknowns + 1):
                normal[u, c] += weighted * W[i, q + c]
    for u in range(unknowns):
        for i in range(q):
            normal[u, unknowns + 1 + i] = A[i, u]
    diagonal = np.empty(unknowns)
    for u in range(unknowns):
        diagonal[u] = normal[u, u]
    _eliminate(normal)
    status = OK
    H, range_m = np.empty((unknowns, q)), np.zeros(q)
    for u in range(unknowns):
        if not normal[u, u] > _SINGULAR * diagonal[u]:
            status = WEAK
        root = np.sqrt(normal[u, u])
        squares -= (normal[u, unknowns] / root) ** 2
        for i in range(q):
            H[u, i] = normal[u, unknowns + 1 + i] / root
            range_m[i] += H[u, i] * normal[u, unknowns] / root
    return status, H, range_m, squares


@inlined
def _observed(
    A: FloatArray, code_m: FloatArray, variance: FloatArray, links: IntArray
) -> FloatArray:
    """Return covariance, design and codes of links side by side, (q, q + unknowns + 1)."""
    q, unknowns = A.shape
    W, C = np.empty((q, q + unknowns + 1)), link_covariance(links, variance)
    for i in range(q):
        for c in range(q):
            W[i, c] = C[i, c]
        for u in range(unknowns):
            W[i, q + u] = A[i, u]
        W[i, -1] = code_m[links[i, 0], links[i, 1]]
    return W


@inner
def _eliminate(W: FloatArray) -> None:
    """Bring ``[S | B]``, S symmetric, to ``[D L^T | L^-1 B]`` with ``S = L D L^T``, in place."""
    q, width = W.shape
    for j in range(q):
        for i in range(j + 1, q):
            factor = W[j, i] / W[j, j]
            for c in range(i, width):
                W[i, c] -= factor * W[j, c]
