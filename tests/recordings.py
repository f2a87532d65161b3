"""Real recordings as flights, as a user would bring them: of the shared data and of GTSAM."""

import struct
from pathlib import Path

import gtsam
import numpy as np

from fgnav.geometry.earth import Origin, ecef
from fgnav.io.flight.series import within_a_sample_s
from fgnav.io.gps_time import GPS_EPOCH
from fgnav.io.importers.settings import Settings
from fgnav.types.flight import Antenna, Fixes, Flight, Imu
from tests.io.importers.helpers import whole_of
from tests.umn import read_umn

G_MPS2 = 9.80665
UNIX_OF_GPS_S = 315_964_800.0
# Data sheet of a consumer unit (TDK ICM-42688-P: 70 ug and 2.8 mdps per root Hz).
DATA_SHEET = {
    "accelerometer_noise_mps2_per_sqrt_hz": 7e-4,
    "accelerometer_bias_mps2": 0.2,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 1e-3,
    "gyroscope_noise_radps_per_sqrt_hz": 5e-5,
    "gyroscope_bias_radps": 0.01,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-5,
}


def drive(shared: Path, *, stretched: bool = False, mounted: bool = True) -> Flight:
    """Return the car: stretched, its samples lie evenly as its authors lay them, else by counter.

    Not mounted, its axes are the unit's own.
    """
    folder = shared / "flights" / "drive_0708"
    text = [line.split() for line in (folder / "gnss_1934_sf.pos").read_text().splitlines()[1:]]
    date = np.array([f"{r[0].replace('/', '-')}T{r[1]}" for r in text], dtype="datetime64[ms]")
    x = np.array([r[2:] for r in text], dtype=float)
    t_s = (date - date[0]) / np.timedelta64(1, "s")
    start_gps_s = float((date[0] - GPS_EPOCH) / np.timedelta64(1, "s"))
    place = np.column_stack([np.radians(x[:, 0]), np.radians(x[:, 1]), x[:, 2]])
    origin = Origin(latitude_rad=place[0, 0], longitude_rad=place[0, 1], height_m=place[0, 2])
    turned = origin.local_ned(origin.to_n(ecef(*place.T)))
    velocity = np.column_stack([x[:, 13], x[:, 14], -x[:, 15]])
    tag = (folder / "imu_1934.csv.tag").read_bytes()
    seconds, fraction = struct.unpack("<Id", tag[64:76])
    imu_start_s = seconds + fraction - UNIX_OF_GPS_S - start_gps_s
    lines = (folder / "imu_1934.csv").read_text().splitlines()
    rows = [line.split(",") for line in lines]
    samples = np.array([row for row in rows if len(row) == 7][:-1], dtype=float)
    counted_s = (samples[:, 6] - samples[0, 6]) / 1e3
    imu_s = imu_start_s + counted_s
    if stretched:
        entries = np.frombuffer(tag[76 : 76 + 8 * ((len(tag) - 76) // 8)], "<u4").reshape(-1, 2)
        imu_s = imu_start_s + np.linspace(0.0, entries[-1, 0] / 1e3, len(samples))
    R_bu = _of_unit(180.0, -6.79, 185.35) if mounted else np.eye(3)
    return Flight(
        name="drive",
        start_gps_s=start_gps_s,
        origin=origin,
        antennas=(Antenna(name="gps", position_b_m=np.zeros(3)),),
        imu=Imu(
            t_s=imu_s,
            f_b_mps2=G_MPS2 * samples[:, :3] @ R_bu.T,
            w_b_radps=np.radians(samples[:, 3:6]) @ R_bu.T,
            clock_offset_sigma_s=within_a_sample_s(imu_s),
            **DATA_SHEET,
        ),
        fixes=(
            Fixes(
                t_s=t_s,
                antenna="gps",
                p_n_m=origin.to_n(ecef(*place.T)),
                v_n_mps=np.einsum("nij,nj->ni", turned, velocity),
                position_sigma_m=np.maximum(x[:, [5, 6, 7]], 1e-3),
                velocity_sigma_mps=x[:, 16:19],
            ),
        ),
    )


def quadrotor(shared: Path, path: str) -> Flight:
    """Return one path of the quadrotor: positions alone, axes turned to forward-right-down."""
    folder = shared / "flights" / "quadrotor" / path
    imu = np.genfromtxt(folder / "IMU_1.csv", delimiter=",", skip_header=1)
    fixes = np.genfromtxt(folder / "GT.csv", delimiter=",", skip_header=1)
    down = np.array([1.0, -1.0, -1.0])
    return Flight(
        name=path,
        start_gps_s=1e9,
        origin=Origin(latitude_rad=0.57, longitude_rad=0.61, height_m=100.0),
        antennas=(Antenna(name="rtk", position_b_m=np.zeros(3)),),
        imu=Imu(
            t_s=imu[:, 0],
            f_b_mps2=imu[:, 4:7] * down,
            w_b_radps=np.radians(imu[:, 7:10]) * down,
            clock_offset_sigma_s=within_a_sample_s(imu[:, 0]),
            **DATA_SHEET,
        ),
        fixes=(
            Fixes(
                t_s=fixes[:, 0],
                antenna="rtk",
                p_n_m=fixes[:, -3:],
                v_n_mps=None,
                position_sigma_m=np.tile([0.02, 0.02, 0.04], (len(fixes), 1)),
                velocity_sigma_mps=None,
            ),
        ),
    )


def uav_field(shared: Path, t_s: np.ndarray) -> np.ndarray:
    """Return what the UAV's magnetometer measured at times, (k, 3), in its own axes and gauss."""
    from scipy.io import loadmat

    file = shared / "flights" / "thor75" / "thor_flight75.mat"
    data = loadmat(file, struct_as_record=False, squeeze_me=True)["flight_data"]
    first = int(np.flatnonzero(np.diff(data.GPS_TOW, prepend=0.0))[0])
    since_s = data.time - data.time[first]
    return np.column_stack([np.interp(t_s, since_s, h) for h in (data.hx, data.hy, data.hz)])


def uav(shared: Path) -> Flight:
    """Return flight 75 of Thor, a UAV, with its on-board filter as reference."""
    settings = Settings()
    file = shared / "flights" / "thor75" / "thor_flight75.mat"
    return whole_of([read_umn(file, settings, file.parent)], settings).flight


def kitti(until_s: float = np.inf, *, position_sigma_m: float = 0.01) -> Flight:
    """Return the drive that GTSAM's package has of KITTI: positions once a second, no velocities.

    Geiger, Lenz, Stiller, Urtasun: Vision meets Robotics, IJRR 2013. Noise as its metadata say.
    """
    imu = np.loadtxt(_of_gtsam("KittiEquivBiasedImu.txt"), skiprows=1)
    fixes = np.loadtxt(_of_gtsam("KittiGps_converted.txt"), skiprows=1, delimiter=",")
    sheet = dict(zip(*_metadata(_of_gtsam("KittiEquivBiasedImu_metadata.txt")), strict=True))
    begin_s, down = fixes[0, 0], np.array([1.0, -1.0, -1.0])
    imu, fixes = (part[part[:, 0] - begin_s < until_s] for part in (imu, fixes))
    imu_s = imu[:, 0] - begin_s
    return Flight(
        name="kitti",
        start_gps_s=1e9,
        origin=Origin(latitude_rad=np.radians(49.0), longitude_rad=np.radians(8.4), height_m=110.0),
        antennas=(Antenna(name="gps", position_b_m=np.zeros(3)),),
        imu=Imu(
            t_s=imu_s,
            f_b_mps2=imu[:, 2:5] * down,
            w_b_radps=imu[:, 5:8] * down,
            accelerometer_noise_mps2_per_sqrt_hz=sheet["AccelerometerSigma"],
            gyroscope_noise_radps_per_sqrt_hz=sheet["GyroscopeSigma"],
            accelerometer_bias_mps2=0.05,
            gyroscope_bias_radps=0.001,
            accelerometer_bias_walk_mps2_per_sqrt_s=sheet["AccelerometerBiasSigma"],
            gyroscope_bias_walk_radps_per_sqrt_s=sheet["GyroscopeBiasSigma"],
            clock_offset_sigma_s=within_a_sample_s(imu_s),
        ),
        fixes=(
            Fixes(
                t_s=fixes[:, 0] - begin_s,
                antenna="gps",
                p_n_m=fixes[:, [2, 1, 3]] * down[[0, 0, 1]],
                v_n_mps=None,
                position_sigma_m=np.full((len(fixes), 3), position_sigma_m),
                velocity_sigma_mps=None,
            ),
        ),
    )


def _of_gtsam(name: str) -> Path:
    return Path(gtsam.findExampleDataFile(name))


def _metadata(file: Path) -> tuple[list[str], list[float]]:
    names, values = file.read_text().splitlines()
    return names.split(), [float(value) for value in values.split()]


def _of_unit(roll_deg: float, pitch_deg: float, yaw_deg: float) -> np.ndarray:
    from fgnav.geometry.rotations import from_euler

    return from_euler(*np.radians([[roll_deg], [pitch_deg], [yaw_deg]]))[0].T
