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
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples, vectors
from fgnav.io.gps_time import WEEK_S
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

_US, _MS = 1e-6, 1e-3
_UT_PER_MILLIGAUSS = 0.1
_FIX_3D = 3  # GPS.Status
_HEAD_BYTES = 3  # before a message's fields
_NEEDED = {
    "GPS": ("TimeUS", "Status", "GMS", "GWk", "Lat", "Lng", "Alt"),
    "IMU": ("TimeUS", *(f"{kind}{axis}" for kind in ("Gyr", "Acc") for axis in "XYZ")),
    "GPA": ("TimeUS", "HAcc", "VAcc", "SAcc"),
    "BARO": ("TimeUS", "Alt"),
    "MAG": ("TimeUS", "MagX", "MagY", "MagZ"),
}
_DESCRIPTIONS = ("FMT", "FMTU", "UNIT", "MULT")  # of the other messages


def read_ardupilot(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log; its clock is set by the receiver's week and milliseconds."""
    messages, lost = _messages(path)
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
        imu = messages["IMU"]
        blocks = (col.FORCE, _triple(imu, "Acc")), (col.RATE, _triple(imu, "Gyr"))
        tables["imu"] = samples(imu["TimeUS"] * _US, *blocks)
    if "BARO" in messages:
        air = messages["BARO"]
        tables["barometer"] = samples(air["TimeUS"] * _US, (col.HEIGHT, air["Alt"]))
    if "MAG" in messages:
        magnet = messages["MAG"]
        field = _triple(magnet, "Mag") * _UT_PER_MILLIGAUSS
        tables["magnetometer"] = samples(magnet["TimeUS"] * _US, (col.FIELD, field))
    above_sea = "heights are above the sea: the log has no GPA.Und"
    has_undulation = "Und" in messages.get("GPA", {})
    return Recording(
        source=path,
        tables=tables,
        clock="own" if start_s is None else "gps",
        gps_start_s=start_s or 0.0,
        losses=tuple(Loss(what=w, reason=why, count=count) for w, why, count in lost),
        notes={"fixes": above_sea} if "fixes" in tables and not has_undulation else {},
    )


def _messages(path: Path) -> tuple[dict[str, dict[str, FloatArray]], list[tuple[str, str, int]]]:
    """Return the fields of the messages that are read, in SI, by type, and what is not used."""
    os.environ.setdefault("PYMAVLINK_FAST_INDEX", "0")  # its compiled index prints on the screen
    module = reader("pymavlink.DFReader", "ardupilot")
    lost: list[tuple[str, str, int]] = []
    with foreign(path, "a DataFlash log"):
        log = module.DFReader_binary(str(path))
        try:
            n_bytes, fields_by_type = 0, {}
            for kind, places in enumerate(log.offsets):
                layout = log.formats.get(kind)
                if layout is None or not places:
                    continue
                places = [at for at in places if at + layout.len <= log.data_len]  # noqa: PLW2901
                n_bytes += layout.len * len(places)
                if layout.name not in _NEEDED:
                    is_read = layout.name in _DESCRIPTIONS
                    lost += [(f"{layout.name} message", "not read", 0 if is_read else len(places))]
                elif places:
                    columns = _fields(path, layout, log.data_map, places)
                    of_first = columns.pop("", None)
                    fields_by_type[layout.name] = columns
                    others = 0 if of_first is None else len(places) - int(of_first.sum())
                    lost += [(f"{layout.name} message", "of another instance", others)]
        finally:
            log.filehandle.close()
        lost += [("byte", "in no message: the log is damaged there", log.data_len - n_bytes)]
    return fields_by_type, lost


def _fields(path: Path, layout: Any, content: Any, places: list[int]) -> dict[str, FloatArray]:  # noqa: ANN401
    """Return the fields of a type's first instance; under "", which messages are of it."""
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
    of_first = instance == instance.min()
    return {field: column[of_first] for field, column in columns.items()} | {"": of_first}


def _triple(columns: dict[str, FloatArray], name: str) -> FloatArray:
    return np.stack([columns[f"{name}{axis}"] for axis in "XYZ"], axis=1)


def _fixes(gps: dict[str, FloatArray], accuracy: dict[str, FloatArray]) -> Samples:
    """Return fixes; speed and course are the receiver's velocity, GPA its accuracy."""
    at = gps["TimeUS"]
    height_m = gps["Alt"]
    fixes = {"t_s": at * _US}
    if {"Spd", "GCrs", "VZ"} <= set(gps):
        course_rad = np.radians(gps["GCrs"])
        north_mps, east_mps = gps["Spd"] * np.cos(course_rad), gps["Spd"] * np.sin(course_rad)
        fixes |= vectors(col.VELOCITY, np.stack([north_mps, east_mps, gps["VZ"]], axis=1))
    if accuracy:
        at_fixes = {n: np.interp(at, accuracy["TimeUS"], x) for n, x in accuracy.items()}
        height_m = height_m + at_fixes.get("Und", 0.0)
        sigma_m = np.stack([at_fixes["HAcc"], at_fixes["HAcc"], at_fixes["VAcc"]], axis=1)
        fixes |= vectors(col.POSITION_SIGMA, sigma_m)
        if col.VELOCITY[0] in fixes:
            fixes |= vectors(col.VELOCITY_SIGMA, np.repeat(at_fixes["SAcc"][:, None], 3, axis=1))
    return fixes | vectors(col.PLACE, np.stack([gps["Lat"], gps["Lng"], height_m], axis=1))
