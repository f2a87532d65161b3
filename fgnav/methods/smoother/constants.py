"""What stays as it is for a whole flight and can be estimated with it: levers, angles, offsets.

All keyframes lean on these few dimensions: they are the border of the chain. Each is how far
something is from what the flight states, the landmark excepted, which is a place. Off unless asked
for, but for the landmark, the barometer's offset and hard iron, which always have their doubt.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray, NoSolutionError
from fgnav.flight import Flight

# Where the kinds stand in the columns that the kernels read; antennas follow, one place for each
# but the reference.
LANDMARK, BORESIGHT, GRAVITY, LEVER, HEIGHT, IRON, FLOAT, PIECE, ANTENNAS = range(9)
LINEAR = (HEIGHT, FLOAT, PIECE)  # however much they are off, derivatives stay
SURVEYED_M = 0.01  # 1-sigma of a landmark that is not asked for: a surveyed beacon
_SPACE_N = ("north", "east", "down")
_SPACE_B = ("x_b", "y_b", "z_b")


@dataclass(frozen=True, slots=True)
class _Kind:
    """What may be asked for: axes, unit of the stated sigma, its default, of what in a flight."""

    place: int
    axes: tuple[str, ...]
    degrees: bool
    sigma: float


_KINDS = {
    "landmark": _Kind(LANDMARK, _SPACE_N, False, 10.0),
    "boresight": _Kind(BORESIGHT, ("about y_b", "about z_b"), True, 2.0),
    "gravity": _Kind(GRAVITY, ("about x_b", "about y_b"), True, 2.0),
    "lever-arm": _Kind(LEVER, _SPACE_B, False, 0.3),
    "antenna": _Kind(ANTENNAS, _SPACE_B, False, 0.05),
}
NAMES = (*(name for name in _KINDS if name != "antenna"), "antennas", "antenna:NAME")


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class FlightConstant:
    """A few dimensions that hold for the whole flight.

    Attributes
    ----------
    name : str
        ``"boresight"``, ``"antenna a4"``.
    place : int
        Its place in the columns that the kernels read.
    axes : tuple of str, length d
    unit : {"m", "rad", "uT"}
    start : ndarray, shape (d,)
        Where the search starts, as seen from what the flight states.
    covariance : ndarray, shape (d, d)
        Of what is known of it before the flight, about zero.
    """

    name: str
    place: int
    axes: tuple[str, ...]
    unit: str
    start: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """One word of ``estimate``: a kind, for antennas a name or all, and a sigma, m or rad."""

    kind: str
    antenna: str | None
    sigma: float


def asked(estimate: Iterable[str]) -> tuple[Asked, ...]:
    """Return what the words of ``estimate`` ask for.

    Parameters
    ----------
    estimate : iterable of str
        ``"landmark"`` (10 m), ``"boresight"`` (2 degrees about y_b and z_b), ``"gravity"`` (2
        degrees about x_b and y_b, of a gravity estimator), ``"lever-arm"`` (0.3 m, from the
        accelerometer to the antennas), ``"antennas"`` (0.05 m, each but the reference), or
        ``"antenna:a4"``. ``"landmark=30"`` states another 1-sigma, in metres or degrees.

    Raises
    ------
    BadInputError
        Naming the word and what is known.
    """
    found = []
    for word in estimate:
        name, said, sigma = word.partition("=")
        kind, of_one, antenna = name.partition(":")
        kind = "antenna" if kind == "antennas" and not of_one else kind
        known = _KINDS.get(kind)
        if known is None or bool(of_one) != bool(antenna) or (antenna and kind != "antenna"):
            raise BadInputError(f"estimate: {word!r} is none of {', '.join(NAMES)}")
        if kind == name == "antenna":
            raise BadInputError("estimate: 'antenna' must name one, antenna:a4, or be antennas")
        value = _sigma(word, sigma) if said else known.sigma
        found.append(
            Asked(
                kind=kind,
                antenna=antenna or None,
                sigma=float(np.radians(value)) if known.degrees else value,
            )
        )
    said_of = [(one.kind, one.antenna) for one in found]
    for word, of in zip(estimate, said_of, strict=True):
        if said_of.count(of) > 1 or (of[1] and ("antenna", None) in said_of):
            raise BadInputError(f"estimate: {word!r} is asked for twice")
    return tuple(found)


def _sigma(word: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0 < value < np.inf:
        raise BadInputError(f"estimate: {word!r}: after = comes a positive 1-sigma, got {text!r}")
    return value


def constants_of(
    words: tuple[Asked, ...], flight: Flight, *, gravity: bool
) -> tuple[FlightConstant, ...]:
    """Return the constants that are asked for, in the order of their places.

    Parameters
    ----------
    words : tuple of Asked
    flight : Flight
    gravity : bool
        Whether something tells the direction of gravity.

    Raises
    ------
    BadInputError
        If the flight has nothing that the constant belongs to.
    """
    lacking = {
        "landmark": flight.seeker is None and "the flight has no [seeker]",
        "boresight": flight.seeker is None and "the flight has no [seeker]",
        "gravity": not gravity and "nothing tells the direction of gravity; see --gravity",
        "lever-arm": flight.imu is None and "the flight has no [imu]",
    }
    found = []
    for word in words:
        if lacking.get(word.kind):
            raise BadInputError(f"estimate {word.kind}: {lacking[word.kind]}")
        if word.kind != "antenna":
            found.append(of_vehicle(word))
            continue
        for i in _antennas(word, flight):
            name = f"antenna {flight.antennas[i].name}"
            found.append(constant(name, ANTENNAS + i - 1, _SPACE_B, "m", word.sigma))
    return tuple(sorted(found, key=lambda one: one.place))


def of_vehicle(word: Asked) -> FlightConstant:
    """Return the constant that a word asks for, of all but antennas."""
    kind = _KINDS[word.kind]
    return constant(word.kind, kind.place, kind.axes, "rad" if kind.degrees else "m", word.sigma)


def with_evidence(
    constants: tuple[FlightConstant, ...], *, sight: bool
) -> tuple[FlightConstant, ...]:
    """Return constants that something measured.

    Raises
    ------
    NoSolutionError
        Naming one of which nothing tells.
    """
    for one in constants:
        if one.place in (LANDMARK, BORESIGHT) and not sight:
            raise NoSolutionError(f"{one.name}: the detector never sees the landmark")
    return constants


def constant(
    name: str, place: int, axes: tuple[str, ...], unit: str, sigma: float
) -> FlightConstant:
    """Return a constant that is known to one sigma in all its axes, starting at zero."""
    return FlightConstant(
        name=name,
        place=place,
        axes=axes,
        unit=unit,
        start=np.zeros(len(axes)),
        covariance=sigma**2 * np.eye(len(axes)),
    )


def _antennas(word: Asked, flight: Flight) -> tuple[int, ...]:
    """Return which antennas a word means; the reference is where its own lever arm says."""
    count = len(flight.antennas)
    if count < 2 or flight.observations is None:
        raise BadInputError("estimate antennas: the flight has no array of antennas")
    if word.antenna is None:
        return tuple(range(1, count))
    names = [antenna.name for antenna in flight.antennas]
    if word.antenna not in names:
        raise BadInputError(f"estimate antenna:{word.antenna}: not one of {', '.join(names)}")
    if word.antenna == names[0]:
        raise BadInputError(
            f"estimate antenna:{word.antenna}: is the reference of the array; ask for lever-arm"
        )
    return (names.index(word.antenna),)


def width(constants: tuple[FlightConstant, ...]) -> int:
    """Return the dimensions of all constants together."""
    return sum(len(one.start) for one in constants)


def columns(constants: tuple[FlightConstant, ...], antennas: int) -> IntArray:
    """Return the first column of each kind within the border, (8 + antennas,); -1 of absent."""
    found = np.full(ANTENNAS + antennas, -1, dtype=np.int64)
    first = 0
    for one in constants:
        found[one.place] = first
        first += len(one.start)
    return found


def covariance(constants: tuple[FlightConstant, ...]) -> FloatArray:
    """Return the covariance of all before the flight, (b, b)."""
    P, first = np.zeros((width(constants), width(constants))), 0
    for one in constants:
        last = first + len(one.start)
        P[first:last, first:last] = one.covariance
        first = last
    return P
