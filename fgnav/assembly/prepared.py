"""A flight as a smoothing problem, with what is reported of it and needed to go on."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from fgnav.alignment.in_motion.windows import EarlierMotion
from fgnav.assembly.position.numbered_arcs import EarlierArcs, Observed
from fgnav.assembly.sensors.standstill import Standing
from fgnav.assembly.settings import ProblemSettings
from fgnav.checks import FloatArray, Unused
from fgnav.graph.delayed import TimedMotion
from fgnav.graph.types.problem import Opening, Problem
from fgnav.types.estimate import Rejected
from fgnav.types.flight import Flight, Imu
from fgnav.types.integers import ArcInteger, Integers


class Earlier(NamedTuple):
    """Summary of earlier keyframes for the problem of a flight that continues.

    Of a flight with a gyroscope and one antenna, or fixes, whose heading is known.
    """

    motion: EarlierMotion
    arcs: EarlierArcs | None


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PreparedFlight:
    """A smoothing problem, and what is reported of it."""

    problem: Problem
    imu: Imu
    epochs: int  # GNSS epochs of the flight, and times between them that are far apart
    integers: Integers | None
    unused: tuple[Unused, ...]
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]
    observed: tuple[Observed, ...]  # phases and codes of antennas, by keyframe
    timed: TimedMotion  # how keyframes move, by which clocks and delays show
    rough: bool = False  # whether the attitudes that the search starts from assume something
    causal: bool = False  # whether each keyframe is to be known by what came before it alone
    opening: Opening | None = None  # what a filter is given in its place until the heading is known
    # What was identified of noise and set-up, over the largest plausible value.
    implausible: Mapping[str, float] = field(default_factory=dict)
    # Covariance that other rate priors, nearly as likely, add to the attitudes of ``problem``.
    attitude_inflation_rad2: FloatArray | None = None  # (n, 3, 3)
    standing: Standing | None = None
    goes_on: Earlier | None = None  # what keyframes to come need of these
    arcs: tuple[ArcInteger, ...] = ()  # against a base

    def changed(self, by: Callable[[Problem], Problem]) -> "PreparedFlight":
        """Apply a change to the problem, and to that of the opening."""
        opening = self.opening
        if opening is not None:
            aligned = None if opening.aligned is None else by(opening.aligned)
            opening = replace(opening, problem=by(opening.problem), aligned=aligned)
        return replace(self, problem=by(self.problem), opening=opening)


Build = Callable[[Flight, ProblemSettings], PreparedFlight]
