"""Receivers' own files: their solutions, and raw measurements as RINEX by RTKLIB; RINEX and SP3.

Raw measurements are taken where a file has broadcast messages, too, and no baseline, or no
solution: a solution is of the same signals. ``solution`` of the settings decides otherwise.
"""

from collections import Counter
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from fgnav.checks import BadInputError, unused_of
from fgnav.io.flight.toml import gps_seconds
from fgnav.io.importers.formats.fields import Counts
from fgnav.io.importers.formats.readers import guard_reading
from fgnav.io.importers.formats.solution import LAYOUT, solution
from fgnav.io.importers.formats.streams import messages
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.io.rinex.text import read_text
from fgnav.io.rtklib_convert import convert
from fgnav.io.user_files import read_bytes, remove_mark

_MISSING = {"antenna.position_b_m": "where the antenna sits in the body is in no file: state it"}
_NO_CHECKSUM = "its {} sentences have no checksums: what is damaged in them is not noticed"
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
_Kinds = Counter[tuple[str, int, str]]  # by protocol, number and name


def read_stream(path: Path, settings: Settings, scratch: Path) -> Recording:
    r"""Read a file of any receiver, of one protocol or of several between each other.

    Examples
    --------
    >>> sentences = "$GPRMC,120000,A,,,,,,,010124,,,A\r\n$GPGGA,120000,4019.8,N,00352.8,W,"
    >>> _ = Path("a.nmea").write_text(sentences + "1,8,1,649,M,51,M,,\r\n", newline="")
    >>> recording = read_stream(Path("a.nmea"), Settings(), Path())
    >>> recording.tables["fixes"]["height_m"].tolist(), recording.notes["nmea"]
    ([700.0], 'its 2 sentences have no checksums: what is damaged in them is not noticed')
    """
    content, counts = remove_mark(read_bytes(path)), Counts()
    stated, others, size, unproved = _decoded(path, content, counts)
    near_s = None if settings.start is None else gps_seconds(path, settings.start)
    tables, is_dated, has_vectors, notes = solution(stated, near_s, counts)
    rows = {kind: len(table["t_s"]) for kind, table in tables.items()}
    protocol, observations = _observations(path, others, settings, scratch, rows)
    if observations:
        reason = "of the same signals as raw measurements; solution = true in --settings takes it"
        counts.update({(kind, reason): count for kind, count in rows.items()})
        tables = {}
    kinds = _OBSERVED.get(protocol, set()) | _DECODED.get(protocol, set())
    for (other, number, name), count in others.items():
        if other != protocol or number not in kinds:
            is_raw = number in _OBSERVED.get(other, ())
            reason = "the receiver's solution is taken; solution = false in --settings takes it"
            counts[f"{name} message", reason if is_raw else "not read"] += count
    counts["byte", "in no whole message: damaged, or of another format"] += len(content) - size
    if not (tables or observations):
        if not is_dated and any(protocol == "nmea" for protocol, *_ in stated):
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
    first_s = min((float(rows["t_s"][0]) for rows in tables.values() if is_dated), default=0.0)
    return Recording(
        source=path,
        tables={kind: {**rows, "t_s": rows["t_s"] - first_s} for kind, rows in tables.items()},
        clock="gps" if is_dated or not tables else "week",
        gps_start_s=first_s,
        baseline_ends_at_fixes=has_vectors,
        observations=observations[:1],
        navigation=observations[1:],
        unused=unused_of(counts),
        notes=notes | ({"nmea": _NO_CHECKSUM.format(unproved)} if unproved else {}),
        missing=_MISSING if observations else {},
    )


def _decoded(
    path: Path, content: bytes, counts: Counts
) -> tuple[list[tuple[str, str, Any]], _Kinds, int, int]:
    """Return messages of solutions, the others' kinds, all their bytes, and those unproved."""
    stated, others, size = list[tuple[str, str, Any]](), _Kinds(), 0
    stream, unproved = messages(content)
    for message in stream:
        size += len(message.raw)
        if message.name not in LAYOUT:
            others[message.protocol, message.number, message.name] += 1
            continue
        try:
            with guard_reading(path, message.name):
                stated.append((message.protocol, message.name, message.decoded()))
        except BadInputError:  # one message, that its checksum has proved, is no reason to stop
            counts[f"{message.name} message", "cannot be decoded"] += 1
    return stated, others, size, unproved


def _observations(
    path: Path, kinds: _Kinds, settings: Settings, scratch: Path, rows: dict[str, int]
) -> tuple[str, tuple[Path, ...]]:
    """Return the protocol of raw measurements and their RINEX files, none where none are taken."""
    counts = Counter[str]()
    for (protocol, number, _), count in kinds.items():
        counts[protocol] += count * (number in _OBSERVED.get(protocol, ()))
    protocol, count = next(iter(counts.most_common(1)), ("", 0))
    if not count or (settings.solution and "fixes" in rows):
        return "", ()
    if protocol == "rtcm3" and settings.start is None:
        raise BadInputError(
            f"{path}: RTCM 3 has no week; state start in --settings, within half a week"
        )
    near_s = "" if settings.start is None else repr(gps_seconds(path, settings.start))
    file = Path(mkdtemp(dir=scratch)) / f"{path.stem}.obs"
    convert(path, [protocol, str(path), str(file), near_s])
    files = [x for x in (file, file.with_suffix(".nav")) if x.is_file() and x.stat().st_size]
    is_poorer = "fixes" in rows and (len(files) == 1 or "baseline" in rows)
    if file not in files or (is_poorer and settings.solution is None):
        return "", ()
    return protocol, tuple(files)


def read_rinex_file(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Take a RINEX file as it is: observations of one antenna, or navigation messages.

    Examples
    --------
    >>> read_rinex_file(Path("demo/flight/broadcast.rnx"), Settings(), Path()).navigation
    (PosixPath('demo/flight/broadcast.rnx'),)
    """
    kind = read_text(path)[:60].tobytes()[20:21]
    if kind == b"O":
        return Recording(source=path, observations=(path,), missing=_MISSING)
    if kind in (b"N", b"G", b"E", b"C", b"J"):
        return Recording(source=path, navigation=(path,))
    raise BadInputError(f"{path}: must be RINEX observations or navigation, is of type {kind!r}")


def read_sp3_file(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Take a file of precise orbits as it is.

    Examples
    --------
    >>> read_sp3_file(Path("igs.sp3"), Settings(), Path()).orbits
    (PosixPath('igs.sp3'),)
    """
    return Recording(source=path, orbits=(path,))
