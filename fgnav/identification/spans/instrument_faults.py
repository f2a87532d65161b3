"""An instrument that is wrong for a while, in place of all that its flight would contradict else.

What one instrument measures wrongly another noise explains as well: of the inertial unit, which no
longer contradicts the instrument then, so that attitudes follow it.
Left out, the rest predicts it. What it measures in spans in which it is beyond its band is of any
size f then: D values of innovations r, of predicted covariance S, have

    ln p = -(sum ln det S + D (1 + ln f^2)) / 2        f^2 = sum r' S^-1 r / D

beside the likelihood of the rest. An instrument is at fault where both are likelier than what the
flight says else by the odds of any contradiction, and by as many again as a record of seconds has
spans, and by more than an error of the unit or of fixes over a span is.
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
from fgnav.identification.noise.stated import INSTRUMENTS, with_factors, with_rest
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.spans.unit_faults import Requests
from fgnav.identification.spans.unit_odds import anchored, nats_beside
from fgnav.identification.time_tags import AtTags, TagSearch
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.estimate import Consistency, Contradiction


class _Trial(NamedTuple):
    """An instrument's spans, and the likelihood of a flight with whatever they measure."""

    out: Consistency
    likelihood: float


class WithoutInstrument(NamedTuple):
    """A search without an instrument's fault, what the flight says then, and what is out."""

    search: TagSearch
    at_tags: AtTags
    out: Exclusion


def without_faulty_instrument(
    search: TagSearch,
    at_tags: AtTags,
    in_body_axes: AtTags,
    requests: Requests,
    *,
    is_turned: bool,
) -> WithoutInstrument | None:
    """Return a search without an instrument's fault; None where there is none.

    Parameters
    ----------
    search : TagSearch
    at_tags : AtTags
        What the flight says: asked are those that contradict what is stated of other noise than an
        instrument's, or of axes.
    in_body_axes : AtTags
        The same where axes may be turned.
    requests : callable
        What is to be estimated with a flight.
    is_turned : bool
        Whether axes are turned there.
    """
    others = (at_tags.identified, in_body_axes.identified)
    if not (is_turned or any(one.contradicted.keys() - set(INSTRUMENTS) for one in others)):
        return None
    best = _likeliest(search, at_tags)
    limit = max(one.likelihood for one in others) + EXCLUDED
    nats = -np.inf if best is None else best.likelihood - limit
    if best is None or nats <= 0.0:
        return None
    settings = replace(search.settings, calibration=requests(search, at_tags))
    if nats_beside(search._replace(settings=settings), at_tags, INSTRUMENTS) >= nats:
        return None
    out = of_instrument(search.flight, best.out)
    rest = search._replace(flight=out.flight)
    try:
        after = rest.likeliest(rest.build(rest.flight, rest.settings))
    except NoSolutionError:
        return None
    return None if after is None else WithoutInstrument(rest, after, out)


def _likeliest(search: TagSearch, at_tags: AtTags) -> _Trial | None:
    try:
        flight = search.tested(at_tags.moved)
    except NoSolutionError:
        return None
    names = {one.name for one in flight.problem.measurements} & set(INSTRUMENTS)
    trials = [one for name in sorted(names) if (one := _trial(search, at_tags, flight, name))]
    return max(trials, key=lambda one: one.likelihood, default=None)


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
    chosen = len(spans) * _ways(t_s)
    likelihood = rest.likelihood - (log_det[bad].sum() + freedom * (1 + size)) / 2 - chosen
    return _Trial(_out(name, one, spans), float(likelihood))


def _ways(t_s: FloatArray) -> float:
    """Return ln of the number of spans of seconds."""
    seconds = max(float(t_s[-1] - t_s[0]), 1.0)
    return float(np.log(seconds * (seconds + 1.0) / 2))


def _with(flight: ThinnedFlight, one: Measurement, keep: BoolArray) -> ThinnedFlight:
    """Return a flight with some of a measurement's rows, (k,)."""
    which = np.flatnonzero(keep)
    others = tuple(other for other in flight.problem.measurements if other is not one)
    kept = (Some(one, which, row=one.row[which]),) if len(which) else ()
    return flight._replace(problem=replace(flight.problem, measurements=(*others, *kept)))


def _predicted(
    search: TagSearch, at_tags: AtTags, without: Identified, name: str
) -> tuple[FloatArray, FloatArray]:
    """Return an instrument's innovations squared by all others, and ln det S, (k,) each.

    At the noise identified without it, by a chain with the flight's own constants alone.
    """
    louder = search._replace(
        flight=with_factors(search.flight, without.factors),
        settings=with_rest(search.settings, without.factors),
    )
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
