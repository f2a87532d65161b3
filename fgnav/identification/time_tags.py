"""What a flight says of its noise, with the inertial unit's tags moved as it is likeliest."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.frontend.calibration_request import calibration_requests, of_time, of_vehicle
from fgnav.frontend.prepared import PreparedFlight
from fgnav.frontend.settings import ProblemSettings
from fgnav.graph.inertial.gyro_free import GyroFree
from fgnav.graph.turned import UNIT_TURN
from fgnav.graph.types.constants import FlightConstant
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.array.turn import tested_turn, with_turn
from fgnav.identification.likelihood.bent_clock import informed, informed_requests
from fgnav.identification.likelihood.beside_phases import profile_likelihood
from fgnav.identification.likelihood.clock_determinant import ClockDeterminant
from fgnav.identification.likelihood.record_clock import (
    RecordClock,
    clock_off,
    record_clock,
)
from fgnav.identification.noise.identified import Identified
from fgnav.identification.noise.identify import as_stated, identify
from fgnav.identification.noise.thinned_flight import ThinnedFlight
from fgnav.identification.spans.beside_phases import nats_of_span
from fgnav.identification.tested_constants import SIGMAS, SQUARES_OF_TWO
from fgnav.identification.track.candidates import clock_candidates, over_common_span
from fgnav.identification.track.clock import STEP_S
from fgnav.identification.track.tags import is_far, middle_of_tags_s, with_tags_moved
from fgnav.identification.track.windows import EXCLUDED
from fgnav.process.hyperparameters import IntervalPriors
from fgnav.types.flight import Flight

_CLOCK_STEPS = 5  # at most: each leaves half or less of what is left
Build = Callable[[Flight, ProblemSettings], PreparedFlight]


def with_rates_of(settings: ProblemSettings, problem: SmoothingProblem) -> ProblemSettings:
    """Return settings of the same flight with other tags or noise of its unit: it turns alike."""
    motion = problem.motion
    if not isinstance(motion, GyroFree):
        return settings
    priors = IntervalPriors(motion.t_s, motion.poles_per_s, motion.variance_rad2ps2)
    return replace(settings, interval_priors=priors)


class AtTags(NamedTuple):
    """What a flight says, and by what its unit's tags are moved: offset in s, rate in ppm, (2,)."""

    identified: Identified
    moved: FloatArray


class _Likelihood(NamedTuple):
    """How likely tags are, and what a flight says with them, but for phases of arcs."""

    likelihood: float
    identified: Identified | None = None


class TagSearch(NamedTuple):
    """A flight, and how its problem is built."""

    flight: Flight
    settings: ProblemSettings
    build: Build
    determinant: ClockDeterminant | None = None  # what it says of a clock that states bend to

    def likeliest(self, prepared: PreparedFlight, clock_nats: float = np.inf) -> AtTags | None:
        """Return what the flight says with the unit's tags moved as fits best.

        Of several clocks the likeliest over the same measurements, but the stated one, the first,
        as long as no other excludes it. None with a heading that nothing tells.

        Parameters
        ----------
        prepared : PreparedFlight
            With tags as they are.
        clock_nats : float
            What a step of the clock promises there, if that is known.
        """
        late_s = clock_candidates(self.flight)
        begin = np.array([late_s[0], 0.0])
        if len(late_s) > 1:
            common = self._replace(flight=over_common_span(self.flight, late_s))
            ends = [common._end_from(one) for one in late_s]
            likely = [-np.inf if end is None else end.identified.likelihood for end in ends]
            best = int(np.argmax(likely)) if max(likely) > likely[0] + EXCLUDED else 0
            end = ends[best]
            if end is None:
                return None
            begin = np.array([late_s[best], 0.0])
            if abs(end.moved[0] - begin[0]) > STEP_S:  # in another valley than it began
                begin = end.moved
        if begin.any():
            return self.identified(begin)
        return self.identified(begin, begin=prepared, clock_nats=clock_nats)

    def identified(
        self,
        moved: FloatArray,
        turn: str = UNIT_TURN,
        begin: PreparedFlight | None = None,
        clock_nats: float = np.inf,
        *,
        is_turned: bool = False,
    ) -> AtTags | None:
        """Return what the flight says with its unit's tags moved at first, and further if likelier.

        None with a heading that nothing tells.

        Parameters
        ----------
        moved : ndarray, shape (2,)
        turn : str
            Which turn of the array is tested.
        begin : PreparedFlight, optional
            With these tags.
        clock_nats : float
            What a step of the clock promises there, if that is known.
        is_turned : bool
            Whether a turn has been taken back, and something may be left of it.
        """
        at_first = self._with_tags(moved)
        prepared = self.build(at_first, self.settings) if begin is None else begin
        if prepared.opening is not None and prepared.opening.until_s == np.inf:
            return None
        extra = self._extra(prepared, turn)
        others = self._replace(settings=with_rates_of(self.settings, prepared.problem))
        identified = identify(ThinnedFlight.of(at_first, prepared, extra))
        search = self.informed(AtTags(identified, moved))
        if search is not self:
            return search.identified(moved, turn, is_turned=is_turned)
        clock = None
        is_turned |= identified.is_turned  # where that is not free a clock stands for it
        turned = tested_turn(prepared.problem, turn) if is_turned else ()
        if prepared.problem.phase is not None and 2 * clock_nats > SQUARES_OF_TWO:
            whole = with_turn(prepared.from_minimum, turned)
            clock = clock_off(whole, middle_of_tags_s(self.flight.imu), moved)
            if clock is not None and clock.squares <= 2 * nats_of_span(whole):
                return AtTags(identified.on_time(), moved)
        if clock is not None:  # phases tell it best
            identified = identified.with_clock(clock.value, clock.sigma)
        elif not is_far(self.flight, identified.times):
            return AtTags(identified, moved)
        unmoved = AtTags(identified.on_time(), moved)
        try:
            if clock is None:
                stepped = others._stepped(AtTags(identified, moved), extra)
            else:
                stepped = others._stepped_by(moved, clock, extra, turned)
        except NoSolutionError:
            return unmoved
        if self.flight.observations is not None:  # nothing is left to estimate
            rest = stepped.identified.times.value[:2]
            stepped = AtTags(stepped.identified.on_time(), stepped.moved + rest)
        either = identified.times.are_one_or_the_other
        return others._likelier(unmoved, stepped, turned, is_late_velocity=either)

    def on_time(self) -> AtTags:
        """Return what the flight says with its unit's tags as they are, whatever contradicts them.

        Raises
        ------
        NoSolutionError
            If its chain has no solution.
        """
        prepared = self.build(self.flight, self.settings)
        identified = identify(
            ThinnedFlight.of(self.flight, prepared, self._extra(prepared, UNIT_TURN))
        )
        return AtTags(identified.on_time(), np.zeros(2))

    def _likelier(
        self,
        unmoved: AtTags,
        stepped: AtTags,
        turned: tuple[FlightConstant, ...],
        *,
        is_late_velocity: bool,
    ) -> AtTags:
        """Return what a flight says with tags moved further, if that is likelier.

        Where late velocities are as likely as these tags it is enough that nothing excludes them.
        """
        both = (unmoved.moved, stepped.moved)
        before, after = (self.without_clock(by, both, turned) for by in both)
        least = -EXCLUDED if is_late_velocity else SIGMAS**2 / 2
        if after.likelihood > before.likelihood + least:
            return stepped
        late = before.identified if is_late_velocity else None
        return unmoved if late is None else unmoved._replace(identified=late)

    def informed(self, at_tags: AtTags) -> "TagSearch":
        """Return the same with what determinants say of a clock that states bend to."""
        determinant = at_tags.identified.times.determinant
        if determinant is None or self.determinant is not None:
            return self
        requests = informed_requests(self.settings.calibration, determinant)
        settings = replace(self.settings, calibration=requests)
        return self._replace(settings=settings, determinant=determinant)

    def tested(self, moved: FloatArray) -> ThinnedFlight:
        """Return the flight's thinned chain with tags so moved, and all that is tested with it.

        Raises
        ------
        NoSolutionError
            If the flight has no problem at these tags.
        """
        prepared = self.at_tags(moved)
        extra = self._extra(prepared, UNIT_TURN)
        return ThinnedFlight.of(self._with_tags(moved), prepared, extra)

    def at_tags(self, moved: FloatArray) -> PreparedFlight:
        """Return the flight's problem with tags so moved."""
        return self.build(self._with_tags(moved), self.settings)

    def _extra(self, prepared: PreparedFlight, turn: str) -> tuple[FlightConstant, ...]:
        return (*self._tested_constants(), *tested_turn(prepared.problem, turn))

    def _with_tags(self, moved: FloatArray) -> Flight:
        return with_tags_moved(self.flight, moved, middle_of_tags_s(self.flight.imu))

    def _end_from(self, late_s: float) -> AtTags | None:
        """Return what the flight says begun at a clock; None without a solution or a heading."""
        try:
            return self.identified(np.array([late_s, 0.0]))
        except NoSolutionError:
            return None

    def _stepped(self, first: AtTags, extra: tuple[FlightConstant, ...]) -> AtTags:
        """Return what the flight says at tags moved by steps until one is within its sigma.

        A step takes variances of the rate at the times of the tags before, and falls short.
        Where noise had no minimum it is sought again at the last tags alone.

        Raises
        ------
        NoSolutionError
            If a step leaves no less than the one before: of other faults than the clock's they lead
            to and fro, and each identifies all noise.
        """
        identified, moved = first.identified, first.moved
        before, is_stated = identified.times.clock_sigmas, identified.has_no_minimum
        for _ in range(_CLOCK_STEPS):
            moved = moved + identified.times.value[:2]
            judge = as_stated if is_stated else partial(identify, factors=first.identified.factors)
            identified = judge(self._thinned(moved, extra))
            remaining = identified.times.clock_sigmas
            if remaining <= 1.0:
                break
            if remaining >= before:
                raise NoSolutionError("clock: its steps do not end")
            before = remaining
        return AtTags(identify(self._thinned(moved, extra)) if is_stated else identified, moved)

    def _stepped_by(
        self,
        moved: FloatArray,
        clock: RecordClock,
        extra: tuple[FlightConstant, ...],
        turned: tuple[FlightConstant, ...],
    ) -> AtTags:
        """Return what the flight says at tags moved by steps of the whole problem.

        Raises
        ------
        NoSolutionError
            If a step leaves no problem that has a minimum, or the steps do not end.
        """
        for _ in range(_CLOCK_STEPS):
            moved = moved + clock.value
            problem = self.build(self._with_tags(moved), self.settings).problem
            again = record_clock(
                with_turn(problem, turned), middle_of_tags_s(self.flight.imu), moved
            )
            if again is None:
                break
            clock = again
            if clock.squares <= 1.0:
                moved = moved + clock.value
                identified = identify(self._thinned(moved, extra))
                return AtTags(identified.with_clock(np.zeros(2), clock.sigma), moved)
        raise NoSolutionError("clock: its steps do not end")

    def _thinned(self, moved: FloatArray, extra: tuple[FlightConstant, ...]) -> ThinnedFlight:
        """Return the flight's thinned chain with tags moved."""
        flight = self._with_tags(moved)
        return ThinnedFlight.of(flight, self.build(flight, self.settings), extra)

    def without_clock(
        self,
        moved: FloatArray,
        others: tuple[FloatArray, ...],
        turned: tuple[FlightConstant, ...] = (),
    ) -> "_Likelihood":
        """Return how likely tags so moved are, over what is measured with others as well.

        The steps that led to them take all else of a chain as it is, the rates' variances as well,
        which are of the times of the tags before: a body that turns alike all along seems to tell
        them. Where there are phases of arcs, all of the problem is asked: they tell forces far
        better than the thinned chain's Doppler; ``turned``: a turn of the array that is free there.
        Minus infinity without a solution.
        """
        span = tuple(float(by[0]) for by in others)
        at = self._replace(flight=over_common_span(self.flight, span))._with_tags(moved)
        try:
            prepared = self.build(at, self.settings)
            if prepared.problem.phase is not None:
                whole = with_turn(prepared.problem, turned)
                return _Likelihood(profile_likelihood(whole))
            turn = tested_turn(prepared.problem, UNIT_TURN)
            constants = (*self._tested_constants(clock=False), *turn)
            identified = identify(ThinnedFlight.of(at, prepared, constants))
        except NoSolutionError:
            return _Likelihood(-np.inf)
        return _Likelihood(identified.likelihood, identified)

    def gained(self, at_tags: AtTags, factors: dict[str, float]) -> float:
        """Return by how much what a flight says is likelier than noise and times as stated.

        Over the same measurements, less the odds of each contradiction. ``factors``: of the noise
        that is not stated.
        """
        moved, stated = at_tags.moved, np.zeros(2)
        likely = _Likelihood(at_tags.identified.likelihood)
        at = self
        if moved.any():
            likely = self.without_clock(moved, (stated, moved))
            at = self._replace(flight=over_common_span(self.flight, (0.0, float(moved[0]))))
        as_stated = at._thinned(stated, ()).likelihood_at(factors)
        return _less_odds(at_tags, likely) - as_stated

    def _tested_constants(self, *, clock: bool = True) -> tuple[FlightConstant, ...]:
        """Return constants that are tested without a request: clock, delay and lever arm."""
        flight, requested = self.flight, [one.kind for one in self.settings.calibration]
        has_velocities = (
            flight.observations is None
            and flight.fixes is not None
            and flight.fixes.v_n_mps is not None
        )
        is_tested = {"clock": clock, "velocity-delay": has_velocities}
        words = [word for word, tested in is_tested.items() if tested]
        times = calibration_requests([word for word in words if word not in requested])
        arm = [] if "lever-arm" in requested else calibration_requests(["lever-arm"])
        return (
            *informed((one for word in times for one in of_time(word)), self.determinant),
            *(of_vehicle(word) for word in arm),
        )


def common_likelihoods(*flights: tuple[TagSearch, PreparedFlight]) -> tuple[float, ...]:
    """Return how likely flights of the same measurements are, noise and tags as each says.

    Over what all have measured at these tags, less the odds of a contradiction for tags that are
    moved and for each noise that is not as stated. Minus infinity without a solution or a heading.
    """
    likeliest = [_likeliest(*one) for one in flights]
    moved = tuple(one.moved for one in likeliest if one is not None)
    return tuple(
        -np.inf if one is None else _less_odds(one, search.without_clock(one.moved, moved))
        for (search, _), one in zip(flights, likeliest, strict=True)
    )


def _less_odds(at_tags: AtTags, likely: _Likelihood) -> float:
    contradictions = at_tags.moved.any() + len(at_tags.identified.contradicted)
    return likely.likelihood - EXCLUDED * contradictions


def _likeliest(search: TagSearch, prepared: PreparedFlight) -> AtTags | None:
    try:
        return search.likeliest(prepared)
    except NoSolutionError:
        return None
