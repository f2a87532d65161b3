"""The relaxation of the rigid array that lets its integers be searched exactly.

In coordinates ``c_i``, (r,), of the space it spans, an array with attitude ``R_nb`` has baselines
``M c_i`` with orthonormal columns: ``M = R_nb V``, (3, r). Leaving M free gives the affine model
[1]_, whose integer search is exact but weak. It is not weak any more once the known length of the
columns enters: for every M with unit columns

    cost(M, z)  =  cost(M, z) + e (|M|^2 - r)

whatever e, and with e > 0 the right side, minimised over *all* M, is still a quadratic form in z.
It bounds the constrained cost from below as a Lagrangian relaxation does, and it stays positive
definite with any satellites. Enumerating the integers below a bound of the relaxed cost therefore
misses none below that bound of the constrained cost.

References
----------
.. [1] P. J. G. Teunissen, "The affine constrained GNSS attitude model and its multivariate integer
   least-squares solution", J. Geodesy 86, 2012.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.ils.array_model import (
    LinkArrays,
    Spans,
    by_code,
    design_and_code,
    epoch_links,
    floats,
    normal_equations,
)
from fgnav.integers.ils.link_weights import solved, weighed
from fgnav.kernels.compiled import inlined, kernel

# The multiplier e trades what it takes off the bound, e r, for the reach of directions that code
# leaves open: of q integers least volume is left near 6 q / (q - 3 r), without end for q = 3 r.
# Nodes at the 1e-4 quantile of chi-square, four antennas and satellites, code 10 m: 3e5 at 1, 58880
# at 4, 6947 at 10, 2347 at 25; where more is known all but 1 are alike.
_PER_INTEGER = 6.0
_LARGEST_MULTIPLIER = 30.0


class Relaxation(NamedTuple):
    """One epoch, relaxed: ``constant + |cycles - z|^2`` in the metric of ``covariance``.

    Once z is known the columns of M, one after the other, are ``columns + gain @ (cycles - z)``,
    and the constrained cost is the relaxed one plus the distance to the nearest M with orthonormal
    columns in the metric of ``information``.
    """

    links: IntArray  # (q, 3): baseline, channel, reference
    cycles: FloatArray  # (q,)
    covariance: FloatArray  # (q, q)
    constant: float
    columns: FloatArray  # (3 r,)
    gain: FloatArray  # (3 r, q)
    information: FloatArray  # (3 r, 3 r)


@kernel
def relaxation(epochs: LinkArrays, arrays: Spans, k: int) -> Relaxation:
    """Relax one epoch."""
    pattern = arrays.pattern[k]
    r = arrays.rank[pattern]
    everywhere = np.ones(epochs.phase_m.shape[1], dtype=np.bool_)
    links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
    q, u = len(links), 3 * r
    A = design_and_code(epochs, arrays.coordinates_m[pattern], k, links, u)
    weighted = weighed(links, epochs.code_variance_m2[k], epochs.phase_variance_m2[k], A)
    normal, of_phase = normal_equations(A, weighted[0]), normal_equations(A, weighted[1])
    constant = normal[u, u]
    multiplier = _multiplier(q, u)
    N, of_code = by_code(A, normal, multiplier)
    gain = np.empty((u, q))
    columns = np.empty(u)
    for i in range(u):
        columns[i] = of_code[i, q]
        constant -= normal[i, u] * columns[i]
    cycles, covariance = floats(epochs, k, links, A, of_code)
    for i in range(u):
        for j in range(u):
            N[i, j] += of_phase[i, j]
        for j in range(q):
            gain[i, j] = weighted[1, j, i] * epochs.wavelength_m[links[j, 1]]
    gain = solved(N, gain)
    return Relaxation(links, cycles, covariance, constant - multiplier * r, columns, gain, N)


@inlined
def _multiplier(q: int, u: int) -> float:
    best = _PER_INTEGER * q / max(q - u, 1)
    return min(best, _LARGEST_MULTIPLIER) if q > u else _LARGEST_MULTIPLIER
