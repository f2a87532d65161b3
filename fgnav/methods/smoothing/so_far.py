"""A causal method whose measurements contradict each other: judged and mended by the record so far.

The innovations of each sensor before each whole second are held against their band
(``graph.innovation.band.beyond_s``). When they leave it, the record up to then is treated as a
whole flight is: its noise is identified, and sensors are left out of it in turn
(``identification.contradictions``). What is found holds from then on; what was estimated before
stays as it is. The method then runs again over all epochs before, without what is left out. A
stream of observations is judged at the same times by the same ``Judged``.

Where that mends nothing, it is tried again after 1, 2, 4, ... seconds. Until then there are no
estimates, if no covariance would hold. Where the record as a whole contradicts nothing, it is
judged again when it is twice as long.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import Loss, NoSolutionError
from fgnav.frontend.causal.truncation import truncated
from fgnav.frontend.prepared import PreparedFlight, Stretch
from fgnav.identification.contradictions import (
    Rest,
    consistent_rest,
    contradictory,
    is_hopeless,
    refusal,
    with_words,
)
from fgnav.identification.exclusion import Exclusion
from fgnav.methods.smoothing.joined import among, joined_estimates
from fgnav.types.estimate import Estimate, Rejected
from fgnav.types.flight import Flight

_MOST = 4  # times that a flight is judged: each takes as long as several flights
_BEFORE_S = 1.5  # tests are a second apart: in as long there is one
_REFUSED = "measurements so far contradict each other"


class CausalMethod(NamedTuple):
    """A causal method, and how its record so far is estimated as a whole flight.

    ``whole`` is None where contradictions are only noted; ``waits_s`` is how much of what comes
    later an estimate takes part of.
    """

    prepare: Callable[[Flight, float], PreparedFlight]
    estimated: Callable[[Flight, PreparedFlight], Estimate]
    whole: Callable[[Flight], Estimate] | None
    waits_s: float


@dataclass(slots=True)
class Judged:
    """How a record that goes on has been judged so far, and what it goes on without."""

    from_s: float = -np.inf  # of what is to be estimated next
    judged_s: float = -np.inf  # the next time that contradictions count
    wait_s: float = 1.0  # until then, where nothing is mended; doubled each time
    left: int = _MOST
    out: tuple[Exclusion, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    refused: list[tuple[float, float]] = field(default_factory=list)

    @classmethod
    def by(cls, method: CausalMethod) -> "Judged":
        """Return how nothing has been judged yet by a method, or never is."""
        return cls(judged_s=-np.inf if method.whole is not None else np.inf)

    def since_s(self, from_s: float) -> float:
        """Return since when contradictions count, of estimates from a time on."""
        return max(self.judged_s, from_s - _BEFORE_S)

    def without(self, flight: Flight) -> Flight:
        """Return a flight without what is left out."""
        for one in self.out:
            flight = one.of(flight)
        return flight

    def judge(self, flight: Flight, method: CausalMethod, known_s: float, begin_s: float) -> None:
        """Judge a record that begins so, up to a time; go on without what contradicts there."""
        self.left -= 1
        later_s = known_s + self.wait_s if self.left else np.inf
        rest = _rest(self.without(flight), method, known_s)
        self.judged_s = float(np.nextafter(known_s, np.inf)) if self.left else np.inf
        if rest is None or not rest.out:
            self.judged_s, self.wait_s = later_s, 2 * self.wait_s
        if rest is not None and not rest.out and not contradictory(rest.estimate):
            # As a whole it contradicts nothing: what was beyond is the filter's own beginning.
            self.judged_s = max(self.judged_s, 2 * known_s - begin_s)
        if rest is None:
            return
        self.out += rest.out
        self.rejected += tuple(
            replace(r, from_s=max(r.from_s, known_s)) if r.until_s > known_s else r
            for one in rest.out
            for r in one.rejected
        )
        if is_hopeless(rest.estimate):
            self.from_s, self.judged_s = later_s, later_s - _BEFORE_S
            begin_s = known_s
            if self.refused and self.refused[-1][1] >= known_s:
                begin_s, _ = self.refused.pop()
            self.refused.append((begin_s, later_s))


@dataclass(slots=True)
class _SoFar:
    """What has been estimated of a flight, and how it has been judged."""

    prepared: PreparedFlight
    judged: Judged
    parts: list[Estimate] = field(default_factory=list)
    due: int = 0  # keyframes


def consistent_so_far(flight: Flight, prepared: PreparedFlight, method: CausalMethod) -> Estimate:
    """Return a causal estimate, each part of it by what was consistent of the record up to then.

    Raises
    ------
    NoSolutionError
        If there is no part of it.
    """
    so_far = _SoFar(prepared, Judged.by(method))
    while (known_s := _until_contradicted(flight, so_far, method)) < np.inf:
        begin_s = float(so_far.prepared.problem.t_s[0])
        so_far.judged.judge(flight, method, known_s, begin_s)
        so_far.prepared = method.prepare(so_far.judged.without(flight), known_s)
    return _joined(so_far)


def _until_contradicted(flight: Flight, so_far: _SoFar, method: CausalMethod) -> float:
    """Estimate until the record contradicts itself; return when, infinity for never."""
    stretches, judged = so_far.prepared.stretches, so_far.judged
    flight = judged.without(flight)
    for one in stretches or (Stretch(-np.inf, np.inf, flight, so_far.prepared),):
        from_s, t_s = max(one.from_s, judged.from_s), one.prepared.problem.t_s
        if so_far.parts and (from_s >= one.until_s or from_s > t_s[-1]):
            continue
        estimate = method.estimated(one.flight, one.prepared)
        beyond_s = (s for test in estimate.consistency for s in test.beyond_s)
        counting = (s for s in beyond_s if judged.since_s(from_s) <= s < one.until_s)
        known_s = max(min(counting, default=np.inf), from_s)
        until_s = min(one.until_s, known_s)
        so_far.due += int(((t_s >= from_s) & (t_s < until_s)).sum())
        so_far.parts.append(among(estimate, from_s, until_s))
        judged.from_s = max(until_s, from_s)
        if known_s < one.until_s:
            return known_s
    return np.inf


def _rest(flight: Flight, method: CausalMethod, known_s: float) -> Rest | None:
    """Return what is consistent of the record up to a time; None if it has no solution."""
    if method.whole is None:
        return None
    until_s, whole = known_s + method.waits_s, method.whole
    past = truncated(flight, until_s)
    try:
        return consistent_rest(past, whole(past), whole, known_s)
    except NoSolutionError:
        return None


def _joined(so_far: _SoFar) -> Estimate:
    """Return all parts as one, with what they are without and where there are none."""
    parts = so_far.parts
    estimate = joined_estimates(parts, max(one.epochs for one in parts), so_far.due)
    if not len(estimate.t_s):
        raise refusal(estimate)
    t_s = so_far.prepared.problem.t_s
    out = (replace(r, until_s=min(r.until_s, float(t_s[-1]))) for r in so_far.judged.rejected)
    estimate = with_words(estimate, tuple(out))
    refused = so_far.judged.refused
    if not refused:
        return estimate
    spans = ", ".join(f"{a:.1f} to {min(b, t_s[-1]):.1f} s" for a, b in refused)
    lost = max(len(t_s) - so_far.due, 0)
    return replace(
        estimate,
        notes=(f"No estimate from {spans}: {_REFUSED}.", *estimate.notes),
        losses=(*estimate.losses, Loss(what="keyframe", reason=_REFUSED, count=lost)),
    )
