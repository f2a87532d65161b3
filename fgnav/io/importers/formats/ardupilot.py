"""DataFlash logs of ArduPilot, ``.BIN`` [1]_, by pymavlink: the first instrument of each kind.

Logs of 2014, which count milliseconds in ``TimeMS``, are read alike. Axes are forward, right, down.
Heights are above the ellipsoid where the log has the undulation (``GPA.Und``), else above the sea,
which shifts the whole flight alike. Messages that are not read are counted by their type.

References
----------
.. [1] ArduPilot developer documentation, "Log messages", AP_Logger/LogStructure.h.
"""

import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, unused_of
from fgnav.io.flight import columns as col
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.fields import Counts, Fields, tables_of, xyz
from fgnav.io.importers.formats.readers import guard_reading, reader
from fgnav.io.importers.recording import ABOVE_SEA, Recording
from fgnav.io.importers.settings import Settings

_US, _MS = 1e-6, 1e-3
_UT_PER_MILLIGAUSS = 0.1
_FIX_3D = 3  # GPS.Status
_HEAD_BYTES = 3  # before a message's fields
_VELOCITY = ("VN", "VE", "VZ")  # north and east of GPS's speed and course
_LAYOUT = {
    "IMU": (
        Fields("imu", col.FORCE, xyz("Acc{}", "XYZ")),
        Fields("imu", col.RATE, xyz("Gyr{}", "XYZ")),
    ),
    "BARO": (Fields("barometer", col.HEIGHT, ("Alt",)),),
    "MAG": (Fields("magnetometer", col.FIELD, xyz("Mag{}", "XYZ"), _UT_PER_MILLIGAUSS),),
    "GPS": (
        Fields("fixes", col.PLACE, ("Lat", "Lng", "Alt")),
        Fields("fixes", col.VELOCITY, _VELOCITY),
    ),
    "GPA": (
        Fields("fixes", col.POSITION_SIGMA, ("HAcc", "HAcc", "VAcc")),
        Fields("fixes", col.VELOCITY_SIGMA, ("SAcc", "SAcc", "SAcc")),
    ),
}
_NEEDED = {
    name: [
        "TimeUS",
        *(field for fields in some for field in fields.names if field not in _VELOCITY),
    ]
    for name, some in _LAYOUT.items()
}
_NEEDED["GPS"] += ["Status", "GMS", "GWk"]
_DESCRIPTIONS = ("FMT", "FMTU", "UNIT", "MULT")  # of the other messages
_Message = dict[str, FloatArray]  # fields by name, (k,)


def read_ardupilot(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log; its clock is set by the receiver's week and milliseconds.

    Examples
    --------
    >>> read_ardupilot(Path("log.BIN"), Settings(), Path()).clock  # doctest: +SKIP
    'gps'
    """
    counts, start_s, notes = Counts(), None, dict[str, str]()
    messages = _messages(path, counts)
    if (gps := messages.pop("GPS", None)) is not None:
        flying = (gps["Status"] >= _FIX_3D) & (gps["GWk"] > 0)
        counts["fix", "has no height (Status)"] += int((~flying).sum())
        if flying.any():
            gps = {name: column[flying] for name, column in gps.items()}
            gps_s = WEEK_S * gps["GWk"] + gps["GMS"] * _MS
            start_s = float(np.median(gps_s - gps["t_s"]))
            accuracy = messages.get("GPA", {})
            if "Und" in accuracy:
                gps["Alt"] = gps["Alt"] + np.interp(gps["t_s"], accuracy["t_s"], accuracy["Und"])
            else:
                notes["fixes"] = ABOVE_SEA
            messages["GPS"] = _with_velocity(gps)
    if "GPS" not in messages:
        messages.pop("GPA", None)
    return Recording(
        source=path,
        tables=tables_of(messages, _LAYOUT, counts),
        clock="own" if start_s is None else "gps",
        gps_start_s=start_s or 0.0,
        unused=unused_of(counts),
        notes=notes,
    )


def _with_velocity(gps: _Message) -> _Message:
    """Return fixes with the velocity of speed and course, NaN where the log lacks one."""
    none = np.full(len(gps["t_s"]), np.nan)
    course_rad = np.radians(gps.get("GCrs", none))
    speed_mps = gps.get("Spd", none)
    north, east = speed_mps * np.cos(course_rad), speed_mps * np.sin(course_rad)
    return {"VZ": none, **gps, "VN": north, "VE": east}


def _messages(path: Path, counts: Counts) -> dict[str, _Message]:
    """Return the fields of the messages that are read, in SI, by type; count the others."""
    os.environ.setdefault("PYMAVLINK_FAST_INDEX", "0")  # its compiled index prints on the screen
    module = reader("pymavlink.DFReader", "ardupilot")
    with guard_reading(path, "a DataFlash log"):
        log = module.DFReader_binary(str(path))
        try:
            outside, messages = log.data_len, dict[str, _Message]()
            for kind, offsets in enumerate(log.offsets):
                layout = log.formats.get(kind)
                if layout is None or not offsets:
                    continue
                offsets = [at for at in offsets if at + layout.len <= log.data_len]  # noqa: PLW2901
                outside -= layout.len * len(offsets)
                what = f"{layout.name} message"
                if layout.name in _NEEDED and offsets:
                    messages[layout.name] = _fields(path, layout, log.data_map, offsets)
                    count = len(offsets) - len(messages[layout.name]["t_s"])
                    counts[what, "of another instance"] += count
                elif layout.name not in _DESCRIPTIONS:
                    counts[what, "not read"] += len(offsets)
        finally:
            log.filehandle.close()
    counts["byte", "in no message: the log is damaged there"] += outside
    return messages


def _fields(path: Path, layout: Any, content: Any, offsets: Sequence[int]) -> _Message:  # noqa: ANN401
    """Return the fields of a type's first instance."""
    wrong = f"{path}: message {layout.name}: {{}}; the log is another's"
    sound = struct.calcsize(layout.msg_struct) + _HEAD_BYTES == layout.len
    if not sound or len(layout.columns) != len(layout.msg_mults):
        raise BadInputError(wrong.format("its FMT is damaged"))
    unpack = struct.Struct(layout.msg_struct).unpack_from
    rows = zip(*(unpack(content, at + _HEAD_BYTES) for at in offsets), strict=True)
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
    columns["t_s"] = columns["TimeUS"] * _US
    instance = columns.get("I", np.zeros(len(offsets)))
    return {field: column[instance == instance.min()] for field, column in columns.items()}
