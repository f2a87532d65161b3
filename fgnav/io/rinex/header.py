"""The head of a RINEX file: what kind it is, and which observation types its lines hold."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from fgnav.checks import BadInputError, quoted
from fgnav.io.gps_time import GPS_EPOCH
from fgnav.io.rinex.text import Bytes
from fgnav.io.tables import is_number

MAX_TYPES = 99  # more than any receiver tracks
_TYPE_2 = re.compile(r"[CLPDS][1-9A-Z]")
_TYPE_3 = re.compile(r"[CLDSIX][0-9][A-Z0-9]?")
_VERSIONS = {2: (2.00, 2.11), 3: (3.00, 3.05), 4: (4.00, 4.02)}
_SYSTEMS = "GRECJSI"

Kind = Literal["observations", "navigation"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """What the head of a RINEX file says."""

    path: Path
    version: float
    system: str  # letter of the constellation, ``M`` for mixed
    # observation types by letter of the constellation; all letters share one tuple in RINEX 2
    types: dict[str, tuple[str, ...]]
    time_system: str  # ``GPS``, ``GLO``, ``GAL``, ``QZS``, ``BDT``; of observations
    # announced last epoch, microseconds since 1980-01-06 in the file's time system
    last_us: int | None
    interval_s: float | None  # announced time between epochs
    klobuchar: tuple[float, ...]  # GPS ionosphere, alpha and beta; zeros where absent
    # size, lines: bytes and lines of the head, its last line included
    size: int
    lines: int
    # divisor of values by constellation and type, 1 where absent
    scales: dict[tuple[str, str], int] = field(default_factory=dict)


def read_header(path: Path, text: Bytes, kind: Kind) -> Header:
    """Read and check the head of a RINEX file.

    Parameters
    ----------
    path : Path
        Name for the error texts.
    text : ndarray of uint8
        The whole file.
    kind : {"observations", "navigation"}
        What the caller expects.

    Raises
    ------
    BadInputError
        Naming file, line, rule and value.
    """
    lines, size = _lines(path, text)
    version, system = _version(path, lines[0], kind)
    labelled = [(number, line[:60], line[60:].strip()) for number, line in enumerate(lines, 1)]
    types: dict[str, tuple[str, ...]] = {}
    scales: dict[tuple[str, str], int] = {}
    time_system = {"R": "GLO", "E": "GAL", "C": "BDT", "J": "QZS"}.get(system, "GPS")
    if kind == "observations":
        if version < 3:
            types = dict.fromkeys(_SYSTEMS, _types_2(path, labelled))
        else:
            types = _types_3(path, labelled, version)
        first = [line for _, line, label in labelled if label == "TIME OF FIRST OBS"]
        if not first:
            raise BadInputError(f"{path}: header must have TIME OF FIRST OBS, it is missing")
        time_system = first[0][48:51].strip() or time_system
        if time_system not in ("GPS", "GLO", "GAL", "QZS", "BDT"):
            raise BadInputError(
                f"{path}: time system must be GPS, GLO, GAL, QZS or BDT, got {quoted(time_system)}"
            )
        scales = _scales(path, labelled, types)
    return Header(
        path=path,
        version=version,
        system=system,
        types=types,
        time_system=time_system,
        last_us=_last_us(path, labelled),
        interval_s=_interval_s(labelled),
        klobuchar=_klobuchar(path, labelled),
        size=size,
        lines=len(lines),
        scales=scales,
    )


def _lines(path: Path, text: Bytes) -> tuple[list[str], int]:
    """Return the lines of the head and the offset of the body."""
    lines: list[str] = []
    offset = 0
    head = text[: 1 << 20].tobytes().decode("latin-1")  # a head of a megabyte is no head
    while offset < len(head):
        end = head.find("\n", offset)
        if end < 0:
            break
        lines.append(head[offset:end].rstrip("\r"))
        offset = end + 1
        if len(lines) == 1 and "RINEX VERSION / TYPE" not in lines[0][60:]:
            break
        if lines[-1][60:].startswith("END OF HEADER"):
            return lines, offset
    if not lines or "RINEX VERSION / TYPE" not in lines[0][60:]:
        got = head[:60].split("\n")[0]
        raise BadInputError(f"{path}: line 1: must be RINEX VERSION / TYPE, got {quoted(got)}")
    raise BadInputError(
        f"{path}: line {len(lines)}: header must end with END OF HEADER, it does not"
    )


def _version(path: Path, line: str, kind: Kind) -> tuple[float, str]:
    """Return the version and the constellation's letter, of a file of the expected kind."""
    try:
        version = float(line[:9])
    except ValueError as error:
        raise BadInputError(
            f"{path}: line 1: RINEX version must be a number, got {quoted(line[:9])}"
        ) from error
    low, high = _VERSIONS.get(int(version) if np.isfinite(version) else 0, (1.0, 0.0))
    if not low <= round(version, 3) <= high:
        raise BadInputError(
            f"{path}: line 1: RINEX version must be 2.00-2.11, 3.00-3.05 or 4.00-4.02, "
            f"got {version:g}"
        )
    letter = line[20:21]
    is_observation = letter == "O"
    if is_observation != (kind == "observations") or letter not in "ONGHJLE":
        raise BadInputError(
            f"{path}: line 1: must be a RINEX {kind} file, got {quoted(line[20:40].strip())}"
        )
    system = line[40:41].strip() or ("G" if version < 3 else "M")
    if not is_observation and version < 3 and letter != "N":
        system = {"G": "R", "H": "S", "J": "J", "L": "E", "E": "E"}[letter]
    if system not in _SYSTEMS + "M":
        raise BadInputError(
            f"{path}: line 1: constellation must be one of GRECJSIM, got {quoted(system)}"
        )
    return version, system


def _types_3(
    path: Path, labelled: list[tuple[int, str, str]], version: float
) -> dict[str, tuple[str, ...]]:
    """Return the observation types of a RINEX 3 or 4 head, BeiDou's B1I always named 2I."""
    found: dict[str, tuple[int, int, list[str]]] = {}
    letter = ""
    for number, line, label in labelled:
        if label != "SYS / # / OBS TYPES":
            continue
        if line[0] != " ":
            letter = line[0]
            if letter not in _SYSTEMS or letter in found:
                raise BadInputError(
                    f"{path}: line {number}: constellation must be new and one of {_SYSTEMS}, "
                    f"got {quoted(letter)}"
                )
            found[letter] = (number, _count(path, number, line[3:6]), [])
        elif not letter:
            raise BadInputError(f"{path}: line {number}: OBS TYPES must start with a constellation")
        found[letter][2].extend(line[6:58].split())
    if not found:
        raise BadInputError(f"{path}: header must have SYS / # / OBS TYPES, it is missing")
    types = {}
    for letter, (number, count, names) in found.items():
        _check_types(path, number, count, names, _TYPE_3)
        if letter == "C" and round(version, 2) == 3.02:
            names = [name[0] + name[1].replace("1", "2") + name[2:] for name in names]  # noqa: PLW2901
        types[letter] = tuple(names)
    return types


def _types_2(path: Path, labelled: list[tuple[int, str, str]]) -> tuple[str, ...]:
    """Return the observation types of a RINEX 2 head."""
    count, first, names = 0, 0, list[str]()
    for number, line, label in labelled:
        if label != "# / TYPES OF OBSERV":
            continue
        if line[:6].strip():
            count, first = _count(path, number, line[:6]), number
        names += line[6:].split()
    if not first:
        raise BadInputError(f"{path}: header must have # / TYPES OF OBSERV, it is missing")
    _check_types(path, first, count, names, _TYPE_2)
    return tuple(names)


def _count(path: Path, number: int, text: str) -> int:
    try:
        return int(text)
    except ValueError as error:
        raise BadInputError(
            f"{path}: line {number}: number of observation types must be whole, got {quoted(text)}"
        ) from error


def _check_types(
    path: Path, number: int, count: int, names: list[str], pattern: re.Pattern[str]
) -> None:
    """Check the number of observation types against the list, and each of them."""
    if count != len(names):
        raise BadInputError(
            f"{path}: line {number}: {count} observation types announced, {len(names)} listed"
        )
    if not 0 < count <= MAX_TYPES:
        raise BadInputError(
            f"{path}: line {number}: 1 to {MAX_TYPES} observation types, got {count}"
        )
    for name in names:
        if not pattern.fullmatch(name) or names.count(name) > 1:
            raise BadInputError(
                f"{path}: line {number}: observation type must be known and new, got {quoted(name)}"
            )


def _scales(
    path: Path, labelled: list[tuple[int, str, str]], types: dict[str, tuple[str, ...]]
) -> dict[tuple[str, str], int]:
    """Return the factors that values of types were multiplied by; refuse phases in half cycles."""
    scales = {}
    letter, factor = "", 1
    for number, line, label in labelled:
        if label == "WAVELENGTH FACT L1/2" and "2" in line[:12]:
            raise BadInputError(
                f"{path}: line {number}: {label} must be 1, got "
                f"{quoted(line.strip())}; convert the file"
            )
        if label != "SYS / SCALE FACTOR":
            continue
        if line[0] != " ":
            letter, text = line[0], line[2:6].strip()
            if text not in ("", "1", "10", "100", "1000"):
                raise BadInputError(
                    f"{path}: line {number}: {label} must be 1, 10, 100 or 1000, got "
                    f"{quoted(text)}; repair the line"
                )
            factor = int(text or "1")
        for name in line[10:58].split() or types.get(letter, ()):
            scales[letter, name] = factor
    return scales


def _last_us(path: Path, labelled: list[tuple[int, str, str]]) -> int | None:
    """Return the announced last epoch."""
    for number, line, label in labelled:
        if label != "TIME OF LAST OBS":
            continue
        try:
            year, month, day, hour, minute = (int(line[6 * k : 6 * k + 6]) for k in range(5))
            second = float(line[30:43])
            day_start = np.datetime64(f"{year:04d}-{month:02d}-{day:02d}", "us")
        except ValueError as error:
            raise BadInputError(
                f"{path}: line {number}: TIME OF LAST OBS must be a date, got {quoted(line[:43])}"
            ) from error
        since = int((day_start - GPS_EPOCH) / np.timedelta64(1, "us"))
        return since + round((hour * 3600 + minute * 60 + second) * 1e6)
    return None


def _interval_s(labelled: list[tuple[int, str, str]]) -> float | None:
    """Return the announced time between epochs; None where it is absent, zero or no number."""
    for _, line, label in labelled:
        if label == "INTERVAL":
            interval_s = float(line[:10]) if is_number(line[:10]) else 0.0
            return interval_s if 0 < interval_s < np.inf else None
    return None


def _klobuchar(path: Path, labelled: list[tuple[int, str, str]]) -> tuple[float, ...]:
    """Return the GPS ionosphere model of a navigation head."""
    model = [0.0] * 8
    for number, line, label in labelled:
        start, shift = -1, 2
        if label in ("ION ALPHA", "ION BETA"):
            start = 4 * (label == "ION BETA")
        elif label == "IONOSPHERIC CORR" and line[:4] in ("GPSA", "GPSB"):
            start, shift = 4 * (line[:4] == "GPSB"), 5
        if start >= 0:
            fields = [line[shift + 12 * k : shift + 12 * k + 12] for k in range(4)]
            try:
                model[start : start + 4] = [
                    float(f.replace("D", "E").replace("d", "e")) for f in fields
                ]
            except ValueError as error:
                raise BadInputError(
                    f"{path}: line {number}: {label} must hold four numbers, "
                    f"got {quoted(line.strip())}"
                ) from error
    return tuple(model)
