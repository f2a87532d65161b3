"""A sliding window over the flight: keyframes come one by one, are smoothed, and are forgotten.

Whoever leaves the window leaves what it knew of the next keyframe behind, as the chain's message:
marginalisation is exact up to its linearisation, and the window's size does not grow.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.methods.smoother import links
from fgnav.methods.smoother.chain import Chain, Marginals
from fgnav.methods.smoother.chain_kernel import far
from fgnav.methods.smoother.graph import Solution, border
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.link_kernel import (
    Motions,
    Prior,
    Senses,
    States,
    linearise,
    move,
    predict,
)

# Keyframes leave in blocks: one run over the window gives the marginals of all of them.
_BLOCK_S = 1.0
_ROUNDING_S = 1e-6
# A state is linearised anew when its estimate has moved further than this from where it was:
# rotations err by half the square, 0.001 degree.
MOVED_RAD = 0.005
_ERRS_AT_MOST = 0.25  # of sigma, by half the square of a move: 3 % more RMS error
_REPEATS = 5  # at most, while states are linearised anew: a rough start needs three
# A motion is preintegrated anew when its slot has moved so far that turns come out differently.
TURNED_RAD = 0.05


_LEAST_ROOM = 16  # keyframes


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Taken:
    """Keyframes as they left the window, or the newest as it stands in it.

    Attributes
    ----------
    t_s : ndarray, shape (m,)
    states : States
    marginals : Marginals
        Their covariances, and the cross covariance of each with the keyframe after it.
    moved_rad : float
        How far a rotation is from where it was linearised, at most; 0 where that matters little
        beside its own sigma.
    """

    t_s: FloatArray
    states: States
    marginals: Marginals
    moved_rad: float


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Rows:
    """Memory of a window, a row for each keyframe in it.

    Attributes
    ----------
    chain : Chain
    t_s : ndarray, shape (n,)
    states : States
        Where they are linearised.
    motions : Motions
    senses : Senses
    """

    chain: Chain
    t_s: FloatArray
    states: States
    motions: Motions
    senses: Senses

    @classmethod
    def empty(cls, n: int, border: int) -> "_Rows":
        """Return room for n keyframes."""
        return cls(
            chain=Chain.empty(n, border),
            t_s=np.zeros(n),
            states=links.empty_states(n),
            motions=links.empty_motions(n),
            senses=links.empty_senses(n),
        )

    def take(self, other: "_Rows", first: int, count: int) -> None:
        """Copy rows of another memory to the front of this one."""
        self.chain.take(other.chain, first, count)
        self.t_s[:count] = other.t_s[first : first + count]
        for mine, its in zip(self._parts, other._parts, strict=True):
            mine[:count] = its[first : first + count]
        self.states.landmark_n_m[:] = other.states.landmark_n_m

    @property
    def _parts(self) -> tuple[FloatArray, ...]:
        return (*self.states[:4], *self.motions, *self.senses)


class _Source(NamedTuple):
    """Keyframes, and what they measured as the kernels read it."""

    keyframes: Keyframes
    senses: Senses
    samples: links.Samples


class Window:
    """The newest keyframes of a flight, each smoothed by what came after it.

    Parameters
    ----------
    lag_s : float
        Keyframes leave when they are known from the data up to this long after them, or up to a
        second longer.
    """

    def __init__(self, lag_s: float) -> None:
        self._lag_s = lag_s
        self._key = 0  # number of the oldest keyframe kept
        self._first = 0  # its row
        self._kept: list[tuple[_Source, int]] = []  # each with its place among its keyframes
        self._rows = _Rows.empty(0, 0)
        self._prior: Prior | None = None
        self._steps: FloatArray = np.empty((0, 0))  # from where kept states are to their estimates

    def __len__(self) -> int:
        """Return how many keyframes it holds."""
        return len(self._kept)

    def update(self, keyframes: Keyframes, row: int) -> Taken | None:
        """Take a keyframe in; return those that leave by that, if any."""
        self._make_room(border(keyframes))
        place, here = len(self), self._first + len(self)
        source = self._source(keyframes)
        self._kept.append((source, row))
        self._rows.t_s[here] = keyframes.t_s[row]
        for mine, its in zip(self._rows.senses, source.senses, strict=True):
            mine[here] = its[row]
        if self._prior is None:
            self._prior = links.prior_of(keyframes)
            self._start(keyframes, row, here)
        else:
            self._carry_on(source, row, place)
        self._solve({place})
        t_s = self._rows.t_s[self._first : self._first + len(self)]
        if t_s[0] > t_s[-1] - self._lag_s - _BLOCK_S - _ROUNDING_S:
            return None
        return self._leave(int(np.searchsorted(t_s, t_s[-1] - self._lag_s + _ROUNDING_S)))

    def place_n_m(self) -> FloatArray:
        """Return where the newest keyframe is, (3,)."""
        return np.asarray(self._estimates(len(self) - 1, len(self)).p_n_m[0])

    def newest(self) -> Taken:
        """Return the newest keyframe, known from the data up to it and no further."""
        return self._taken(len(self) - 1, len(self))

    def rest(self) -> Taken:
        """Return all keyframes that have not left, known from all data so far."""
        return self._taken(0, len(self))

    def _source(self, keyframes: Keyframes) -> _Source:
        if self._kept and self._kept[-1][0].keyframes is keyframes:
            return self._kept[-1][0]
        return _Source(keyframes, links.senses_of(keyframes), links.samples_of(keyframes))

    def _make_room(self, border: int) -> None:
        """When the memory is full, move what is kept to the front of one twice as long."""
        if self._first + len(self) < len(self._rows.t_s):
            return
        rows = _Rows.empty(max(_LEAST_ROOM, 2 * len(self)), border)
        if len(self):
            rows.take(self._rows, self._first, len(self))
        self._rows, self._first = rows, 0

    def _start(self, keyframes: Keyframes, row: int, here: int) -> None:
        start, states = links.states_of(keyframes), self._rows.states
        for mine, its in zip(states[:4], start[:4], strict=True):
            mine[here] = its[row]
        states.landmark_n_m[:] = start.landmark_n_m

    def _carry_on(self, source: _Source, row: int, place: int) -> None:
        """Put a keyframe where the motion leads from the one before, by the array's attitude.

        The state before is where it is linearised; for the prediction its estimate takes its place.
        """
        rows, here = self._rows, self._first + place
        kept = [part[here - 1].copy() for part in rows.states[:4]]
        step = self._steps[place - 1 :]
        move(rows.states, step, here - 1, rows.states, here - 1, wholly=True)
        slot = rows.states.slot[here - 1 : here]
        links.integrate(rows.motions, np.array([here]), source.samples, np.array([row]), slot)
        predict(rows.states, rows.motions, here)
        for mine, was in zip(rows.states[:4], kept, strict=True):
            mine[here - 1] = was
        if source.keyframes.array.there[row]:
            rows.states.R_nb[here] = source.keyframes.R_nb[row]

    def _solve(self, changed: set[int]) -> None:
        """Solve with some links new, and again while that moves estimates too far."""
        if self._prior is None:
            return
        rows, first, last = self._rows, self._first, self._first + len(self) - 1
        chain, start = rows.chain, first if self._key == 0 else -1
        for _ in range(_REPEATS):
            new = first + np.array(sorted(changed))
            parts = (rows.states, rows.motions, rows.senses, self._prior)
            linearise(chain.link, *parts, new, start)
            if new[0] == start:
                chain.begin(first)
            chain.eliminate(max(int(new[0]) - 1, first), last)
            self._steps, _ = chain.step(first, last)
            changed = self._mended()
            if not changed:
                return

    def _mended(self) -> set[int]:
        """Linearise rotations and slots anew that are far from it; return the links it concerns.

        What has left speaks of the oldest state where it was linearised then: it stays there.
        """
        at, states, motions = self._first, self._rows.states, self._rows.motions
        rows = slice(at, at + len(self))
        moved, turned, count = far(
            self._steps,
            self._rows.t_s[rows],
            states.slot[rows],
            motions.about[rows],
            MOVED_RAD,
            TURNED_RAD,
        )
        if not count:
            return set()
        moved[0] &= self._key == 0
        for place in np.flatnonzero(turned):
            slot = states.slot[at + place - 1] + self._steps[place - 1, 9:15]
            source, row = self._kept[place]
            one = (np.array([at + place]), source.samples, np.array([row]))
            links.integrate(motions, *one, slot[None])
        for place in np.flatnonzero(moved):  # at the start, velocities and slots are rough, too
            step, row = self._steps[place : place + 1], at + int(place)
            move(states, step, row, states, row, wholly=self._key == 0)
        turned[1:] |= moved[:-1]
        return {int(place) for place in np.flatnonzero(moved | turned)}

    def _leave(self, count: int) -> Taken:
        """Take the oldest keyframes out, and forget all but what they know of the next."""
        taken = self._taken(0, count)
        del self._kept[:count]
        self._steps = self._steps[count:]
        self._first, self._key = self._first + count, self._key + count
        return taken

    def _estimates(self, begin: int, end: int) -> States:
        found = links.empty_states(end - begin)
        move(
            self._rows.states,
            self._steps[begin:end],
            self._first + begin,
            found,
            0,
            wholly=True,
        )
        return found

    def _taken(self, begin: int, end: int) -> Taken:
        last = self._first + len(self) - 1
        marginals = self._rows.chain.marginals(self._first + begin, last)
        moved = np.linalg.norm(self._steps[begin:end, :3], axis=1)
        doubt = np.sqrt(np.einsum("nii->n", marginals.covariance[: end - begin, :3, :3]))
        matters = moved**2 / 2 > _ERRS_AT_MOST * doubt
        return Taken(
            t_s=self._rows.t_s[self._first + begin : self._first + end].copy(),
            states=self._estimates(begin, end),
            marginals=Marginals(
                covariance=marginals.covariance[: end - begin],
                cross=marginals.cross[: end - begin],
            ),
            moved_rad=float(np.where(matters, moved, 0.0).max()),
        )


def solve_window(keyframes: Keyframes, lag_s: float) -> Solution:
    """Return each keyframe as known from the data up to at least ``lag_s`` after it.

    Parameters
    ----------
    keyframes : Keyframes
    lag_s : float
        Length of the window; a block of a second is added to it before keyframes leave.
    """
    window = Window(lag_s)
    left = [window.update(keyframes, row) for row in range(len(keyframes.t_s))]
    return solution_of([taken for taken in (*left, window.rest()) if taken is not None])


def solve_forward(keyframes: Keyframes, lag_s: float) -> Solution:
    """Return each keyframe as known from the data up to it, what a filter would say.

    Parameters
    ----------
    keyframes : Keyframes
    lag_s : float
        States this far back are still linearised anew.
    """
    window, taken = Window(lag_s), []
    for row in range(len(keyframes.t_s)):
        window.update(keyframes, row)
        taken.append(window.newest())
    return solution_of(taken)


def solution_of(taken: list[Taken]) -> Solution:
    """Return keyframes that left one after another as one solution."""
    R_nb, p_n_m, v_n_mps, slot = (
        np.concatenate([part.states[i] for part in taken]) for i in range(4)
    )
    cross = np.concatenate([part.marginals.cross for part in taken])
    return Solution(
        R_nb=R_nb,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        slot=slot,
        covariance=np.concatenate([part.marginals.covariance for part in taken]),
        cross=cross if len(cross) == len(R_nb) - 1 else None,
        converged=max(part.moved_rad for part in taken) < 2 * MOVED_RAD,
    )
