"""Partial fixing: the integers that can be trusted."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from fgnav.checks import BadInputError, BoolArray, IntArray
from fgnav.integers.ils.decorrelation import decorrelate
from fgnav.integers.ils.search import (
    NOT_POSITIVE,
    OK,
    WITHOUT_LIMIT,
    checked_problem,
    fault,
    fixable,
    refused,
    search,
)


class PartialFix(NamedTuple):
    """A float solution, given integers of some combinations of its ambiguities."""

    combinations: IntArray  # (p, n): fixed combinations, one a row
    integers: IntArray  # (p,): their values
    success: float  # bootstrapped success rate of these: they are right at least as often
    fixed: BoolArray  # (n,): ambiguities that are integers now


def partial_integer_least_squares(
    float_cycles: ArrayLike, covariance: ArrayLike, success_min: float
) -> PartialFix:
    """Fix as many decorrelated integers as reach a success rate.

    Parameters
    ----------
    float_cycles : array_like, shape (n,)
    covariance : array_like, shape (n, n)
        Theirs, cycles^2.
    success_min : float
        Least bootstrapped success rate, between 0 and 1.

    Raises
    ------
    BadInputError
        As ``integer_least_squares``, or if ``success_min`` is no probability.
    """
    if not 0.0 <= success_min <= 1.0:
        raise BadInputError(f"success_min: must be between 0 and 1, got {success_min}")
    a, Q = checked_problem(float_cycles, covariance, 1)
    n = len(a)
    status, Z_T = fault(a, Q), np.eye(n)
    positive, L, d, T = decorrelate(np.array(Q, order="C"), Z_T)
    if status != OK or not positive:
        raise refused(status or NOT_POSITIVE)
    first, success = fixable(d, success_min)
    rounded, Z_T = np.rint(a), Z_T[first:]
    z_float = Z_T @ (a - rounded)
    z = np.zeros(n - first)
    if first < n:
        L, d = L[first:, first:].copy(), d[first:].copy()
        z = search(L, d, z_float, 1, WITHOUT_LIMIT)[1][0]
    combined = Z_T.astype(np.int64)
    return PartialFix(
        combinations=combined,
        integers=z.astype(np.int64) + combined @ rounded.astype(np.int64),
        success=success,
        fixed=(T[:first] == 0.0).all(axis=0),
    )
