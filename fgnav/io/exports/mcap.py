"""Estimates as a ROS 2 bag in one MCAP file: ``nav_msgs/Odometry`` and ``sensor_msgs/NavSatFix``.

ROS has its own axes [1]_: the map's are east, north, up at the flight's origin, the body's forward,
left, up. Times are UTC.

References
----------
.. [1] ROS REP 103, "Standard Units of Measure and Coordinate Conventions"; nav_msgs/Odometry.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.rotations import quaternion_wxyz
from fgnav.io.atomic_write import atomic_file
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.exports.trajectories import Track, track_of

_ENU_OF_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FLU_OF_FRD = np.diag([1.0, -1.0, -1.0])
_KNOWN = 3  # NavSatFix: a full covariance; 0: none
_UNKNOWN_VARIANCE = -1.0  # nav_msgs: "the estimate is not available"
_Classes: TypeAlias = Mapping[str, Callable[..., Any]]  # of messages, which rosbags makes


def write_mcap(recorded: RecordedEstimate, path: Path) -> None:
    """Write ``/fgnav/odometry`` and ``/fgnav/fix``; epochs without a position are left out.

    Examples
    --------
    >>> write_mcap(fgnav.load_estimate("run"), Path("run.mcap"))
    """
    try:
        from rosbags.rosbag2 import StoragePlugin, Writer  # noqa: PLC0415  # lazy: an extra
        from rosbags.typesys import Stores, get_typestore  # noqa: PLC0415
    except ModuleNotFoundError:
        raise BadInputError("mcap needs rosbags; pip install 'fgnav[importers]'") from None
    types = get_typestore(Stores.ROS2_HUMBLE)
    track = track_of(recorded)
    stamps_ns = track.utc.astype("datetime64[ns]").astype(np.int64).tolist()
    with atomic_file(path) as temporary, TemporaryDirectory(dir=temporary.parent) as scratch:
        bag = Path(scratch) / "bag"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            for topic, messages in (
                ("/fgnav/odometry", _odometry(track, stamps_ns, types.types)),
                ("/fgnav/fix", _fixes(track, stamps_ns, types.types)),
            ):
                first, *rest = messages
                kind = first.__msgtype__
                connection = writer.add_connection(topic, kind, typestore=types)
                for at_ns, message in zip(stamps_ns, (first, *rest), strict=True):
                    writer.write(connection, at_ns, types.serialize_cdr(message, kind))
        shutil.copyfile(next(bag.glob("*.mcap")), temporary)


def _header(make: _Classes, at_ns: int, frame: str) -> Any:  # noqa: ANN401
    stamp = make["builtin_interfaces/msg/Time"](sec=at_ns // 10**9, nanosec=at_ns % 10**9)
    return make["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def _in_axes(R: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return (n, 3, 3) covariances in other axes."""
    return np.asarray(R @ covariance @ np.swapaxes(R, -1, -2))


def _six(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return (n, 36) of two blocks; where one is not known, its first element says so."""
    covariances = np.zeros((len(first), 6, 6))
    for at, block in ((0, first), (3, second)):
        is_finite = np.isfinite(block).all(axis=(1, 2))
        covariances[is_finite, at : at + 3, at : at + 3] = block[is_finite]
        covariances[~is_finite, at, at] = _UNKNOWN_VARIANCE
    return covariances.reshape(-1, 36)


def _odometry(track: Track, stamps_ns: list[int], make: _Classes) -> Iterator[Any]:
    """Yield poses in the map's axes and twists in the body's."""
    R_map = _ENU_OF_NED @ track.R_nb
    to_body = _FLU_OF_FRD @ track.R_nb.swapaxes(1, 2)
    columns = (
        track.p_n_m @ _ENU_OF_NED.T,
        quaternion_wxyz(R_map @ _FLU_OF_FRD),
        _six(_in_axes(_ENU_OF_NED, track.P_position), _in_axes(R_map, track.P_attitude)),
        np.einsum("nij,nj->ni", to_body, track.v_n_mps),
        track.rate_b_radps @ _FLU_OF_FRD,
        _six(_in_axes(to_body, track.P_velocity), np.full_like(track.P_velocity, np.nan)),
    )
    vector, point = make["geometry_msgs/msg/Vector3"], make["geometry_msgs/msg/Point"]
    for at_ns, p, q, spread, v, w, spread_v in zip(stamps_ns, *columns, strict=True):
        orientation = make["geometry_msgs/msg/Quaternion"](w=q[0], x=q[1], y=q[2], z=q[3])
        pose = make["geometry_msgs/msg/Pose"](position=point(*p), orientation=orientation)
        twist = make["geometry_msgs/msg/Twist"](linear=vector(*v), angular=vector(*w))
        yield make["nav_msgs/msg/Odometry"](
            header=_header(make, at_ns, "map"),
            child_frame_id="base_link",
            pose=make["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=spread),
            twist=make["geometry_msgs/msg/TwistWithCovariance"](twist=twist, covariance=spread_v),
        )


def _fixes(track: Track, stamps_ns: list[int], make: _Classes) -> Iterator[Any]:
    """Yield places, their covariance east, north, up where the vehicle is."""
    spread = _in_axes(_ENU_OF_NED @ track.R_ln, track.P_position).reshape(-1, 9)
    status = make["sensor_msgs/msg/NavSatStatus"](status=0, service=1)
    for at_ns, (latitude, longitude, height), nine in zip(
        stamps_ns, track.place, spread, strict=True
    ):
        is_finite = np.isfinite(nine).all()
        yield make["sensor_msgs/msg/NavSatFix"](
            header=_header(make, at_ns, "base_link"),
            status=status,
            latitude=latitude,
            longitude=longitude,
            altitude=height,
            position_covariance=nine if is_finite else np.zeros(9),
            position_covariance_type=_KNOWN if is_finite else 0,
        )
