"""ULog files of PX4 [1]_: inertial samples, fixes, barometer, magnetometer, on-board filter.

Axes are forward, right, down. ``eph`` and ``epv`` become the standard deviation of each horizontal
axis and of the height; times since boot become GPS time by the median of ``time_utc_usec``.

References
----------
.. [1] PX4 User Guide, "ULog File Format", and the messages SensorCombined, SensorGps,
   VehicleAirData, VehicleMagnetometer, VehicleAttitude, VehicleGlobalPosition,
   VehicleLocalPosition.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import unused_of
from fgnav.geometry.rotations import to_euler
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, vectors
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.parts import Part, table_of, xyz
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

_US = 1e-6
_UT_PER_GAUSS = 100.0
_FIX_3D = 3  # fix_type: 2 and less have no height
_GPS = ("sensor_gps", "vehicle_gps_position")
_FILTER = ("vehicle_global_position", "vehicle_local_position", "vehicle_attitude")
_TABLES: dict[str, tuple[str, list[Part]]] = {
    "imu": (
        "sensor_combined",
        [Part(col.FORCE, xyz("accelerometer_m_s2[{}]")), Part(col.RATE, xyz("gyro_rad[{}]"))],
    ),
    "barometer": ("vehicle_air_data", [Part(col.HEIGHT, ("baro_alt_meter",))]),
    "magnetometer": (
        "vehicle_magnetometer",
        [Part(col.FIELD, xyz("magnetometer_ga[{}]"), _UT_PER_GAUSS)],
    ),
    "fixes": (
        "sensor_gps",
        [
            Part(col.PLACE, ("latitude_deg", "longitude_deg", "altitude_ellipsoid_m")),
            Part(col.VELOCITY, xyz("vel_{}_m_s", "ned")),
            Part(col.POSITION_SIGMA, ("eph", "eph", "epv")),
            Part(col.VELOCITY_SIGMA, ("s_variance_m_s",) * 3),
        ],
    ),
    "baseline": (
        "sensor_gnss_relative",
        [
            Part(col.BASELINE, xyz("position[{}]")),
            Part(col.POSITION_SIGMA, xyz("position_accuracy[{}]")),
        ],
    ),
}
# Releases that log 1e-7 degrees and millimetres.
_OLD_PLACE = Part(col.PLACE, ("lat", "lon", "alt_ellipsoid"), (1e-7, 1e-7, 1e-3))
_READ = (*(topic for topic, _ in _TABLES.values()), *_GPS, *_FILTER)


def read_ulog(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log's first inertial unit, and its receiver with the most fixes that have a height."""
    pyulog = reader("pyulog", "ulog")
    counts, start_s, tables = Counter[tuple[str, str]](), None, dict[str, Samples]()
    with foreign(path, "ULog") as output, path.open("rb") as file:
        log = pyulog.ULog(file)
        counts["logger dropout", "the logger could not keep up"] += len(log.dropouts)
        damaged = int(log.file_corruption or "corruption" in output.getvalue())
        counts["message", "the log is damaged there"] += damaged
        topics = _topics(log.data_list, counts)
        for kind, (topic, parts) in _TABLES.items():
            if (messages := topics.get(topic)) is None:
                continue
            if kind == "fixes":
                start_s = _start(messages)
                is_new = "latitude_deg" in messages
                parts = parts if is_new else [_OLD_PLACE, *parts[1:]]  # noqa: PLW2901
            tables[kind] = table_of(messages, messages["timestamp"] * _US, parts)
        if all(topic in topics for topic in _FILTER):
            tables["truth"] = _reference(*(topics[topic] for topic in _FILTER))
        else:
            reason = f"a reference needs {', '.join(_FILTER)}"
            for topic in set(_FILTER) & set(topics):
                counts[f"{topic} message", reason] += len(topics[topic]["timestamp"])
    return Recording(
        source=path,
        tables={kind: table for kind, table in tables.items() if len(table["t_s"])},
        clock="own" if start_s is None else "gps",
        gps_start_s=start_s or 0.0,
        baseline_ends_at_fixes=True,  # as u-blox's
        unused=unused_of(counts),
        truth_source="filter" if "truth" in tables else None,
        notes={"truth": "the on-board filter's estimate, not truth"} if "truth" in tables else {},
    )


def _topics(logged: list[Any], counts: Counter[tuple[str, str]]) -> dict[str, dict[str, Any]]:
    """Return the messages that are used, by topic, fixes as of ``sensor_gps``; count the others."""
    used = {one.name: one for one in reversed(logged) if one.name in _READ}  # the first instances
    receivers = [one for one in logged if one.name in _GPS]
    if receivers:
        best = max(receivers, key=lambda one: (one.data["fix_type"] >= _FIX_3D).sum())
        used = {name: one for name, one in used.items() if name not in _GPS} | {_GPS[0]: best}
    for one in logged:
        if one not in used.values():
            reason = "of another instance" if one.name in _READ else "not read"
            counts[f"{one.name} message", reason] += len(one.data["timestamp"])
    topics = {name: one.data for name, one in used.items()}
    if receivers:
        flying = topics[_GPS[0]]["fix_type"] >= _FIX_3D
        topics[_GPS[0]] = {name: x[flying] for name, x in topics[_GPS[0]].items()}
        counts["fix", "has no height (fix_type)"] += int((~flying).sum())
    if (of := topics.get("sensor_gnss_relative")) is not None:
        flags = ("relative_position_valid", "carrier_solution_fixed", "moving_base_mode")
        good = np.all([of[name].astype(bool) for name in flags], axis=0)
        if (has_no_length := of.get("relative_position_normalized")) is not None:
            good &= ~has_no_length.astype(bool)
        topics["sensor_gnss_relative"] = {name: x[good] for name, x in of.items()}
        reason = "is not valid, of a float solution or of a still base"
        counts["baseline", reason] += int((~good).sum())
    return topics


def _start(fixes: dict[str, Any]) -> float | None:
    """Return the GPS time of boot, None where the receiver never knew the time."""
    utc_s, t_s = (
        np.asarray(fixes[name], np.float64) * _US for name in ("time_utc_usec", "timestamp")
    )
    dated = utc_s > 0
    return float(np.median((gps_of_utc(utc_s) - t_s)[dated])) if dated.any() else None


def _reference(at: dict[str, Any], local: dict[str, Any], attitude: dict[str, Any]) -> Samples:
    """Return the filter's estimates at its positions: velocities, attitudes nearest in time."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  # lazy: not every log has one

    def nearest(topic: dict[str, Any], columns: tuple[str, ...], fields: tuple[str, ...]) -> Any:  # noqa: ANN401
        times = topic["timestamp"]
        rows = np.searchsorted(times[1:] / 2 + times[:-1] / 2, at["timestamp"])
        return Part(columns, fields).of(topic)[rows]

    wxyz = nearest(attitude, (), xyz("q[{}]", range(4)))
    R_nb = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
    height = "alt_ellipsoid" if "alt_ellipsoid" in at else "alt"
    place = table_of(at, at["timestamp"] * _US, [Part(col.PLACE, ("lat", "lon", height))])
    velocity = nearest(local, col.VELOCITY, ("vx", "vy", "vz"))
    euler_deg = np.degrees(to_euler(R_nb))
    return {**place, **vectors(col.VELOCITY, velocity), **vectors(col.EULER, euler_deg)}
