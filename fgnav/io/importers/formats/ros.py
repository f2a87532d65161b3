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
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, Loss
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings
from fgnav.progress import report

_TYPES = {
    "imu": "sensor_msgs/msg/Imu",
    "fixes": "sensor_msgs/msg/NavSatFix",
    "barometer": "sensor_msgs/msg/FluidPressure",
    "magnetometer": "sensor_msgs/msg/MagneticField",
}
_AROUND = ("barometer", "magnetometer")
_AROUND_TYPES = tuple(_TYPES[kind] for kind in _AROUND)
_NOT_MEASURED = -1.0  # first element of a covariance, sensor_msgs/Imu
_SEA_LEVEL_PA = 101_325.0  # ISO 2533
_SCALE_M = 288.15 / 0.0065  # ISO 2533: temperature at sea level by its lapse, K and K/m
_EXPONENT = 287.05287 * 0.0065 / 9.80665  # ISO 2533: gas constant times lapse by gravity
_UT_PER_T = 1e6
_FLU_TO_FRD = np.array([1.0, -1.0, -1.0])
_NO_FIX, _UNKNOWN_COVARIANCE = -1, 0
_DIAGONAL_NED = [4, 0, 8]  # of a covariance east, north, up


def read_bag(path: Path, settings: Settings, _: Path) -> Recording:
    """Read one topic of each type; the settings name it where there are several.

    Topics that are not used are counted with their reason.
    """
    highlevel = reader("rosbags.highlevel", "rosbag")
    typesys = reader("rosbags.typesys", "rosbag")
    types = typesys.get_typestore(typesys.Stores.LATEST)
    rows_by_kind: dict[str, list[Any]] = {}
    with (
        foreign(path, "a bag"),
        highlevel.AnyReader([path], default_typestore=types) as bag,
    ):
        kinds, losses = _chosen(path, bag, settings)
        chosen = [one for one in bag.connections if one.topic in kinds]
        total = sum(one.msgcount for one in chosen)
        for k, (where, at_ns, data) in enumerate(bag.messages(chosen) if chosen else ()):
            report(k / max(total, 1))
            kind = kinds[where.topic]
            row = _row(kind, at_ns, bag.deserialize(data, where.msgtype))
            rows_by_kind.setdefault(kind, []).append(row)
        if not rows_by_kind:
            held = sorted({one.msgtype for one in bag.connections})
            raise BadInputError(
                f"{path}: must hold messages of {', '.join(_TYPES.values())}, has "
                f"{', '.join(held) or 'none'}; record those topics, or convert them"
            )
    rows = {kind: np.array(some) for kind, some in rows_by_kind.items()}
    if "fixes" in rows:
        no_fix = rows["fixes"][:, 1] <= _NO_FIX
        rows["fixes"] = rows["fixes"][~no_fix]
        reason = "the receiver had none (status)"
        losses.append(Loss(what="fix", reason=reason, count=int(no_fix.sum())))
        stated = _has_variances(rows["fixes"])
        if 2 * stated.sum() > len(stated):
            count, what, reason = int((~stated).sum()), "fix", "has no covariance, as most have"
            rows["fixes"] = rows["fixes"][stated]
        else:
            count, what, reason = int(stated.sum()), "covariance", "of a fix; most have none"
        losses.append(Loss(what=what, reason=reason, count=count))
    first_s = min((float(x[0, 0]) for x in rows.values() if len(x)), default=0.0)
    start_s = float(gps_of_utc(np.array([first_s]))[0])
    tables = {kind: _table(kind, x, first_s) for kind, x in rows.items()}
    return Recording(source=path, tables=tables, gps_start_s=start_s, losses=tuple(losses))


def _chosen(path: Path, bag: Any, settings: Settings) -> tuple[dict[str, str], list[Loss]]:  # noqa: ANN401
    """Return the kind of each topic that is read, and the messages of the others."""
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
    losses = [
        Loss(
            what=f"{names[msgtype]} row" if msgtype in _AROUND_TYPES else f"{topic} message",
            reason=reason,
            count=counts[topic],
        )
        for topic, reason in reasons.items()
        for msgtype in [bag.topics[topic].msgtype]
    ]
    return kinds, losses


def _lacks_force(bag: Any, connection: Any) -> bool:  # noqa: ANN401
    """Return True if the first message has a covariance of specific force of -1."""
    first = next(bag.messages([connection]), None) if connection.msgcount else None
    if first is None:
        return False
    message = bag.deserialize(first[2], connection.msgtype)
    return bool(message.linear_acceleration_covariance[0] == _NOT_MEASURED)


def _row(kind: str, at_ns: int, message: Any) -> list[float]:  # noqa: ANN401  # made by rosbags
    """Return time and what counts of a message; NaN for what its covariance says is not there."""
    stamp = message.header.stamp
    t_s = stamp.sec + 1e-9 * stamp.nanosec or 1e-9 * at_ns
    if kind == "imu":
        f, w = message.linear_acceleration, message.angular_velocity
        has_force = message.linear_acceleration_covariance[0] != _NOT_MEASURED
        has_rate = message.angular_velocity_covariance[0] != _NOT_MEASURED
        force = [f.x, f.y, f.z] if has_force else [np.nan] * 3
        return [t_s, *force, *([w.x, w.y, w.z] if has_rate else [np.nan] * 3)]
    if kind == "barometer":
        return [t_s, message.fluid_pressure]
    if kind == "magnetometer":
        field = message.magnetic_field
        return [t_s, field.x, field.y, field.z]
    is_stated = message.position_covariance_type != _UNKNOWN_COVARIANCE
    variance = message.position_covariance if is_stated else np.full(9, np.nan)
    place = [message.latitude, message.longitude, message.altitude]
    return [t_s, message.status.status, *place, *variance[_DIAGONAL_NED].tolist()]


def _has_variances(fixes: FloatArray) -> BoolArray:
    """Return which fixes have three variances."""
    return np.asarray((fixes[:, 5:] > 0).all(axis=1) & np.isfinite(fixes[:, 5:]).all(axis=1))


def _table(kind: str, x: FloatArray, first_s: float) -> Samples:
    """Return the flight's columns."""
    t_s = x[:, 0] - first_s
    if kind == "imu":
        force, rate = x[:, 1:4] * _FLU_TO_FRD, x[:, 4:] * _FLU_TO_FRD
        rates = () if np.isnan(rate).all() else ((col.RATE, rate),)
        return samples(t_s, (col.FORCE, force), *rates)
    if kind == "barometer":
        pressure = np.maximum(x[:, 1], 0.0) / _SEA_LEVEL_PA
        return samples(t_s, (col.HEIGHT, _SCALE_M * (1 - pressure**_EXPONENT)))
    if kind == "magnetometer":
        return samples(t_s, (col.FIELD, x[:, 1:] * _FLU_TO_FRD * _UT_PER_T))
    sigmas = ((col.POSITION_SIGMA, np.sqrt(x[:, 5:])),) if _has_variances(x).all() else ()
    return samples(t_s, (col.PLACE, x[:, 2:5]), *sigmas)
