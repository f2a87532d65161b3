"""Arcs of carrier phase in the chain: beside the constants, changed from block to block.

The border of the chain is (constants, A), A padded to the most dimensions that it has in the
flight by independent unit variables. Between keyframes of two blocks the information of (state,
constants, A, 1) becomes that of (state, constants, A', 1): what leads from A to A' is added and A
eliminated. Backwards A follows from the others as a state does from the next one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock, StackedRows
from fgnav.graph.types.states import States
from fgnav.solve.chain import arcs_kernel, back_kernel, kernel


class LinearPhases(NamedTuple):
    """Phases of some keyframes, and where the A of each block is linearised."""

    rows: StackedRows | None  # None where these have none
    arcs: Sequence[FloatArray] = ()  # empty: at zero


class EliminatedArcs(NamedTuple):
    """How A of a block follows from state, constants and A' of the next one."""

    root: FloatArray  # (a, a), lower: information of A given the others
    gain: FloatArray  # (a, D + b + a' + 1): E[A | rest] = gain[:, -1] - gain[:, :-1] @ rest


class Border:
    """What stands beside the states of a chain: constants, and arcs that change between keyframes.

    Without phases it is the constants alone. Keyframes are counted from the oldest.

    Parameters
    ----------
    phase : AntennaPhase or None
    """

    def __init__(self, phase: AntennaPhase | None) -> None:
        self.width = 0  # of A
        self._phase: AntennaPhase | None = None
        self._blocks: dict[int, ArcBlock] = {}  # of the keyframes, by number
        self._block: list[int] = []  # of each keyframe; -1 before the first
        self._eliminated: dict[int, EliminatedArcs] = {}  # by number of the keyframe before
        self._oldest = 0
        self.at: list[FloatArray] = []  # where the A of each block is linearised; empty: at zero
        self._linear: dict[int, ArcBlock] = {}  # blocks about there
        self.steps: dict[int, FloatArray] = {}  # from there, by block, once substituted
        self.read(phase)

    @property
    def log_root(self) -> float:
        """Return the log determinant of the root of the information of all A before the last."""
        return float(sum(np.log(one.root.diagonal()).sum() for one in self._eliminated.values()))

    @property
    def cost(self) -> float:
        """Return the sum of squares of what leads from block to block."""
        rights = (self._linearised(block, j).right for j, block in self._blocks.items())
        return float(sum(right @ right for right in rights))

    def linearise(self, at: Sequence[FloatArray]) -> None:
        """Linearise the A of each block anew."""
        self.at, self._linear = list(at), {}

    def size(self, k: int) -> int:
        """Return how many dimensions A of keyframe k has."""
        arcs = self._arcs(k)
        return 0 if arcs is None else arcs.size

    @property
    def leads_on(self) -> bool:
        """Return whether the oldest keyframe's information is that with the A of the next one."""
        return self._oldest in self._eliminated

    def read(self, phase: AntennaPhase | None) -> None:
        """Let keyframes come from other phases: of the same flight, which has gone on since."""
        if phase is not self._phase and phase is not None:
            self.width = max(self.width, *(one.size for one in phase.blocks), 0)
        self._phase = phase

    def append(self, row: int) -> None:
        """Take in a keyframe of the phases read last."""
        before, phase = self._block[-1] if self._block else -1, self._phase
        number = before if phase is None else phase.block_at(row, before)
        if phase is not None and number >= 0 and number not in self._blocks:
            self._blocks[number] = phase.blocks[number - phase.first_block]
        self._block.append(number)

    def forget(self, count: int) -> None:
        """Take the oldest keyframes out."""
        for number in range(self._oldest, self._oldest + count):
            self._eliminated.pop(number, None)
        del self._block[:count]
        self._oldest += count
        for number in [j for j in self._blocks if self._block and j < self._block[0]]:
            del self._blocks[number]

    def begin(self, information: FloatArray) -> None:
        """Begin anew at the first keyframe: add what is known of its A."""
        self._eliminated.clear()
        if self.width:
            begin(information, self._arcs(0), self.width)

    def eliminate(
        self,
        rows: tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray],
        first: int,
        *,
        by_rows: bool,
        offset: int = 0,
    ) -> int:
        """Eliminate keyframes as ``kernel.eliminate``, A with them where it ends.

        Parameters
        ----------
        rows : tuple of ndarray
            Motion, node, forward, root and gain of some keyframes.
        first : int
            Row of the keyframe whose forward information is known.
        by_rows : bool
        offset : int
            Number of keyframes before those of the rows.
        """
        k, n = first, len(rows[0])
        while k < n - 1:
            end, here = min(self._end(offset + k + 1) - offset, n), offset + k
            number = self._oldest + here
            changes = self._block[here + 1] != self._block[here]
            if changes and (k > first or number not in self._eliminated):
                before, after = self._arcs(here), self._arcs(here + 1)
                size = 0 if before is None else before.size
                if after is not None:
                    self._eliminated[number] = eliminate_arcs(rows[2][k], after, size, self.width)
            motion, node, forward, root, gain = (part[k:end] for part in rows)
            failed = kernel.eliminate(motion, node, forward, root, gain, by_rows)
            if failed >= 0:
                return k + int(failed)
            k = end - 1
        return -1

    def substitute(self, gain: FloatArray, end: FloatArray, steps: FloatArray) -> None:
        """Fill the steps, (n, D), of all states; see ``back_kernel.substitute``."""
        after, last = end.copy(), len(steps)
        while last:
            first = self._first(last - 1)
            arcs = self._arcs(last - 1)
            if arcs is not None:
                A = after[len(after) - self.width :]
                self.steps[self._block[last - 1]] = A[: arcs.size].copy()
            begin = max(first - 1, 0)
            back_kernel.substitute(gain[begin:], after, steps[begin:last])
            after[: steps.shape[1]] = steps[begin]
            if first:
                steps_before(self._eliminated[self._oldest + begin], after, self.width)
            last = first

    def moved(self) -> tuple[FloatArray, ...]:
        """Return where the A of each block is estimated, once substituted."""
        at = self.at or [np.zeros(len(step)) for _, step in sorted(self.steps.items())]
        return tuple(at[j] + step for j, step in sorted(self.steps.items()))

    def marginals(
        self,
        begin: int,
        gain: FloatArray,
        root: FloatArray,
        end: FloatArray,
        out: tuple[FloatArray, FloatArray, FloatArray],
    ) -> None:
        """Fill covariances of keyframes from ``begin`` on; see ``back_kernel.marginals``."""
        joint, last = end.copy(), begin + len(out[0])
        while True:
            first = self._first(last - 1)
            start = max(first - 1, begin)
            part = tuple(one[start - begin : last - begin] for one in out)
            back_kernel.marginals(gain[start:], root[start:], joint, *part)
            if start == begin:
                return
            before = self._eliminated[self._oldest + start]
            arcs_kernel.covariance_before(before.root, before.gain, joint, self.width)
            last = first

    def _arcs(self, k: int) -> ArcBlock | None:
        """Return the block of arcs of a keyframe, about where it is linearised; None before any."""
        j = self._block[k]
        return None if j < 0 else self._linearised(self._blocks[j], j)

    def _linearised(self, block: ArcBlock, j: int) -> ArcBlock:
        if not self.at:
            return block
        if j not in self._linear:
            right = block.right - block.after @ self.at[j]
            right += block.before @ self.at[j - 1] if j else 0.0
            self._linear[j] = block._replace(right=right)
        return self._linear[j]

    def _first(self, k: int) -> int:
        """Return the first keyframe that has the arcs of keyframe k."""
        if not self.width:
            return 0
        block = self._block[k]
        while k and self._block[k - 1] == block:
            k -= 1
        return k

    def _end(self, k: int) -> int:
        """Return the first keyframe after k that has other arcs, or how many there are."""
        if not self.width:
            return len(self._block)
        block = self._block[k]
        while k < len(self._block) and self._block[k] == block:
            k += 1
        return k


def add_phases(
    phase: AntennaPhase,
    phases: LinearPhases,
    rows: IntArray,
    at: States,
    node: FloatArray,
    into: IntArray,
) -> None:
    """Add phases of some keyframes, (j,), to the nodes ``into``; see ``kernel``.

    Parameters
    ----------
    phase : AntennaPhase
    phases : LinearPhases
        Those of these keyframes.
    rows : ndarray of int, shape (j,)
        Keyframes.
    at : States
        Where they are linearised, (j,).
    node : ndarray, shape (n, W, W)
    into : ndarray of int, shape (j,)
    """
    of_epochs, arcs = phases
    if of_epochs is None:
        return
    epoch, shape, G, H, z = of_epochs
    place, lever = rows.searchsorted(phase.row[epoch]), phase.lever_column
    D, b, arm_b_m = at.width, len(at.constants), phase.arm_b_m[epoch]
    if node.shape[1] <= D + b + shape[:, 1].max():  # a kernel would write beyond its memory
        raise ValueError(f"node: {node.shape[1]} columns, of states, constants, arcs and 1 too few")
    if lever >= 0:
        arm_b_m = arm_b_m + at.constants[lever : lever + 3]
    first = np.cumsum([0, *map(len, arcs)])[phase.block[epoch]] if arcs else np.zeros_like(epoch)
    kernel.add_phases(
        node,
        into[place],
        (D + b, -1 if lever < 0 else D + lever),
        (at.R_nb[place], at.p_n_m[place], arm_b_m),
        np.concatenate(arcs) if arcs else np.zeros(shape[:, 1].max()),
        first,
        shape,
        (G, H, z),
    )


def begin(information: FloatArray, block: ArcBlock | None, a: int) -> None:
    """Add what is known of the first keyframe's A, which has ``a`` columns before the last."""
    size, first = 0 if block is None else block.size, len(information) - 1 - a
    if block is not None:
        own = slice(first, first + size)
        information[own, own] += block.after.T @ block.after
        information[own, -1] += block.after.T @ block.right
        information[-1, -1] += block.right @ block.right
    unused = np.arange(first + size, first + a)
    information[unused, unused] += 1.0


def eliminate_arcs(forward: FloatArray, block: ArcBlock, size: int, a: int) -> EliminatedArcs:
    """Turn the information of a keyframe into that with the A of a block; see ``change_arcs``."""
    is_positive, root, gain = arcs_kernel.change_arcs(
        forward, size, a, block.before, block.after, block.right
    )
    if not is_positive:
        raise NoSolutionError("arcs: the data leave an ambiguity open")
    return EliminatedArcs(root, gain)


def steps_before(eliminated: EliminatedArcs, step: FloatArray, a: int) -> None:
    """Turn steps of (state, constants, A'), in place, into those of the A before."""
    arcs = eliminated.gain[:, -1] - eliminated.gain[:, :-1] @ step[: eliminated.gain.shape[1] - 1]
    step[len(step) - a :] = 0.0
    step[len(step) - a : len(step) - a + len(arcs)] = arcs
