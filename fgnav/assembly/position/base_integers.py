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

from fgnav.assembly.position.ambiguity_filter import (
    Ambiguities,
    ArcNames,
    Constraint,
    Slip,
    largest,
    slips,
)
from fgnav.assembly.position.live_arcs import LiveRows
from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.factors.antenna_phase import ArcBlock
from fgnav.graph.types.on_demand import OnDemand
from fgnav.integers.ils.partial import partial_integer_least_squares
from fgnav.types.integers import ArcInteger

_WRONG_MAX = 1e-3  # chance that integers fixed together are not all right
_DETERMINED_CYCLES = 0.05  # 1-sigma of a difference whose integer is fixed
_LEAST_FIXED = 4  # arcs that make a position


class BaseIntegers(NamedTuple):
    """Blocks with integers, and what is reported of them."""

    blocks: Sequence[ArcBlock]
    fixed: BoolArray  # (b,), whether enough arcs of each block are fixed for a position
    wrong_probability: float
    arcs: tuple[ArcInteger, ...]  # against the oldest arc of their carrier
    slips: tuple[Slip, ...] = ()  # first epoch with any: all else is of blocks before
    epoch: int = 0  # of the slips


def with_integers(live: LiveRows, t_s: FloatArray, *, causal: bool) -> BaseIntegers:
    """Return blocks whose arcs have their integers where these are fixed.

    Parameters
    ----------
    live : LiveRows
    t_s : ndarray, shape (n,)
        Keyframes.
    causal : bool
        Whether integers enter with the block after that in which they are fixed; else with the
        first that has all of their arcs.
    """
    blocks, names, epoch_s = live.blocks, live.names, t_s[live.row]
    ends = np.searchsorted(live.block, np.arange(len(blocks) + 1))
    state, constraints = Ambiguities(), list[Constraint]()
    fixed, arcs = np.zeros(len(blocks), dtype=np.bool_), dict[tuple[int, int], ArcInteger]()
    for j in range(len(blocks)):
        state = state.propagated(blocks[j])
        for i in range(ends[j], ends[j + 1]):
            H, z = live.rows[i].without_place()
            if jumped := slips(state, H, z, names[j]):
                return BaseIntegers((), fixed, 0.0, (), jumped, i)
            state = state.measured(H, z)
        one, fixed[j] = _searched(j, names[j], state)
        if one is not None:
            constraints.append(one)
            state = state.constrained(one)
        span_s = float(epoch_s[ends[j]]), float(epoch_s[ends[j + 1] - 1])
        _note(arcs, span_s, names[j], state, constraints)
    if not causal:
        for one in constraints:
            fixed[_first_with(names, one) : one.block + 1] = True
    success = float(np.prod([constraint.success for constraint in constraints]))
    out = _entered(blocks, names, constraints, causal=causal)
    return BaseIntegers(out, fixed, 1 - success, tuple(arcs.values()))


def _note(
    arcs: dict[tuple[int, int], ArcInteger],
    span_s: tuple[float, float],
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
        before = arcs.get((arc, held))
        arcs[arc, held] = ArcInteger(
            link=names.link[a],
            from_s=span_s[0] if before is None else before.from_s,
            until_s=span_s[1],
            cycles=held,
            wrong_probability=wrong,
            by="base",
        )


def _searched(j: int, of: ArcNames, state: Ambiguities) -> tuple[Constraint | None, bool]:
    """Return integers that a block newly fixes, and whether enough are fixed by then."""
    D, cycles = of.differences, of.cycles
    if not len(D):
        return None, False
    is_determined = np.diag(state.combined(cycles)[1]) < _DETERMINED_CYCLES**2
    is_placed = int(is_determined.sum()) >= _LEAST_FIXED - 1
    if is_determined.all():
        return None, is_placed
    D, cycles = D[~is_determined], cycles[~is_determined]
    floats, covariance = state.combined(cycles)
    offset = cycles @ of.offset_m
    floats = floats + (offset - np.rint(offset))
    best = partial_integer_least_squares(floats, (covariance + covariance.T) / 2, 1 - _WRONG_MAX)
    Z = best.combinations
    if not len(Z):
        return None, is_placed
    deviation = Z @ floats - best.integers
    squares = float(deviation @ np.linalg.solve(Z @ covariance @ Z.T, deviation))
    if squares > largest(len(Z)):
        return None, is_placed
    right = best.integers - Z @ (offset - np.rint(offset))
    is_placed = int(is_determined.sum() + best.fixed.sum()) >= _LEAST_FIXED - 1
    combination = np.rint(Z @ D).astype(np.int64)
    return Constraint(j, of.arc, Z @ cycles, right, combination, best.success), is_placed


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
