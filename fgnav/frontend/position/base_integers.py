"""The one owner of integers of arcs against a base: each has one, a probability, and its span.

A filter of ambiguities alone, with a free place at every epoch, yields differences of two arcs of
one carrier, which are integers in cycles; those of which the bootstrapped success rate is high
enough are fixed [1]_, refused where they lie further from the float solution than noise can be, and
become constraints on the graph's variable A. A second filter that no integer has entered says at
the end of each block how likely they still are: what another integer is likelier of is taken back
(``base_faults``). Causal throughout: a filter has integers from the block after that in which they
are fixed until the block after that in which they are taken back, when it forgets that it had them;
others have those that hold at the end, from where their arcs begin.

References
----------
.. [1] Teunissen, Joosten, Tiberius: Geometry-free ambiguity success rates in case of partial
   fixing, ION NTM 1999.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.position.ambiguity_filter import (
    Ambiguities,
    ArcNames,
    Constraint,
)
from fgnav.frontend.position.base_faults import Slip, largest, odds, slips
from fgnav.graph.factors.antenna_phase import ArcBlock, PhaseRows
from fgnav.graph.types.on_demand import OnDemand
from fgnav.integers.ils.partial import partial_integer_least_squares

_WRONG_MAX = 1e-3  # chance that integers fixed together are not all right
_DETERMINED_CYCLES = 0.05  # 1-sigma of a difference whose integer is fixed
_LEAST_FIXED = 4  # arcs that make a position
_LIKELIER = 0.5  # less probable integers are taken back


class ArcSpan(NamedTuple):
    """An arc's integer against the oldest arc of its carrier, in some blocks."""

    link: str
    first: int  # block
    last: int  # block
    cycles: int
    wrong: float  # probability
    likelier: int | None  # where it was taken back after its last block


class BaseIntegers(NamedTuple):
    """Blocks with integers, and what is reported of them."""

    blocks: Sequence[ArcBlock]
    fixed: BoolArray  # (b,), whether enough arcs of each block are fixed for a position
    wrong_probability: float
    arcs: tuple[ArcSpan, ...]
    earlier: tuple[tuple[int, Sequence[ArcBlock]], ...]  # blocks as they were before a block
    slips: tuple[Slip, ...] = ()  # first epoch with any: all else is of blocks before
    at: tuple[int, int] = (0, 0)  # its block, and which of the block's epochs it is


@dataclass(slots=True)
class _Owner:
    """Blocks with their epochs, and what is known of them so far."""

    blocks: Sequence[ArcBlock]
    names: list[ArcNames]
    rows: Sequence[PhaseRows]
    ends: IntArray  # (b + 1,), first epochs
    state: Ambiguities = field(default_factory=Ambiguities)  # of the last block
    constraints: list[Constraint] = field(default_factory=list)
    current: dict[int, ArcSpan] = field(default_factory=dict)  # by arc
    past: list[ArcSpan] = field(default_factory=list)

    def epochs(self, j: int) -> list[tuple[FloatArray, FloatArray]]:
        """Return rows of a block on A alone."""
        return [self.rows[i].without_place() for i in range(self.ends[j], self.ends[j + 1])]

    def go_on(self, j: int, epochs: list[tuple[FloatArray, FloatArray]]) -> None:
        """Go on by a block and its epochs, with the constraints of the one before."""
        for one in self.constraints:
            if one.block == j - 1:
                self.state = self.state.constrained(one)
        self.state = self.state.led(self.blocks[j])
        for H, z in epochs:
            self.state = self.state.measured(H, z)


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
    owner, free = _Owner(blocks, names, rows, ends), Ambiguities()
    fixed = np.zeros(len(blocks), dtype=np.bool_)
    earlier: list[tuple[int, Sequence[ArcBlock]]] = []
    for j in range(len(blocks)):
        free, epochs = free.led(blocks[j]), owner.epochs(j)
        for i, (H, z) in enumerate(epochs):
            if jumped := slips(free, H, z, names[j]):
                return BaseIntegers((), fixed, 0.0, (), (), jumped, (j, i))
            free = free.measured(H, z)
        owner.go_on(j, epochs)
        before = list(owner.constraints)
        if _checked(owner, j, free) and causal:
            earlier.append((j + 1, _entered(blocks, names, before, causal=True)))
        one, fixed[j] = _searched(j, names[j], owner.state)
        if one is not None:
            owner.constraints.append(one)
    if not causal:
        for one in owner.constraints:
            fixed[_first_with(names, one) : one.block + 1] = True
    success = float(np.prod([one.success for one in owner.constraints]))
    out = _entered(blocks, names, owner.constraints, causal=causal)
    if earlier and earlier[-1][0] == len(blocks):  # too late for any estimate
        out = earlier.pop()[1]
    arcs = (*owner.past, *owner.current.values())
    return BaseIntegers(out, fixed, 1 - success, arcs, tuple(earlier))


def _checked(owner: _Owner, j: int, free: Ambiguities) -> bool:
    """Take back integers that others are likelier than; return whether there were any.

    The probabilities of all others are noted.
    """
    names = owner.names[j]
    rows, singles = _integer_combinations(owner, names)
    if not len(rows):
        return False
    cycles = rows / names.wavelength_m
    offset = cycles @ names.offset_m
    rounded = np.rint(offset).astype(np.int64)
    held = np.rint(owner.state.combined(cycles)[0] + offset).astype(np.int64)
    floats, covariance = free.combined(cycles)
    likely = odds(floats + offset - rounded, covariance, held - rounded)
    if likely is None:
        return False
    is_back, other = likely.held < _LIKELIER, likely.likeliest + rounded
    for i in range(singles):
        a = int(rows[i].argmax())
        changed = int(other[i]) if is_back and other[i] != held[i] else None
        _noted(owner, names, a, j, (int(held[i]), float(likely.wrong[i]), changed))
    if is_back:
        _taken_back(owner, j, rows, other - held)
    return is_back


def _integer_combinations(owner: _Owner, names: ArcNames) -> tuple[FloatArray, int]:
    """Return independent combinations of live arcs that are integers, (k, c).

    First differences that are determined, how many there are of them, and then what else is fixed.
    """
    D, cycles = _by_difference(names)
    rows = D[_sigma_cycles(owner.state, cycles) < _DETERMINED_CYCLES] if len(D) else D
    singles = len(rows)
    for one in owner.constraints:
        for row in _on_arcs(one, names.arc)[0]:
            more = np.vstack([rows, row])
            if row.any() and np.linalg.matrix_rank(more) == len(more):
                rows = more
    return rows, singles


def _on_arcs(one: Constraint, arc: IntArray) -> tuple[FloatArray, BoolArray]:
    """Return combinations on arcs, (k, c), and which have others as well, (k,): zero here."""
    _, at, of = np.intersect1d(arc, one.arc, return_indices=True)
    rows = np.zeros((len(one.right), len(arc)))
    rows[:, at] = one.combination[:, of]
    others = np.delete(one.combination, of, axis=1).any(axis=1)
    rows[others] = 0.0
    return rows, np.asarray(others)


def _noted(
    owner: _Owner, names: ArcNames, a: int, j: int, of: tuple[int, float, int | None]
) -> None:
    """Note an arc's integer, the chance that it is wrong, and what takes its place."""
    cycles, wrong, likelier = of
    arc, span = int(names.arc[a]), owner.current.pop(int(names.arc[a]), None)
    if span is not None and span.cycles != cycles:  # an older arc of its carrier has ended
        owner.past.append(span)
        span = None
    first = j if span is None else span.first
    span = ArcSpan(names.link[a], first, j, cycles, wrong, likelier)
    if likelier is None:
        owner.current[arc] = span
    else:
        owner.past.append(span)


def _taken_back(owner: _Owner, j: int, rows: FloatArray, by: IntArray) -> None:
    """Drop the combinations that likelier integers contradict, and what is known by them.

    Those of arcs that have ended as well: nothing tells any more whether they were right.
    """
    kept = []
    for one in owner.constraints:
        on_arcs, others = _on_arcs(one, owner.names[j].arc)
        moved = np.linalg.lstsq(rows.T, on_arcs.T, rcond=None)[0].T @ by
        live = np.isin(one.arc, owner.names[j].arc)
        wrong = (np.abs(moved) > 1e-6) | (others & one.combination[:, live].any(axis=1))
        if not wrong.all():
            kept.append(one.without(wrong))
    owner.constraints, owner.state = kept, Ambiguities()
    for k in range(j + 1):
        owner.go_on(k, owner.epochs(k))


def _searched(j: int, of: ArcNames, state: Ambiguities) -> tuple[Constraint | None, bool]:
    """Return integers that a block newly fixes, and whether enough are fixed by then."""
    D, cycles = _by_difference(of)
    if not len(D):
        return None, False
    is_determined = _sigma_cycles(state, cycles) < _DETERMINED_CYCLES
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


def _by_difference(of: ArcNames) -> tuple[FloatArray, FloatArray]:
    """Return differences of arcs, (d, c), and the same in cycles per metre."""
    D = of.differences
    return D, D / of.wavelength_m


def _sigma_cycles(state: Ambiguities, cycles: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.diag(state.combined(cycles)[1])))


def _entered(
    blocks: Sequence[ArcBlock],
    names: list[ArcNames],
    constraints: list[Constraint],
    *,
    causal: bool,
) -> Sequence[ArcBlock]:
    """Return blocks with constraints."""
    changed: dict[int, ArcBlock] = {}
    for one in constraints:
        at = one.block + 1 if causal else _first_with(names, one)
        if at < len(blocks):
            changed[at] = _constrained(changed.get(at, blocks[at]), names[at], one, causal=causal)
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
