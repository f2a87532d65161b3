"""Double differences of an epoch as equations linear in its array, for kernels.

A body array with baselines L of rank r has ``L = C V^T``, V an orthonormal basis, (3, r), of the
space it spans. Leaving ``M = R_nb V`` free of the rotation's constraints, 3 r real unknowns, makes
all double differences of the epoch linear in it: ``-(e_j - e_r) . (M c_i)`` [1]_. One baseline has
r = 1.

References
----------
.. [1] P. J. G. Teunissen, "The affine constrained GNSS attitude model and its multivariate integer
   least-squares solution", J. Geodesy 86, 2012.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.kernels.compiled import kernel
from fgnav.types.differences import DoubleDifferences

_FLAT_M = 1e-3  # an array is flat in a direction it leaves by less: below phase noise


class LinkArrays(NamedTuple):
    """The arrays of ``DoubleDifferences`` a kernel reads."""

    code_m: FloatArray
    phase_m: FloatArray
    e_n: FloatArray
    code_variance_m2: FloatArray
    phase_variance_m2: FloatArray
    resolvable: BoolArray
    of_reference: IntArray  # (n, m): the reference channel of each channel
    wavelength_m: FloatArray


class Spans(NamedTuple):
    """Coordinates of the present antennas in the space that they span."""

    pattern: IntArray  # (n,)
    coordinates_m: FloatArray  # (p, b, 3): the first r columns count, the longest axis first
    rank: IntArray  # (p,)


def link_arrays(differences: DoubleDifferences) -> LinkArrays:
    """Return the arrays of double differences as kernels take them."""
    return LinkArrays(
        differences.code_m,
        differences.phase_m,
        differences.e_n,
        differences.code_variance_m2,
        differences.phase_variance_m2,
        differences.resolvable,
        np.ascontiguousarray(differences.reference[:, differences.group]),
        differences.wavelength_m,
    )


def spans(baselines_b_m: FloatArray, present: BoolArray) -> Spans:
    """Find right-handed coordinates of the antennas present, once for every pattern of presence.

    Parameters
    ----------
    baselines_b_m : ndarray, shape (b, 3)
    present : ndarray of bool, shape (n, b)
    """
    if len(present) == 1 or (len(present) > 1 and (present == present[:1]).all()):
        patterns, pattern = present[:1], np.zeros(len(present), dtype=np.int64)  # the usual case
    else:
        patterns, pattern = np.unique(present, axis=0, return_inverse=True)
    cached = _spans(baselines_b_m.tobytes(), patterns.tobytes())
    return cached._replace(pattern=pattern.reshape(-1))


@lru_cache(maxsize=1000)  # single epochs of one flight ask for the same few again and again
def _spans(baselines: bytes, patterns: bytes) -> Spans:
    """Return the spans of patterns of presence, (p, b), read-only; no epochs."""
    baselines_b_m = np.frombuffer(baselines).reshape(-1, 3)
    present = np.frombuffer(patterns, dtype=np.bool_).reshape(-1, len(baselines_b_m))
    coordinates, rank = np.zeros((*present.shape, 3)), np.zeros(len(present), dtype=np.int64)
    for p, antennas in enumerate(present):
        size, V_T = np.linalg.svd(baselines_b_m[antennas])[1:]
        rank[p] = (size > _FLAT_M).sum()
        basis_b = V_T.T * [1.0, 1.0, np.linalg.det(V_T)]
        coordinates[p, antennas] = baselines_b_m[antennas] @ basis_b
    for array in (coordinates, rank):
        array.flags.writeable = False
    return Spans(np.zeros(0, dtype=np.int64), coordinates, rank)


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
    """Return the covariance of double differences, (q, q)."""
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
