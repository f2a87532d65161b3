"""A problem linearised where states stand, as GTSAM's linear factors by the keyframe they enter.

Sensors and motion are linearised all epochs at once; what each keyframe has is then a
``gtsam.JacobianFactor`` of whitened rows ``A dx = -residual``, the same as ``linearize`` of the
problem's nonlinear factors yields one by one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import gtsam
import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.build import (
    Layout,
    constant_priors,
    insert_constants,
    insert_keyframe,
    keyframe_priors,
)
from fgnav.graph.linear_factor import linear_factor
from fgnav.graph.types.motion import LinearisedMotion
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Linearised
from fgnav.graph.types.states import AUX, POSITION, VELOCITY, States

_POSE = slice(0, POSITION.stop)


@dataclass(frozen=True, eq=False, slots=True)
class LinearProblem:
    """Some keyframes of a problem linearised.

    Attributes
    ----------
    layout : Layout
    numbers : ndarray of int, shape (j,)
        Of the keyframes in the graph.
    motion : LinearisedMotion or None
        What leads to the last of them, (j,) or (j - 1,), from the keyframes before.
    sensors : tuple of (ndarray of int, Linearised)
        Places among the keyframes, and what stands there.
    phases : tuple of (int, gtsam.JacobianFactor)
        Likewise, one by one.
    priors : tuple of gtsam.GaussianFactor
        What is known of the first keyframe and the constants before, where it is among these.
    """

    layout: Layout
    numbers: IntArray
    motion: LinearisedMotion | None
    sensors: tuple[tuple[IntArray, Linearised], ...]
    phases: tuple[tuple[int, gtsam.JacobianFactor], ...]
    priors: tuple[gtsam.JacobianFactor, ...]

    @property
    def cost(self) -> float:
        """Return the sum of the squares of all residuals."""
        of_motion = 0.0 if self.motion is None else float((self.motion.value**2).sum())
        of_sensors = sum(float((linear.value**2).sum()) for _, linear in self.sensors)
        single = (*self.priors, *(factor for _, factor in self.phases))
        return of_motion + of_sensors + sum(float(one.getb() @ one.getb()) for one in single)

    def motion_factors(self) -> Iterator[gtsam.JacobianFactor]:
        """Yield the motion to each keyframe from the one before, where that is known."""
        if self.motion is None:
            return
        value, before, after, shared = self.motion
        blocks = [
            *self._of_keyframe(before),
            *self._of_keyframe(after),
            *self._of_constants(shared),
        ]
        for i, k in enumerate(self.numbers[len(self.numbers) - len(value) :].tolist()):
            variables = (
                *self.layout.keyframe(k - 1),
                *self.layout.keyframe(k),
                *self.layout.constant_keys,
            )
            yield _factor(variables, blocks, i, value[i])

    def unary_factors(self) -> list[list[gtsam.GaussianFactor]]:
        """Collect the factors of each keyframe that touch no other keyframe."""
        found: list[list[gtsam.GaussianFactor]] = [[] for _ in self.numbers]
        if self.priors:
            found[0] += self.priors
        for places, (value, state, shared) in self.sensors:
            blocks = [*self._of_keyframe(state), *self._of_constants(shared)]
            for i, place in enumerate(places.tolist()):
                k = int(self.numbers[place])
                variables = (*self.layout.keyframe(k), *self.layout.constant_keys)
                found[place].append(_factor(variables, blocks, i, value[i]))
        for place, factor in self.phases:
            found[place].append(factor)
        return found

    def factors_by_keyframe(self) -> list[list[gtsam.GaussianFactor]]:
        """Return all by the oldest keyframe of each, of keyframes from the first of a flight on.

        Rows of a keyframe and of the motion to the next are one factor: to make a factor takes as
        long as to eliminate it.
        """
        found: list[list[gtsam.GaussianFactor]] = [[] for _ in self.numbers]
        found[0] += self.priors
        for place, factor in self.phases:
            found[place].append(factor)
        rows, first = self._stacked()
        spans = list(pairwise(np.cumsum([0, *self._sizes]).tolist()))
        used = [bool(rows[:, begin:end].any()) for begin, end in spans]
        for i, k in enumerate(self.numbers.tolist()):
            own = np.ascontiguousarray(rows[first[i] : first[i + 1]].T)
            is_last = i + 1 == len(self.numbers)
            after = () if is_last else self.layout.keyframe(k + 1)
            keys = (*self.layout.keyframe(k), *after, *self.layout.constant_keys)
            of = [*spans[:3], *spans[6:]] if is_last else spans
            is_used = [*used[:3], *used[6:]] if is_last else used
            terms = [
                (key, own[begin:end].T)
                for key, (begin, end), is_in in zip(keys, of, is_used, strict=True)
                if is_in
            ]
            if own.shape[1]:
                found[i].append(linear_factor(terms, own[-1]))
        return found

    @property
    def _sizes(self) -> list[int]:
        """Dimensions of two keyframes' variables, and of each constant."""
        own = [_POSE.stop, VELOCITY.stop - VELOCITY.start, self.layout.width - AUX]
        return [*own, *own, *(part.size for part in self.layout.constants.parts)]

    def _stacked(self) -> tuple[FloatArray, IntArray]:
        """Return rows of all keyframes, one after another, and the first of each, (n + 1,).

        Columns: the keyframe's tangent, that of the next, constants, the right-hand side.
        """
        n, D = len(self.numbers), self.layout.width
        width = 2 * D + self.layout.constants.width + 1
        parts: list[tuple[IntArray, FloatArray]] = []
        if self.motion is not None:
            value, before, after, shared = self.motion
            wide = np.concatenate([before, after, shared, -value[:, :, None]], axis=2)
            parts.append((np.arange(len(value)), wide))
        for places, (value, state, shared) in self.sensors:
            wide = np.zeros((*value.shape, width))
            wide[:, :, :D], wide[:, :, 2 * D : -1], wide[:, :, -1] = state, shared, -value
            parts.append((places, wide))
        counts = np.zeros(n, dtype=np.int64)
        for places, wide in parts:
            np.add.at(counts, places, wide.shape[1])
        first = np.concatenate([[0], np.cumsum(counts)])
        rows, begin = np.empty((first[-1], width)), first[:-1].copy()
        for places, wide in parts:
            m = wide.shape[1]
            among = np.arange(len(places)) - places.searchsorted(places)  # of one keyframe
            rows[(begin[places] + among * m)[:, None] + np.arange(m)] = wide
            np.add.at(begin, places, m)
        return rows, first

    def _of_keyframe(self, J: FloatArray) -> list[FloatArray | None]:
        return _blocks(J, (_POSE, VELOCITY, slice(AUX, self.layout.width)))

    def _of_constants(self, J: FloatArray) -> list[FloatArray | None]:
        constants = self.layout.constants
        parts = zip(constants.first, constants.parts, strict=True)
        return _blocks(J, [slice(first, first + part.size) for first, part in parts])


def linearise(
    problem: Problem,
    rows: IntArray,
    at: States,
    before: States,
    *,
    numbers: IntArray | None = None,
    arcs: Mapping[int, FloatArray] | None = None,
    begins: bool = True,
) -> LinearProblem:
    """Linearise some keyframes of a problem.

    Parameters
    ----------
    problem : Problem
    rows : ndarray of int, shape (j,)
        Keyframes of it, increasing.
    at : States
        Where those are, (j,).
    before : States
        Where the keyframes before them are, (j,); of j - 1 if there is none before the first.
    numbers : ndarray of int, shape (j,), optional
        Of the keyframes in the graph; the rows by default.
    arcs : mapping of int to ndarray, optional
        Where ambiguities are linearised, by key; else at zero.
    begins : bool
        Whether a first keyframe without one before is that of the flight, with its priors.

    Raises
    ------
    NoSolutionError
        If a residual is not finite.
    """
    layout, j = Layout.of(problem), len(before.R_nb)
    begins &= len(rows) > j
    numbers = rows if numbers is None else numbers
    motion = None
    if j:
        after = at if len(rows) == j else at.at(slice(1, None))
        motion = problem.motion.linearise(before, after, rows[-j:] - 1)
    sensors = []
    for measurement in problem.sensors:
        which, places = _among(measurement.row, rows)
        if len(which):
            sensors.append((places, measurement.linearise(at.at(places), which)))
    linear = LinearProblem(
        layout=layout,
        numbers=numbers,
        motion=motion,
        sensors=tuple(sensors),
        phases=tuple(_phases(problem, rows, at, numbers, arcs)),
        priors=tuple(_priors(problem, layout, int(numbers[0]), at)) if begins else (),
    )
    if not np.isfinite(linear.cost):
        raise _not_finite(problem, rows, linear)
    return linear


def keyframe_factor(
    layout: Layout, k: int, J: FloatArray, right: FloatArray
) -> gtsam.JacobianFactor:
    """Return whitened rows, (m, D + b), of keyframe k's tangent and the constants."""
    first, terms, begin = (*layout.keyframe(k), *layout.constant_keys), [], 0
    sizes = (6, 3, layout.width - AUX, *(part.size for part in layout.constants.parts))
    for key, size in zip(first, sizes, strict=True):
        terms.append((key, J[:, begin : begin + size]))
        begin += size
    return linear_factor(terms, right)


def _phases(
    problem: Problem,
    rows: IntArray,
    at: States,
    numbers: IntArray,
    arcs: Mapping[int, FloatArray] | None,
) -> Iterator[tuple[int, gtsam.JacobianFactor]]:
    """Yield the phases of some keyframes."""
    phase = problem.phase
    if phase is None:
        return
    for i, place in zip(*(of.tolist() for of in _among(phase.row, rows)), strict=True):
        yield place, phase.linear(i, int(numbers[place]), at, place, problem.constants, arcs)


def _among(row: IntArray, rows: IntArray) -> tuple[IntArray, IntArray]:
    """Find the measurements of keyframes, both increasing, and the keyframe of each."""
    first, last = row.searchsorted((rows[0], rows[-1] + 1))
    places = rows.searchsorted(row[first:last])
    among = rows[places] == row[first:last]
    return np.arange(first, last)[among], places[among]


def _priors(problem: Problem, layout: Layout, k: int, at: States) -> Iterator[gtsam.JacobianFactor]:
    """Yield what is known of the first keyframe and of the constants before the flight."""
    values = gtsam.Values()
    insert_keyframe(values, layout, k, at)
    insert_constants(values, layout, at.constants)
    for factor in (*keyframe_priors(problem, k), *constant_priors(problem.constants)):
        yield gtsam.JacobianFactor(factor.linearize(values))


def _blocks(J: FloatArray, columns: Sequence[slice]) -> list[FloatArray | None]:
    """Return columns of Jacobians, (k, m, c), transposed; None of those that are zero in all."""
    transposed = np.ascontiguousarray(J.swapaxes(1, 2))
    return [transposed[:, of] if transposed[:, of].any() else None for of in columns]


def _factor(
    variables: Sequence[int], blocks: Sequence[FloatArray | None], i: int, residual: FloatArray
) -> gtsam.JacobianFactor:
    pairs = zip(variables, blocks, strict=True)
    return linear_factor([(key, of[i].T) for key, of in pairs if of is not None], -residual)


def _not_finite(problem: Problem, rows: IntArray, linear: LinearProblem) -> NoSolutionError:
    """Return the error of a residual that is no number, by the first keyframe that has one."""
    bad = [
        int(places[~np.isfinite(one.value).all(axis=1)].min(initial=len(rows) - 1))
        for places, one in linear.sensors
    ]
    if linear.motion is not None:
        wrong = np.flatnonzero(~np.isfinite(linear.motion.value).all(axis=1))
        bad.append(int(wrong.min(initial=len(rows) - 1)))
    t_s = float(problem.t_s[rows[min(bad, default=0)]])
    return NoSolutionError(f"residuals are not finite at {t_s:.2f} s")
