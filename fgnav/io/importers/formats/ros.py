"""Bags of ROS 1 and ROS 2 (rosbag, sqlite3, MCAP): messages of ``sensor_msgs`` [1]_.

``Imu``, of which a covariance that begins with -1 says that there is no such sensor, ``NavSatFix``,
``FluidPressure``, which becomes height by the standard atmosphere [2]_, and
``MagneticField``. Axes of the messages are forward, left, up; times are those of the headers, UTC,
or the recorder's where a header has none.

References
----------
.. [1] ROS REP 103, "Standard Units of Measure and Coordinate Conventions"; sensor_msgs/Imu,
   sensor_msgs/NavSatFix, sensor_msgs/FluidPressure, sensor_msgs/MagneticField.
.. [2] ISO 2533, "Standard Atmosphere", 1975, sections 2 and 3.
"""

from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, unused_of
from fgnav.io.flight import columns as col
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.fields import Counts, Fields, tables_of, xyz
from fgnav.io.importers.formats.readers import guard_reading, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.progress import report

_FLU_TO_FRD = (1.0, -1.0, -1.0)
_LAYOUT = {
    "sensor_msgs/msg/Imu": (
        Fields("imu", col.FORCE, xyz("linear_acceleration.{}", "xyz"), _FLU_TO_FRD),
        Fields("imu", col.RATE, xyz("angular_velocity.{}", "xyz"), _FLU_TO_FRD),
    ),
    "sensor_msgs/msg/NavSatFix": (
        Fields("fixes", col.PLACE, ("latitude", "longitude", "altitude")),
        Fields(  # of east, north, up
            "fixes", col.POSITION_SIGMA, xyz("position_covariance.{}", (4, 0, 8)), is_variance=True
        ),
    ),
    "sensor_msgs/msg/FluidPressure": (Fields("barometer", col.HEIGHT, ("fluid_pressure",)),),
    "sensor_msgs/msg/MagneticField": (
        Fields("magnetometer", col.FIELD, xyz("magnetic_field.{}", "xyz"), (1e6, -1e6, -1e6)),  # T
    ),
}
_KINDS = {message: some[0].table for message, some in _LAYOUT.items()}
_OPTIONAL = ("barometer", "magnetometer")
_NOT_MEASURED = -1.0  # first element of a covariance, sensor_msgs/Imu
_NO_FIX = -1  # of a status; less there is none
_SEA_LEVEL_PA = 101_325.0  # ISO 2533
_SCALE_M = 288.15 / 0.0065  # ISO 2533: temperature at sea level by its lapse, K and K/m
_EXPONENT = 287.05287 * 0.0065 / 9.80665  # ISO 2533: gas constant times lapse by gravity


def read_bag(path: Path, settings: Settings, _: Path) -> Recording:
    """Read one topic of each type; the settings name it where there are several.

    Topics that are not used are counted with their reason.

    Examples
    --------
    >>> list(read_bag(Path("drive.mcap"), Settings(), Path()).tables)  # doctest: +SKIP
    ['imu', 'fixes']
    """
    highlevel = reader("rosbags.highlevel", "rosbag")
    typesys = reader("rosbags.typesys", "rosbag")
    types = typesys.get_typestore(typesys.Stores.LATEST)
    counts, rows = Counts(), defaultdict[str, list[list[float]]](list)
    with guard_reading(path, "a bag"), highlevel.AnyReader([path], default_typestore=types) as bag:
        topics = _topics(path, bag, settings, counts)
        chosen = [connection for connection in bag.connections if connection.topic in topics]
        if not chosen:
            held = sorted({connection.msgtype for connection in bag.connections})
            raise BadInputError(
                f"{path}: must hold messages of {', '.join(_LAYOUT)}, has "
                f"{', '.join(held) or 'none'}; record those topics, or convert them"
            )
        total = sum(connection.msgcount for connection in chosen)
        for k, (connection, at_ns, data) in enumerate(bag.messages(chosen)):
            report(k / max(total, 1))
            message, kind = bag.deserialize(data, connection.msgtype), connection.msgtype
            if _KINDS[kind] == "fixes" and message.status.status <= _NO_FIX:
                counts["fix", "the receiver had none (status)"] += 1
                continue
            stamp = message.header.stamp
            at_s = stamp.sec + 1e-9 * stamp.nanosec or 1e-9 * at_ns
            names = [name for fields in _LAYOUT[kind] for name in fields.names]
            rows[kind].append([at_s, *(_value(message, name) for name in names)])
    first_s = min((some[0][0] for some in rows.values()), default=0.0)
    messages = {}
    for kind, some in rows.items():
        names = [name for fields in _LAYOUT[kind] for name in fields.names]
        columns = dict(zip(("t_s", *names), np.array(some).T, strict=True))
        messages[kind] = {**columns, "t_s": columns["t_s"] - first_s}
    tables = tables_of(messages, _LAYOUT, counts)
    if "barometer" in tables:
        pressure = np.maximum(tables["barometer"]["height_m"], 0.0) / _SEA_LEVEL_PA
        height_m = _SCALE_M * (1 - pressure**_EXPONENT)
        tables["barometer"] = {**tables["barometer"], "height_m": height_m}
    start_s = float(gps_of_utc(np.array([first_s]))[0])
    return Recording(source=path, tables=tables, gps_start_s=start_s, unused=unused_of(counts))


def _topics(path: Path, bag: Any, settings: Settings, counts: Counts) -> set[str]:  # noqa: ANN401
    """Return the topics that are read; count the messages of the others."""
    topics: dict[str, list[str]] = {kind: [] for kind in _KINDS.values()}
    reasons = dict[str, str]()
    for connection in sorted(bag.connections, key=lambda connection: connection.topic):
        topic, kind = connection.topic, _KINDS.get(connection.msgtype)
        if kind is None:
            reasons[topic] = f"{connection.msgtype} is not read"
        elif kind in _OPTIONAL and getattr(settings, kind) is None:
            reasons[topic] = f"[{kind}] of --settings does not state its noise ({path.name})"
        elif kind == "imu" and _lacks_force(bag, connection):
            reasons[topic] = "has no specific force (covariance -1)"
        elif topic not in topics[kind]:
            topics[kind].append(topic)
    for kind, some in topics.items():
        name = _chosen(path, kind, some, getattr(settings.ros, kind))
        reasons |= {topic: f"{name} is read as {kind}" for topic in some if topic != name}
    for connection in bag.connections:
        if reason := reasons.get(connection.topic):
            kind = _KINDS.get(connection.msgtype, "")
            what = f"{kind} row" if kind in _OPTIONAL else f"{connection.topic} message"
            counts[what, reason] += connection.msgcount
    return {topic for some in topics.values() for topic in some} - set(reasons)


def _chosen(path: Path, kind: str, topics: Sequence[str], name: str | None) -> str | None:
    """Return the topic of a kind that is read: the one that the settings name, or the only one."""
    if name is None and len(topics) > 1:
        message = next(message for message, table in _KINDS.items() if table == kind)
        raise BadInputError(
            f"{path}: has {len(topics)} topics of {message}, {', '.join(topics)}; name one as "
            f"{kind} in [ros] of --settings"
        )
    if name is not None and name not in topics:
        raise BadInputError(f"{path}: key ros.{kind}: {name!r} is not one of {', '.join(topics)}")
    return name or next(iter(topics), None)


def _lacks_force(bag: Any, connection: Any) -> bool:  # noqa: ANN401
    """Return True if the first message has a covariance of specific force of -1."""
    first = next(bag.messages([connection]), None) if connection.msgcount else None
    if first is None:
        return False
    message = bag.deserialize(first[2], connection.msgtype)
    return bool(message.linear_acceleration_covariance[0] == _NOT_MEASURED)


def _value(message: Any, name: str) -> float:  # noqa: ANN401  # made by rosbags
    """Return the value of a field, NaN of what its covariance says is not there."""
    field, _, inner = name.partition(".")
    covariance = getattr(message, f"{field}_covariance", (0.0,))
    if covariance[0] == _NOT_MEASURED or getattr(message, f"{field}_type", 1) == 0:
        return np.nan
    value = getattr(message, field)
    if inner.isdigit():
        return float(value[int(inner)])
    return float(getattr(value, inner) if inner else value)
