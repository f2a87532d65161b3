"""Receivers' own files: their solutions, and raw measurements as RINEX by RTKLIB; RINEX and SP3.

Raw measurements are taken where a file has broadcast messages, too, and no baseline, or no
solution: a solution is of the same signals. ``solution`` of the settings decides otherwise.
"""

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from fgnav.checks import BadInputError, unused_of
from fgnav.io.flight.columns import Samples
from fgnav.io.flight.toml import gps_seconds
from fgnav.io.importers.formats.readers import foreign
from fgnav.io.importers.formats.solution import STATED, Solution, take
from fgnav.io.importers.formats.streams import messages
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.io.rinex.text import read_text
from fgnav.io.rtklib_convert import convert
from fgnav.io.user_files import read_bytes, unmarked

_MISSING = {"antenna.position_b_m": "where the antenna sits in the body is in no file: state it"}
_OBSERVED = {  # kinds of raw observations
    "ubx": {0x0210, 0x0215},
    "sbf": {4027},
    "novatel": {43, 140},
    "rtcm3": {*range(1001, 1005), *range(1009, 1013), *range(1071, 1138)},
}
_DECODED = {  # and of what else RTKLIB 2.5.0 decodes
    "ubx": {0x0120, 0x0211, 0x0213, 0x030F, 0x0310},
    "sbf": {4002, 4004, *range(4017, 4024), 4026, 4030, 4031, 4047, 4066, 4081, 4093, 4095, 5891}
    | {*range(5893, 5897)},
    "novatel": {7, 8, 41, 287, 723, 1121, 1122, 1127, 1273, 1330, 1331, 1347, 1696},
    "rtcm3": {1005, 1006, 1007, 1008, 1013, 1019, 1020, 1033, *range(1041, 1047), 1230},
}


def read_stream(path: Path, settings: Settings, scratch: Path) -> Recording:
    """Read a file of any receiver, of one protocol or of several between each other.

    Raises
    ------
    BadInputError
        If it has neither a solution nor observations.
    """
    content = unmarked(read_bytes(path))
    solution = Solution()
    stated, others, size = _decoded(path, content, solution.counts)
    start_s = None if settings.start is None else gps_seconds(path, settings.start)
    take(stated, start_s, solution)
    tables = {"fixes": solution.fixes(), "baseline": solution.baselines()}
    tables = {kind: rows for kind, rows in tables.items() if len(rows["t_s"])}
    counts = solution.counts
    protocol, observations = _observations(path, others, settings, scratch, tables)
    if observations:
        reason = "of the same signals as raw measurements; solution = true in --settings takes it"
        counts.update({(kind, reason): len(rows["t_s"]) for kind, rows in tables.items()})
        tables = {}
    kinds = _OBSERVED.get(protocol, set()) | _DECODED.get(protocol, set())
    for (of, number, name), count in others.items():
        if of != protocol or number not in kinds:
            is_raw = number in _OBSERVED.get(of, ())
            reason = "the receiver's solution is taken; solution = false in --settings takes it"
            counts[f"{name} message", reason if is_raw else "not read"] += count
    counts["byte", "in no whole message: damaged, or of another format"] += len(content) - size
    if not (tables or observations):
        if not solution.is_dated and any(protocol == "nmea" for protocol, *_ in stated):
            raise BadInputError(
                f"{path}: no RMC or ZDA sentence has a date; state start in --settings, within "
                "half a day"
            )
        what, reason = next((key for key, count in counts.items() if count), ("", ""))
        raise BadInputError(
            f"{path}: has no fix of a receiver, as of NAV-PVT, PVTGeodetic, BESTPOS or GGA, and no "
            f"raw measurements{f' ({what}: {reason})' if what else ''}; look what the receiver was "
            "set to put out"
        )
    firsts_s = [float(rows["t_s"][0]) for rows in tables.values()] if solution.is_dated else []
    first_s = min(firsts_s, default=0.0)
    return Recording(
        source=path,
        tables={kind: {**rows, "t_s": rows["t_s"] - first_s} for kind, rows in tables.items()},
        clock="gps" if solution.is_dated or not tables else "week",
        gps_start_s=first_s,
        baseline_ends_at_fixes=solution.has_vectors,
        observations=observations[:1],
        navigation=observations[1:],
        unused=unused_of(counts),
        notes=solution.notes,
        missing=_MISSING if observations else {},
    )


def _decoded(
    path: Path, content: bytes, counts: Counter[tuple[str, str]]
) -> tuple[list[tuple[str, str, Any]], Counter[tuple[str, int, str]], int]:
    """Return the messages of solutions, the others' kinds, and how long all together are."""
    stated, others, size = list[tuple[str, str, Any]](), Counter[tuple[str, int, str]](), 0
    for one in messages(content):
        size += len(one.raw)
        if one.name not in STATED:
            others[one.protocol, one.number, one.name] += 1
            continue
        try:
            with foreign(path, one.name):
                stated.append((one.protocol, one.name, one.decoded()))
        except BadInputError:  # one message, that its checksum has proved, is no reason to stop
            counts[f"{one.name} message", "cannot be decoded"] += 1
    return stated, others, size


def _observations(
    path: Path,
    kinds: Mapping[tuple[str, int, str], int],
    settings: Settings,
    scratch: Path,
    tables: Mapping[str, Samples],
) -> tuple[str, tuple[Path, ...]]:
    """Return the protocol of raw measurements and their RINEX files, none where none are taken."""
    counts = Counter[str]()
    for (protocol, number, _), count in kinds.items():
        counts[protocol] += count * (number in _OBSERVED.get(protocol, ()))
    protocol, count = next(iter(counts.most_common(1)), ("", 0))
    if not count or (settings.solution and "fixes" in tables):
        return "", ()
    if protocol == "rtcm3" and settings.start is None:
        raise BadInputError(
            f"{path}: RTCM 3 has no week; state start in --settings, within half a week"
        )
    near_s = "" if settings.start is None else repr(gps_seconds(path, settings.start))
    place = Path(mkdtemp(dir=scratch)) / f"{path.stem}.obs"
    convert(path, [protocol, str(path), str(place), near_s])
    files = [
        one for one in (place, place.with_suffix(".nav")) if one.is_file() and one.stat().st_size
    ]
    is_poorer = "fixes" in tables and (len(files) == 1 or "baseline" in tables)
    if place not in files or (is_poorer and settings.solution is None):
        return "", ()
    return protocol, tuple(files)


def read_rinex_file(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Take a RINEX file as it is: observations of one antenna, or navigation messages."""
    kind = read_text(path)[:60].tobytes()[20:21]
    if kind == b"O":
        return Recording(source=path, observations=(path,), missing=_MISSING)
    if kind in (b"N", b"G", b"E", b"C", b"J"):
        return Recording(source=path, navigation=(path,))
    raise BadInputError(f"{path}: must be RINEX observations or navigation, is of type {kind!r}")


def read_sp3_file(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Take a file of precise orbits as it is."""
    return Recording(source=path, orbits=(path,))
