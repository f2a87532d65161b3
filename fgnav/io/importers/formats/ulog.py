"""ULog files of PX4 [1]_: inertial samples, fixes, barometer, magnetometer, on-board filter.

Axes are forward, right, down. ``eph`` and ``epv`` become the standard deviation of each horizontal
axis and of the height; times since boot become GPS time by the median of ``time_utc_usec``.

References
----------
.. [1] PX4 User Guide, "ULog File Format", and the messages SensorCombined, SensorGps,
   VehicleAirData, VehicleMagnetometer, VehicleAttitude, VehicleGlobalPosition,
   VehicleLocalPosition.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import unused_of
from fgnav.geometry.rotations import to_euler
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.fields import Counts, Fields, Message, tables_of, xyz
from fgnav.io.importers.formats.readers import guard_reading, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

_US = 1e-6
_UT_PER_GAUSS = 100.0
_FIX_3D = 3  # fix_type: 2 and less have no height
_GPS, _OLD_GPS = "sensor_gps", "vehicle_gps_position"
_BASELINE_FLAGS = ("relative_position_valid", "carrier_solution_fixed", "moving_base_mode")
_FILTER = ("vehicle_global_position", "vehicle_local_position", "vehicle_attitude")
_LAYOUT = {
    "sensor_combined": (
        Fields("imu", col.FORCE, xyz("accelerometer_m_s2[{}]")),
        Fields("imu", col.RATE, xyz("gyro_rad[{}]")),
    ),
    "vehicle_air_data": (Fields("barometer", col.HEIGHT, ("baro_alt_meter",)),),
    "vehicle_magnetometer": (
        Fields("magnetometer", col.FIELD, xyz("magnetometer_ga[{}]"), _UT_PER_GAUSS),
    ),
    _GPS: (
        Fields("fixes", col.PLACE, ("latitude_deg", "longitude_deg", "altitude_ellipsoid_m")),
        Fields("fixes", col.VELOCITY, xyz("vel_{}_m_s", "ned")),
        Fields("fixes", col.POSITION_SIGMA, ("eph", "eph", "epv")),
        Fields("fixes", col.VELOCITY_SIGMA, ("s_variance_m_s",) * 3),
    ),
    "sensor_gnss_relative": (
        Fields("baseline", col.BASELINE, xyz("position[{}]")),
        Fields("baseline", col.POSITION_SIGMA, xyz("position_accuracy[{}]")),
    ),
}
# Of releases that log 1e-7 degrees and millimetres.
_OLD_FIELDS = {"lat": ("latitude_deg", 1e-7), "lon": ("longitude_deg", 1e-7)}
_OLD_FIELDS["alt_ellipsoid"] = ("altitude_ellipsoid_m", 1e-3)


def read_ulog(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log's first inertial unit, and its receiver with the most fixes that have a height.

    Examples
    --------
    >>> read_ulog(Path("log.ulg"), Settings(), Path()).clock  # doctest: +SKIP
    'gps'
    """
    pyulog = reader("pyulog", "ulog")
    counts, start_s = Counts(), None
    with guard_reading(path, "ULog") as output, path.open("rb") as file:
        log = pyulog.ULog(file)
        counts["logger dropout", "the logger could not keep up"] += len(log.dropouts)
        damaged = int(log.file_corruption or "corruption" in output.getvalue())
        counts["message", "the log is damaged there"] += damaged
        topics = _topics(log.data_list, counts)
        if (fixes := topics.get(_GPS)) is not None:
            start_s = _start(fixes)
        tables = tables_of(topics, _LAYOUT, counts)
        if all(topic in topics for topic in _FILTER):
            tables["truth"] = _reference(*(topics[topic] for topic in _FILTER))
        else:
            reason = f"a reference needs {', '.join(_FILTER)}"
            for topic in set(_FILTER) & set(topics):
                counts[f"{topic} message", reason] += len(topics[topic]["t_s"])
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


def _topics(logged: Sequence[Any], counts: Counts) -> dict[str, dict[str, Any]]:
    """Return the messages that are used, by topic, fixes as of ``sensor_gps``; count the others."""
    receivers = [topic for topic in logged if topic.name in (_GPS, _OLD_GPS)]
    used = {
        t.name: t for t in reversed(logged) if t.name in (*_LAYOUT, *_FILTER)
    }  # first instances
    if receivers:
        used[_GPS] = max(receivers, key=lambda topic: (topic.data["fix_type"] >= _FIX_3D).sum())
    for topic in logged:
        if topic not in used.values():
            is_read = topic.name in (*_LAYOUT, *_FILTER, _OLD_GPS)
            reason = "of another instance" if is_read else "not read"
            counts[f"{topic.name} message", reason] += len(topic.data["timestamp"])
    topics = {name: {**t.data, "t_s": t.data["timestamp"] * _US} for name, t in used.items()}
    if (fixes := topics.get(_GPS)) is not None:
        flying = fixes["fix_type"] >= _FIX_3D
        counts["fix", "has no height (fix_type)"] += int((~flying).sum())
        topics[_GPS] = {name: x[flying] for name, x in fixes.items()}
        for old, (new, scale) in _OLD_FIELDS.items() if "latitude_deg" not in fixes else ():
            topics[_GPS][new] = topics[_GPS][old] * scale
    if (baselines := topics.get("sensor_gnss_relative")) is not None:
        good = np.all([baselines[name].astype(bool) for name in _BASELINE_FLAGS], axis=0)
        good &= np.asarray(baselines.get("relative_position_normalized", 0)) == 0
        topics["sensor_gnss_relative"] = {name: x[good] for name, x in baselines.items()}
        reason = "is not valid, of a float solution or of a still base"
        counts["baseline", reason] += int((~good).sum())
    return topics


def _start(fixes: Message) -> float | None:
    """Return the GPS time of boot, None where the receiver never knew the time."""
    utc_s = np.asarray(fixes["time_utc_usec"], np.float64) * _US
    dated = utc_s > 0
    return float(np.median((gps_of_utc(utc_s) - fixes["t_s"])[dated])) if dated.any() else None


def _reference(position: Message, velocity: Message, attitude: Message) -> Samples:
    """Return the filter's estimates at its positions: velocities, attitudes nearest in time."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  # lazy: not every log has one

    t_s = position["t_s"]

    def nearest(topic: Message, names: Sequence[str]) -> Any:  # noqa: ANN401
        rows = np.searchsorted(topic["t_s"][1:] / 2 + topic["t_s"][:-1] / 2, t_s)
        return np.stack([topic[name] for name in names], axis=1)[rows]

    height = "alt_ellipsoid" if "alt_ellipsoid" in position else "alt"
    R_nb = Rotation.from_quat(nearest(attitude, xyz("q[{}]", range(4))), scalar_first=True)
    return samples(
        t_s,
        (col.PLACE, np.stack([position[name] for name in ("lat", "lon", height)], axis=1)),
        (col.VELOCITY, nearest(velocity, ("vx", "vy", "vz"))),
        (col.EULER, np.degrees(to_euler(R_nb.as_matrix()))),
    )
