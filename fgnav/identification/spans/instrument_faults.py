"""An instrument that is wrong for a while, in place of all that its flight would contradict else.

What one instrument measures wrongly another noise explains as well: of the inertial unit, which no
longer contradicts the instrument then, so that attitudes follow it.
Left out, the rest predicts it. What it measures in spans in which it is beyond its band is of any
size f then: D values of innovations r, of predicted covariance S, have

    ln p = -(sum ln det S + D (1 + ln f^2)) / 2        f^2 = sum r' S^-1 r / D

beside the likelihood of the rest. An instrument is at fault where both are likelier than what the
flight says else, by the odds of any contradiction.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.graph.innovation.band import contradictions
from fgnav.graph.types.measurement import Measurement
from fgnav.identification.exclusion import Exclusion, of_instrument
from fgnav.identification.likelihood.thinned import Some, thinned
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.identify import identify
from fgnav.identification.noise.stated import INSTRUMENTS, with_factors
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.spans.unit_faults import anchored
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.estimate import Consistency, Contradiction


class _Trial(NamedTuple):
    """An instrument's spans, and the likelihood of a flight with whatever they measure."""

    out: Consistency
    likelihood: float


def without_faulty_instrument(
    search: TagSearch, at_tags: AtTags
) -> tuple[TagSearch, AtTags, tuple[Exclusion, ...]]:
    """Return a search without an instrument's fault, what the flight says then, and what is out.

    Where any noise but an instrument's own is other than stated. Not where axes are turned: an
    instrument that is right tells which.
    """
    identified, unchanged = at_tags.identified, (search, at_tags, ())
    if identified.is_turned or not identified.contradicted.keys() - set(INSTRUMENTS):
        return unchanged
    try:
        flight = search.tested(at_tags.moved)
    except NoSolutionError:
        return unchanged
    names = {one.name for one in flight.problem.measurements} & set(INSTRUMENTS)
    trials = [one for name in sorted(names) if (one := _trial(search, at_tags, flight, name))]
    best = max(trials, key=lambda one: one.likelihood, default=None)
    if best is None or best.likelihood <= identified.likelihood + EXCLUDED:
        return unchanged
    out = of_instrument(search.flight, best.out)
    rest = search._replace(flight=out.flight)
    try:
        after = rest.likeliest(rest.build(rest.flight, rest.settings))
    except NoSolutionError:
        return unchanged
    return unchanged if after is None else (rest, after, (out,))


def _trial(search: TagSearch, at_tags: AtTags, flight: ThinnedFlight, name: str) -> _Trial | None:
    """Return the spans of an instrument which the rest contradicts; None where there are none."""
    (one,) = (one for one in flight.problem.measurements if one.name == name)
    t_s = flight.problem.t_s[one.row]
    try:
        without = identify(_with(flight, one, np.zeros(len(t_s), dtype=np.bool_)))
        squared, log_det = _predicted(search, at_tags, without, name)
        spans = contradictions(t_s, squared, one.freedom)
        if not spans:
            return None
        bad = np.any([(t_s >= s.from_s) & (t_s <= s.until_s) for s in spans], axis=0)
        rest = without if bad.all() else identify(_with(flight, one, ~bad))
    except NoSolutionError:
        return None
    freedom = int(one.freedom[bad].sum())
    size = np.log(squared[bad].sum() / freedom)
    likelihood = rest.likelihood - (log_det[bad].sum() + freedom * (1 + size)) / 2
    return _Trial(_out(name, one, spans), float(likelihood))


def _with(flight: ThinnedFlight, one: Measurement, keep: BoolArray) -> ThinnedFlight:
    """Return a flight with some of a measurement's rows, (k,)."""
    which = np.flatnonzero(keep)
    others = tuple(other for other in flight.problem.measurements if other is not one)
    kept = (Some(one, which, one.row[which]),) if len(which) else ()
    return flight._replace(problem=replace(flight.problem, measurements=(*others, *kept)))


def _predicted(
    search: TagSearch, at_tags: AtTags, without: Identified, name: str
) -> tuple[FloatArray, FloatArray]:
    """Return an instrument's innovations squared by all others, and ln det S, (k,) each.

    At the noise identified without it, by a chain with the flight's own constants alone.
    """
    louder = search._replace(flight=with_factors(search.flight, without.factors))
    small = anchored(thinned(louder.at_tags(at_tags.moved).problem))
    (one,) = (one for one in small.measurements if one.name == name)
    others = tuple(other for other in small.measurements if other is not one)
    small = replace(small, measurements=others)
    rest = solve_batch(small, begin=solve_batch(small).states)
    value, state, shared = one.linearise(rest.states.at(one.row), np.arange(len(one.row)))
    P, X = rest.covariance[one.row], rest.constant_cross[one.row]
    joint = np.block([[P, X], [X.swapaxes(1, 2), rest.constant_covariance[one.row]]])
    J = np.concatenate([state, shared], axis=2)
    S = np.eye(value.shape[1]) + J @ joint @ J.swapaxes(1, 2)
    squared = np.einsum("ki,ki->k", value, np.linalg.solve(S, value[:, :, None])[:, :, 0])
    return squared, np.linalg.slogdet(S)[1]


def _out(name: str, one: Measurement, spans: tuple[Contradiction, ...]) -> Consistency:
    freedom = int(one.freedom.sum())
    worst = max(spans, key=lambda span: span.nis)
    return Consistency(
        what=name,
        count=len(one.row),
        freedom=freedom,
        nis=worst.nis,
        beyond_99=1.0,
        contradictions=spans,
    )
