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

import numpy as np

from fgnav.integers.ils.array_model import LinkArrays, Spans, epoch_links
from fgnav.integers.ils.float_solution import FloatSolution, float_solution
from fgnav.kernels.compiled import kernel

# The multiplier e trades what it takes off the bound, e r, for the reach of directions that code
# leaves open: of q integers least volume is left near 6 q / (q - 3 r), without end for q = 3 r.
# Nodes at the 1e-4 quantile of chi-square, four antennas and satellites, code 10 m: 3e5 at 1, 58880
# at 4, 6947 at 10, 2347 at 25; where more is known all but 1 are alike.
_PER_INTEGER = 6.0
_LARGEST_MULTIPLIER = 30.0


@kernel
def relaxation(epochs: LinkArrays, arrays: Spans, k: int) -> FloatSolution:
    """Relax one epoch.

    The constrained cost is the relaxed one plus the distance to the nearest M with orthonormal
    columns in the metric of ``information``.
    """
    pattern = arrays.pattern[k]
    everywhere = np.ones(epochs.phase_m.shape[1], dtype=np.bool_)
    links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
    multiplier = _multiplier(len(links), 3 * arrays.rank[pattern])
    return float_solution(epochs, arrays, k, pattern, links, multiplier)


@kernel
def _multiplier(q: int, u: int) -> float:
    best = _PER_INTEGER * q / max(q - u, 1)
    return min(best, _LARGEST_MULTIPLIER) if q > u else _LARGEST_MULTIPLIER
