"""A causal method whose measurements contradict each other: judged and mended by the record so far.

The innovations of each sensor up to the end of each second are held against their band
(``graph.innovation.band.beyond_s``). When they leave it, the record up to then is treated as a
whole flight is: its noise is identified, and sensors are left out of it in turn
(``identification.contradictions``). What is found holds from then on; what was estimated before
stays as it is. The method then runs again over all epochs before, without what is left out.

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
class _SoFar:
    """What has been estimated of a flight, and what it goes on without."""

    flight: Flight
    prepared: PreparedFlight
    from_s: float = -np.inf  # of what is to be estimated next
    judged_s: float = -np.inf  # the next time that contradictions count
    wait_s: float = 1.0  # until then, where nothing is mended; doubled each time
    parts: list[Estimate] = field(default_factory=list)
    due: int = 0  # keyframes
    refused: list[tuple[float, float]] = field(default_factory=list)
    out: tuple[Rejected, ...] = ()


def consistent_so_far(flight: Flight, prepared: PreparedFlight, method: CausalMethod) -> Estimate:
    """Return a causal estimate, each part of it by what was consistent of the record up to then.

    Raises
    ------
    NoSolutionError
        If there is no part of it.
    """
    so_far = _SoFar(flight, prepared)
    if method.whole is None:
        so_far.judged_s = np.inf
    for remaining in range(_MOST, -1, -1):
        known_s = _until_contradicted(so_far, method)
        if known_s == np.inf:
            break
        _adapt(so_far, method, known_s, is_last=remaining == 1)
    return _joined(so_far)


def _until_contradicted(so_far: _SoFar, method: CausalMethod) -> float:
    """Estimate until the record contradicts itself; return when, infinity for never."""
    stretches = so_far.prepared.stretches
    for one in stretches or (Stretch(-np.inf, np.inf, so_far.flight, so_far.prepared),):
        from_s = max(one.from_s, so_far.from_s)
        if from_s >= min(one.until_s, one.prepared.problem.t_s[-1]) and so_far.parts:
            continue
        estimate = method.estimated(one.flight, one.prepared)
        beyond_s = {s for test in estimate.consistency for s in test.beyond_s}
        judged_s = max(so_far.judged_s, from_s - _BEFORE_S)
        known_s = min((s for s in beyond_s if judged_s <= s < one.until_s), default=np.inf)
        until_s = min(one.until_s, np.nextafter(known_s, np.inf))
        t_s = one.prepared.problem.t_s
        so_far.due += int(((t_s >= from_s) & (t_s < until_s)).sum())
        so_far.parts.append(among(estimate, from_s, until_s))
        so_far.from_s = max(until_s, from_s)
        if known_s < one.until_s:
            return float(max(known_s, from_s))
    return np.inf


def _adapt(so_far: _SoFar, method: CausalMethod, known_s: float, *, is_last: bool) -> None:
    """Judge the record up to a time, and go on without what contradicts there."""
    later_s = np.inf if is_last else known_s + so_far.wait_s
    rest = _rest(so_far.flight, method, known_s)
    so_far.judged_s = np.inf if is_last else float(np.nextafter(known_s, np.inf))
    if rest is None or not rest.out:
        so_far.judged_s, so_far.wait_s = later_s, 2 * so_far.wait_s
    if rest is not None and not rest.out and not contradictory(rest.estimate):
        # As a whole it contradicts nothing: what was beyond is the filter's own beginning.
        since_s = known_s - float(so_far.prepared.problem.t_s[0])
        so_far.judged_s = max(so_far.judged_s, known_s + since_s)
    if rest is not None:
        for one in rest.out:
            so_far.flight = one.of(so_far.flight)
            so_far.out += tuple(
                replace(r, from_s=max(r.from_s, known_s)) if r.until_s > known_s else r
                for r in one.rejected
            )
        if is_hopeless(rest.estimate):
            so_far.from_s, so_far.judged_s = later_s, later_s - _BEFORE_S
            begin_s = known_s
            if so_far.refused and so_far.refused[-1][1] >= known_s:
                begin_s, _ = so_far.refused.pop()
            so_far.refused.append((begin_s, later_s))
    so_far.prepared = method.prepare(so_far.flight, known_s)


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
    out = (replace(one, until_s=min(one.until_s, float(t_s[-1]))) for one in so_far.out)
    estimate = with_words(estimate, tuple(out))
    if not so_far.refused:
        return estimate
    spans = ", ".join(f"{a:.1f} to {min(b, t_s[-1]):.1f} s" for a, b in so_far.refused)
    lost = max(len(t_s) - so_far.due, 0)
    return replace(
        estimate,
        notes=(f"No estimate from {spans}: {_REFUSED}.", *estimate.notes),
        losses=(*estimate.losses, Loss(what="keyframe", reason=_REFUSED, count=lost)),
    )
