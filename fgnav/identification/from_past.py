"""Noise of a causal method: identified by what came before, again whenever that has doubled.

And when motion first tells the heading, whenever that motion has doubled: from then on a filter
states attitudes, and noise at rest is not that in motion (a quadrotor's accelerometer: 300 times
its data sheet's). Before as well: with the unit's clock off nothing tells the heading. As long as
the chain has no minimum about which noise could be identified, the heading stays open: what a
flight contradicts so much is not known by it.

A stretch is estimated with the noise and the times that the record up to its beginning told, and,
of a unit that is not as its sheet has it, with the doubt that the record leaves of its other noises
(``noise.doubted``). What is estimated within it depends on nothing later: the method runs anew over
all that came before.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.frontend.calibration_request import calibration_requests
from fgnav.frontend.causal.truncation import truncated
from fgnav.frontend.prepared import PreparedFlight, Stretch
from fgnav.frontend.settings import ProblemSettings
from fgnav.identification.apply import corrected, with_findings
from fgnav.identification.findings import FEWEST, Findings, findings
from fgnav.identification.likelihood.bent_clock import determinant_of, informed_requests
from fgnav.identification.noise.doubted import is_doubted, mean_squares
from fgnav.identification.noise.loud_phases import (
    loud_phases,
    loudness_notes,
    with_loud_phases,
)
from fgnav.identification.noise.stated import unstated
from fgnav.identification.notes import doubt_notes
from fgnav.identification.time_tags import Build
from fgnav.types.flight import Flight
from fgnav.types.instruments import LoudPhases

FIRST_S = 30.0  # as many fixes at one a second
MOVED_S = 5.0  # half a dozen of them: of noise in motion next to nothing is known before


def stretches(
    flight: Flight,
    settings: ProblemSettings,
    prepared: PreparedFlight,
    ahead_s: float,
    build: Build,
    since_s: float = -np.inf,
) -> tuple[Stretch, ...]:
    """Return the stretches of a flight, in turn; none where nothing contradicts what it states.

    Parameters
    ----------
    flight : Flight
    settings : ProblemSettings
        Causal.
    prepared : PreparedFlight
        With the noise as the flight has it.
    ahead_s : float
        How much later data an estimate may take part of.
    build : callable
        From a flight to its problem.
    since_s : float
        When estimates begin, and noise is identified, too: earlier ones are not wanted.
    """
    end_s = float(prepared.problem.t_s[-1])
    from_s = [since_s, *(s for s in looks_s(prepared, end_s) if s > since_s), np.inf]
    by_then = [
        Look(None) if s == -np.inf else look(flight, settings, float(s), build) for s in from_s[:-1]
    ]
    if all(one == Look(None) for one in by_then):
        return ()
    parts: list[Stretch] = []
    before = None
    for begin_s, until_s, told in zip(from_s[:-1], from_s[1:], by_then, strict=True):
        part = flight if until_s == np.inf else truncated(flight, float(until_s + ahead_s))
        try:
            problem = told.prepared(part, settings, build)
        except NoSolutionError:
            if until_s == np.inf:
                raise
            before = None  # nothing is known by then, whatever comes later
            continue
        # Causal: of a longer record the same is estimated, once for both.
        first_s = parts.pop().from_s if told.goes_on(before) else float(begin_s)
        parts.append(Stretch(first_s, float(until_s), part, problem))
        before = told
    changed_s = ", ".join(f"{one.from_s:.0f}" for one in parts if one.from_s > -np.inf)
    note = f"Noise is identified anew from the past, from {changed_s} s on."
    last = parts[-1]
    said = replace(last.prepared, notes=(*last.prepared.notes, note))
    return (*parts[:-1], last._replace(prepared=said))


def looks_s(prepared: PreparedFlight, end_s: float) -> list[float]:
    """Return when noise is identified, before a flight's end."""
    t_s, opening = prepared.problem.t_s, prepared.opening
    looks_s = {*_doublings(float(t_s[0]), FIRST_S, end_s)}
    if opening is not None and opening.keyframes >= FEWEST:
        known_s = float(opening.until_s)
        until_s = min((s for s in looks_s if s > known_s), default=end_s)
        looks_s |= {*_doublings(float(t_s[0]), MOVED_S, float(t_s[0] + FIRST_S))}
        if opening.keyframes < len(t_s):
            looks_s |= {known_s, *_doublings(known_s, MOVED_S, until_s)}
    return sorted(looks_s)


def _doublings(from_s: float, after_s: float, until_s: float) -> list[float]:
    """Return times ``after_s``, twice that and so on from a time, before another."""
    count = int(np.ceil(np.log2(max((until_s - from_s) / after_s, 1.0))))
    return [from_s + after_s * 2.0**j for j in range(count)]


class Look(NamedTuple):
    """What the record up to a time tells of noise and times.

    ``is_told``: nothing is in its way; ``doubted``: by what noises count that it leaves open;
    ``loud``: phases of its antenna.
    """

    found: Findings | None
    is_told: bool = True
    doubted: Mapping[str, float] = MappingProxyType({})
    loud: tuple[LoudPhases, ...] = ()

    def goes_on(self, before: "Look | None") -> bool:
        """Return whether noise is as stated, as by the look before."""
        return self.found is None and self == before

    def prepared(self, flight: Flight, settings: ProblemSettings, build: Build) -> PreparedFlight:
        """Return the problem of a flight that goes on, with noise and times as found."""
        flight = with_loud_phases(flight, self.loud)
        if self.found is None:
            problem = build(flight, settings)
        else:
            factors = {**self.found.factors, **self.doubted}
            problem = with_findings(flight, settings, self.found._replace(factors=factors), build)
            problem = replace(problem, notes=(*problem.notes, *doubt_notes(self.doubted)))
        if self.loud:
            problem = replace(problem, notes=(*problem.notes, *loudness_notes(flight.gnss_noise)))
        if self.is_told or problem.opening is None:
            return problem
        return replace(problem, opening=replace(problem.opening, until_s=np.inf))


def look(flight: Flight, settings: ProblemSettings, until_s: float, build: Build) -> Look:
    """Return what a flight tells up to a time."""
    past = truncated(flight, until_s)
    loud = loud_phases(past)
    past = with_loud_phases(past, loud)
    return _looked(past, settings, until_s, build)._replace(loud=loud)


def _looked(past: Flight, settings: ProblemSettings, until_s: float, build: Build) -> Look:
    """Return what a record tells, its phases as loud as they are."""
    whole = replace(settings, causal=False)
    try:
        prepared = build(past, whole)
    except NoSolutionError:  # next to nothing is there yet
        return Look(None)
    try:
        changes = findings(past, whole, prepared, build)
        decided = None if changes is None else changes.decided_by(until_s)
        if decided is None or prepared.problem.phase is not None:  # the chain has no arcs
            return Look(decided)
        return _with_doubt(_with_late_velocities(decided, past, whole), past, whole, build)
    except NoSolutionError:
        return Look(None, is_told=_is_open(prepared))


def _is_open(prepared: PreparedFlight) -> bool:
    """Return whether nothing tells the heading, whatever noise is."""
    return prepared.opening is not None and prepared.opening.until_s == np.inf


def _with_late_velocities(changes: Findings, past: Flight, settings: ProblemSettings) -> Findings:
    """Return findings, velocities of fixes as late as they may be where the unit's clock is off.

    By then their sum alone is known as a rule: what comes next tells them apart, and until then
    either may be the other.
    """
    fixes, requested = past.fixes, settings.calibration
    is_off = any(one.kind == "clock" and one not in requested for one in changes.calibration)
    is_late = any(one.kind == "velocity-delay" for one in changes.calibration)
    if fixes is None or fixes.v_n_mps is None or is_late or not is_off:
        return changes
    late = calibration_requests(["velocity-delay"])
    return changes._replace(calibration=(*changes.calibration, *late))


def _with_doubt(changes: Findings, past: Flight, settings: ProblemSettings, build: Build) -> Look:
    """Return a look with what it leaves open of a unit that is not as its sheet has it."""
    if not is_doubted(changes.factors, unstated(past)):
        return Look(changes)
    changes = _with_open_clock(changes, past, settings, build)
    thinned = corrected(past, settings, changes, build).tested(np.zeros(2))
    return Look(changes, doubted=mean_squares(thinned, changes.factors))


def _with_open_clock(
    changes: Findings, past: Flight, settings: ProblemSettings, build: Build
) -> Findings:
    """Return findings with the clock of a unit that is not as its sheet has it: as nobody states.

    Until it is told, a record that shows no clock that is off has none that is right either.
    """
    if past.fixes is None or any(one.kind == "clock" for one in changes.calibration):
        return changes
    requests = (*changes.calibration, *calibration_requests(["clock"]))
    with_clock = changes._replace(calibration=requests)
    determinant = determinant_of(with_findings(past, settings, with_clock, build))
    if determinant is None:
        return with_clock
    return changes._replace(calibration=informed_requests(requests, determinant))
