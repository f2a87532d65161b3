"""Bags of ROS 1 and ROS 2 (rosbag, sqlite3, MCAP): messages of ``sensor_msgs`` [1]_.

``Imu``, ``NavSatFix``, ``FluidPressure``, which becomes height by the standard atmosphere [2]_, and
``MagneticField``. Axes of the messages are forward, left, up; times are those of the headers, UTC,
or the recorder's where a header has none.

References
----------
.. [1] ROS REP 103, "Standard Units of Measure and Coordinate Conventions"; sensor_msgs/Imu,
   sensor_msgs/NavSatFix, sensor_msgs/FluidPressure, sensor_msgs/MagneticField.
.. [2] ISO 2533, "Standard Atmosphere", 1975, sections 2 and 3.
"""

from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.io.flight import columns as col
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import Recording, Samples, vectors
from fgnav.io.importers.settings import Settings
from fgnav.progress import report

_TYPES = {
    "imu": "sensor_msgs/msg/Imu",
    "fixes": "sensor_msgs/msg/NavSatFix",
    "barometer": "sensor_msgs/msg/FluidPressure",
    "magnetometer": "sensor_msgs/msg/MagneticField",
}
_SEA_LEVEL_PA = 101_325.0  # ISO 2533
_SCALE_M = 288.15 / 0.0065  # ISO 2533: temperature at sea level by its lapse, K and K/m
_EXPONENT = 287.05287 * 0.0065 / 9.80665  # ISO 2533: gas constant times lapse by gravity
_UT_PER_T = 1e6
_FLU_TO_FRD = np.array([1.0, -1.0, -1.0])
_NO_FIX, _UNKNOWN_COVARIANCE = -1, 0
_DIAGONAL_NED = [4, 0, 8]  # of a covariance east, north, up


def read_bag(path: Path, settings: Settings, _: Path) -> Recording:
    """Read one topic of each type; the settings name it where there are several."""
    highlevel = reader("rosbags.highlevel", "rosbag")
    typesys = reader("rosbags.typesys", "rosbag")
    types = typesys.get_typestore(typesys.Stores.LATEST)
    rows_by_kind: dict[str, list[Any]] = {kind: [] for kind in _TYPES}
    with (
        foreign(path, "a bag"),
        highlevel.AnyReader([path], default_typestore=types) as bag,
    ):
        wanted = {
            kind: _connections(path, bag, kind, settings)
            for kind in _TYPES
            if kind in ("imu", "fixes") or getattr(settings, kind) is not None
        }
        losses = [
            Loss(
                what=f"{kind} row",
                reason=f"[{kind}] of --settings does not state its noise ({path.name})",
                count=count,
            )
            for kind in _TYPES
            if kind not in wanted and (count := _count(bag, kind))
        ]
        chosen = [one for some in wanted.values() for one in some]
        kinds = {one.topic: kind for kind, some in wanted.items() for one in some}
        total = sum(one.msgcount for one in chosen)
        for k, (where, at_ns, data) in enumerate(bag.messages(chosen) if chosen else ()):
            report(k / max(total, 1))
            kind = kinds[where.topic]
            rows_by_kind[kind].append(_row(kind, at_ns, bag.deserialize(data, where.msgtype)))
    rows = {kind: np.array(some) for kind, some in rows_by_kind.items() if some}
    if "fixes" in rows:
        no_fix = rows["fixes"][:, 1] <= _NO_FIX
        rows["fixes"] = rows["fixes"][~no_fix]
        reason = "the receiver had none (status)"
        losses.append(Loss(what="fix", reason=reason, count=no_fix.sum()))
    first_s = min((float(x[0, 0]) for x in rows.values() if len(x)), default=0.0)
    start_s = float(gps_of_utc(np.array([first_s]))[0])
    tables = {kind: _table(kind, x, first_s) for kind, x in rows.items()}
    lost = tuple(one for one in losses if one.count)
    return Recording(source=path, tables=tables, gps_start_s=start_s, losses=lost)


def _count(bag: Any, kind: str) -> int:  # noqa: ANN401
    """Return how many messages there are of a kind."""
    return sum(one.msgcount for one in bag.connections if one.msgtype == _TYPES[kind])


def _connections(path: Path, bag: Any, kind: str, settings: Settings) -> list[Any]:  # noqa: ANN401
    """Return the connections of the topic of a kind.

    Raises
    ------
    BadInputError
        If there are several and none is named, or the one named is not there.
    """
    of_type = [one for one in bag.connections if one.msgtype == _TYPES[kind]]
    topics = sorted({one.topic for one in of_type})
    name = getattr(settings.ros, kind)
    if name is None and len(topics) > 1:
        raise BadInputError(
            f"{path}: has {len(topics)} topics of {_TYPES[kind]}, {', '.join(topics)}; name one as "
            f"{kind} in [ros] of --settings"
        )
    if name is not None and name not in topics:
        raise BadInputError(f"{path}: key ros.{kind}: {name!r} is not one of {', '.join(topics)}")
    return [one for one in of_type if name in (None, one.topic)]


def _row(kind: str, at_ns: int, message: Any) -> list[float]:  # noqa: ANN401  # made by rosbags
    """Return time and what counts of a message."""
    stamp = message.header.stamp
    t_s = stamp.sec + 1e-9 * stamp.nanosec or 1e-9 * at_ns
    if kind == "imu":
        f, w = message.linear_acceleration, message.angular_velocity
        return [t_s, f.x, f.y, f.z, w.x, w.y, w.z]
    if kind == "barometer":
        return [t_s, message.fluid_pressure]
    if kind == "magnetometer":
        field = message.magnetic_field
        return [t_s, field.x, field.y, field.z]
    is_stated = message.position_covariance_type != _UNKNOWN_COVARIANCE
    variance = message.position_covariance if is_stated else np.full(9, np.nan)
    place = [message.latitude, message.longitude, message.altitude]
    return [t_s, message.status.status, *place, *variance[_DIAGONAL_NED].tolist()]


def _table(kind: str, x: FloatArray, first_s: float) -> Samples:
    """Return the flight's columns."""
    table = {"t_s": x[:, 0] - first_s}
    if kind == "imu":
        f_b_mps2, w_b_radps = x[:, 1:4] * _FLU_TO_FRD, x[:, 4:] * _FLU_TO_FRD
        return table | vectors(col.FORCE, f_b_mps2) | vectors(col.RATE, w_b_radps)
    if kind == "barometer":
        height_m = _SCALE_M * (1 - (np.maximum(x[:, 1:], 0.0) / _SEA_LEVEL_PA) ** _EXPONENT)
        return table | vectors(col.HEIGHT, height_m)
    if kind == "magnetometer":
        return table | vectors(col.FIELD, x[:, 1:] * _FLU_TO_FRD * _UT_PER_T)
    table |= vectors(col.PLACE, x[:, 2:5])
    is_stated = np.isfinite(x[:, 5:]).all() and (x[:, 5:] > 0).all()
    return table | vectors(col.POSITION_SIGMA, np.sqrt(x[:, 5:])) if is_stated else table
