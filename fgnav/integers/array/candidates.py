"""The integer vectors of least constrained cost, several for every epoch, for whoever ranks them.

The search is that of ``fgnav.integers.array.search``. It keeps the best few instead of two,
and looks as far above the least cost as it is told to, whatever chi-square says of that: a bad link
can make the true integers cost more than wrong ones, and both of them more than noise would.
"""

from dataclasses import dataclass, fields

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray
from fgnav.integers.array.search import searched
from fgnav.types.differences import DoubleDifferences

_BLOCK = 256  # epochs whose lists are held at full length


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Candidates:
    """Integer vectors that an epoch may have, those of an epoch together, the cheapest first."""

    epoch: IntArray  # (c,): to which each belongs; rising
    cycles: IntArray  # (c, b, m): 0 where there is no link
    # At the candidate's own best attitude; 0 of an antenna that has no link.
    baselines_n_m: FloatArray  # (c, b, 3)
    cost: FloatArray  # (c,): weighted square sum of code and phase residuals
    # Of attitudes around the best: ``log_volume - cost / 2`` is the logarithm of a candidate's
    # weight in the posterior of Gaussian noise.
    log_volume: FloatArray  # (c,)
    status: IntArray  # (n,): how each epoch's search ended, as in ``ConstrainedSearch``


def candidates(
    differences: DoubleDifferences, *, most: int = 32, reach: float = 25.0, nodes: int = 10**6
) -> Candidates:
    """Return up to ``most`` integer vectors of each epoch.

    Parameters
    ----------
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
    parts = []
    for start in range(0, max(n, 1), _BLOCK):
        at = np.arange(start, min(start + _BLOCK, n))
        some = differences if n <= _BLOCK else differences.resampled(at)
        parts.append(_of_block(some, start, most, reach, nodes))
    if len(parts) == 1:
        return parts[0]
    joined = {f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(parts[0])}
    return Candidates(**joined)


def _of_block(
    differences: DoubleDifferences, start: int, most: int, reach: float, nodes: int
) -> Candidates:
    """Search a block of epochs, of which ``start`` is the first."""
    result, arrays, _ = searched(differences, most, most, reach, nodes, listed=True)
    finite = np.isfinite(result.costs)
    of_epoch, cost = np.nonzero(finite)[0], result.costs[finite]
    coordinates_m = arrays.coordinates_m[arrays.pattern[of_epoch]]
    return Candidates(
        epoch=of_epoch + start,
        cycles=result.cycles[finite],
        baselines_n_m=coordinates_m @ result.columns[finite].reshape(-1, 3, 3),
        cost=cost,
        log_volume=result.log_weights[finite] + 0.5 * cost,
        status=result.status,
    )
