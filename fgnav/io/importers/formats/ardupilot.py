"""DataFlash logs of ArduPilot, ``.BIN`` [1]_: the first instrument of each kind.

A log explains itself: messages of type 128 say how long each other type is, and its fields. Axes
are forward, right, down. Heights are above the ellipsoid where the log has the undulation
(``GPA.Und``), else above the sea, which shifts the whole flight alike.

References
----------
.. [1] ArduPilot developer documentation, "Log messages", AP_Logger/LogStructure.h.
"""

from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.io.flight import columns as col
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.recording import Recording, Samples, vectors
from fgnav.io.importers.settings import Settings
from fgnav.io.user_files import read_bytes
from fgnav.progress import report

_US, _MS = 1e-6, 1e-3
_UT_PER_MILLIGAUSS = 0.1
_FIX_3D = 3  # GPS.Status
_HEAD, _FORMAT, _FORMAT_BYTES = b"\xa3\x95", 128, 89
# Letters of a format, numpy's codes and scales, as LogStructure.h lists them.
_LETTERS = "b:i1 B:u1 M:u1 h:<i2 H:<u2 c:<i2 C:<u2 i:<i4 I:<u4 e:<i4 E:<u4 L:<i4 q:<i8 Q:<u8"
_LETTERS += " g:<f2 f:<f4 d:<f8 n:S4 N:S16 Z:S64 a:S64"
_CODES = {pair[0]: pair[2:] for pair in _LETTERS.split()}
_SCALES = {"c": 1e-2, "C": 1e-2, "e": 1e-2, "E": 1e-2, "L": 1e-7}
_NEEDED = {
    "GPS": ("TimeUS", "Status", "GMS", "GWk", "Lat", "Lng", "Alt", "Spd", "GCrs", "VZ"),
    "IMU": ("TimeUS", *(f"{kind}{axis}" for kind in ("Gyr", "Acc") for axis in "XYZ")),
    "GPA": ("TimeUS", "HAcc", "VAcc", "SAcc"),
    "BARO": ("TimeUS", "Alt"),
    "MAG": ("TimeUS", "MagX", "MagY", "MagZ"),
}


def read_ardupilot(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log; its clock is set by the receiver's week and milliseconds."""
    content = read_bytes(path)
    formats, places, damaged = _index(path, content)
    messages = {
        name: _fields(path, content, name, described, places[kind])
        for kind, described in formats.items()
        if (name := described[1]) in _NEEDED and places[kind]
    }
    lost = [("stretch of bytes", "the log is damaged there", damaged)]
    tables: dict[str, Samples] = {}
    start_s = None
    if "GPS" in messages:
        gps = messages["GPS"]
        flying = (gps["Status"] >= _FIX_3D) & (gps["GWk"] > 0)
        lost += [("fix", "has no height (Status)", int((~flying).sum()))]
        gps = {name: column[flying] for name, column in gps.items()}
        if flying.any():
            gps_s = WEEK_S * gps["GWk"] + gps["GMS"] * _MS
            start_s = float(np.median(gps_s - gps["TimeUS"] * _US))
            tables["fixes"] = _fixes(gps, messages.get("GPA", {}))
    if "IMU" in messages:
        tables["imu"] = _imu(messages["IMU"])
    if "BARO" in messages:
        air = messages["BARO"]
        tables["barometer"] = {"t_s": air["TimeUS"] * _US} | vectors(
            col.HEIGHT, air["Alt"][:, None]
        )
    if "MAG" in messages:
        field = np.stack([messages["MAG"][f"Mag{axis}"] for axis in "XYZ"], axis=1)
        t_s = messages["MAG"]["TimeUS"] * _US
        tables["magnetometer"] = {"t_s": t_s} | vectors(col.FIELD, field * _UT_PER_MILLIGAUSS)
    above_sea = "heights are above the sea: the log has no GPA.Und"
    return Recording(
        source=path,
        tables=tables,
        clock="own" if start_s is None else "gps",
        gps_start_s=start_s or 0.0,
        losses=tuple(Loss(what=w, reason=why, count=count) for w, why, count in lost if count),
        notes={"fixes": above_sea}
        if "fixes" in tables and "Und" not in messages.get("GPA", {})
        else {},
    )


_Formats = dict[int, tuple[int, str, str, str]]  # by type: length, name, letters, names of fields


def _index(path: Path, content: bytes) -> tuple[_Formats, dict[int, list[int]], int]:
    """Return formats and where messages are, by type, and how many stretches are no messages."""
    formats: _Formats = {_FORMAT: (_FORMAT_BYTES, "FMT", "", "")}
    places: dict[int, list[int]] = {_FORMAT: []}
    at, damaged, size = 0, 0, len(content)
    while at + 3 <= size:
        kind = content[at + 2]
        layout = formats.get(kind) if content[at : at + 2] == _HEAD else None
        if layout is None:  # look for the next message; logs may end in a page that was not filled
            following = content.find(_HEAD, at + 1)
            damaged += following >= 0
            at = following if following >= 0 else size
            continue
        if at + layout[0] > size:
            break
        if kind == _FORMAT:
            new, length = content[at + 3], content[at + 4]
            texts = [content[at + a : at + b] for a, b in ((5, 9), (9, 25), (25, 89))]
            name, letters, fields = (t.rstrip(b"\0").decode("ascii", "replace") for t in texts)
            formats[new] = (max(length, 3), name, letters, fields)
            places.setdefault(new, [])
        places[kind].append(at)
        at += layout[0]
        if len(places[kind]) % 50_000 == 0:
            report(at / size)
    if not places[_FORMAT]:
        raise BadInputError(f"{path}: must be a DataFlash log, holds no FMT message")
    return formats, places, damaged


def _fields(
    path: Path, content: bytes, name: str, described: tuple[int, str, str, str], places: list[int]
) -> dict[str, FloatArray]:
    """Return the fields of all messages of a type, of its first instance, in SI.

    Raises
    ------
    BadInputError
        If the log describes the type otherwise than ArduPilot does.
    """
    size, _, letters, names = described
    fields = names.split(",")
    missing = [field for field in _NEEDED[name] if field not in fields]
    codes = [_CODES.get(letter, "") for letter in letters]
    sound = len(fields) == len(set(fields)) == len(codes) and all(codes)
    dtype = np.dtype(list(zip(fields, codes, strict=True)) if sound else [])
    if missing or dtype.itemsize + 3 != size:
        wrong = f"field {missing[0]} is missing" if missing else "its FMT is damaged"
        raise BadInputError(f"{path}: message {name}: {wrong}; the log is another's or damaged")
    raw = np.frombuffer(content, np.uint8)
    bodies = raw[np.array(places)[:, None] + np.arange(3, 3 + dtype.itemsize)]
    rows = bodies.view(dtype)[:, 0]
    columns = {
        field: rows[field] * np.float64(_SCALES.get(letter, 1.0))
        for field, letter in zip(fields, letters, strict=True)
        if _CODES[letter][0] != "S"
    }
    instance = columns.get("I", np.zeros(len(rows)))
    return {field: column[instance == instance.min()] for field, column in columns.items()}


def _imu(imu: dict[str, FloatArray]) -> Samples:
    return (
        {"t_s": imu["TimeUS"] * _US}
        | vectors(col.FORCE, np.stack([imu[f"Acc{axis}"] for axis in "XYZ"], axis=1))
        | vectors(col.RATE, np.stack([imu[f"Gyr{axis}"] for axis in "XYZ"], axis=1))
    )


def _fixes(gps: dict[str, FloatArray], accuracy: dict[str, FloatArray]) -> Samples:
    """Return fixes; speed and course are the receiver's velocity, GPA its accuracy."""
    course_rad = np.radians(gps["GCrs"])
    north_mps, east_mps = gps["Spd"] * np.cos(course_rad), gps["Spd"] * np.sin(course_rad)
    at = gps["TimeUS"]
    height_m = gps["Alt"]
    fixes = {"t_s": at * _US}
    fixes |= vectors(col.VELOCITY, np.stack([north_mps, east_mps, gps["VZ"]], axis=1))
    if accuracy:
        at_fixes = {n: np.interp(at, accuracy["TimeUS"], x) for n, x in accuracy.items()}
        height_m = height_m + at_fixes.get("Und", 0.0)
        sigma_m = np.stack([at_fixes["HAcc"], at_fixes["HAcc"], at_fixes["VAcc"]], axis=1)
        fixes |= vectors(col.POSITION_SIGMA, sigma_m)
        fixes |= vectors(col.VELOCITY_SIGMA, np.repeat(at_fixes["SAcc"][:, None], 3, axis=1))
    return fixes | vectors(col.PLACE, np.stack([gps["Lat"], gps["Lng"], height_m], axis=1))
