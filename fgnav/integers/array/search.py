"""The integers of least constrained cost, epoch by epoch, with what speaks for the others.

All integer vectors whose relaxed cost is below a bound are enumerated depth first after LAMBDA's
decorrelation, nearest first; each that gets through is given its constrained cost. The first bound
is where chi-square would refuse the epoch anyway; it shrinks to the least constrained cost found
plus a reach within which candidates still count against the best. What is returned is therefore
the minimum, and the posterior misses no candidate within that reach.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import chdtri

from fgnav.checks import FloatArray, IntArray
from fgnav.integers.array.kernel import Found, nothing_found, search_epochs
from fgnav.integers.ils.array_model import Spans, link_arrays, spans
from fgnav.types.differences import DoubleDifferences

# Chance that the true integers cost more. They are then missed, whatever is found instead: of two
# antennas under 7 satellites, 480,000 sets, 111 of those accepted were wrong with 104.0 expected
# at 1e-4, and 101 with 103.5 expected at 1e-7, which takes a sixth more nodes.
_FIRST_BOUND = 1e-7

_REACH = 25.0  # above the least cost a candidate weighs below exp(-12.5) = 4e-6


class ConstrainedSearch(NamedTuple):
    """Integers of least constrained cost of every epoch, and their chance to be wrong."""

    cycles: IntArray  # (n, b, m): of least constrained cost; 0 where nothing was found
    # Weighted square sum of the code and phase residuals of the best and the second-best integers,
    # each with its own best attitude; infinite where there is none within reach.
    costs: FloatArray  # (n, 2)
    degrees: IntArray  # (n,): degrees of freedom of the best cost
    # That the best integers are not the true ones; see ``search_constrained``.
    wrong_probability: FloatArray  # (n,)
    # Logarithm of the summed weights of all candidates, each ``exp(-cost / 2)`` times the volume of
    # attitudes around its optimum; minus infinity where there is none.
    log_evidence: FloatArray  # (n,)
    # ``PROVEN`` (nothing costs less), ``NOTHING`` (no link), ``UNPROVEN`` (the search was given up
    # with what it had), ``UNFINISHED`` (with nothing), or ``ILL`` (covariance), see ``kernel``.
    status: IntArray  # (n,)
    # Visited by the search, the attitude of a complete integer vector counted as 100.
    nodes: IntArray  # (n,)
    baselines_n_m: FloatArray  # (n, b, 3), by the best; 0 of an antenna that has no link

    def with_rows(self, at: IntArray, part: "ConstrainedSearch") -> "ConstrainedSearch":
        """Return all epochs, some of them replaced."""
        columns = [column.copy() for column in self]
        for column, replaced in zip(columns, part, strict=True):
            column[at] = replaced
        return ConstrainedSearch._make(columns)


def search_constrained(differences: DoubleDifferences, nodes: int) -> ConstrainedSearch:
    """Find the integers of least constrained cost in every epoch.

    ``wrong_probability`` is one minus the share of the best integers in the posterior of all
    integers: Gaussian noise of the stated covariance, every integer vector and every attitude as
    likely before as any other, and integrated out as in ``volume``. Of two antennas 1 m apart under
    7 satellites, 480,000 simulated sets, 101 of the 103,572 accepted for a share of 1e-3 were
    wrong, with 103.5 expected.

    Parameters
    ----------
    nodes : int
        What a search may visit before it is given up, 10 to 100 ns each; the attitude of
        a complete integer vector counts as 100.
    """
    result, arrays, degrees = searched(differences, 2, 1, _REACH, nodes, listed=False)
    columns = result.columns[:, 0].reshape(-1, 3, 3)
    return ConstrainedSearch(
        cycles=result.cycles[:, 0],
        costs=result.costs,
        degrees=degrees,
        wrong_probability=result.wrong_probability,
        log_evidence=result.log_evidence,
        status=result.status,
        nodes=result.nodes,
        baselines_n_m=arrays.coordinates_m[arrays.pattern] @ columns,
    )


def searched(
    differences: DoubleDifferences,
    held: int,
    written: int,
    reach: float,
    nodes: int,
    *,
    listed: bool,
) -> tuple[Found, Spans, IntArray]:
    """Search every epoch as ``search_epochs`` does, into room as ``nothing_found`` makes it.

    Returns
    -------
    Found
    Spans
    ndarray of int64, shape (n,)
        Degrees of freedom of true integers' cost.
    """
    epochs = link_arrays(differences)
    arrays = spans(differences.baselines_b_m, np.any(epochs.resolvable, axis=2))
    open_angles = np.where(arrays.rank[arrays.pattern] == 1, 2, 3)
    degrees = np.maximum(2 * epochs.resolvable.sum(axis=(1, 2)) - open_angles, 0)
    bound = np.asarray(chdtri(np.maximum(degrees, 1), _FIRST_BOUND))  # of the cost, (n,)
    result = nothing_found(epochs.phase_m.shape, held=held, written=written)
    search_epochs(epochs, arrays, bound, result, reach, nodes, listed)
    return result, arrays, degrees
