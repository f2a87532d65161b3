"""The one owner of integers of arcs against a base: each has one, a probability, and its span.

A filter of ambiguities alone, with a free place at every epoch, yields differences of two arcs of
one carrier, which are integers in cycles; those of which the bootstrapped success rate is high
enough are fixed [1]_, refused where they lie further from the float solution than noise can be, and
become constraints on the graph's variable A. Causal throughout: a filter has integers from the
block after that in which they are fixed; others have them from where their arcs begin.

References
----------
.. [1] Teunissen, Joosten, Tiberius: Geometry-free ambiguity success rates in case of partial
   fixing, ION NTM 1999.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fgnav.assembly.position.ambiguity_filter import Ambiguities, ArcNames, Constraint
from fgnav.assembly.position.arc_slips import Slip, largest, slips
from fgnav.checks import BoolArray, IntArray
from fgnav.graph.factors.antenna_phase import ArcBlock, PhaseRows
from fgnav.graph.types.on_demand import OnDemand
from fgnav.integers.ils.partial import partial_integer_least_squares

_WRONG_MAX = 1e-3  # chance that integers fixed together are not all right
_DETERMINED_CYCLES = 0.05  # 1-sigma of a difference whose integer is fixed
_LEAST_FIXED = 4  # arcs that make a position


class ArcSpan(NamedTuple):
    """An arc's integer against the oldest arc of its carrier, in some blocks."""

    link: str
    first: int  # block
    last: int  # block
    cycles: int
    wrong: float  # probability


class BaseIntegers(NamedTuple):
    """Blocks with integers, and what is reported of them."""

    blocks: Sequence[ArcBlock]
    fixed: BoolArray  # (b,), whether enough arcs of each block are fixed for a position
    wrong_probability: float
    arcs: tuple[ArcSpan, ...]
    slips: tuple[Slip, ...] = ()  # first epoch with any: all else is of blocks before
    at: tuple[int, int] = (0, 0)  # its block, and which of the block's epochs it is


def with_integers(
    blocks: Sequence[ArcBlock],
    names: list[ArcNames],
    rows: Sequence[PhaseRows],
    block: IntArray,
    *,
    causal: bool,
) -> BaseIntegers:
    """Return blocks whose arcs have their integers where these are fixed.

    Parameters
    ----------
    blocks : sequence of ArcBlock
    names : list of ArcNames
        Of each block.
    rows : sequence of PhaseRows, length k
    block : ndarray of int, shape (k,)
        Of each epoch, in order.
    causal : bool
        Whether integers enter with the block after that in which they are fixed; else with the
        first that has all of their arcs.
    """
    ends = np.searchsorted(block, np.arange(len(blocks) + 1))
    state, constraints = Ambiguities(), list[Constraint]()
    fixed, spans = np.zeros(len(blocks), dtype=np.bool_), dict[tuple[int, int], ArcSpan]()
    for j in range(len(blocks)):
        state = state.propagated(blocks[j])
        for i in range(ends[j], ends[j + 1]):
            H, z = rows[i].without_place()
            if jumped := slips(state, H, z, names[j]):
                return BaseIntegers((), fixed, 0.0, (), jumped, (j, i - int(ends[j])))
            state = state.measured(H, z)
        one, fixed[j] = _searched(j, names[j], state)
        if one is not None:
            constraints.append(one)
            state = state.constrained(one)
        _note(spans, j, names[j], state, constraints)
    if not causal:
        for one in constraints:
            fixed[_first_with(names, one) : one.block + 1] = True
    success = float(np.prod([constraint.success for constraint in constraints]))
    out = _entered(blocks, names, constraints, causal=causal)
    return BaseIntegers(out, fixed, 1 - success, tuple(spans.values()))


def _note(
    spans: dict[tuple[int, int], ArcSpan],
    j: int,
    names: ArcNames,
    state: Ambiguities,
    constraints: list[Constraint],
) -> None:
    """Note the integers that arcs of a block have, and the chance that each is wrong."""
    D, cycles = names.differences, names.cycles
    if not len(D) or not constraints:
        return
    floats, covariance = state.combined(cycles)
    integers = np.rint(floats + cycles @ names.offset_m).astype(np.int64)
    for i in np.flatnonzero(np.diag(covariance) < _DETERMINED_CYCLES**2):
        a = int(D[i].argmax())
        arc, held = int(names.arc[a]), int(integers[i])
        of_arc = [
            constraint.success
            for constraint in constraints
            if arc in constraint.arc[constraint.used]
        ]
        wrong = 1 - min(of_arc, default=1.0)
        span = spans.get((arc, held), ArcSpan(names.link[a], j, j, held, wrong))
        spans[arc, held] = span._replace(last=j, wrong=wrong)


def _searched(j: int, of: ArcNames, state: Ambiguities) -> tuple[Constraint | None, bool]:
    """Return integers that a block newly fixes, and whether enough are fixed by then."""
    D, cycles = of.differences, of.cycles
    if not len(D):
        return None, False
    is_determined = np.diag(state.combined(cycles)[1]) < _DETERMINED_CYCLES**2
    enough = int(is_determined.sum()) >= _LEAST_FIXED - 1
    if is_determined.all():
        return None, enough
    D, cycles = D[~is_determined], cycles[~is_determined]
    floats, covariance = state.combined(cycles)
    offset = cycles @ of.offset_m
    floats = floats + (offset - np.rint(offset))
    best = partial_integer_least_squares(floats, (covariance + covariance.T) / 2, 1 - _WRONG_MAX)
    Z = best.combinations
    if not len(Z):
        return None, enough
    apart = Z @ floats - best.integers
    squares = float(apart @ np.linalg.solve(Z @ covariance @ Z.T, apart))
    if squares > largest(len(Z)):
        return None, enough
    right = best.integers - Z @ (offset - np.rint(offset))
    enough = int(is_determined.sum() + best.fixed.sum()) >= _LEAST_FIXED - 1
    combination = np.rint(Z @ D).astype(np.int64)
    return Constraint(j, of.arc, Z @ cycles, right, combination, best.success), enough


def _entered(
    blocks: Sequence[ArcBlock],
    names: list[ArcNames],
    constraints: list[Constraint],
    *,
    causal: bool,
) -> Sequence[ArcBlock]:
    """Return blocks with constraints."""
    changed: dict[int, ArcBlock] = {}
    for constraint in constraints:
        at = constraint.block + 1 if causal else _first_with(names, constraint)
        if at < len(blocks):
            changed[at] = _constrained(
                changed.get(at, blocks[at]), names[at], constraint, causal=causal
            )
    return OnDemand(len(blocks), lambda j: changed[j] if j in changed else blocks[j])


def _first_with(names: list[ArcNames], one: Constraint) -> int:
    """Return the first block that has all arcs of a constraint."""
    arcs, at = one.arc[one.used], one.block
    while at and np.isin(arcs, names[at - 1].arc).all():
        at -= 1
    return at


def _constrained(block: ArcBlock, of: ArcNames, one: Constraint, *, causal: bool) -> ArcBlock:
    """Return a block that knows integers: of the A before it, or of its own."""
    (rows, right), k = one.whitened, len(one.right)
    before, after = np.zeros((k, block.before.shape[1])), np.zeros((k, block.size))
    if causal:
        before[:, : len(one.arc)] = -rows
    else:
        place = {int(arc): i for i, arc in enumerate(of.arc)}
        used = np.flatnonzero(one.used)
        after[:, [place[int(one.arc[i])] for i in used]] = rows[:, used]
    return block._replace(
        before=np.vstack([block.before, before]),
        after=np.vstack([block.after, after]),
        right=np.append(block.right, right),
    )
