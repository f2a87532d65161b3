"""Estimates whose measurements contradict each other: whose exclusion leaves a consistent rest.

Detection, identification and adaptation [1]_ on whole sensors and spans of time: innovations beyond
their band detect, the flight is estimated without each suspect in turn, and the exclusion that
leaves the most consistent rest is kept.

References
----------
.. [1] Teunissen: Distributional theory for the DIA method, Journal of Geodesy 92, 2018.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.checks import NoSolutionError
from fgnav.graph.innovation.band import TOLERATED
from fgnav.identification.exclusion import Exclusion, exclusions, going_on
from fgnav.identification.notes import exclusion_notes
from fgnav.identification.track.forces import NAME as FORCES
from fgnav.types.estimate import Consistency, Estimate, Rejected
from fgnav.types.flight import Flight

_ROUNDS = 3  # faults at a time
_TRIALS = 6  # in all: each takes as long as the flight
_BETTER = 0.5  # of what is left of contradictions by the round before
# Residuals twice what noise explains all along, the noise identified: of states that fit such
# measurements no covariance holds. Of faulty units NEES were 300 and more of 3 at an NIS of 4.
_HOPELESS = 4.0

Again = Callable[[Flight], Estimate]


def contradictory(estimate: Estimate) -> tuple[Consistency, ...]:
    """Return the sensors that contradict the others, the worst first."""
    found = [one for one in estimate.consistency if one.contradictions]
    return tuple(sorted(found, key=lambda one: -_worst(one)))


def without_contradictions(flight: Flight, estimate: Estimate, again: Again | None) -> Estimate:
    """Return the estimate of what is consistent of a flight, with what it leaves out.

    Parameters
    ----------
    flight : Flight
    estimate : Estimate
        Of all of it.
    again : callable or None
        The same method, its noise identified; None: contradictions are said, and nothing is left
        out.

    Raises
    ------
    NoSolutionError
        If nothing consistent is left.
    """
    rest = consistent_rest(flight, estimate, again)
    if again is not None and rest.estimate.converged and is_hopeless(rest.estimate):
        raise refusal(rest.estimate)
    out = tuple(rejected for one in rest.out for rejected in one.rejected)
    return with_words(rest.estimate, out)


class Rest(NamedTuple):
    """The estimate of what is consistent of a flight, and what that is without, in turn."""

    estimate: Estimate
    out: tuple[Exclusion, ...]


def consistent_rest(
    flight: Flight, estimate: Estimate, again: Again | None, present_s: float = np.inf
) -> Rest:
    """Return what is consistent of a flight; parameters as in ``without_contradictions``.

    Of a record that goes on, what contradicts at present, ``present_s``, is left out for as long
    again as it has done so.
    """
    out: tuple[Exclusion, ...] = ()
    trials = _Trials(again, _TRIALS)
    for _ in range(_ROUNDS):
        # Real noise is not white: without what contradicts for seconds alone nothing is gained.
        if not any(one.nis > TOLERATED for one in contradictory(estimate)):
            break
        found = _best(flight, estimate, trials, present_s)
        if found is None:
            break
        one, estimate = found
        flight, out = one.flight, (*out, one)
    return Rest(estimate, out)


def is_hopeless(estimate: Estimate) -> bool:
    """Return whether no covariance holds of what such measurements tell."""
    return any(map(_hopeless, contradictory(estimate)))


def refusal(estimate: Estimate) -> NoSolutionError:
    """Return the error that names what contradicts."""
    return NoSolutionError(
        f"measurements contradict each other: {_listed(contradictory(estimate))}; axes, units, "
        "signs or times of one of them, or of the inertial unit, are not as stated; fgnav check "
        "may name it"
    )


def with_words(estimate: Estimate, out: tuple[Rejected, ...]) -> Estimate:
    """Return an estimate with what it is without, and with what of it still contradicts."""
    left, notes = contradictory(estimate), exclusion_notes(out)
    if left:
        notes += (
            f"Measurements contradict each other: {_listed(left)}: one of them, or the inertial "
            "unit, is not as stated there, and covariances are too small.",
        )
    notes += _doubts(estimate)
    if not notes and not out:
        return estimate
    return replace(
        estimate,
        rejections=(*estimate.rejections, *out),
        notes=(*notes, *estimate.notes),
    )


@dataclass(slots=True)
class _Trials:
    """A method, and how often it may still be asked."""

    again: Again | None
    left: int

    def __call__(self, flight: Flight) -> Estimate | None:
        """Return the estimate of a flight; None where there is none."""
        if self.again is None or self.left == 0:
            return None
        self.left -= 1
        try:
            estimate = self.again(flight)
        except NoSolutionError:
            return None
        return estimate if estimate.converged else None


def _doubts(estimate: Estimate) -> tuple[str, ...]:
    """Return a sentence for each sensor whose noise may be more than is tolerated.

    Acted upon is a variance that is out of its band and beyond ``TOLERATED``. Said is one that is
    out of its band, and beyond as far as its samples tell: they know it to a factor of their limit,
    for of so many the lower quantile of chi-square over its freedom is about one over the upper.
    """
    return tuple(
        f"Residuals of {one.what} are {np.sqrt(one.nis):.2g} x what noise explains (chance leaves "
        f"{np.sqrt(one.limit):.2g} x): its noise is more than stated, or something is not as "
        "stated; covariances may be too small."
        for one in estimate.consistency
        if not one.contradictions
        and one.limit is not None
        and one.nis > max(one.limit, TOLERATED / one.limit)
    )


def _best(
    flight: Flight, estimate: Estimate, trials: _Trials, present_s: float
) -> tuple[Exclusion, Estimate] | None:
    """Return the exclusion that leaves least; None if none leaves half of what there is.

    Of a record that goes on, whose noise may be about to be identified, it is to leave nothing.
    """
    best, least = None, _BETTER * _left(estimate) if present_s == np.inf else 0.0
    for one in exclusions(flight, going_on(contradictory(estimate), present_s)):
        trial = trials(one.flight)
        if trial is None:
            continue
        left = _left(trial)
        if left <= least:
            best, least = (one, trial), left
        if left == 0:
            break
    return best


def _left(estimate: Estimate) -> float:
    """Return by how much all that contradict are beyond their noise."""
    spans = [span for one in contradictory(estimate) for span in one.contradictions]
    return sum((span.nis - 1.0) * span.freedom for span in spans)


def _worst(one: Consistency) -> float:
    return max(span.nis for span in one.contradictions)


def _hopeless(one: Consistency) -> bool:
    """Return whether one sensor contradicts throughout; the unit's forces wherever they do.

    Forces are tested where no heading is known, so that no noise of the unit is identified, and a
    motion that rests on them for seconds is wrong for all that follows.
    """
    return any(
        span.nis > _HOPELESS and (span.throughout or one.what == FORCES)
        for span in one.contradictions
    )


def _listed(left: tuple[Consistency, ...]) -> str:
    """Return each sensor with when and by how much it contradicts most."""
    parts = []
    for one in left:
        span = max(one.contradictions, key=lambda span: span.nis)
        when = "throughout" if span.throughout else f"{span.from_s:.1f} to {span.until_s:.1f} s"
        parts.append(
            f"{one.what} ({when}: residuals {np.sqrt(span.nis):.2g} x what noise explains)"
        )
    return ", ".join(parts)
