"""Logs of the same two seconds in three formats: a still, level unit and a fix a second.

The first fix has no height. Each is made as its format says, ROS's by rosbags.
"""

import struct

import numpy as np
import pytest

FORCE, RATE = (1.0, 2.0, -9.75), (0.1, 0.2, 0.3)
PLACE, VELOCITY = (47.0, 8.0, 450.0), (3.0, -4.0, 0.5)
SIGMA, SPREAD_MPS = (1.5, 1.5, 2.5), 0.25
FIELD_UT, HEIGHT_M = (25.0, -12.5, 50.0), 1000.0
UTC_S = 1_751_000_000  # 2025: GPS is 18 s ahead
START_GPS_S = UTC_S - 315_964_800 + 18

_SPEED = "float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
_SPEED += "uint64_t time_utc_usec;uint8_t fix_type;"
_OLD = "uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt_ellipsoid;" + _SPEED
_NEW = "uint64_t timestamp;double latitude_deg;double longitude_deg;double altitude_ellipsoid_m;"
_ULOG = {
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;float[3] accelerometer_m_s2;",
    "gps": "",
    "vehicle_attitude": "uint64_t timestamp;float[4] q;",
    "vehicle_global_position": "uint64_t timestamp;double lat;double lon;float alt_ellipsoid;",
    "vehicle_local_position": "uint64_t timestamp;float vx;float vy;float vz;",
    "vehicle_air_data": "uint64_t timestamp;float baro_alt_meter;",
    "vehicle_magnetometer": "uint64_t timestamp;float[3] magnetometer_ga;",
    "sensor_gnss_relative": "uint64_t timestamp;float[3] position;float[3] position_accuracy;"
    "bool relative_position_valid;bool carrier_solution_fixed;bool moving_base_mode;",
}


def _message(kind, body):
    return struct.pack("<Hc", len(body), kind) + body


def ulog(year=2024):
    """Return a log of PX4 with its filter's estimates and a moving base, by PX4's user guide."""
    gps = "sensor_gps" if year > 2021 else "vehicle_gps_position"
    formats = {gps if name == "gps" else name: fields for name, fields in _ULOG.items()}
    formats[gps] = _NEW + _SPEED if year > 2021 else _OLD
    place = struct.pack("<3d", *PLACE)
    if year <= 2021:
        place = struct.pack(
            "<3i", *(round(x * s) for x, s in zip(PLACE, (1e7, 1e7, 1e3), strict=True))
        )
    out = b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0) + _message(b"B", bytes(40))
    for topic, fields in formats.items():
        out += _message(b"F", f"{topic}:{fields}".encode())
    for k, topic in enumerate(formats):
        out += _message(b"A", struct.pack("<BH", 0, k) + topic.encode())
    for k in range(200):
        out += _message(b"D", struct.pack("<HQ6f", 0, 10_000 * k, *RATE, *FORCE))
    for k in range(3):
        t_us = 1_000_000 * k
        fix = struct.pack("<6f", SPREAD_MPS, SIGMA[0], SIGMA[2], *VELOCITY)
        fix += struct.pack("<QB", (UTC_S + k) * 1_000_000, 3 if k else 2)
        rows = [place + fix, struct.pack("<4f", np.cos(0.2), 0, 0, np.sin(0.2))]
        rows += [struct.pack("<ddf", *PLACE), struct.pack("<3f", *VELOCITY)]
        rows += [struct.pack("<f", HEIGHT_M), struct.pack("<3f", *(x / 100 for x in FIELD_UT))]
        rows += [struct.pack("<6f3?", 0.1, -1.5, 0.02, 0.01, 0.01, 0.02, True, k != 1, True)]
        for topic, row in enumerate(rows, start=1):
            out += _message(b"D", struct.pack("<HQ", topic, t_us) + row)
    return out


_WEEK, _MS = divmod(START_GPS_S, 604_800)
_DATAFLASH = {  # type: name, format, columns; the codes of struct
    1: ("IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "<QB6f"),
    2: ("GPS", "QBBIHLLefff", "TimeUS,I,Status,GMS,GWk,Lat,Lng,Alt,Spd,GCrs,VZ", "<QBBIHiiifff"),
    3: ("GPA", "QBCCCf", "TimeUS,I,HAcc,VAcc,SAcc,Und", "<QBHHHf"),
    4: ("BARO", "QBff", "TimeUS,I,Alt,Press", "<QB2f"),
    5: ("MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ", "<QB3h"),
}
_OF_2014 = {
    1: ("IMU", "Iffffff", "TimeMS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ", "<I6f"),
    2: ("GPS", "BIHLLeeEfI", "Status,TimeMS,Week,Lat,Lng,Alt,Spd,GCrs,VZ,T", "<BIHiiiiIfI"),
}


def _dataflash_formats(formats):
    out = b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns"
    )
    for kind, (name, *texts, code) in formats.items():
        values = (kind, struct.calcsize(code) + 3, *(text.encode() for text in (name, *texts)))
        out += b"\xa3\x95\x80" + struct.pack("<BB4s16s64s", *values)
    return out


def ardupilot(*, accuracy=True, status=3, year=2024):
    """Return a log of ArduPilot with two units, or one of 2014, as its FMT messages say."""
    formats = _DATAFLASH if year > 2014 else _OF_2014
    out = _dataflash_formats(formats)

    def record(kind, *values):
        return b"\xa3\x95" + bytes([kind]) + struct.pack(formats[kind][3], *values)

    lat, lng, alt = (round(x * s) for x, s in zip(PLACE, (1e7, 1e7, 1e2), strict=True))
    speed, course = float(np.hypot(*VELOCITY[:2])), np.degrees(np.arctan2(VELOCITY[1], VELOCITY[0]))
    if year <= 2014:
        for k in range(100):
            out += record(1, 5000 + 20 * k, *RATE, *FORCE)
        for k in range(2):
            motion = (round(100 * speed), round(100 * (course % 360)), VELOCITY[2])
            time = (1000 * (_MS + k), _WEEK)
            out += record(2, 3, *time, lat, lng, alt, *motion, 5000 + 1000 * k)
        return out
    for k in range(100):
        for unit in (0, 1):
            out += record(1, 20_000 * k, unit, *RATE[:2], RATE[2] + unit, *FORCE)
    for k in range(3):
        t_us, gms = 1_000_000 * k, 1000 * (_MS + k)
        fix = (gms, _WEEK, lat, lng, alt - 4750, speed, course, VELOCITY[2])
        out += record(2, t_us, 0, status if k else 1, *fix)
        out += record(4, t_us, 0, HEIGHT_M, 96_000.0)
        out += record(5, t_us, 0, *(round(10 * x) for x in FIELD_UT))
        if accuracy:
            centimetres = (round(100 * x) for x in (SIGMA[0], SIGMA[2], SPREAD_MPS))
            out += record(3, t_us, 0, *centimetres, 47.5)
    return out


def _bag_messages(make, k):
    """Return an inertial sample, a fix, a pressure and a field at 0.1 k seconds."""
    stamp = make["builtin_interfaces/msg/Time"](sec=UTC_S + k // 10, nanosec=k % 10 * 100_000_000)
    fields = {"seq": k} if "seq" in make["std_msgs/msg/Header"].__dataclass_fields__ else {}
    header = make["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **fields)
    vector, nine = make["geometry_msgs/msg/Vector3"], np.zeros(9)

    def flu(x, y, z):
        return vector(x=x, y=-y, z=-z)

    yield make["sensor_msgs/msg/Imu"](
        header=header,
        orientation=make["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=nine,
        angular_velocity=flu(*RATE),
        angular_velocity_covariance=nine,
        linear_acceleration=flu(*FORCE),
        linear_acceleration_covariance=nine,
    )
    north, east, down = (x**2 for x in SIGMA)
    yield make["sensor_msgs/msg/NavSatFix"](
        header=header,
        status=make["sensor_msgs/msg/NavSatStatus"](status=0 if k else -1, service=1),
        **dict(zip(("latitude", "longitude", "altitude"), PLACE, strict=True)),
        position_covariance=np.diag([east, north, down]).ravel(),
        position_covariance_type=0 if k == 19 else 2,
    )
    yield make["sensor_msgs/msg/FluidPressure"](
        header=header, fluid_pressure=89_874.6, variance=0.0
    )
    yield make["sensor_msgs/msg/MagneticField"](
        header=header,
        magnetic_field=flu(*(x * 1e-6 for x in FIELD_UT)),
        magnetic_field_covariance=nine,
    )


def bag(place, kind, topics=("/imu",)):
    """Write a bag of ROS 1, or of ROS 2 in one of its storages."""
    rosbag1, rosbag2, typesys = (
        pytest.importorskip(f"rosbags.{name}") for name in ("rosbag1", "rosbag2", "typesys")
    )
    is_first = kind == "bag"
    stores = typesys.Stores
    types = typesys.get_typestore(stores.ROS1_NOETIC if is_first else stores.ROS2_HUMBLE)
    encode = types.serialize_ros1 if is_first else types.serialize_cdr
    plugin = rosbag2.StoragePlugin.MCAP if kind == "mcap" else rosbag2.StoragePlugin.SQLITE3
    options = {} if is_first else {"version": 9, "storage_plugin": plugin}
    with (rosbag1 if is_first else rosbag2).Writer(place, **options) as writer:
        connections = {}
        for k in range(20):
            for one in _bag_messages(types.types, k):
                name = one.__msgtype__.rpartition("/")[2]
                for topic in topics if name == "Imu" else (f"/{name}",):
                    if topic not in connections:
                        connections[topic] = writer.add_connection(
                            topic, one.__msgtype__, typestore=types
                        )
                    at_ns = UTC_S * 10**9 + k * 10**8
                    writer.write(connections[topic], at_ns, encode(one, one.__msgtype__))
