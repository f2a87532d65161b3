"""Hyperparameters of a causal method: identified from the record so far, whenever it has doubled.

And when motion first determines the heading, whenever that motion has doubled: from then on a
filter states attitudes, and noise at standstill is not that in motion. What is estimated from a
time on depends on nothing later.
"""

from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from fgnav.assembly.prepared import Build, PreparedFlight
from fgnav.assembly.settings import ProblemSettings
from fgnav.assembly.truncation import truncated
from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.messages import note
from fgnav.noise.identify import Hyperparameters, hyperparameters, with_exact_timestamps
from fgnav.noise.report import noise_notes
from fgnav.types.flight import Flight

_FIRST_S = 30.0  # as many fixes at one a second
_MOVED_S = 5.0  # half a dozen of them in motion
_KEYFRAMES = 10  # fewest before motion that determine any noise


class Stretch(NamedTuple):
    """A flight up to a time, as it is prepared for estimates from another time on."""

    from_s: float
    until_s: float  # estimates before it
    flight: Flight
    prepared: PreparedFlight

    def answers(self, t_s: FloatArray) -> BoolArray:
        """Select the times, (k,), that are estimated; a clock correction shifts the record."""
        covered_s = self.prepared.problem.t_s
        within = (t_s >= max(self.from_s, covered_s[0])) & (t_s < self.until_s)
        return np.asarray(within & (t_s <= covered_s[-1]))


@dataclass(frozen=True, eq=False, slots=True)
class Identification:
    """Hyperparameters identified from the record up to a time."""

    hyperparameters: Hyperparameters = field(default_factory=Hyperparameters)
    # Whether there is no minimum yet about which to identify anything: the heading stays open.
    is_open: bool = False

    @property
    def is_nominal(self) -> bool:
        """True if all is nominal."""
        return self.hyperparameters.is_nominal and not self.is_open

    def prepared(self, flight: Flight, settings: ProblemSettings, build: Build) -> PreparedFlight:
        """Return the problem of a flight that goes on."""
        prepared = self.hyperparameters.prepared(flight, settings, build)
        notes = (*prepared.notes, *noise_notes(flight, self.hyperparameters))
        prepared = replace(prepared, notes=notes)
        if not self.is_open or prepared.opening is None:
            return prepared
        return replace(prepared, opening=replace(prepared.opening, until_s=np.inf))


def stretches(
    flight: Flight,
    settings: ProblemSettings,
    prepared: PreparedFlight,
    ahead_s: float,
    build: Build,
) -> tuple[Stretch, ...]:
    """Return the stretches of a flight, in turn: one where all is as stated throughout.

    Parameters
    ----------
    flight : Flight
    settings : ProblemSettings
        Causal.
    prepared : PreparedFlight
        With the nominal noise.
    ahead_s : float
        How much later data an estimate may take part of.
    build : callable
        From a flight to its problem.
    """
    end_s = float(prepared.problem.t_s[-1])
    times_s = identification_times_s(prepared, end_s)
    results = [Identification()]
    for s in times_s:
        results.append(identification(flight, settings, s, build, results[-1]))
    if all(result.is_nominal for result in results):
        return (Stretch(-np.inf, np.inf, flight, prepared),)
    parts: list[Stretch] = []
    before: Identification | None = None
    edges_s = [-np.inf, *times_s, np.inf]
    for begin_s, until_s, result in zip(edges_s[:-1], edges_s[1:], results, strict=True):
        record = flight if until_s == np.inf else truncated(flight, float(until_s + ahead_s))
        try:
            problem = result.prepared(record, settings, build)
        except NoSolutionError:
            if until_s == np.inf:
                raise
            before = None  # nothing is known by then, whatever comes later
            continue
        goes_on = before is not None and before.is_nominal and result.is_nominal
        first_s = parts.pop().from_s if goes_on else float(begin_s)
        parts.append(Stretch(first_s, float(until_s), record, problem))
        before = result
    changed_s = ", ".join(f"{stretch.from_s:.0f}" for stretch in parts if stretch.from_s > -np.inf)
    last = parts[-1]
    noted = replace(last.prepared, notes=(*last.prepared.notes, note("I307", times_s=changed_s)))
    return (*parts[:-1], last._replace(prepared=noted))


def identification_times_s(prepared: PreparedFlight, end_s: float) -> list[float]:
    """Return when noise is identified, before a flight's end."""
    t_s, opening = prepared.problem.t_s, prepared.opening
    times_s = {*_doublings(float(t_s[0]), _FIRST_S, end_s)}
    if opening is not None and opening.keyframes >= _KEYFRAMES:
        known_s = float(opening.until_s)
        until_s = min((s for s in times_s if s > known_s), default=end_s)
        times_s |= {*_doublings(float(t_s[0]), _MOVED_S, float(t_s[0] + _FIRST_S))}
        if opening.keyframes < len(t_s):
            times_s |= {known_s, *_doublings(known_s, _MOVED_S, until_s)}
    return sorted(times_s)


def _doublings(from_s: float, after_s: float, until_s: float) -> list[float]:
    """Return times ``after_s``, twice that and so on from a time, before another."""
    count = int(np.ceil(np.log2(max((until_s - from_s) / after_s, 1.0))))
    return [from_s + after_s * 2.0**j for j in range(count)]


def identification(
    flight: Flight,
    settings: ProblemSettings,
    until_s: float,
    build: Build,
    before: Identification,
) -> Identification:
    """Identify hyperparameters from the flight up to a time, starting at the previous ones."""
    past = with_exact_timestamps(truncated(flight, until_s))
    whole = replace(settings, causal=False)
    try:
        prepared = build(past, whole)
    except NoSolutionError:  # next to nothing is there yet
        return Identification()
    try:
        return Identification(
            hyperparameters(past, whole, build, prepared, before.hyperparameters)[0]
        )
    except NoSolutionError:
        opening = prepared.opening
        return Identification(is_open=opening is not None and opening.until_s == np.inf)
