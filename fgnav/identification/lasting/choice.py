"""Which error of a whole flight, or of all that follows a time, is the likeliest, if any is.

It is taken for true by the odds of any contradiction, if it leaves no more than chance, and if no
louder unit, no drift, no lever arm and no late velocities are likelier. A flight that rests says
what its unit's noise is at rest: louder in motion is usual there, and a cause is to be likelier
than that, with late velocities or a lever arm beside, by the same odds. Short of these odds nothing
is said, and attitudes are doubted for all that is likelier than none (``lasting.averaging``).
"""

from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from scipy.special import expit

from fgnav.checks import NoSolutionError
from fgnav.frontend.calibration_request import CalibrationRequest
from fgnav.frontend.prepared import AttitudeDoubt
from fgnav.graph.delayed import CLOCK_OFFSET, VELOCITY_DELAY
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.graph.types.solution import Solution
from fgnav.identification.lasting import (
    arm,
    field,
    late_instrument,
    late_samples,
    quadrants,
    sight,
    unit_axes,
)
from fgnav.identification.lasting.averaging import Possible, Rivals, possible, rivals_of
from fgnav.identification.lasting.clock import CLOCK, ClockOff, clock_off
from fgnav.identification.lasting.error import LastingError
from fgnav.identification.lasting.lost_samples import LOST, LostSamples, lost_samples
from fgnav.identification.likelihood.beside_phases import (
    Scored,
    is_misfit,
    noise_in_motion,
    schwarz_nats,
    white_noise,
)
from fgnav.identification.likelihood.changed_samples import Promise, promised_each
from fgnav.identification.likelihood.record_clock import tags, with_drifts
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.noise.begin import WHITE
from fgnav.identification.spans.beside_phases import nats_of_span
from fgnav.identification.track.windows import EXCLUDED
from fgnav.solve.chain import solve_batch
from fgnav.types.flight import Flight

_OF_AXES = (*WHITE, field.MAGNETOMETER, field.DECLINATION)
# Samples or the stated field are put right by these, and nothing is estimated.
_PUT_RIGHT: dict[str, Callable[[Flight, LastingError], Flight]] = {
    kind: module.put_right
    for module in (unit_axes, field, late_samples, late_instrument, quadrants)
    for kind in module.KINDS
}
_SENTENCES: dict[str, Callable[[LastingError], str]] = {
    kind: module.sentence
    for module in (late_samples, late_instrument, quadrants, sight)
    for kind in module.KINDS
}
# Of a record that loses samples evenly, and of a fast clock, tags are as early; what an antenna is
# off along the way a clock is late.
_ALIKE = {LOST, CLOCK, arm.LEVER_ARM}


class Lasting(NamedTuple):
    """The likeliest error, and the probability that it is of this sensor, not of another."""

    error: LastingError
    share: float
    rivals: Rivals | None = None

    @property
    def kind(self) -> str:
        """What it is called."""
        return self.error.kind

    @property
    def is_likely(self) -> bool:
        """That it is taken for true."""
        return True

    @property
    def is_of_unit(self) -> bool:
        """Whether it is of axes, scales or biases of the inertial unit's sensors."""
        return self.error.kind in unit_axes.KINDS

    @property
    def is_put_right(self) -> bool:
        """Whether samples or the stated field are put right by it, and nothing is estimated."""
        return self.error.kind in _PUT_RIGHT

    @property
    def requests(self) -> tuple[CalibrationRequest, ...]:
        """What is to be estimated with the flight."""
        if self.is_put_right:
            return ()
        return (sight.request_of(self.error),)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What is to be said of it."""
        if self.is_of_unit:
            return (unit_axes.sentence(self.error, self.share),)
        if self.error.kind in field.KINDS:
            return (field.sentence(self.error, self.share),)
        if self.error.kind == arm.LEVER_ARM:
            return (arm.sentence(self.error.off, self.error.covariance),)
        return (_SENTENCES[self.error.kind](self.error),)

    @property
    def doubt(self) -> AttitudeDoubt | None:
        """What is doubted of attitudes beside what their states are, if anything is."""
        return self.error.doubt(self.share) if self.is_put_right else None

    def undone(self, flight: Flight) -> Flight:
        """Return a flight without it, where that is put right."""
        if flight.imu is None or not self.is_put_right:
            return flight
        return _PUT_RIGHT[self.error.kind](flight, self.error)

    def in_doubt(self, problem: SmoothingProblem) -> SmoothingProblem:
        """Return the same problem: what is left of it is estimated, or doubted of attitudes."""
        return problem


Cause = Lasting | LostSamples | ClockOff | Possible


class Variants(NamedTuple):
    """A problem otherwise than stated.

    Attributes
    ----------
    with_noise : callable
        From factors on the unit's white noise to the problem with these.
    in_motion : callable or None
        The same, at rest as stated; None of a flight that never rests.
    estimating : callable
        From what is to be estimated, and factors in motion, to the problem with it.
    others : tuple of CalibrationRequest
        Lever arm and delay of velocities, where they are not estimated.
    """

    with_noise: Callable[[dict[str, float]], SmoothingProblem]
    in_motion: Callable[[dict[str, float]], SmoothingProblem] | None
    estimating: Callable[[CalibrationRequest, dict[str, float]], SmoothingProblem]
    others: tuple[CalibrationRequest, ...]


def promises_of(problem: SmoothingProblem, stated: Solution, middle_s: float) -> dict[str, Promise]:
    """Return what steps of constants promise, each alone: clock, unit, lever arm; by kind.

    Parameters as of ``likely_causes``.
    """
    by = unit_axes.tested(problem) | late_samples.tested(problem)
    if by and problem.constants.column(CLOCK_OFFSET) < 0:
        by |= {CLOCK: tags(middle_s, np.zeros(2))}
    return promised_each(problem, stated.states, by, arm.tested(problem))


def likely_causes(
    at: tuple[SmoothingProblem, Solution],
    middle_s: float,
    promises: Mapping[str, Promise],
    variants: Variants,
    flight: Flight,
) -> tuple[Cause, ...]:
    """Return what is off for a whole flight, or from some time on; nothing where nothing is.

    The likeliest; after lost samples, which are still to be held against other noise, a clock that
    is as likely.

    Parameters
    ----------
    at : tuple of SmoothingProblem and Solution
        Its minimum.
    middle_s : float
        For which a clock's offset is stated.
    promises : mapping of str to Promise
        See ``promises_of``.
    variants : Variants
    flight : Flight
    """
    problem, stated = at
    tested = (
        *sight.sight_errors(problem, stated, flight.seeker),
        *unit_axes.unit_errors(problem, stated, promises),
        *field.field_errors(problem, stated),
        *arm.arm_errors(problem, stated, promises),
        *late_instrument.late_instruments(problem, stated, flight),
    )
    moved = None
    if CLOCK in promises and promises[CLOCK].nats >= EXCLUDED - LIKELY:
        moved = clock_off(problem, stated, middle_s)
    late = late_samples.late_samples(problem, stated, promises)
    errors = sorted((*tested, *_late(late, problem, moved)), key=lambda one: -one.nats)
    changed = [one for one in (lost_samples(problem, stated), moved) if one is not None]
    ordered = sorted((*errors, *changed), key=lambda one: -one.nats)
    likely = (
        one for one in ordered if one.nats > EXCLUDED and not _is_of_span(one, problem, stated)
    )
    best = next(likely, None)
    if best is None:
        return _possible(at, ordered, variants)
    if is_misfit(problem, best.cost):
        return ()
    rivals = [
        one
        for one in variants.others
        if not (isinstance(best, LastingError) and best.kind == one.kind)
    ]
    if isinstance(best, ClockOff | LostSamples) and best.nats <= nats_of_span(*at):
        return ()
    others = (variants.estimating(one, {}) for one in rivals)
    if best.nats <= _otherwise(problem, stated.cost, others, best.nats):
        return ()
    if best.nats <= white_noise(problem, variants.with_noise, Scored.of(*at)).nats:
        return ()
    if best.nats - EXCLUDED <= _usual(at, variants, rivals):
        return _possible(at, ordered, variants)
    cause = _of_errors(best, errors, problem) if isinstance(best, LastingError) else best
    like_it = [one for one in ordered if _may_stand_for(one, best)]
    first = cause._replace(rivals=rivals_of(best, like_it, problem.t_s))
    if not isinstance(best, LostSamples) or moved is None or not moved.is_likely:
        return (first,)
    if moved.nats <= best.nats - EXCLUDED:
        return (first,)
    other = rivals_of(moved, [best], problem.t_s)
    return first, moved._replace(rivals=other)


def _possible(
    at: tuple[SmoothingProblem, Solution],
    causes: Iterable["LastingError | LostSamples | ClockOff"],
    variants: Variants,
) -> tuple[Possible, ...]:
    """Return what attitudes are doubted for causes that none of is named, if any is possible.

    Loggers that lose samples unnoticed are rarer than other causes: beforehand one in a hundred.
    """
    problem, stated = at
    weighed = (
        one._replace(nats=one.nats - LIKELY) if isinstance(one, LostSamples) else one
        for one in causes
    )
    able = [one for one in weighed if one.nats > -LIKELY and not is_misfit(problem, one.cost)]
    if not able:
        return ()
    others = nats_of_span(*at), white_noise(problem, variants.with_noise, Scored.of(*at)).nats
    return (possible(able, others, problem.t_s, stated.states.R_nb),)


def _may_stand_for(one: "LastingError | Cause", best: "LastingError | Cause") -> bool:
    """Return whether one may look like the other: a late instrument, tags, or a lever arm."""
    kinds = {one.kind, best.kind}
    late = not kinds.isdisjoint(late_instrument.KINDS)
    return len(kinds) == 2 and (late or kinds <= _ALIKE)


def _is_of_span(one: "LastingError | Cause", problem: SmoothingProblem, stated: Solution) -> bool:
    return isinstance(one, LastingError) and unit_axes.is_of_span(one, problem, stated)


def _late(
    late: Iterable[LastingError], problem: SmoothingProblem, clock: ClockOff | None
) -> Iterable[LastingError]:
    """Return by how much forces or rates are late, if that is no clock's.

    By a clock the forces of an accelerometer alone are late as well, and it may be fast or slow
    beside: what leaves less is taken.
    """
    if clock is None or not isinstance(problem.motion, GyroFree):
        return late
    return (one for one in late if one.cost < clock.cost)


def _of_errors(
    best: LastingError, errors: list[LastingError], problem: SmoothingProblem
) -> Lasting:
    """Return the likeliest error with its share among those of axes that may stand for it."""
    share = 1.0
    if best.kind in _OF_AXES:
        of_other = [one.nats for one in errors if one.kind in _OF_AXES and one is not best]
        share = float(expit(best.nats - max(of_other, default=-np.inf)))
        share = share if unit_axes.are_distinguished(problem) else 0.5
    return Lasting(best, share)


def _usual(
    at: tuple[SmoothingProblem, Solution],
    variants: Variants,
    requests: Iterable[CalibrationRequest],
) -> float:
    """Return what is gained by what is no fault of a flight that rests; 0 of others.

    By a unit as loud in motion as is likeliest, and beside it by late velocities or a lever arm,
    which nobody states: none of these costs anything.
    """
    if variants.in_motion is None:
        return 0.0
    noise = noise_in_motion(Scored.of(*at), variants.in_motion)
    gains = [0.0]
    with suppress(NoSolutionError):
        cost = solve_batch(variants.in_motion(noise.factors)).cost
        gains += (_gained(cost, variants.estimating(one, noise.factors)) for one in requests)
    return noise.nats + max(gains)


def _otherwise(
    problem: SmoothingProblem, stated: float, others: Iterable[SmoothingProblem], least: float
) -> float:
    """Return what drifts, a lever arm or late velocities gain, the greatest, if it is so much.

    Less what each of their constants costs (``schwarz_nats``).
    """
    each = schwarz_nats(problem)
    enough = stated - 2 * least
    drifts, gains = with_drifts(problem, enough), [0.0]
    if drifts is not None:
        added = len(drifts.states.constants) - problem.constants.width
        gains.append((stated - drifts.cost) / 2 - added * each)
    for one in others:
        added = one.constants.width - problem.constants.width
        gains.append(_gained(stated, one, enough) - added * each)
    return max(gains)


def _gained(stated: float, other: SmoothingProblem, enough: float = np.inf) -> float:
    """Return what a problem with a lever arm or late velocities gains; 0 without a solution.

    And of a delay below zero: no velocity is of a later time than it is stated for.
    """
    try:
        free = solve_batch(other, enough=enough)
    except NoSolutionError:
        return 0.0
    delay = other.constants.column(VELOCITY_DELAY)
    is_late = delay < 0 or free.states.constants[delay] > 0.0
    return (stated - free.cost) / 2 if is_late else 0.0
