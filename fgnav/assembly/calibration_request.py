"""Parameters of a flight that are requested: landmark, boresight, gravity's tilt, lever arm, array.

Each is the error of a nominal value, the landmark excepted, which is a place. None is estimated
unless requested, but the landmark, which always has the uncertainty of its survey.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

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
SURVEYED_M = 0.01  # 1-sigma of a landmark that is not requested: a surveyed beacon
_SPACE_N = ("north", "east", "down")
_SPACE_B = ("x_b", "y_b", "z_b")


class _Kind(NamedTuple):
    """Kind of a calibration parameter: its name, axes and unit, and the default of its 1-sigma."""

    name: str
    axes: tuple[str, ...]
    unit: str
    sigma: float  # in degrees of angles


_KINDS = {
    "landmark": _Kind("landmark", _SPACE_N, "m", 10.0),
    "boresight": _Kind("boresight", ("about y_b", "about z_b"), "rad", 2.0),
    "gravity": _Kind("gravity", ("about x_b", "about y_b"), "rad", 2.0),
    "lever-arm": _Kind("lever-arm", _SPACE_B, "m", 0.3),
    "antenna": _Kind("antenna", _SPACE_B, "m", 0.05),
    # Timestamps by a computer's clock, or of arrival: tenths of a second.
    "clock": _Kind(CLOCK_OFFSET, ("offset",), "s", 0.3),
    # A velocity that is the mean since the fix before is half an interval old, of 1 Hz 0.5 s.
    "velocity-delay": _Kind(VELOCITY_DELAY, ("delay",), "s", 0.3),
}
# 1-sigma of a clock's rate: quartz is good to 1e-4, the ceramic resonators of small units to
# 0.5 % (data sheets of Murata CSTNE).
_CLOCK_RATE_PPM = 1000.0
NAMES = (*(name for name in _KINDS if name != "antenna"), "antennas", "antenna:NAME")


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationRequest:
    """One word of ``calibrate``: a kind, for antennas a name or all, and a sigma, m, rad or s.

    Of a clock ``moved`` is by how much timestamps have been corrected, s and parts per million;
    of a delay ``start`` is where its search starts, s.
    """

    kind: str
    antenna: str | None
    sigma: float
    moved: tuple[float, float] = (0.0, 0.0)
    start: float = 0.0

    def parameters(self, antennas: tuple[str, ...] = ()) -> tuple[Parameter, ...]:
        """Return the parameters: of antennas by their names one each, of a clock offset and rate.

        Parameters
        ----------
        antennas : tuple of str
            Those whose position is requested.
        """
        kind = _KINDS[self.kind]
        names = [f"antenna {name}" for name in antennas] or [kind.name]
        constants = tuple(flight_constant(name, kind.axes, kind.unit, self.sigma) for name in names)
        if self.kind == "velocity-delay":
            return (replace(constants[0], start=np.array([self.start])),)
        if self.kind != "clock":
            return constants
        # As little is known of the rate of a clock that has proved off as that is large.
        rate_ppm = max(_CLOCK_RATE_PPM, abs(self.moved[1]))
        both = (*constants, flight_constant(CLOCK_RATE, ("rate",), "ppm", rate_ppm))
        return tuple(
            replace(direction, stated=np.array([-moved]))
            for direction, moved in zip(both, self.moved, strict=True)
        )


def calibration_requests(estimate: Iterable[str]) -> tuple[CalibrationRequest, ...]:
    """Parse the words of ``calibrate``.

    Parameters
    ----------
    estimate : iterable of str
        ``"landmark"`` (10 m), ``"boresight"`` (2 degrees about y_b and z_b), ``"gravity"`` (2
        degrees about x_b and y_b, of a gravity estimator), ``"lever-arm"`` (0.3 m, from the
        accelerometer to the antennas), ``"antennas"`` (0.05 m, each but the reference), or
        ``"antenna:a4"``; ``"clock"`` (0.3 s and 1,000 ppm: what is to be added to timestamps of the
        inertial unit, in the middle of the flight, and how that grows) and ``"velocity-delay"``
        (0.3 s, of fixes). ``"landmark=30"`` states another 1-sigma, in metres,
        degrees or seconds.

    Raises
    ------
    BadInputError
        Naming the word and what is known.
    """
    requests: list[CalibrationRequest] = []
    for word in estimate:
        name, equals, sigma = word.partition("=")
        kind, of_one, antenna = name.partition(":")
        kind = "antenna" if kind == "antennas" and not of_one else kind
        entry = _KINDS.get(kind)
        if entry is None or bool(of_one) != bool(antenna) or (antenna and kind != "antenna"):
            raise BadInputError(f"calibrate: {quoted(word)} is none of {', '.join(NAMES)}")
        if kind == name == "antenna":
            raise BadInputError("calibrate: 'antenna' must name one, antenna:a4, or be antennas")
        value = _sigma(name, sigma) if equals else entry.sigma
        value = float(np.radians(value)) if entry.unit == "rad" else value
        requests.append(CalibrationRequest(kind=kind, antenna=antenna or None, sigma=value))
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
    requests: tuple[CalibrationRequest, ...], flight: Flight, *, gravity: bool
) -> tuple[Parameter, ...]:
    """Return the constants that are requested.

    Parameters
    ----------
    requests : tuple of CalibrationRequest
    flight : Flight
    gravity : bool
        Whether directions of gravity are measured.

    Raises
    ------
    BadInputError
        If the flight has nothing that the constant belongs to.
    """
    has_velocities = any(fixes.v_n_mps is not None for fixes in flight.fixes)
    photodetector = (flight.photodetector is not None, "the flight has no [photodetector]")
    imu = (flight.imu is not None, "the flight has no [imu]")
    needed = {
        "landmark": photodetector,
        "boresight": photodetector,
        "gravity": (gravity, "no source of the direction of gravity; see --gravity"),
        "lever-arm": imu,
        "clock": imu,
        "velocity-delay": (has_velocities, "the flight has no [fixes] with velocities"),
    }
    constants: list[Parameter] = []
    for request in requests:
        is_there, lack = needed.get(request.kind, (True, ""))
        if not is_there:
            raise BadInputError(f"calibrate {request.kind}: {lack}")
        antennas = _antennas(request, flight) if request.kind == "antenna" else ()
        constants += request.parameters(antennas)
    return tuple(constants)


def timestamp_offset(
    requests: tuple[CalibrationRequest, ...], flight: Flight
) -> tuple[Parameter, ...]:
    """Return the offset of the unit's clock, unless it is requested or exact.

    Of flights with a gyroscope and fixes: it leads from one to the next better than they see, and
    half a sample of a turn is a thousandth of a radian. Phases of arcs depend on no clock: beside
    them timestamps are taken as exact.
    """
    imu = flight.imu
    is_requested = any(request.kind == "clock" for request in requests)
    if imu is None or imu.w_b_radps is None or is_requested or flight.observations is not None:
        return ()
    sigma_s = imu.clock_offset_sigma_s
    offset = flight_constant(CLOCK_OFFSET, ("offset",), "s", sigma_s, reported=False)
    return (offset,) if sigma_s else ()


def propagation_span_s(requests: tuple[CalibrationRequest, ...]) -> float:
    """Return the time over which states are propagated back to delayed velocities."""
    return max(
        (FORCE_SPAN_S, *(request.start for request in requests if request.kind == "velocity-delay"))
    )


def with_landmark(
    constants: tuple[Parameter, ...], landmark_n_m: FloatArray | None
) -> tuple[Parameter, ...]:
    """Return constants with the place of a landmark: surveyed, unless requested; None: not seen.

    Raises
    ------
    NoSolutionError
        Naming a constant that no line of sight determines.
    """
    names = [constant.name for constant in constants]
    if landmark_n_m is None:
        for name in {"landmark", "boresight"}.intersection(names):
            raise NoSolutionError(f"{name}: the detector never sees the landmark")
        return constants
    if "landmark" not in names:
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
    rate = flight_constant(MEAN_RATE, _SPACE_B, "rad/s", _MEAN_RATE_RADPS, reported=False)
    return replace(rate, linear=True)


def _antennas(request: CalibrationRequest, flight: Flight) -> tuple[str, ...]:
    """List the antennas of a request; the reference has the lever arm."""
    names, name = tuple(antenna.name for antenna in flight.antennas), request.antenna
    if len(names) < 2 or flight.observations is None:
        raise BadInputError("calibrate antennas: the flight has no array of antennas")
    if name is None:
        return names[1:]
    if name not in names:
        raise BadInputError(f"calibrate antenna:{name}: not one of {', '.join(names)}")
    if name == names[0]:
        raise BadInputError(
            f"calibrate antenna:{name}: is the reference of the array; ask for lever-arm"
        )
    return (name,)
