"""A sensor of the inertial unit whose axes are mixed over a span: exchanged, reversed, turned far.

Such samples are put right by a matrix, ``x_true = (I - U) x``: nine numbers, in which the motion is
linear about right states, however large they are. A turn of three numbers is not: of 90 degrees it
is no small one. Prior to the flight U is that of any orthogonal ``I - U``, which keeps it regular
in directions that x does not have.

States at the minimum without it are bent. So its span and U are sought in turn: the likeliest span
about states, then the minimum with U free there, as long as that is less, and then by keyframes at
either end. Errors from bent states shrink by orders: the first minimum is to be halfway to chance
by its logarithm.

It is asked where errors of three numbers leave more than chance, and none that leaves more itself.
What its six further numbers cost is Schwarz's.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.graph.inertial.preintegrated import Inertial
from fgnav.graph.types.constants import flight_constant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import States
from fgnav.identification.likelihood.beside_phases import chance_of, schwarz_nats
from fgnav.identification.likelihood.changed_samples import (
    Change,
    ChangedBy,
    with_changed_samples,
)
from fgnav.identification.likelihood.span_constants import seconds
from fgnav.identification.likelihood.span_offsets import LEAST_S, LIKELY, Offset
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.errors import ANY_MIX, MIX, further, without
from fgnav.identification.spans.likeliest import finer_span, likeliest
from fgnav.solve.chain import solve_batch

_STEPS = 4  # at most: each leaves a few hundredths of what is left
_STEP = 1e-2  # of difference quotients, of samples' sizes
_LONG_S = LEAST_S - 1e-6  # of a span; times are rounded
_NUMBERS = 9
_NAMES = tuple(f"{i}{j}" for i in "xyz" for j in "xyz")
Built = Callable[[Change], SmoothingProblem]  # of samples that are changed


def mixed_axes(problem: SmoothingProblem, stated: Solution, built: Built) -> tuple[Offset, ...]:
    """Return how axes are mixed, of each sensor of which it is as likely as of the likeliest.

    Empty where that leaves more than chance, or they may as well be mixed throughout.

    Parameters
    ----------
    problem : SmoothingProblem
    stated : Solution
        Its minimum without them.
    built : callable
        From a change of the unit to its problem: rates are part of velocities, too.
    """
    search, mixed = _Search(problem, stated, built), list[_Mixed]()
    least = search.halfway
    for span in sorted(search.spans(search.edges), key=lambda one: -one.gain):
        one = search.settled(span) if stated.cost - 2 * span.gain < least else None
        if one is not None and one.cost < chance_of(problem):
            mixed.append(one)
            least = min(least, one.cost + 2 * LIKELY)
    likely = sorted((one for one in mixed if one.cost < least), key=lambda one: one.cost)
    if not likely or search.is_throughout(likely[0]):
        return ()
    nats = 6 * schwarz_nats(problem)
    return tuple(one.span._replace(gain=(stated.cost - one.cost) / 2 - nats) for one in likely)


class _Mixed(NamedTuple):
    """The minimum with axes unmixed over a span, which has them as its value."""

    span: Offset
    states: States  # with nine constants more, which are none
    cost: float


class _Search(NamedTuple):
    """A problem in which axes are mixed, its minimum without that, and how others are built."""

    problem: SmoothingProblem
    stated: Solution
    built: Built

    @property
    def edges(self) -> IntArray:
        """Keyframes between blocks."""
        return seconds(self.problem.t_s)

    @property
    def halfway(self) -> float:
        """Cost that is halfway to chance by its logarithm."""
        return float(np.sqrt(self.stated.cost * chance_of(self.problem)))

    def spans(self, edges: IntArray) -> list[Offset]:
        """Return each sensor's likeliest span between edges, about the minimum without."""
        at = self.stated.states
        each = (likeliest(self.problem, at, (sensor, MIX), edges) for sensor in WHITE)
        return [one for one in each if one is not None]

    def settled(self, span: Offset) -> _Mixed | None:
        """Return axes unmixed over the span whose minimum is the least; None without one."""
        mixed, other = None, self._minimum(span, None, self.halfway)
        while other is not None:
            mixed = other
            at = mixed.states._replace(constants=mixed.states.constants[:-_NUMBERS])
            again = finer_span(self.problem, at, mixed.span, self.edges)
            other = self._minimum(again, None, np.nextafter(mixed.cost, 0.0))
        if mixed is None:
            return None
        for end in ("begin", "end"):
            mixed = self._climbed(mixed, end)
        for i in range(2):
            mixed = self._between_keyframes(mixed, i)
        return mixed

    def is_throughout(self, mixed: _Mixed) -> bool:
        """Return whether axes of either sensor may as well be mixed all along.

        Such a mix has no span that is chosen among many.
        """
        edges = len(self.edges)
        enough = mixed.cost + 2 * (float(np.log(edges * (edges - 1) / 2)) + LIKELY)
        spans = self.spans(np.array([0, len(self.problem.t_s) - 1]))
        return any(self._minimum(one, None, enough) is not None for one in spans)

    def _climbed(self, mixed: _Mixed, end: str) -> _Mixed:
        """Return the least minimum where a span begins or ends elsewhere, and likely keyframes."""
        first, best, t_s = getattr(mixed.span, end), mixed, self.problem.t_s
        costs = {first: mixed.cost}
        for rows in (range(first - 1, -1, -1), range(first + 1, len(t_s))):
            last = mixed
            for row in rows:
                moved: dict[str, Any] = {end: row}
                span = last.span._replace(**moved, span_s=None)
                is_long = t_s[span.end] - t_s[span.begin] > _LONG_S
                enough = best.cost + 2 * LIKELY
                one = self._minimum(span, last.states, enough) if is_long else None
                if one is None:
                    break
                costs[row], last, best = one.cost, one, min(best, one, key=lambda o: o.cost)
        likely = [row for row, cost in costs.items() if cost < best.cost + 2 * LIKELY]
        ends: dict[str, Any] = {f"{end}s": (min(likely), max(likely))}
        return best._replace(span=best.span._replace(**ends))

    def _between_keyframes(self, mixed: _Mixed, i: int) -> _Mixed:
        """Return the least minimum where a span begins, i = 0, or ends, at samples nearby."""
        t_s, motion, span = self.problem.t_s, self.problem.motion, mixed.span
        row, likely = ((span.begin, span.begins), (span.end, span.ends))[i]
        if not isinstance(motion, Inertial) or row in (0, len(t_s) - 1):
            return mixed
        samples_s, best = motion.imu.t_s, mixed
        inside = samples_s[(samples_s > t_s[row - 1]) & (samples_s < t_s[row + 1])]
        for side in (inside[inside < t_s[row]][::-1], inside[inside > t_s[row]]):
            for time_s in side:
                ends = list(best.span.span_s or t_s[[span.begin, span.end]])
                ends[i] = float(time_s)
                moved = best.span._replace(span_s=(float(ends[0]), float(ends[1])))
                one = self._minimum(moved, best.states, best.cost)
                if one is None:
                    break
                best = one
        at_s = (best.span.span_s or t_s[[span.begin, span.end]])[i]
        after = int(np.searchsorted(t_s, at_s - 1e-9))
        rows = min(likely[0], after), max(likely[1], after)
        both: dict[str, Any] = {("begins", "ends")[i]: rows}
        return best._replace(span=best.span._replace(**both))

    def _minimum(
        self, span: Offset, states: States | None, enough: float = np.inf
    ) -> _Mixed | None:
        """Return the minimum with axes unmixed over a span, by steps about the one before.

        None where there is none of at most a cost, ``enough``.
        """
        by, mixed = np.full(_NUMBERS, _STEP), None
        begin_s, end_s = span.span_s or self.problem.t_s[[span.begin, span.end]]
        part = flight_constant("mixed axes", _NAMES, "", ANY_MIX, reported=False)

        def less(by: FloatArray) -> Change:
            return lambda imu: without(imu, span.sensor, MIX, by, (begin_s, end_s))

        change = ChangedBy((part,), tuple(map(less, np.diag(by))), by)
        for _ in range(_STEPS):
            unmixed = self._unmixed(less(span.value))
            if unmixed.sizes != self.problem.sizes:
                return None
            solution = _least(with_changed_samples(unmixed, change), enough, states)
            if solution is None:
                return None
            step = solution.states.constants[-_NUMBERS:]
            covariance = solution.constant_covariance[0][-_NUMBERS:, -_NUMBERS:]
            value = further(MIX, span.value, step)
            span = span._replace(value=value, covariance=covariance)
            rest = np.append(solution.states.constants[:-_NUMBERS], np.zeros(_NUMBERS))
            states = solution.states._replace(constants=rest)
            mixed = _Mixed(span, states, solution.cost)
            if (step**2 < covariance.diagonal()).all():
                break
        return mixed

    def _unmixed(self, change: Change) -> SmoothingProblem:
        """Return the problem of changed samples, as loud as it was, whatever heading they have."""
        changed, motion = self.built(change), self.problem.motion
        if isinstance(motion, Inertial) and isinstance(changed.motion, Inertial):
            motion = replace(motion, imu=changed.motion.imu)
        return replace(changed, motion=motion)


def _least(problem: SmoothingProblem, enough: float, begin: States | None) -> Solution | None:
    """Return where a search for a minimum ends, if that costs no more than enough.

    It need not be the minimum: steps go on from there.
    """
    try:
        solution = solve_batch(problem, begin=begin, enough=enough)
    except NoSolutionError:
        return None
    return solution if solution.cost <= enough else None
