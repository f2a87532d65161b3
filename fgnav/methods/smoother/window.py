"""A sliding window over the flight: keyframes come one by one, are smoothed, and are forgotten.

Whoever leaves the window leaves what it knew of the next keyframe behind, as the chain's message:
marginalisation is exact up to its linearisation, and the window's size does not grow.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.methods.smoother import links
from fgnav.methods.smoother.chain import STATE, Chain, Marginals, OpenStateError
from fgnav.methods.smoother.chain_kernel import far
from fgnav.methods.smoother.keyframes import Keyframes
from fgnav.methods.smoother.link_kernel import move
from fgnav.methods.smoother.link_types import Motions, Prior, Samples, Senses, States
from fgnav.methods.smoother.solution import SharedSolution, Solution
from fgnav.methods.smoother.window_kernel import OPEN, SETTLED, Held, carry_on, settle

# Keyframes leave in blocks: one run over the window gives the marginals of all of them.
_BLOCK_S = 1.0
_ROUNDING_S = 1e-6
# A state is linearised anew when its estimate has moved further than this from where it was:
# rotations err by half the square, 0.001 degree.
MOVED_RAD = 0.005
_ERRS_AT_MOST = 0.25  # of sigma, by half the square of a move: 3 % more RMS error
_REPEATS = 5  # at most, while states are linearised anew: a rough start needs three
# A motion is preintegrated anew when its slot has moved so far that turns come out differently. At
# ten times that, RMS errors of a lag of 2 s are 3.0 % above the batch's instead of 0.8 % (sines of
# 45 degrees, five flights).
TURNED_RAD = 0.005


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
    shared : ndarray, shape (b,)
        What all keyframes share, as known by then.
    moved_rad : float
        How far a rotation is from where it was linearised, at most; 0 where that matters little
        beside its own sigma.
    """

    t_s: FloatArray
    states: States
    marginals: Marginals
    shared: FloatArray
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
    def empty(cls, n: int, states: States, senses: Senses) -> "_Rows":
        """Return room for n keyframes that measure and share what others do."""
        return cls(
            chain=Chain.empty(n, len(states.constants)),
            t_s=np.zeros(n),
            states=links.empty_states(n, states),
            motions=links.empty_motions(n),
            senses=links.empty_senses(n, senses),
        )

    def take(self, other: "_Rows", first: int, count: int) -> None:
        """Copy rows of another memory to the front of this one."""
        self.chain.take(other.chain, first, count)
        self.t_s[:count] = other.t_s[first : first + count]
        for mine, its in zip(self._parts, other._parts, strict=True):
            mine[:count] = its[first : first + count]

    @property
    def _parts(self) -> tuple[FloatArray, ...]:
        return (*self.states[:4], *self.motions, *self.senses)


class _Source(NamedTuple):
    """Keyframes, and what they measured as the kernels read it."""

    keyframes: Keyframes
    senses: Senses
    samples: Samples


class Window:
    """The newest keyframes of a flight, each smoothed by what came after it.

    Parameters
    ----------
    lag_s : float
        Keyframes leave when they are known from the data up to this long after them, or up to a
        second longer.
    anew : bool
        Whether states are linearised anew as their estimates move. What has left cannot be: where
        that was far from what came out, as a heading that only later motion tells, the window
        grows too sure. Else states are linearised where keyframes start, and stay there.
    """

    def __init__(self, lag_s: float, *, anew: bool = True) -> None:
        self._lag_s = lag_s
        self._anew = anew
        self._limits = (MOVED_RAD, TURNED_RAD) if anew else (np.inf, np.inf)
        self._key = 0  # number of the oldest keyframe kept
        self._first = 0  # its row
        self._kept: list[tuple[_Source, int]] = []  # each with its place among its keyframes
        self._brought: tuple[_Source, int, int] | None = None  # what is in memory, see ``_bring``
        self._rows = _Rows.empty(0, links.empty_states(0), links.no_senses())
        self._prior: Prior | None = None
        self._steps: FloatArray = np.empty((0, 0))  # from where kept states are to their estimates

    def __len__(self) -> int:
        """Return how many keyframes it holds."""
        return len(self._kept)

    def update(self, keyframes: Keyframes, row: int) -> Taken | None:
        """Take a keyframe in; return those that leave by that, if any."""
        source = self._source(keyframes)
        self._make_room(source)
        place, here = len(self), self._first + len(self)
        self._kept.append((source, row))
        self._bring(source, row, here)
        if self._prior is None:
            self._prior = links.prior_of(keyframes)
            self._start(keyframes, row, here)
        else:
            self._carry_on(source, row, place)
        self._solve(place)
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

    def _make_room(self, source: _Source) -> None:
        """When the memory is full, move what is kept to the front of one twice as long."""
        if self._first + len(self) < len(self._rows.t_s):
            return
        shared = links.states_of(source.keyframes) if self._prior is None else self._rows.states
        rows = _Rows.empty(max(_LEAST_ROOM, 2 * len(self)), shared, source.senses)
        if len(self):
            rows.take(self._rows, self._first, len(self))
        self._rows, self._first, self._brought = rows, 0, None

    def _bring(self, source: _Source, row: int, here: int) -> None:
        """Have what a keyframe measured in memory, and those after it as far as there is room."""
        offset = row - here
        if self._brought is not None:
            known, at, end = self._brought
            if known is source and at == offset and here < end:
                return
        count = min(len(self._rows.t_s) - here, len(source.keyframes.t_s) - row)
        into, of = slice(here, here + count), slice(row, row + count)
        self._rows.t_s[into] = source.keyframes.t_s[of]
        for mine, its in zip(self._rows.senses, source.senses, strict=True):
            mine[into] = its[of]
        self._brought = source, offset, here + count

    def _start(self, keyframes: Keyframes, row: int, here: int) -> None:
        starts = (keyframes.R_nb, keyframes.p_n_m, keyframes.v_n_mps, keyframes.slot)
        for mine, its in zip(self._rows.states[:4], starts, strict=True):
            mine[here] = its[row]

    def _carry_on(self, source: _Source, row: int, place: int) -> None:
        """Put a keyframe where the motion leads from the one before, by the array's attitude."""
        rows, here, keyframes = self._rows, self._first + place, source.keyframes
        if not self._anew:
            self._start(keyframes, row, here)
            one, of = np.array([here]), np.array([row])
            links.integrate(rows.motions, one, source.samples, of, keyframes.slot[row - 1 : row])
            return
        step = self._steps[place - 1 :]
        if not carry_on(rows.states, rows.motions, source.samples, step, row, here):
            raise NoSolutionError(f"motion: that to keyframe {row} has no covariance")
        if keyframes.array.there[row]:
            rows.states.R_nb[here] = keyframes.R_nb[row]

    def _solve(self, place: int) -> None:
        """Solve with a link new, and again while that moves estimates too far."""
        if self._prior is None:
            return
        rows, chain, first, last = self._rows, self._rows.chain, self._first, self._first + place
        held = Held(
            link=chain.link,
            message=chain.message,
            root=chain.root,
            gain=chain.gain,
            states=rows.states,
            motions=rows.motions,
            senses=rows.senses,
            prior=self._prior,
            t_s=rows.t_s,
            samples=self._kept[-1][0].samples,
            shift=self._shift(),
        )
        self._steps = np.empty((place + 1, STATE + chain.border))
        changed, rounds = np.arange(place + 1) == place, _REPEATS
        while rounds and changed.any():
            whole = self._key == 0
            end, rounds = settle(held, self._steps, changed, first, whole, self._limits, rounds)
            if end == SETTLED:
                return
            if end == OPEN:
                try:
                    chain.eliminate(max(first + int(changed.argmax()) - 1, first), last)
                    self._steps, _ = chain.step(first, last)
                except OpenStateError as error:
                    raise error.at(float(rows.t_s[error.row])) from error
            changed = self._mended()

    def _shift(self) -> int:
        """Return how much further back keyframes stand than in their common source; -1 of none."""
        (oldest, row), (newest, last) = self._kept[0], self._kept[-1]
        same = oldest is newest and last - row == len(self) - 1
        return row - self._first if same else -1

    def _mended(self) -> BoolArray:
        """Linearise rotations and slots anew that are far from it; return which links it concerns.

        What has left speaks of the oldest state where it was linearised then: it stays there.
        """
        at, states, motions = self._first, self._rows.states, self._rows.motions
        rows = slice(at, at + len(self))
        moved, turned, _ = far(
            self._steps,
            self._rows.t_s[rows],
            states.slot[rows],
            motions.about[rows],
            *self._limits,
        )
        moved[0] &= self._key == 0
        places = np.flatnonzero(turned)
        slot = states.slot[at + places - 1] + self._steps[places - 1, 9:STATE]
        sources = [self._kept[place][0] for place in places]
        place_in = np.array([self._kept[place][1] for place in places])
        for source in {id(one): one for one in sources}.values():
            of = np.array([one is source for one in sources])
            links.integrate(motions, at + places[of], source.samples, place_in[of], slot[of])
        for place in np.flatnonzero(moved):  # at the start, velocities and slots are rough, too
            step, row = self._steps[place : place + 1], at + int(place)
            move(states, step, row, states, row, wholly=self._key == 0)
        turned[1:] |= moved[:-1]
        return np.asarray(moved | turned)

    def _leave(self, count: int) -> Taken:
        """Take the oldest keyframes out, and forget all but what they know of the next."""
        taken = self._taken(0, count)
        del self._kept[:count]
        self._steps = self._steps[count:]
        self._first, self._key = self._first + count, self._key + count
        return taken

    def _estimates(self, begin: int, end: int) -> States:
        found = links.empty_states(end - begin, self._rows.states)
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
                border=marginals.border,
                beside=marginals.beside[: end - begin],
            ),
            shared=self._rows.states.constants + self._steps[end - 1, STATE:],
            moved_rad=float(np.where(matters, moved, 0.0).max()),
        )


def solve_window(keyframes: Keyframes, lag_s: float, *, anew: bool = True) -> Solution:
    """Return each keyframe as known from the data up to at least ``lag_s`` after it.

    Parameters
    ----------
    keyframes : Keyframes
    lag_s : float
        Length of the window; a block of a second is added to it before keyframes leave.
    anew : bool
        As in ``Window``.
    """
    window = Window(lag_s, anew=anew)
    left = [window.update(keyframes, row) for row in range(len(keyframes.t_s))]
    return solution_of([taken for taken in (*left, window.rest()) if taken is not None])


def solve_forward(keyframes: Keyframes, lag_s: float, *, anew: bool = True) -> Solution:
    """Return each keyframe as known from the data up to it, what a filter would say.

    Parameters
    ----------
    keyframes : Keyframes
    lag_s : float
        States this far back are still linearised anew.
    anew : bool
        As in ``Window``.
    """
    window, taken = Window(lag_s, anew=anew), []
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
    b = len(taken[-1].shared)
    borders = [np.broadcast_to(p.marginals.border, (len(p.t_s), b, b)) for p in taken]
    return Solution(
        R_nb=R_nb,
        p_n_m=p_n_m,
        v_n_mps=v_n_mps,
        slot=slot,
        covariance=np.concatenate([part.marginals.covariance for part in taken]),
        cross=cross if len(cross) == len(R_nb) - 1 else None,
        converged=max(part.moved_rad for part in taken) < 2 * MOVED_RAD,
        shared=SharedSolution(
            value=taken[-1].shared,
            covariance=np.concatenate(borders),
            cross=np.concatenate([part.marginals.beside for part in taken]),
        ),
    )
