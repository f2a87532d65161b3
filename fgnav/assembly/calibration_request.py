"""Parameters of a flight that are asked for: landmark, boresight, gravity's tilt, lever arm, array.

Each is how far something is from what the flight states, the landmark excepted, which is a place.
Off unless asked for, but for the landmark, which always has its survey's doubt.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from fgnav.alignment.rates import FORCE_SPAN_S
from fgnav.checks import BadInputError, FloatArray, NoSolutionError, quoted
from fgnav.graph.delayed import CLOCK_OFFSET, CLOCK_RATE, VELOCITY_DELAY
from fgnav.graph.inertial.gyro_free import MEAN_RATE
from fgnav.graph.types.parameters import Parameter, flight_constant
from fgnav.types.flight import Flight

# 1-sigma of the constant part of a rate, rad/s: two and a half turns a second, as rockets spin
# (docs/theory/gyro_free_motion.md).
_MEAN_RATE_RADPS = 15.0
SURVEYED_M = 0.01  # 1-sigma of a landmark that is not asked for: a surveyed beacon
_SPACE_N = ("north", "east", "down")
_SPACE_B = ("x_b", "y_b", "z_b")


@dataclass(frozen=True, slots=True)
class _Kind:
    """Kind of a calibration parameter: axes, unit of its sigma, default."""

    axes: tuple[str, ...]
    degrees: bool
    sigma: float


_KINDS = {
    "landmark": _Kind(_SPACE_N, False, 10.0),
    "boresight": _Kind(("about y_b", "about z_b"), True, 2.0),
    "gravity": _Kind(("about x_b", "about y_b"), True, 2.0),
    "lever-arm": _Kind(_SPACE_B, False, 0.3),
    "antenna": _Kind(_SPACE_B, False, 0.05),
    # Tags by a computer's clock, or its arrival: tenths of a second. Below, its rate.
    "clock": _Kind(("offset",), False, 0.3),
    # A velocity that is the mean since the fix before is half an interval old, of 1 Hz 0.5 s.
    "velocity-delay": _Kind(("delay",), False, 0.3),
}
# 1-sigma of a clock's rate: quartz is good to 1e-4, the ceramic resonators of small units to
# 0.5 % (data sheets of Murata CSTNE).
_CLOCK_RATE_PPM = 1000.0
_OF_TIME = ("clock", "velocity-delay")
NAMES = (*(name for name in _KINDS if name != "antenna"), "antennas", "antenna:NAME")


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationRequest:
    """One word of ``estimate``: a kind, for antennas a name or all, and a sigma, m, rad or s.

    Of a clock ``moved`` is by how much timestamps have been corrected, s and parts per million;
    of a delay ``start`` is where its search starts, s.
    """

    kind: str
    antenna: str | None
    sigma: float
    moved: tuple[float, float] = (0.0, 0.0)
    start: float = 0.0


def calibration_requests(estimate: Iterable[str]) -> tuple[CalibrationRequest, ...]:
    """Parse the words of ``calibrate``.

    Parameters
    ----------
    estimate : iterable of str
        ``"landmark"`` (10 m), ``"boresight"`` (2 degrees about y_b and z_b), ``"gravity"`` (2
        degrees about x_b and y_b, of a gravity estimator), ``"lever-arm"`` (0.3 m, from the
        accelerometer to the antennas), ``"antennas"`` (0.05 m, each but the reference), or
        ``"antenna:a4"``; ``"clock"`` (0.3 s and 1,000 ppm: what is to be added to the tags of the
        inertial unit, in the middle of the flight, and how that grows) and ``"velocity-delay"``
        (0.3 s, of fixes). ``"landmark=30"`` states another 1-sigma, in metres,
        degrees or seconds.

    Raises
    ------
    BadInputError
        Naming the word and what is known.
    """
    requests = []
    for word in estimate:
        name, equals, sigma = word.partition("=")
        kind, of_one, antenna = name.partition(":")
        kind = "antenna" if kind == "antennas" and not of_one else kind
        of_kind = _KINDS.get(kind)
        if of_kind is None or bool(of_one) != bool(antenna) or (antenna and kind != "antenna"):
            raise BadInputError(f"calibrate: {quoted(word)} is none of {', '.join(NAMES)}")
        if kind == name == "antenna":
            raise BadInputError("calibrate: 'antenna' must name one, antenna:a4, or be antennas")
        value = _sigma(name, sigma) if equals else of_kind.sigma
        requests.append(
            CalibrationRequest(
                kind=kind,
                antenna=antenna or None,
                sigma=float(np.radians(value)) if of_kind.degrees else value,
            )
        )
    named = [(request.kind, request.antenna) for request in requests]
    for word, of in zip(estimate, named, strict=True):
        if named.count(of) > 1 or (of[1] and ("antenna", None) in named):
            raise BadInputError(f"calibrate: {quoted(word)} is asked for twice")
    return tuple(requests)


def _sigma(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < np.inf:
        raise BadInputError(
            f"calibrate: {quoted(name)}: after = comes a positive 1-sigma, got {quoted(text)}"
        )
    return value


def constants_of(
    words: tuple[CalibrationRequest, ...], flight: Flight, *, gravity: bool
) -> tuple[Parameter, ...]:
    """Return the constants that are asked for.

    Parameters
    ----------
    words : tuple of CalibrationRequest
    flight : Flight
    gravity : bool
        Whether directions of gravity are measured.

    Raises
    ------
    BadInputError
        If the flight has nothing that the constant belongs to.
    """
    lacking = {
        "landmark": flight.photodetector is None and "the flight has no [photodetector]",
        "boresight": flight.photodetector is None and "the flight has no [photodetector]",
        "gravity": not gravity and "no source of the direction of gravity; see --gravity",
        "lever-arm": flight.imu is None and "the flight has no [imu]",
        "clock": flight.imu is None and "the flight has no [imu]",
        "velocity-delay": all(fixes.v_n_mps is None for fixes in flight.fixes)
        and "the flight has no [fixes] with velocities",
    }
    constants: list[Parameter] = []
    for word in words:
        if lacking.get(word.kind):
            raise BadInputError(f"calibrate {word.kind}: {lacking[word.kind]}")
        if word.kind in _OF_TIME:
            constants += of_time(word)
            continue
        if word.kind != "antenna":
            constants.append(of_vehicle(word))
            continue
        for i in _antennas(word, flight):
            name = f"antenna {flight.antennas[i].name}"
            constants.append(flight_constant(name, _SPACE_B, "m", word.sigma))
    return tuple(constants)


def of_vehicle(word: CalibrationRequest) -> Parameter:
    """Return the constant that a word requests, of all but antennas."""
    kind = _KINDS[word.kind]
    return flight_constant(word.kind, kind.axes, "rad" if kind.degrees else "m", word.sigma)


def of_tags(words: tuple[CalibrationRequest, ...], flight: Flight) -> tuple[Parameter, ...]:
    """Return the offset of the unit's clock within its doubt, unless it is asked for or exact.

    Of flights with a gyroscope and fixes: it leads from one to the next better than they see, and
    half a sample of a turn is a thousandth of a radian. Phases of arcs depend on no clock: beside
    them tags are taken as exact.
    """
    imu = flight.imu
    is_requested = any(word.kind == "clock" for word in words)
    if imu is None or imu.w_b_radps is None or not imu.clock_offset_sigma_s or is_requested:
        return ()
    if flight.observations is not None:
        return ()
    return (
        flight_constant(CLOCK_OFFSET, ("offset",), "s", imu.clock_offset_sigma_s, reported=False),
    )


def late_s(words: tuple[CalibrationRequest, ...]) -> float:
    """Return the latency that back-propagation covers: that of the velocities."""
    return max((FORCE_SPAN_S, *(word.start for word in words if word.kind == "velocity-delay")))


def of_time(word: CalibrationRequest) -> tuple[Parameter, ...]:
    """Return the constants of a clock, or of values that are late."""
    if word.kind == "velocity-delay":
        delay = flight_constant(VELOCITY_DELAY, ("delay",), "s", word.sigma)
        return (replace(delay, start=np.array([word.start])),)
    offset = flight_constant(CLOCK_OFFSET, ("offset",), "s", word.sigma)
    # Of a clock that has proved off, as little is known as it is large.
    rate = flight_constant(CLOCK_RATE, ("rate",), "ppm", max(_CLOCK_RATE_PPM, abs(word.moved[1])))
    return tuple(
        replace(one, stated=np.array([-moved]))
        for one, moved in zip((offset, rate), word.moved, strict=True)
    )


def with_evidence(constants: tuple[Parameter, ...], *, sight: bool) -> tuple[Parameter, ...]:
    """Return constants that something measured.

    Raises
    ------
    NoSolutionError
        Naming one that is not observable.
    """
    for constant in constants:
        if constant.name in ("landmark", "boresight") and not sight:
            raise NoSolutionError(f"{constant.name}: the detector never sees the landmark")
    return constants


def with_landmark(
    constants: tuple[Parameter, ...], landmark_n_m: FloatArray
) -> tuple[Parameter, ...]:
    """Return constants with the landmark's place among them: surveyed, if it was not asked for."""
    if not any(constant.name == "landmark" for constant in constants):
        surveyed = flight_constant("landmark", _SPACE_N, "m", SURVEYED_M, reported=False)
        constants = (*constants, surveyed)
    return tuple(
        replace(constant, mean=landmark_n_m, start=landmark_n_m + constant.start)
        if constant.name == "landmark"
        else constant
        for constant in constants
    )


def mean_rate() -> Parameter:
    """Return the constant about which the rate of a body without a gyroscope wanders."""
    one = flight_constant(MEAN_RATE, _SPACE_B, "rad/s", _MEAN_RATE_RADPS, reported=False)
    return replace(one, linear=True)


def _antennas(word: CalibrationRequest, flight: Flight) -> tuple[int, ...]:
    """List the antennas that a word means; the reference has the lever arm."""
    count = len(flight.antennas)
    if count < 2 or flight.observations is None:
        raise BadInputError("calibrate antennas: the flight has no array of antennas")
    if word.antenna is None:
        return tuple(range(1, count))
    names = [antenna.name for antenna in flight.antennas]
    if word.antenna not in names:
        raise BadInputError(f"calibrate antenna:{word.antenna}: not one of {', '.join(names)}")
    if word.antenna == names[0]:
        raise BadInputError(
            f"calibrate antenna:{word.antenna}: is the reference of the array; ask for lever-arm"
        )
    return (names.index(word.antenna),)
