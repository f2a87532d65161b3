"""Integers of arcs against a base, found block by block and held from there on.

A filter of ambiguities alone, with a free place at every epoch, yields differences of two arcs of
one carrier, which are integers in cycles; those of which the bootstrapped success rate is high
enough are fixed [1]_, refused where they lie further from the float solution than noise can be, and
become constraints on the graph's variable A.

References
----------
.. [1] Teunissen, Joosten, Tiberius: Geometry-free ambiguity success rates in case of partial
   fixing, ION NTM 1999.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.graph.factors.antenna_phase import ArcBlock, PhaseRows
from fgnav.graph.types.on_demand import OnDemand
from fgnav.integers.ils.partial import partial_integer_least_squares

_WRONG_MAX = 1e-3  # chance that integers fixed together are not all right
_FALSE_ALARM = 1e-4  # of the test of integers against the float solution
_SIGMA_M = 1e-3  # of a constraint: what stays of echoes and phase centres
_KNOWN_CYCLES = 0.05  # 1-sigma of a difference whose integer is known
_LEAST_FIXED = 4  # arcs that make a position


class ArcNames(NamedTuple):
    """The arcs of a block, the first dimensions of its A."""

    arc: IntArray  # (c,)
    group: IntArray  # (c,), carriers
    wavelength_m: FloatArray  # (c,)
    offset_m: FloatArray  # (c,), taken off their phases


class Constraint(NamedTuple):
    """Combinations of ambiguities that are known: ``rows @ n - right`` has unit variance."""

    block: int  # in which they were found
    arc: IntArray  # (c,)
    rows: FloatArray  # (k, c)
    right: FloatArray  # (k,)
    success: float


class BaseIntegers(NamedTuple):
    """Blocks with integers, and what is reported of them."""

    blocks: Sequence[ArcBlock]
    fixed: BoolArray  # (b,), whether enough arcs of each block are known for a position
    wrong_probability: float


def with_integers(
    blocks: Sequence[ArcBlock],
    names: list[ArcNames],
    rows: Sequence[PhaseRows],
    block: IntArray,
    *,
    causal: bool,
) -> BaseIntegers:
    """Return blocks whose arcs have their integers where these are known.

    Parameters
    ----------
    blocks : sequence of ArcBlock
    names : list of ArcNames
        Of each block.
    rows : sequence of PhaseRows, length k
    block : ndarray of int, shape (k,)
        Of each epoch, in order.
    causal : bool
        Whether integers enter with the block after that in which they are found; else with the
        first that has all of their arcs.
    """
    constraints: list[Constraint] = []
    fixed = np.zeros(len(blocks), dtype=np.bool_)
    information: FloatArray = np.empty((0, 0))
    vector: FloatArray = np.empty(0)
    ends = np.searchsorted(block, np.arange(len(blocks) + 1))
    for j, (led, of) in enumerate(zip(blocks, names, strict=True)):
        information, vector = _led(information, vector, led)
        for i in range(ends[j], ends[j + 1]):
            H, z = rows[i].without_place()
            information, vector = information + H.T @ H, vector + H.T @ z
        P = np.linalg.inv(information)
        one, fixed_now = _searched(j, of, P @ vector, P)
        if one is not None:
            constraints.append(one)
            c = len(of.arc)
            information[:c, :c] += one.rows.T @ one.rows
            vector[:c] += one.rows.T @ one.right
        fixed[j] = fixed_now
    changed: dict[int, ArcBlock] = {}
    for one in constraints:
        at = one.block + 1 if causal else _first_with(names, one)
        if at < len(blocks):
            changed[at] = _constrained(changed.get(at, blocks[at]), names[at], one, causal=causal)
    if not causal:
        for one in constraints:
            fixed[_first_with(names, one) : one.block + 1] = True
    success = float(np.prod([one.success for one in constraints]))
    out = OnDemand(len(blocks), lambda j: changed[j] if j in changed else blocks[j])
    return BaseIntegers(out, fixed, 1 - success)


def _led(
    information: FloatArray, vector: FloatArray, block: ArcBlock
) -> tuple[FloatArray, FloatArray]:
    """Return the information of a block's A by that of the one before."""
    B, A, right = block.before, block.after, block.right
    after, also = A.T @ A, A.T @ right
    if B.shape[1]:
        cross = -B.T @ A
        gain = np.linalg.solve(information + B.T @ B, np.c_[cross, vector - B.T @ right])
        after, also = after - cross.T @ gain[:, :-1], also - cross.T @ gain[:, -1]
    return (after + after.T) / 2, also


def _searched(j: int, of: ArcNames, A: FloatArray, P: FloatArray) -> tuple[Constraint | None, bool]:
    """Return integers that a block newly fixes, and whether enough are fixed by then."""
    D = _differences(of)
    c = len(of.arc)
    if not len(D):
        return None, False
    cycles = D / of.wavelength_m
    covariance = cycles @ P[:c, :c] @ cycles.T
    is_determined = np.diag(covariance) < _KNOWN_CYCLES**2
    enough = int(is_determined.sum()) >= _LEAST_FIXED - 1
    if is_determined.all():
        return None, enough
    D, cycles = D[~is_determined], cycles[~is_determined]
    covariance = covariance[np.ix_(~is_determined, ~is_determined)]
    offset = cycles @ of.offset_m
    floats = cycles @ A[:c] + (offset - np.rint(offset))
    best = partial_integer_least_squares(floats, (covariance + covariance.T) / 2, 1 - _WRONG_MAX)
    Z = best.combinations
    if not len(Z):
        return None, enough
    apart = Z @ floats - best.integers
    squares = float(apart @ np.linalg.solve(Z @ covariance @ Z.T, apart))
    if squares > _largest(len(Z)):
        return None, enough
    right = best.integers - Z @ (offset - np.rint(offset))
    rows, sigma = Z @ cycles, _SIGMA_M * Z @ D / of.wavelength_m
    enough = int(is_determined.sum() + best.fixed.sum()) >= _LEAST_FIXED - 1
    root = np.linalg.cholesky(sigma @ sigma.T)
    rows, right = np.linalg.solve(root, rows), np.linalg.solve(root, right)
    return Constraint(j, of.arc, rows, right, best.success), enough


def _largest(freedom: int) -> float:
    from scipy.special import chdtri  # noqa: PLC0415  # lazy: keeps the command line quick

    return float(chdtri(freedom, _FALSE_ALARM))


def _differences(of: ArcNames) -> FloatArray:
    """Return arcs against the oldest of their carrier, (d, c)."""
    rows = []
    for group in np.unique(of.group):
        members = np.flatnonzero(of.group == group)
        oldest = members[of.arc[members].argmin()]
        for other in members[members != oldest]:
            row = np.zeros(len(of.arc))
            row[other], row[oldest] = 1.0, -1.0
            rows.append(row)
    return np.array(rows).reshape(-1, len(of.arc))


def _first_with(names: list[ArcNames], one: Constraint) -> int:
    """Return the first block that has all arcs of a constraint."""
    arcs, at = one.arc[one.rows.any(axis=0)], one.block
    while at and np.isin(arcs, names[at - 1].arc).all():
        at -= 1
    return at


def _constrained(block: ArcBlock, of: ArcNames, one: Constraint, *, causal: bool) -> ArcBlock:
    """Return a block that knows integers: of the A before it, or of its own."""
    k = len(one.right)
    before, after = np.zeros((k, block.before.shape[1])), np.zeros((k, block.size))
    if causal:
        before[:, : len(one.arc)] = -one.rows
    else:
        used = one.rows.any(axis=0)
        place = {int(arc): i for i, arc in enumerate(of.arc)}
        after[:, [place[int(arc)] for arc in one.arc[used]]] = one.rows[:, used]
    return block._replace(
        before=np.vstack([block.before, before]),
        after=np.vstack([block.after, after]),
        right=np.append(block.right, one.right),
    )
