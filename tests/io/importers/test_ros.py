"""Bags written by rosbags, of ROS 1, and of ROS 2 in both of its storages."""

import numpy as np
import pytest

from fgnav.geometry.earth import ecef
from tests.io.importers.helpers import AROUND, imported, refused

START_S = 1_751_000_000  # UTC, 2025: GPS is 18 s ahead
COVARIANCE = np.array([4.0, 0, 0, 0, 9.0, 0, 0, 0, 16.0])  # east, north, up


def messages(types, k, status=0):
    """Return an inertial sample and a fix at 0.1 k seconds."""
    make = types.types
    stamp = make["builtin_interfaces/msg/Time"](sec=START_S + k // 10, nanosec=k % 10 * 100_000_000)
    fields = {"seq": k} if "seq" in make["std_msgs/msg/Header"].__dataclass_fields__ else {}
    header = make["std_msgs/msg/Header"](stamp=stamp, frame_id="imu", **fields)
    vector, nine = make["geometry_msgs/msg/Vector3"], np.zeros(9)
    imu = make["sensor_msgs/msg/Imu"](
        header=header,
        orientation=make["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=nine,
        angular_velocity=vector(x=0.1, y=0.2, z=0.3),
        angular_velocity_covariance=nine,
        linear_acceleration=vector(x=1.0, y=2.0, z=9.75),
        linear_acceleration_covariance=nine,
    )
    fix = make["sensor_msgs/msg/NavSatFix"](
        header=header,
        status=make["sensor_msgs/msg/NavSatStatus"](status=status, service=1),
        latitude=47.0,
        longitude=8.0,
        altitude=450.0,
        position_covariance=COVARIANCE,
        position_covariance_type=0 if k == 19 else 2,
    )
    return imu, fix


def around(types, k):
    """Return a pressure and a field at 0.1 k seconds."""
    header = messages(types, k)[0].header
    make = types.types
    air = make["sensor_msgs/msg/FluidPressure"](
        header=header, fluid_pressure=89_874.6, variance=0.0
    )
    field = make["sensor_msgs/msg/MagneticField"](
        header=header,
        magnetic_field=make["geometry_msgs/msg/Vector3"](x=25e-6, y=12.5e-6, z=-50e-6),
        magnetic_field_covariance=np.zeros(9),
    )
    return air, field


def bag(place, kind, topics=("/imu",), *, surroundings=False):
    """Write two seconds of a level unit that stands still; the first fix is none."""
    rosbag1, rosbag2, typesys = (
        pytest.importorskip(f"rosbags.{name}") for name in ("rosbag1", "rosbag2", "typesys")
    )
    Stores, get_typestore = typesys.Stores, typesys.get_typestore
    types = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    encode = types.serialize_ros1 if kind == "bag" else types.serialize_cdr
    if kind == "bag":
        writer = rosbag1.Writer(place)
    else:
        plugin = {"mcap": rosbag2.StoragePlugin.MCAP, "db3": rosbag2.StoragePlugin.SQLITE3}[kind]
        writer = rosbag2.Writer(place, version=9, storage_plugin=plugin)
    with writer:
        units = [writer.add_connection(t, "sensor_msgs/msg/Imu", typestore=types) for t in topics]
        gnss = writer.add_connection("/gps/fix", "sensor_msgs/msg/NavSatFix", typestore=types)
        other = [
            writer.add_connection(f"/{name}", f"sensor_msgs/msg/{name}", typestore=types)
            for name in ("FluidPressure", "MagneticField")
            if surroundings
        ]
        for k in range(20):
            imu, fix = messages(types, k, status=0 if k else -1)
            at_ns = START_S * 10**9 + k * 10**8
            for unit in units:
                writer.write(unit, at_ns, encode(imu, imu.__msgtype__))
            writer.write(gnss, at_ns, encode(fix, fix.__msgtype__))
            for where, one in zip(other, around(types, k), strict=False):
                writer.write(where, at_ns, encode(one, one.__msgtype__))


@pytest.mark.parametrize("kind", ["bag", "mcap", "db3"])
def test_units_and_fixes_come_out_as_recorded(tmp_path, kind):
    place = tmp_path / ("log.bag" if kind == "bag" else "log")
    bag(place, kind)
    whole, flight = imported(tmp_path, "rosbag", place)
    assert flight.start_gps_s == pytest.approx(START_S - 315_964_800 + 18 + 0.1, abs=1e-6)
    np.testing.assert_allclose(flight.imu.t_s[:2], [-0.1, 0.0], atol=1e-6)
    np.testing.assert_allclose(flight.imu.f_b_mps2[3], [1, -2, -9.75], rtol=1e-9)
    np.testing.assert_allclose(flight.imu.w_b_radps[3], [0.1, -0.2, -0.3], rtol=1e-9)
    p_e_m = ecef(np.radians([47.0]), np.radians([8.0]), np.array([450.0]))[0]
    np.testing.assert_allclose(flight.origin.to_e(flight.fixes[0].p_n_m)[0], p_e_m, atol=1e-6)
    np.testing.assert_allclose(flight.fixes[0].position_sigma_m[0], [3, 2, 4])
    lost = {loss.reason: loss.count for loss in whole.losses}
    assert lost == {"the receiver had none (status)": 1, "has no sigma_n_m, as most have": 1}


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_barometer_and_magnetometer_come_with_their_stated_noise(kind, tmp_path):
    """ISO 2533's table: 89874.6 Pa at 1000 m."""
    place = tmp_path / ("log.bag" if kind == "bag" else "log")
    bag(place, kind, surroundings=True)
    _, flight = imported(tmp_path, "rosbag", place, toml=AROUND)
    np.testing.assert_allclose(flight.barometer.height_m, 1000, atol=0.02)
    np.testing.assert_allclose(flight.magnetometer.field_b_ut[3], [25, -12.5, 50], rtol=1e-9)


def test_instruments_of_unstated_noise_are_left_out_and_counted(tmp_path):
    bag(tmp_path / "log", "mcap", surroundings=True)
    whole, flight = imported(tmp_path, "rosbag", tmp_path / "log")
    assert (flight.barometer, flight.magnetometer) == (None, None)
    lost = {loss.what: loss.count for loss in whole.losses}
    assert (lost["barometer row"], lost["magnetometer row"]) == (20, 20)


def test_a_file_of_a_bag_alone_is_told_by_its_first_bytes(tmp_path):
    from fgnav.io.importers.recognise import recognised

    bag(tmp_path / "log", "mcap")
    file = next((tmp_path / "log").glob("*.mcap"))
    assert recognised(file, tmp_path)[0] == "mcap"
    assert recognised(tmp_path / "log", tmp_path)[0] == "rosbag"
    _, flight = imported(tmp_path, "mcap", file)
    assert len(flight.imu.t_s) == 20


def test_of_two_units_the_settings_name_one(tmp_path, capsys):
    bag(tmp_path / "log", "mcap", topics=("/front", "/rear"))
    line = refused(capsys, tmp_path, tmp_path / "log")
    assert "has 2 topics of sensor_msgs/msg/Imu, /front, /rear; name one as imu in [ros]" in line
    _, flight = imported(tmp_path, "rosbag", tmp_path / "log", toml='[ros]\nimu = "/rear"\n')
    assert len(flight.imu.t_s) == 20
    (tmp_path / "s.toml").write_text('[ros]\nimu = "/left"\n')
    words = ("--settings", str(tmp_path / "s.toml"))
    line = refused(capsys, tmp_path, tmp_path / "log", *words)
    assert "key ros.imu: '/left' is not one of /front, /rear" in line


@pytest.mark.parametrize("cut", [40, 2000])
def test_damage_is_one_line(tmp_path, capsys, cut):
    bag(tmp_path / "log.bag", "bag")
    content = (tmp_path / "log.bag").read_bytes()
    (tmp_path / "log.bag").write_bytes(content[:cut])
    assert "log.bag: cannot be read as a bag" in refused(capsys, tmp_path, tmp_path / "log.bag")
