"""Estimates as bags, read back by rosbags, and by our own importer."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.io.exports import exporter_named
from tests.io.importers.helpers import imported
from tests.product.test_exports import ORIGIN, START_GPS_S, made


@pytest.fixture
def recorded():
    return made()


@pytest.fixture
def bag(recorded, tmp_path):
    pytest.importorskip("rosbags")
    exporter_named("mcap")(recorded, tmp_path / "e.mcap")
    return recorded, tmp_path / "e.mcap"


def messages(path):
    from rosbags.highlevel import AnyReader

    found = {}
    with AnyReader([path]) as reader:
        for where, _, data in reader.messages():
            found.setdefault(where.topic, []).append(reader.deserialize(data, where.msgtype))
    return found


def enu(ned):
    return np.array([ned[1], ned[0], -ned[2]])


def test_poses_and_twists_are_those_of_the_estimate_in_ros_axes(bag):
    recorded_, path = bag
    estimate, (third, *_) = recorded_.estimate, messages(path)["/fgnav/odometry"][2:]
    pose, twist = third.pose.pose, third.twist.twist
    got = np.array([pose.position.x, pose.position.y, pose.position.z])
    np.testing.assert_allclose(got, enu(estimate.p_n_m[2]), rtol=1e-12)
    # The body's forward axis in the map: the quaternion applied to x.
    w, x, y, z = (getattr(pose.orientation, name) for name in "wxyz")
    forward = [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
    np.testing.assert_allclose(forward, enu(estimate.R_nb[2][:, 0]), atol=1e-12)
    left = [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)]
    np.testing.assert_allclose(left, -enu(estimate.R_nb[2][:, 1]), atol=1e-12)
    v_b = estimate.R_nb[2].T @ estimate.v_n_mps[2]
    got = np.array([twist.linear.x, twist.linear.y, twist.linear.z])
    np.testing.assert_allclose(got, v_b * [1, -1, -1], rtol=1e-12)
    stamp = third.header.stamp.sec + third.header.stamp.nanosec * 1e-9
    assert stamp == pytest.approx(START_GPS_S + 0.2 + 315_964_800 - 18, abs=1e-6)


def test_covariances_turn_with_their_axes(bag):
    recorded_, path = bag
    estimate, third = recorded_.estimate, messages(path)["/fgnav/odometry"][2]
    spread = third.pose.covariance.reshape(6, 6)
    north_east_down = estimate.position_covariance_m2[2]
    assert spread[0, 0] == pytest.approx(north_east_down[1, 1])
    assert spread[0, 2] == pytest.approx(-north_east_down[1, 2])
    R = estimate.R_nb[2]
    tilt = R @ estimate.attitude_covariance_rad2[2] @ R.T  # about north, east, down
    assert spread[4, 4] == pytest.approx(tilt[0, 0])
    assert third.twist.covariance[21] == -1  # of rates nothing is stated


def test_places_come_back_through_the_importer(bag, tmp_path):
    recorded_, path = bag
    _, flight = imported(tmp_path, "mcap", path)
    p_e_m = ORIGIN.to_e(recorded_.estimate.p_n_m)
    np.testing.assert_allclose(flight.origin.to_e(flight.fixes[0].p_n_m), p_e_m, rtol=0, atol=1e-4)
    assert flight.start_gps_s == pytest.approx(START_GPS_S, abs=1e-3)


def test_without_covariance_or_positions_that_is_said(recorded, tmp_path):
    pytest.importorskip("rosbags")
    plain = replace(recorded.estimate, position_covariance_m2=None)
    exporter_named("mcap")(replace(recorded, estimate=plain), tmp_path / "e.mcap")
    found = messages(tmp_path / "e.mcap")
    assert found["/fgnav/fix"][0].position_covariance_type == 0
    assert found["/fgnav/odometry"][0].pose.covariance[0] == -1
    nothing = replace(plain, p_n_m=None)
    with pytest.raises(BadInputError, match="has no positions"):
        exporter_named("mcap")(replace(recorded, estimate=nothing), tmp_path / "n.mcap")
    assert not (tmp_path / "n.mcap").exists()


def test_without_rosbags_it_says_what_to_install(recorded, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(BadInputError, match=r"mcap needs rosbags; pip install"):
        exporter_named("mcap")(recorded, tmp_path / "e.mcap")
