"""Float solution of an epoch under the affine array model, and the integers nearest to it.

Code alone determines the columns of ``fgnav.integers.ils.array_model``; phase then gives the float
ambiguities, with the full covariance of unequal variances, missing links and several groups.
"""

from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.integers.ils.array_model import LinkArrays, Spans, epoch_links, link_arrays, spans
from fgnav.integers.ils.float_solution import float_solution
from fgnav.integers.ils.search import OK, UNFINISHED, solve_subset
from fgnav.kernels.compiled import kernel
from fgnav.types.differences import DoubleDifferences

NOTHING, WEAK, ILL = range(10, 13)  # how an epoch can end besides OK and UNFINISHED

_NODES = 10**7  # 0.15 s; realistic searches take 1e2 to 1e5, and beyond the answer is seldom right


class ArraySearch(NamedTuple):
    """The nearest integers of every epoch."""

    cycles: IntArray  # (n, b, m): 0 where nothing was resolved
    fixed: BoolArray  # (n, b, m): links that the search, of all integers or of a subset, determined
    # Bootstrapped success rate of what was searched, by the stated noise: a lower bound of the
    # chance that it is right. NaN where nothing was resolved.
    success: FloatArray  # (n, b)
    # Of the best and the second-best vector of the search a baseline took part in; NaN without.
    squared_norms: FloatArray  # (n, b, 2)
    # ``OK``, ``NOTHING`` (no link), ``WEAK`` (geometry), ``ILL`` (covariance) or ``UNFINISHED``
    # (the search was given up).
    status: IntArray  # (n, b)


def search_array(
    differences: DoubleDifferences, *, joint: bool, success_min: float = 0.0
) -> ArraySearch:
    """Resolve every epoch by integer least squares.

    Parameters
    ----------
    joint : bool
        All baselines of an epoch in one search; otherwise every baseline on its own.
    success_min : float
        Least success rate of a search: as many decorrelated integers are searched as reach it, and
        the links they determine are fixed. 0 searches all.
    """
    n, b, m = differences.phase_m.shape
    blocks = np.ones((min(b, 1), b), dtype=np.bool_) if joint else np.eye(b, dtype=np.bool_)
    epochs = link_arrays(differences)
    present = np.any(epochs.resolvable, axis=2)[:, None] & blocks  # (n, s, b)
    arrays = spans(differences.baselines_b_m, present.reshape(-1, b))
    result = ArraySearch(
        np.zeros((n, b, m), dtype=np.int64),
        np.zeros((n, b, m), dtype=np.bool_),
        np.full((n, b), np.nan),
        np.full((n, b, 2), np.nan),
        np.full((n, b), NOTHING),
    )
    _search_epochs(epochs, arrays, blocks, result, success_min)
    return result


def code_residuals(differences: DoubleDifferences) -> tuple[float, int]:
    """Return the normalised squared residuals of all code under the affine array model.

    Returns
    -------
    squares : float
        Sum over the epochs; if code noise is as stated its mean is ``degrees``.
    degrees : int
        Of freedom.
    """
    epochs = link_arrays(differences)
    arrays = spans(differences.baselines_b_m, np.any(epochs.resolvable, axis=2))
    squares, degrees = _code_squares(epochs, arrays)
    return float(squares), int(degrees)


@kernel
def _search_epochs(
    epochs: LinkArrays,
    arrays: Spans,
    blocks: BoolArray,
    result: ArraySearch,
    success_min: float,
) -> None:
    for k in range(len(result.cycles)):
        for s in range(len(blocks)):
            links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], blocks[s])
            if len(links) == 0:
                continue
            pattern = arrays.pattern[k * len(blocks) + s]
            solution = float_solution(epochs, arrays, k, pattern, links, 0.0)
            end = OK if solution.determined else WEAK
            if end == OK:
                # Numbers, no literals: else the search is compiled once more for these two.
                end, integers, norms, fixed, success = solve_subset(
                    solution.cycles,
                    solution.covariance,
                    int(np.int64(2)),
                    int(np.int64(_NODES)),
                    success_min,
                )
                end = end if end in (OK, UNFINISHED) else ILL
                for q in range(len(links)):
                    if end == OK:
                        i, j = links[q, 0], links[q, 1]
                        result.cycles[k, i, j], result.fixed[k, i, j] = integers[0, q], fixed[q]
                        result.success[k, i] = success
                        for c in range(len(norms)):
                            result.squared_norms[k, i, c] = norms[c]
            for q in range(len(links)):
                result.status[k, links[q, 0]] = end


@kernel
def _code_squares(epochs: LinkArrays, arrays: Spans) -> tuple[float, int]:
    squares, degrees = 0.0, 0
    everywhere = np.ones(epochs.phase_m.shape[1], dtype=np.bool_)
    for k in range(len(epochs.code_m)):
        pattern = arrays.pattern[k]
        links = epoch_links(epochs.resolvable[k], epochs.of_reference[k], everywhere)
        spare = len(links) - 3 * arrays.rank[pattern]
        if spare > 0:
            solution = float_solution(epochs, arrays, k, pattern, links, 0.0)
            if solution.determined:
                squares += solution.constant
                degrees += spare
    return squares, degrees
