"""The forward filter fed with raw observations, epoch by epoch, as instruments hand them out."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fgnav.checks import BadInputError, NoSolutionError
from fgnav.frontend.problem import PreparedFlight, build_problem
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.methods.smoothing.estimates import stated_at
from fgnav.methods.smoothing.joined import joined_estimates
from fgnav.methods.streaming.recording import epochs_s, joined, pieces
from fgnav.solve.sliding.departed import joined_solution, with_open_heading
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight

if TYPE_CHECKING:
    from fgnav.identification.from_past import Look
    from fgnav.methods.smoother import Forward
    from fgnav.solve.fixed_lag import Departed, FixedLag

_ROUNDING_S = 1e-6


class _Keyframe(NamedTuple):
    """A keyframe as it was known when it came."""

    prepared: PreparedFlight
    problem: SmoothingProblem
    row: int
    known: "Departed"


class ObservationStream:
    """What ``Forward`` makes of a flight while it is flown.

    Each update brings what instruments measured since the one before, as a flight of its own: raw
    observations of one epoch or more, or fixes, and inertial samples up to the last of them. It
    returns the keyframes that are due by then, each as known from the data up to it.

    Parameters
    ----------
    method : Forward
        With GTSAM, and without factors of one's own.
    """

    def __init__(self, method: "Forward") -> None:
        if method.solver != "gtsam":
            raise BadInputError(f"stream solver: must be gtsam, got {method.solver!r}")
        if method.factors:
            raise BadInputError("stream factors: of one's own go into Stream, keyframe by keyframe")
        self._method = method
        self._record: Flight | None = None
        self._looks: list[tuple[float, Look]] = []
        self._window: FixedLag | None = None
        self._of: tuple[float, bool] | None = None  # what the window is of: look, open heading
        self._taken = 0  # keyframes that have entered it
        self._newest: Departed
        self._last_s = -np.inf  # keyframe that was returned last

    @classmethod
    def replay(cls, flight: Flight, method: "Forward | None" = None) -> Iterator[Estimate]:
        """Yield what a stream would have returned epoch by epoch; see ``update``."""
        from fgnav.methods.smoother import Forward  # noqa: PLC0415  # it imports this module

        stream = cls(Forward() if method is None else method)
        for piece in pieces(flight):
            yield stream.update(piece)
        yield stream.finish()

    def update(self, piece: Flight) -> Estimate:
        """Take in what came since; return the keyframes up to the last epoch that were not yet.

        Parameters
        ----------
        piece : Flight
            The first brings what is known of the vehicle; of others the records count.

        Raises
        ------
        BadInputError
            If a record does not go on where it ended, or the flight brings networks.
        NoSolutionError
            If the measurements so far leave a state open.
        """
        if piece.networks:
            raise BadInputError(f"flight {piece.name}: a stream of observations takes no networks")
        self._record = piece if self._record is None else joined(self._record, piece)
        epochs = epochs_s(self._record)
        return self._estimate(float(epochs[-1]) if len(epochs) else -np.inf)

    def finish(self) -> Estimate:
        """Return the keyframes after the last epoch: of inertial samples alone."""
        return self._estimate(np.inf)

    def _estimate(self, until_s: float) -> Estimate:
        parts, name = [], self._method.name
        for problem, group in groupby(self._due(until_s), key=lambda one: one.problem):
            part = list(group)
            solution = replace(joined_solution([one.known for one in part]), cross=None)
            rows = np.array([one.row for one in part])
            parts.append(stated_at(name, part[0].prepared, problem, solution, rows))
        if not parts:
            return Estimate(method=name, t_s=np.empty(0), epochs=0, R_nb=np.empty((0, 3, 3)))
        count = sum(len(part.t_s) for part in parts)
        return joined_estimates(parts, count, count)

    def _due(self, until_s: float) -> list[_Keyframe]:
        """Return the keyframes up to a time that have not been returned."""
        if self._record is None:
            return []
        settings = self._method.preparation
        try:
            plain = build_problem(self._record, settings)
        except NoSolutionError:  # next to nothing is there yet
            return []
        self._look(plain, min(until_s, float(plain.problem.t_s[-1])))
        due = []
        from_s = [-np.inf, *(s for s, _ in self._looks), np.inf]
        for k, (begin_s, end_s) in enumerate(pairwise(from_s)):
            if end_s <= self._last_s:
                continue
            prepared = plain
            if k:
                told = self._looks[k - 1][1]
                prepared = told.prepared(self._record, settings, build_problem)
            t_s = prepared.problem.t_s
            new = (t_s > self._last_s) & (t_s >= begin_s) & (t_s < end_s) & (t_s <= until_s)
            due += [self._keyframe(prepared, begin_s, at_s) for at_s in t_s[new].tolist()]
        if due:
            self._last_s = float(due[-1].problem.t_s[due[-1].row])
        return due

    def _look(self, plain: PreparedFlight, until_s: float) -> None:
        """Identify noise at the times that have come."""
        if self._record is None or self._method.noise != "identified":
            return
        from fgnav.identification.from_past import Look, look, looks_s  # noqa: PLC0415  # lazy: the chain

        before_s = self._looks[-1][0] if self._looks else -np.inf
        for at_s in looks_s(plain, until_s + _ROUNDING_S):
            if before_s < at_s <= until_s:
                told = look(self._record, self._method.preparation, at_s, build_problem)
                if self._looks or told != Look(None):
                    self._looks.append((at_s, told))

    def _keyframe(self, prepared: PreparedFlight, look_s: float, at_s: float) -> _Keyframe:
        """Let a keyframe enter the window, which begins anew where its problem is another one."""
        from fgnav.solve.fixed_lag import FixedLag  # noqa: PLC0415  # lazy: gtsam

        opening = prepared.opening
        is_open = opening is not None and at_s < opening.until_s
        problem = opening.problem if opening is not None and is_open else prepared.windowed
        if self._window is None or self._of != (look_s, is_open):
            self._window, self._of, self._taken = (
                FixedLag(self._method.lag_s, 0.0),
                (look_s, is_open),
                0,
            )
        row = int(np.searchsorted(problem.t_s, at_s - _ROUNDING_S))
        for k in range(self._taken, row + 1):
            self._window.advance(problem, k)
            self._newest = self._window.newest()  # of each: what is asked for decides what leaves
        self._taken, known = row + 1, self._newest
        if opening is not None and is_open:
            known = with_open_heading(known, opening)
        return _Keyframe(prepared, problem, row, known)
