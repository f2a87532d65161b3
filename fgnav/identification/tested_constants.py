"""Constants that are tested though nobody asked: clock, delay, lever arm, turn of the array.

They stand in the chain on which noise is identified; its solution is a Newton step of their
likelihood.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.graph.delayed import CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY, TimedMotion, on_clock
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.turned import ARRAY_TURN, MOUNTED_RAD, UNIT_TURN, in_turned_axes
from fgnav.graph.types.constants import Constants, FlightConstant
from fgnav.graph.types.measurement import Measurement
from fgnav.graph.types.problem import SmoothingProblem
from fgnav.identification.likelihood.clock_determinant import ClockDeterminant
from fgnav.identification.likelihood.linear_chain import Score
from fgnav.identification.likelihood.thinned import Some

SIGMAS = 4.0  # of a normal variable, two-sided: 6e-5
_ASKED_SIGMAS = 3.0  # 3e-3: so many right flights are asked in vain
_SQUARES, SQUARES_OF_TWO = 22.1, 19.3  # chi-square of three of them, of two, as rare
_TOGETHER = [0, 2]  # offset and delay
LEVER_ARM, TURNS = ("lever-arm",), (ARRAY_TURN, UNIT_TURN)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Times:
    """Clock of the inertial unit and delay of velocities: values, their sigmas; NaN of absent ones.

    Attributes
    ----------
    value, sigma : ndarray, shape (3,)
        Offset (s, in the middle of the record, to be added to the unit's tags), its growth (ppm),
        and how old velocities are (s).
    squares : float
        Chi-square of offset and delay together; 0 where one is absent. Where positions tell little,
        only the sum of both shows: neither is known by itself, though both cannot be zero.
    determinant : ClockDeterminant or None
        What that of the states says of the clock, where that matters.
    """

    value: FloatArray
    sigma: FloatArray
    squares: float = 0.0
    determinant: ClockDeterminant | None = None

    @property
    def significant(self) -> BoolArray:
        """Which of them are not zero, (3,)."""
        with np.errstate(invalid="ignore"):
            alone = np.asarray(np.abs(self.value) > SIGMAS * self.sigma)
        if self.are_one_or_the_other:
            alone[_TOGETHER] = True
        return alone

    @property
    def clock_sigmas(self) -> float:
        """By how many sigmas the clock's offset or rate is off, whichever is by more."""
        return float(np.fmax(*np.abs(self.value[:2] / self.sigma[:2])))

    @property
    def is_clock_in_doubt(self) -> bool:
        """Whether the flight is to be asked at other tags, though these may not exclude its own.

        A step takes the rates' variances at the first tags and falls short by about half.
        """
        return self.clock_sigmas > _ASKED_SIGMAS

    @property
    def are_one_or_the_other(self) -> bool:
        """Whether the clock or velocities are late, and nothing tells which."""
        either = np.abs(self.value[_TOGETHER]) > SIGMAS * self.sigma[_TOGETHER]
        return bool(self.squares > SQUARES_OF_TWO and not either.any())


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class TestedVector:
    """What is to be added to a vector that the flight states, and its covariance.

    Attributes
    ----------
    off : ndarray, shape (3,)
        Of the way from the unit to the antenna, m; the array's turn against the unit, rad.
    covariance : ndarray, shape (3, 3)
    stated : float
        1-sigma to which a flight may be taken to state it.
    """

    off: FloatArray
    covariance: FloatArray
    stated: float = 0.0

    @property
    def significant(self) -> bool:
        """Whether it is not zero."""
        covariance = self.covariance + self.stated**2 * np.eye(len(self.off))
        return bool(self.off @ np.linalg.solve(covariance, self.off) > _SQUARES)


def depending(
    small: SmoothingProblem, timed: TimedMotion, extra: tuple[FlightConstant, ...]
) -> SmoothingProblem:
    """Return a thinned problem whose measurements of GNSS depend on the constants tested."""
    if not extra:
        return small
    tested = {one.name for one in extra}  # the flight's own are in its measurements already
    late = {"velocity": VELOCITY_DELAY} if VELOCITY_DELAY in tested else {}
    is_clock = CLOCK_OFFSET in tested
    gnss = ("array phases", "array shape", "position", "velocity")
    arm = small.constants.column("lever-arm") if "lever-arm" in tested else -1
    turns = Constants(tuple(one for one in extra if one.name in TURNS))
    turned = tuple(_led(one, timed) if late else one for one in small.measurements)
    if turns.parts:  # else those of the flight's own constants depend on them already
        turned = tuple(in_turned_axes(one, small.constants) for one in turned)
    extended = tuple(
        on_clock(
            _with_arm(one, arm),
            timed,
            small.constants,
            delay=late.get(one.name, ""),
            clock=is_clock,
        )
        if one.name in gnss
        else one
        for one in turned
    )
    return replace(small, measurements=extended)


def _led(one: Measurement, timed: TimedMotion) -> Measurement:
    """Return velocities that can be carried back in time, by the forces before them."""
    if one.name != "velocity" or not isinstance(one, Some):
        return one
    led = timed.led[one.row]
    return replace(one, which=one.which[led], row=one.row[led])


def _with_arm(one: Measurement, column: int) -> Measurement:
    """Return a measurement that depends on the lever arm, if it is one that has any."""
    if column < 0 or not isinstance(one, Some):
        return one
    if not isinstance(one.measurement, Position | Velocity):
        return one
    return replace(one, measurement=replace(one.measurement, lever_column=column))


def vector_of(
    names: tuple[str, ...], constants: Constants, value: FloatArray, score: Score
) -> TestedVector | None:
    """Return a vector by its name, or one, its values (b,) among all; None of one not tested."""
    own = max((constants.columns(name) for name in names), key=lambda one: one.stop)
    if not own.stop:
        return None
    covariance = score.constant_covariance[own, own]
    stated = 0.0 if names == LEVER_ARM else MOUNTED_RAD
    return TestedVector(off=value[own], covariance=covariance, stated=stated)


def times_of(constants: Constants, value: FloatArray, score: Score) -> Times:
    """Return clock and delay, their values (b,) among all constants."""
    P = score.constant_covariance
    values, sigmas = np.full(3, np.nan), np.full(3, np.nan)
    for i, name in enumerate((CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY)):
        column = constants.column(name)
        if column >= 0:
            values[i], sigmas[i] = value[column], np.sqrt(P[column, column])
    both = [constants.column(name) for name in (CLOCK_OFFSET, VELOCITY_DELAY)]
    squares = 0.0
    if min(both) >= 0:
        squares = float(value[both] @ np.linalg.solve(P[np.ix_(both, both)], value[both]))
    return Times(value=values, sigma=sigmas, squares=squares)
