"""DataFlash logs of ArduPilot, ``.BIN`` [1]_, by pymavlink: the first instrument of each kind.

Logs of 2014, which count milliseconds in ``TimeMS``, are read alike. Axes are forward, right, down.
Heights are above the ellipsoid where the log has the undulation
(``GPA.Und``), else above the sea, which shifts the whole flight alike. Messages that are not read
are counted by their type.

References
----------
.. [1] ArduPilot developer documentation, "Log messages", AP_Logger/LogStructure.h.
"""

import os
import struct
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, unused_of
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.parts import Part, Timed, joined, table_of, xyz
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import ABOVE_SEA, Recording
from fgnav.io.importers.settings import Settings

_US, _MS = 1e-6, 1e-3
_UT_PER_MILLIGAUSS = 0.1
_FIX_3D = 3  # GPS.Status
_HEAD_BYTES = 3  # before a message's fields
_TABLES = {
    "imu": ("IMU", [Part(col.FORCE, xyz("Acc{}", "XYZ")), Part(col.RATE, xyz("Gyr{}", "XYZ"))]),
    "barometer": ("BARO", [Part(col.HEIGHT, ("Alt",))]),
    "magnetometer": ("MAG", [Part(col.FIELD, xyz("Mag{}", "XYZ"), _UT_PER_MILLIGAUSS)]),
    "fixes": ("GPS", [Part(col.PLACE, ("Lat", "Lng", "Alt"))]),
    "accuracy": (
        "GPA",
        [
            Part(col.POSITION_SIGMA, ("HAcc", "HAcc", "VAcc")),
            Part(col.VELOCITY_SIGMA, ("SAcc", "SAcc", "SAcc")),
        ],
    ),
}
_NEEDED = {
    name: ["TimeUS", *(field for part in parts for field in part.fields)]
    for name, parts in _TABLES.values()
}
_NEEDED["GPS"] += ["Status", "GMS", "GWk"]
_DESCRIPTIONS = ("FMT", "FMTU", "UNIT", "MULT")  # of the other messages
_Messages = dict[str, FloatArray]  # fields by name, (k,)


def read_ardupilot(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log; its clock is set by the receiver's week and milliseconds."""
    counts = Counter[tuple[str, str]]()
    messages = _messages(path, counts)
    tables = {
        kind: table_of(messages[name], messages[name]["TimeUS"] * _US, parts)
        for kind, (name, parts) in _TABLES.items()
        if name in messages and name not in ("GPS", "GPA")
    }
    start_s, gps = None, messages.get("GPS", {})
    if gps:
        flying = (gps["Status"] >= _FIX_3D) & (gps["GWk"] > 0)
        counts["fix", "has no height (Status)"] += int((~flying).sum())
        gps = {name: column[flying] for name, column in gps.items()}
    if gps and len(gps["TimeUS"]):
        gps_s = WEEK_S * gps["GWk"] + gps["GMS"] * _MS
        start_s = float(np.median(gps_s - gps["TimeUS"] * _US))
        tables["fixes"] = _fixes(gps, messages.get("GPA", {}), counts)
    has_undulation = "Und" in messages.get("GPA", {})
    return Recording(
        source=path,
        tables=tables,
        clock="own" if start_s is None else "gps",
        gps_start_s=start_s or 0.0,
        unused=unused_of(counts),
        notes={"fixes": ABOVE_SEA} if "fixes" in tables and not has_undulation else {},
    )


def _messages(path: Path, counts: Counter[tuple[str, str]]) -> dict[str, _Messages]:
    """Return the fields of the messages that are read, in SI, by type; count the others."""
    os.environ.setdefault("PYMAVLINK_FAST_INDEX", "0")  # its compiled index prints on the screen
    module = reader("pymavlink.DFReader", "ardupilot")
    with foreign(path, "a DataFlash log"):
        log = module.DFReader_binary(str(path))
        try:
            outside, fields_by_type = log.data_len, {}
            for kind, places in enumerate(log.offsets):
                layout = log.formats.get(kind)
                if layout is None or not places:
                    continue
                whole = [at for at in places if at + layout.len <= log.data_len]
                outside -= layout.len * len(whole)
                what = f"{layout.name} message"
                if layout.name in _NEEDED and whole:
                    columns = _fields(path, layout, log.data_map, whole)
                    fields_by_type[layout.name] = columns
                    counts[what, "of another instance"] += len(whole) - len(columns["TimeUS"])
                elif layout.name not in _DESCRIPTIONS:
                    counts[what, "not read"] += len(whole)
        finally:
            log.filehandle.close()
    counts["byte", "in no message: the log is damaged there"] += outside
    return fields_by_type


def _fields(path: Path, layout: Any, content: Any, places: list[int]) -> _Messages:  # noqa: ANN401
    """Return the fields of a type's first instance."""
    wrong = f"{path}: message {layout.name}: {{}}; the log is another's"
    sound = struct.calcsize(layout.msg_struct) + _HEAD_BYTES == layout.len
    if not sound or len(layout.columns) != len(layout.msg_mults):
        raise BadInputError(wrong.format("its FMT is damaged"))
    unpack = struct.Struct(layout.msg_struct).unpack_from
    rows = zip(*(unpack(content, at + _HEAD_BYTES) for at in places), strict=True)
    columns = {
        field: np.array(values, np.float64) * (scale or 1.0)
        for field, values, scale in zip(layout.columns, rows, layout.msg_mults, strict=True)
        if not isinstance(values[0], bytes)
    }
    if "TimeMS" in columns:  # of GPS the receiver's, beside the log's T
        time_ms = columns["TimeMS"]
        if layout.name == "GPS" and {"T", "Week"} <= set(columns):
            columns |= {"GMS": time_ms, "GWk": columns["Week"]}
            time_ms = columns["T"]
        columns["TimeUS"] = 1e3 * time_ms
    missing = [field for field in _NEEDED[layout.name] if field not in columns]
    if missing:
        raise BadInputError(wrong.format(f"field {missing[0]} is missing"))
    instance = columns.get("I", np.zeros(len(places)))
    return {field: column[instance == instance.min()] for field, column in columns.items()}


def _fixes(gps: _Messages, accuracy: _Messages, counts: Counter[tuple[str, str]]) -> Samples:
    """Return fixes; speed and course are the receiver's velocity, GPA its accuracy."""
    at_s, others = gps["TimeUS"] * _US, list[Timed]()
    if {"Spd", "GCrs", "VZ"} <= set(gps):
        course_rad = np.radians(gps["GCrs"])
        north_mps, east_mps = gps["Spd"] * np.cos(course_rad), gps["Spd"] * np.sin(course_rad)
        others.append((col.VELOCITY, at_s, np.stack([north_mps, east_mps, gps["VZ"]], axis=1)))
    if accuracy:
        _, parts = _TABLES["accuracy"]
        others += [(one.columns, accuracy["TimeUS"] * _US, one.of(accuracy)) for one in parts]
        if "Und" in accuracy:
            undulation_m = np.interp(gps["TimeUS"], accuracy["TimeUS"], accuracy["Und"])
            gps = gps | {"Alt": gps["Alt"] + undulation_m}
    (place,) = _TABLES["fixes"][1]
    return joined("fix", (place.columns, at_s, place.of(gps)), others, counts)
