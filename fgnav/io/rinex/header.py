"""The head of a RINEX file: what kind it is, and which observation types its lines hold."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from fgnav.checks import BadInputError, quoted
from fgnav.io.gps_time import date_to_gps_s
from fgnav.io.rinex.constellations import CONSTELLATIONS
from fgnav.io.rinex.text import Bytes
from fgnav.io.tables import is_number

_MOST_TYPES = 99  # more than any receiver tracks
_TYPE = {2: re.compile(r"[CLPDS][1-9A-Z]"), 3: re.compile(r"[CLDSIX][0-9][A-Z0-9]?")}
_VERSIONS = {2: (2.00, 2.12), 3: (3.00, 3.05), 4: (4.00, 4.02)}
_SYSTEMS = "".join(CONSTELLATIONS)
_TIMES = {letter: constellation.time for letter, constellation in CONSTELLATIONS.items()}
_NAVIGATION_2 = {"G": "R", "H": "S", "J": "J", "L": "E", "E": "E"}  # constellations by file type
_MOST_BYTES = 1 << 20  # a head of a megabyte is no head

Kind = Literal["observations", "navigation"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Header:
    """The head of a RINEX file."""

    path: Path
    version: float
    system: str  # letter of the constellation, ``M`` for mixed
    # observation types by letter of the constellation; all letters share one tuple in RINEX 2
    types: dict[str, tuple[str, ...]]
    time_system: str  # ``GPS``, ``GLO``, ``GAL``, ``QZS``, ``BDT``; of observations
    klobuchar: tuple[float, ...]  # GPS ionosphere, alpha and beta; zeros where absent
    size: int  # bytes of the head, its last line included
    content: tuple[str, ...]  # its lines
    # divisor of values by constellation and type, 1 where absent
    scales: dict[tuple[str, str], int] = field(default_factory=dict)
    # satellites, "" for all, and carriers whose phases may be off by half a cycle
    half_cycles: frozenset[tuple[str, str]] = frozenset()

    @property
    def lines(self) -> int:
        """Return the number of its lines."""
        return len(self.content)

    def text_of(self, label: str) -> str:
        """Return the first 60 columns of the first line with a label; nothing without one."""
        return next((line[:60] for line in self.content if line[60:].strip() == label), "")

    @property
    def last_gps_s(self) -> float:
        """Return the announced last epoch, in the file's time system; NaN of none."""
        return date_to_gps_s(self.text_of("TIME OF LAST OBS")[:43].split())

    @property
    def interval_s(self) -> float:
        """Return the announced time between epochs; 0 where it is absent or none."""
        text = self.text_of("INTERVAL")[:10]
        interval_s = float(text) if is_number(text) else 0.0
        return interval_s if 0 < interval_s < np.inf else 0.0


class _Line(NamedTuple):
    path: Path
    number: int
    text: str  # the first 60 columns
    label: str
    whole: str

    def fault(self, rule: str, got: str) -> BadInputError:
        return BadInputError(f"{self.path}: line {self.number}: {rule}, got {quoted(got)}")


def read_header(path: Path, text: Bytes, kind: Kind) -> Header:
    """Read and check the head of a RINEX file of a kind; its whole text is given."""
    lines, size = _lines(path, text)
    version, system = _version(lines[0], kind)
    types: dict[str, tuple[str, ...]] = {}
    time_system = _TIMES.get(system, "GPS")
    if kind == "observations":
        types = _types(path, lines, version)
        first = next((line for line in lines if line.label == "TIME OF FIRST OBS"), None)
        if first is None:
            raise BadInputError(f"{path}: header must have TIME OF FIRST OBS, it is missing")
        last = first.text.split()[-1:]  # wherever it stands
        time_system = last[0] if last and last[0].isalpha() else time_system
        if time_system not in _TIMES.values():
            raise first.fault("time system must be GPS, GLO, GAL, QZS or BDT", time_system)
    return Header(
        path=path,
        version=version,
        system=system,
        types=types,
        time_system=time_system,
        klobuchar=_klobuchar(lines, system),
        size=size,
        content=tuple(line.whole for line in lines),
        scales=_scales(lines, types),
        half_cycles=_half_cycles(lines),
    )


def _lines(path: Path, text: Bytes) -> tuple[list[_Line], int]:
    """Return the lines of the head and the offset of the body."""
    head = text[:_MOST_BYTES].tobytes()
    first = head.split(b"\n", 1)[0].decode("latin-1")
    if "RINEX VERSION / TYPE" not in first[60:]:
        rule = f"line 1: must be RINEX VERSION / TYPE, got {quoted(first[:60])}"
        raise BadInputError(f"{path}: {rule}")
    end = re.search(rb"^.{60}END OF HEADER.*\n", head, re.MULTILINE)
    if end is None:
        rule = f"line {head.count(10)}: header must end with END OF HEADER, it does not"
        raise BadInputError(f"{path}: {rule}")
    content = head[: end.end()].decode("latin-1").splitlines()
    return [
        _Line(path, number, line[:60].ljust(60), line[60:].strip(), line.rstrip())
        for number, line in enumerate(content, 1)
    ], end.end()


def _version(line: _Line, kind: Kind) -> tuple[float, str]:
    """Return the version and the constellation's letter, of a file of the expected kind."""
    if not is_number(line.text[:9]):
        raise line.fault("RINEX version must be a number", line.text[:9])
    version = float(line.text[:9])
    low, high = _VERSIONS.get(int(version) if np.isfinite(version) else 0, (1.0, 0.0))
    if not low <= round(version, 3) <= high:
        raise line.fault("RINEX version must be 2.00-2.12, 3.00-3.05 or 4.00-4.02", f"{version:g}")
    letter = line.text[20:21]
    if (letter == "O") != (kind == "observations") or letter not in "ONGHJLE":
        raise line.fault(f"must be a RINEX {kind} file", line.text[20:40].strip())
    system = line.text[40:41].strip() or ("G" if version < 3 else "M")
    if version < 3:
        system = _NAVIGATION_2.get(letter, system)
    if system not in _SYSTEMS + "M":
        raise line.fault("constellation must be one of GRECJSIM", system)
    return version, system


def _types(path: Path, lines: Sequence[_Line], version: float) -> dict[str, tuple[str, ...]]:
    """Return the observation types by constellation, BeiDou's B1I always named 2I."""
    label = "# / TYPES OF OBSERV" if version < 3 else "SYS / # / OBS TYPES"
    listed = [line for line in lines if line.label == label]
    if not listed:
        raise BadInputError(f"{path}: header must have {label}, it is missing")
    if version < 3:
        names = [name for line in listed for name in line.text[6:].split()]
        return dict.fromkeys(_SYSTEMS, _checked(listed[0], listed[0].text[:6], names, _TYPE[2]))
    first: dict[str, _Line] = {}
    types: dict[str, list[str]] = {}
    for letter, line in _by_letter(listed):
        if letter not in _SYSTEMS or (letter in types and line.text[0] != " "):
            raise line.fault(f"constellation must be new and one of {_SYSTEMS}", letter)
        first.setdefault(letter, line)
        types.setdefault(letter, []).extend(line.text[6:].split())
    checked = {
        letter: _checked(first[letter], first[letter].text[3:6], names, _TYPE[3])
        for letter, names in types.items()
    }
    if round(version, 2) == 3.02 and "C" in checked:
        checked["C"] = tuple(n[0] + n[1].replace("1", "2") + n[2:] for n in checked["C"])
    return checked


def _by_letter(lines: Sequence[_Line]) -> Iterator[tuple[str, _Line]]:
    """Yield lines with the letter of their constellation, which lines that go on leave out."""
    letter = ""
    for line in lines:
        letter = line.text[0].strip() or letter
        if not letter:
            raise line.fault(f"{line.label} must start with a constellation", line.text)
        yield letter, line


def _checked(
    line: _Line, count: str, names: Sequence[str], pattern: re.Pattern[str]
) -> tuple[str, ...]:
    """Return observation types; there may be more than announced, but not fewer."""
    if not count.strip().isdigit():
        raise line.fault("number of observation types must be whole", count)
    if int(count) > len(names):
        raise line.fault(f"{int(count)} observation types announced", f"{len(names)} listed")
    if not 0 < len(names) <= _MOST_TYPES:
        raise line.fault(f"1 to {_MOST_TYPES} observation types", count)
    for name in names:
        if not pattern.fullmatch(name) or names.count(name) > 1:
            raise line.fault("observation type must be known and new", name)
    return tuple(names)


def _scales(
    lines: Sequence[_Line], types: dict[str, tuple[str, ...]]
) -> dict[tuple[str, str], int]:
    """Return the factors that values of types were multiplied by."""
    scales, factor = dict[tuple[str, str], int](), 1
    for letter, line in _by_letter([x for x in lines if x.label == "SYS / SCALE FACTOR"]):
        if line.text[0] != " ":
            text = line.text[2:6].strip().lstrip("0")
            if text not in ("", "1", "10", "100", "1000"):
                raise line.fault(f"{line.label} must be 1, 10, 100 or 1000; repair the line", text)
            factor = int(text or "1")
        names = line.text[10:58].split() or types.get(letter, ())
        scales |= {(letter, name): factor for name in names}
    return scales


def _half_cycles(lines: Sequence[_Line]) -> frozenset[tuple[str, str]]:
    """Return satellites, nothing for all, and carriers whose ambiguities may be half cycles."""
    half = set[tuple[str, str]]()
    for text in (line.text for line in lines if line.label == "WAVELENGTH FACT L1/2"):
        names = [name.replace(" ", "0") for name in re.findall(r"[GRSE ][ \d]\d", text[18:])]
        for band, factor in zip("12", (text[:6], text[6:12]), strict=True):
            half |= {(name, band) for name in names or [""] if factor.strip() == "2"}
    return frozenset(half)


def _klobuchar(lines: Sequence[_Line], system: str) -> tuple[float, ...]:
    """Return the GPS ionosphere model of a navigation head."""
    model = [0.0] * 8
    for line in lines:
        start, shift = -1, 2
        if line.label in ("ION ALPHA", "ION BETA") and system == "G":
            start = 4 * (line.label == "ION BETA")
        elif line.label == "IONOSPHERIC CORR" and line.text[:4] in ("GPSA", "GPSB"):
            start, shift = 4 * (line.text[:4] == "GPSB"), 5
        if start >= 0:
            fields = [line.text[shift + 12 * k :][:12] for k in range(4)]
            numbers = [text.replace("D", "E").replace("d", "e") for text in fields]
            if not all(map(is_number, numbers)):
                raise line.fault(f"{line.label} must hold four numbers", line.text.strip())
            model[start : start + 4] = map(float, numbers)
    return tuple(model)
