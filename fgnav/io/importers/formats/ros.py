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

from collections import Counter
from operator import attrgetter
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, FloatArray, unused_of
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.parts import Part, joined, xyz
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.progress import report

_FLU_TO_FRD = (1.0, -1.0, -1.0)
_TABLES = {
    "imu": (
        "sensor_msgs/msg/Imu",
        [
            Part(col.FORCE, xyz("linear_acceleration.{}", "xyz"), _FLU_TO_FRD),
            Part(col.RATE, xyz("angular_velocity.{}", "xyz"), _FLU_TO_FRD),
        ],
    ),
    "fixes": (
        "sensor_msgs/msg/NavSatFix",
        [
            Part(col.PLACE, ("latitude", "longitude", "altitude")),
            Part(col.POSITION_SIGMA, xyz("variance{}", (4, 0, 8))),  # of east, north, up
        ],
    ),
    "barometer": ("sensor_msgs/msg/FluidPressure", [Part(col.HEIGHT, ("fluid_pressure",))]),
    "magnetometer": (
        "sensor_msgs/msg/MagneticField",
        [Part(col.FIELD, xyz("magnetic_field.{}", "xyz"), (1e6, -1e6, -1e6))],  # T
    ),
}
_TYPES = {kind: msgtype for kind, (msgtype, _) in _TABLES.items()}
_AROUND = ("barometer", "magnetometer")
_NOT_MEASURED = -1.0  # first element of a covariance, sensor_msgs/Imu
_NO_FIX = -1  # of a status; less there is none
_SEA_LEVEL_PA = 101_325.0  # ISO 2533
_SCALE_M = 288.15 / 0.0065  # ISO 2533: temperature at sea level by its lapse, K and K/m
_EXPONENT = 287.05287 * 0.0065 / 9.80665  # ISO 2533: gas constant times lapse by gravity


def read_bag(path: Path, settings: Settings, _: Path) -> Recording:
    """Read one topic of each type; the settings name it where there are several.

    Topics that are not used are counted with their reason.
    """
    highlevel = reader("rosbags.highlevel", "rosbag")
    typesys = reader("rosbags.typesys", "rosbag")
    types = typesys.get_typestore(typesys.Stores.LATEST)
    counts, rows_by_kind = Counter[tuple[str, str]](), dict[str, list[Any]]()
    with foreign(path, "a bag"), highlevel.AnyReader([path], default_typestore=types) as bag:
        kinds = _chosen(path, bag, settings, counts)
        chosen = [one for one in bag.connections if one.topic in kinds]
        total = sum(one.msgcount for one in chosen)
        for k, (where, at_ns, data) in enumerate(bag.messages(chosen) if chosen else ()):
            report(k / max(total, 1))
            message, kind = bag.deserialize(data, where.msgtype), kinds[where.topic]
            if kind == "fixes" and message.status.status <= _NO_FIX:
                counts["fix", "the receiver had none (status)"] += 1
                continue
            stamp = message.header.stamp
            at_s = stamp.sec + 1e-9 * stamp.nanosec or 1e-9 * at_ns
            row = [at_s, *(value for part in _TABLES[kind][1] for value in _values(message, part))]
            rows_by_kind.setdefault(kind, []).append(row)
        if not kinds:
            held = sorted({one.msgtype for one in bag.connections})
            raise BadInputError(
                f"{path}: must hold messages of {', '.join(_TYPES.values())}, has "
                f"{', '.join(held) or 'none'}; record those topics, or convert them"
            )
    rows = {kind: np.array(some) for kind, some in rows_by_kind.items()}
    first_s = min((float(x[0, 0]) for x in rows.values()), default=0.0)
    start_s = float(gps_of_utc(np.array([first_s]))[0])
    tables = {kind: _table(kind, x, first_s, counts) for kind, x in rows.items()}
    return Recording(source=path, tables=tables, gps_start_s=start_s, unused=unused_of(counts))


def _chosen(
    path: Path,
    bag: Any,  # noqa: ANN401
    settings: Settings,
    lost: Counter[tuple[str, str]],
) -> dict[str, str]:
    """Return the kind of each topic that is read; count the messages of the others."""
    names = {msgtype: kind for kind, msgtype in _TYPES.items()}
    topics: dict[str, list[str]] = {kind: [] for kind in _TYPES}
    reasons, counts = dict[str, str](), Counter[str]()
    for one in sorted(bag.connections, key=lambda connection: connection.topic):
        counts[one.topic] += one.msgcount
        kind = names.get(one.msgtype)
        if kind is None:
            reasons[one.topic] = f"{one.msgtype} is not read"
        elif kind in _AROUND and getattr(settings, kind) is None:
            reasons[one.topic] = f"[{kind}] of --settings does not state its noise ({path.name})"
        elif kind == "imu" and _lacks_force(bag, one):
            reasons[one.topic] = "has no specific force (covariance -1)"
        elif one.topic not in topics[kind]:
            topics[kind].append(one.topic)
    kinds = dict[str, str]()
    for kind, some in topics.items():
        name = getattr(settings.ros, kind)
        if name is None and len(some) > 1:
            raise BadInputError(
                f"{path}: has {len(some)} topics of {_TYPES[kind]}, {', '.join(some)}; name one as "
                f"{kind} in [ros] of --settings"
            )
        if name is not None and name not in some:
            raise BadInputError(f"{path}: key ros.{kind}: {name!r} is not one of {', '.join(some)}")
        kinds |= {topic: kind for topic in some if name in (None, topic)}
        reasons |= {t: f"{name} is read as {kind}" for t in some if name not in (None, t)}
    for topic, reason in reasons.items():
        kind = names.get(bag.topics[topic].msgtype, "")
        lost[f"{kind} row" if kind in _AROUND else f"{topic} message", reason] += counts[topic]
    return kinds


def _lacks_force(bag: Any, connection: Any) -> bool:  # noqa: ANN401
    """Return True if the first message has a covariance of specific force of -1."""
    first = next(bag.messages([connection]), None) if connection.msgcount else None
    if first is None:
        return False
    message = bag.deserialize(first[2], connection.msgtype)
    return bool(message.linear_acceleration_covariance[0] == _NOT_MEASURED)


def _values(message: Any, part: Part) -> list[float]:  # noqa: ANN401  # made by rosbags
    """Return what a message has of a part; NaN of what its covariance says is not there."""
    if part.columns == col.POSITION_SIGMA:
        is_stated = message.position_covariance_type != 0
        return [message.position_covariance[k] if is_stated else np.nan for k in (4, 0, 8)]
    covariance = getattr(message, f"{part.fields[0].partition('.')[0]}_covariance", (0.0,))
    if covariance[0] == _NOT_MEASURED:
        return [np.nan] * len(part.fields)
    return [attrgetter(field)(message) for field in part.fields]


def _table(kind: str, x: FloatArray, first_s: float, counts: Counter[tuple[str, str]]) -> Samples:
    """Return the flight's columns of times and values, in the order of its parts."""
    t_s, blocks = x[:, 0] - first_s, []
    ends = np.cumsum([1, *(len(part.columns) for part in _TABLES[kind][1])])
    for part, begin, end in zip(_TABLES[kind][1], ends, ends[1:], strict=False):
        blocks.append((part.columns, x[:, begin:end] * part.unit))
    if kind == "fixes":
        (place, values), (sigma, variances) = blocks
        stated = np.isfinite(variances).all(axis=1) & (variances > 0).all(axis=1)
        sigmas = sigma, t_s[stated], np.sqrt(variances[stated])
        return joined("fix", (place, t_s, values), [sigmas], counts)
    if kind == "barometer":
        pressure = np.maximum(x[:, 1:], 0.0) / _SEA_LEVEL_PA
        return samples(t_s, (col.HEIGHT, _SCALE_M * (1 - pressure**_EXPONENT)))
    return samples(t_s, *(one for one in blocks if not np.isnan(one[1]).all()))
