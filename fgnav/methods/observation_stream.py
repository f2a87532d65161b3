"""The forward filter fed with raw observations, epoch by epoch, as instruments hand them out."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import NamedTuple

import numpy as np

from fgnav.assembly.position.by_observations import LastObservations
from fgnav.assembly.prepared import PreparedFlight
from fgnav.assembly.problem import build_problem
from fgnav.assembly.settings import ProblemSettings
from fgnav.checks import BadInputError, NoSolutionError
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.solution import Solution
from fgnav.methods.causal import Identification, identification, identification_times_s
from fgnav.methods.smoother import Forward
from fgnav.methods.smoothing.concatenation import concatenate_estimates, no_keyframes
from fgnav.methods.smoothing.estimates import stated_at
from fgnav.methods.streaming.going_on import GoingOn, going_on
from fgnav.methods.streaming.recording import concatenate_flights, epochs_s, pieces
from fgnav.solve.fixed_lag import joined_solution, with_open_heading
from fgnav.solve.sliding.window import FixedLag
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

_ROUNDING_S = 1e-6


class _Keyframe(NamedTuple):
    """A keyframe as it was known when it came."""

    prepared: PreparedFlight
    problem: Problem
    row: int
    known: Solution


@dataclass(slots=True)
class _Span:
    """Keyframes from a time on, with noise and times as identified by then."""

    from_s: float
    identified: Identification
    record: GoingOn

    def prepared(self, settings: ProblemSettings) -> PreparedFlight:
        """Return the problem of what is kept."""
        build = partial(build_problem, earlier=self.record.earlier)
        return self.identified.prepared(self.record.flight, settings, build)


class ObservationStream:
    """Estimate states from a stream of measurements, as ``Forward`` does from a flight.

    Each update brings what instruments measured since the one before, as a flight of its own: raw
    observations of one epoch or more, or fixes, and inertial samples up to the last of them. It
    returns the keyframes that are due by then, each as known from the data up to it: joined they
    are what ``method(flight)`` returns.

    Of one antenna, or fixes, beside a gyroscope it keeps half a minute of records once the heading
    is known, and an epoch costs the same however long it runs. Where noise is identified it keeps
    all of them (20 MB an hour, of 2 and 100 samples a second) and runs again whenever that has
    doubled. Of arrays, bodies without a gyroscope, and beside a base, a detector, a gravity
    estimator or wheels it keeps and reads all of them at every epoch: for short flights
    (docs/howto/streaming.md).

    Parameters
    ----------
    method : Forward
        Without custom factors.
    """

    def __init__(self, method: Forward) -> None:
        if method.factors:
            raise BadInputError("stream factors: of one's own go into Stream, keyframe by keyframe")
        self._method = method
        self._pieces: list[Flight] = []  # all of them, where noise is to be identified
        self._spans: list[_Span] = []  # that keyframes to come may be in
        self._plain: PreparedFlight | None = None  # as stated, up to where the heading is known
        self._window: FixedLag | None = None
        self._of: tuple[float, int, bool] | None = None  # look, constants, open
        self._taken_s = -np.inf  # keyframe that entered it last
        self._newest: Solution
        self._last_s = -np.inf  # keyframe that was returned last
        self._looked_s = -np.inf  # when noise was identified last
        self._identified = Identification()  # by then

    @classmethod
    def replay(cls, flight: Flight, method: Forward | None = None) -> Iterator[Estimate]:
        """Yield what a stream would have returned epoch by epoch; see ``update``."""
        stream = cls(Forward() if method is None else method)
        for piece in pieces(flight):
            yield stream.update(piece)
        yield stream.finish()

    @property
    def kept(self) -> Flight | None:
        """Records that later keyframes need."""
        return self._spans[-1].record.flight if self._spans else None

    def update(self, piece: Flight) -> Estimate:
        """Take in what came since; return the keyframes up to the last epoch that were not yet.

        Parameters
        ----------
        piece : Flight
            The first brings what is known of the vehicle; of others records and orbits count.

        Raises
        ------
        BadInputError
            If a record does not go on where it ended, or the flight brings networks.
        NoSolutionError
            If the measurements so far leave a state open.
        """
        if piece.networks:
            raise BadInputError(f"flight {piece.name}: a stream of observations takes no networks")
        if not self._spans:
            self._spans.append(_Span(-np.inf, self._identified, GoingOn(piece)))
        else:
            grown = [concatenate_flights(span.record.flight, piece) for span in self._spans]
            for span, flight in zip(self._spans, grown, strict=True):
                span.record = span.record._replace(flight=flight)
        if self._method.noise == "estimated":
            self._pieces.append(piece)
        epochs = epochs_s(self._spans[-1].record.flight)
        return self._estimate(float(epochs[-1]) if len(epochs) else -np.inf)

    def finish(self) -> Estimate:
        """Return the keyframes after the last epoch: of inertial samples alone.

        Raises
        ------
        NoSolutionError
            If all that has come determines no state.
        """
        return self._estimate(np.inf)

    def _estimate(self, until_s: float) -> Estimate:
        parts, name = [], self._method.name
        for problem, group in groupby(self._due(until_s), key=lambda keyframe: keyframe.problem):
            block = list(group)
            known = joined_solution((keyframe.known for keyframe in block), len(block))
            rows = np.array([keyframe.row for keyframe in block])
            parts.append(stated_at(name, block[0].prepared, problem, known, rows))
        if not parts:
            return no_keyframes(name)
        count = sum(len(block.t_s) for block in parts)
        return concatenate_estimates(parts, count, count)

    def _due(self, until_s: float) -> list[_Keyframe]:
        """Return the keyframes up to a time that have not been returned."""
        due: list[_Keyframe] = []
        settings = self._method.preparation
        try:
            self._look(until_s)
            problems = [span.prepared(settings) for span in self._spans]
        except NoSolutionError:
            if self._window is not None or until_s == np.inf:
                raise
            return due  # next to nothing is there yet
        ends_s = [*(span.from_s for span in self._spans[1:]), np.inf]
        for span, prepared, end_s in zip(self._spans, problems, ends_s, strict=True):
            t_s = prepared.problem.t_s
            new = (t_s > self._last_s) & (t_s >= span.from_s) & (t_s < end_s) & (t_s <= until_s)
            for at_s in t_s[new].tolist():
                problem = self._begun(prepared, span.from_s, at_s)
                due.append(self._keyframe(prepared, problem, at_s))
                self._last_s = at_s
        while len(self._spans) > 1 and self._spans[1].from_s <= self._last_s:
            del self._spans[0]
        if len(self._spans) == 1 and not self._spans[0].identified.is_open:
            record = self._spans[0].record
            self._spans[0].record = going_on(record.flight, problems[-1]) or record
        return due

    def _look(self, until_s: float) -> None:
        """Identify noise at the times that have come."""
        if self._method.noise != "estimated":
            return
        imu = self._spans[-1].record.flight.imu
        until_s = min(until_s, -np.inf if imu is None else float(imu.t_s[-1]))
        for at_s in identification_times_s(self._stated(), until_s + _ROUNDING_S):
            if self._looked_s < at_s <= until_s:
                self._identify(at_s)

    def _identify(self, at_s: float) -> None:
        """Identify noise at a time, for keyframes from then on."""
        self._looked_s = at_s
        flight, settings = self._whole(), self._method.preparation
        build = partial(build_problem, last=LastObservations())
        identified = self._identified = identification(
            flight, settings, at_s, build, self._identified
        )
        is_first = len(self._spans) == 1 and self._spans[0].from_s == -np.inf
        if not (is_first and identified.is_nominal):
            self._spans.append(_Span(at_s, identified, GoingOn(flight)))

    def _stated(self) -> PreparedFlight:
        """Return the problem with noise as stated, up to where the heading is known."""
        plain = self._plain
        if plain is None or (plain.opening is not None and plain.opening.until_s == np.inf):
            plain = self._plain = build_problem(self._whole(), self._method.preparation)
        return plain

    def _whole(self) -> Flight:
        """Return all that has come."""
        flight = concatenate_flights(*self._pieces)
        self._pieces = [flight]
        return flight

    def _begun(self, prepared: PreparedFlight, look_s: float, at_s: float) -> Problem:
        """Advance the window to a time, and return the problem that it solves.

        The window begins again where its problem is another one.
        """
        opening = prepared.opening
        is_open = opening is not None and at_s < opening.until_s
        problem = opening.problem if opening is not None and is_open else prepared.problem
        of = look_s, problem.constants.width  # of a sensor that begins, or comes back
        is_another = self._of is None or self._of[:2] != of
        if is_another and opening is not None and not is_open:
            self._window = None
            self._advance(prepared, opening.problem, opening.keyframes)
        if self._of != (*of, is_open):
            self._window, self._of = None, (*of, is_open)
        self._advance(prepared, problem, int(np.searchsorted(problem.t_s, at_s)))
        return problem

    def _keyframe(self, prepared: PreparedFlight, problem: Problem, at_s: float) -> _Keyframe:
        """Let a keyframe enter the window."""
        row = int(np.searchsorted(problem.t_s, at_s))
        self._advance(prepared, problem, row + 1)
        return _Keyframe(prepared, problem, row, self._newest)

    def _advance(self, prepared: PreparedFlight, problem: Problem, end: int) -> None:
        """Let keyframes before a row enter the window."""
        if self._window is None:
            self._window, self._taken_s = FixedLag(self._method.lag_s, 0.0), -np.inf
        opening, window = prepared.opening, self._window
        first = int(np.searchsorted(problem.t_s, self._taken_s, side="right"))
        for row in range(first, end):
            window.advance(problem, row)
            newest = window.latest()  # of each: what is asked for decides what leaves
            if opening is not None and problem is opening.problem:
                newest = with_open_heading(newest, opening)
            self._newest, self._taken_s = newest, float(problem.t_s[row])
