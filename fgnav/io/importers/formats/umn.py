"""Flights of the University of Minnesota's UAV laboratory: a MATLAB file with ``flight_data``.

Inertial samples at 50 Hz in body axes, a receiver's fixes at 1 Hz, and the on-board filter's
solution, which becomes the flight's reference: it is an estimate too, not truth [1]_.

References
----------
.. [1] UAV Laboratory, University of Minnesota, flight data in the format ``UMN1``.
"""

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Loss
from fgnav.geometry.earth import Origin, ecef
from fgnav.geometry.rotations import from_euler
from fgnav.types.flight import Antenna, Fixes, Flight, Imu, Truth

# The recordings do not state them: an ADIS16405 on a vibrating airframe, a code receiver. Vibration
# and the gyroscope's alignment, not the data sheet, set the densities.
_imu = partial(
    Imu,
    accelerometer_noise_mps2_per_sqrt_hz=0.05,
    accelerometer_bias_mps2=0.5,
    accelerometer_bias_walk_mps2_per_sqrt_s=5e-3,
    gyroscope_noise_radps_per_sqrt_hz=1e-3,
    gyroscope_bias_radps=0.02,
    gyroscope_bias_walk_radps_per_sqrt_s=1e-4,
)
POSITION_SIGMA_M = (3.0, 3.0, 6.0)
VELOCITY_SIGMA_MPS = (0.3, 0.3, 0.5)

_HDF5 = b"MATLAB 7.3"  # another format under the same name
_RATES, _FORCES = ("p", "q", "r"), ("ax", "ay", "az")
_GNSS = ("lat", "lon", "alt", "vn", "ve", "vd", "GPS_TOW")
_FILTER = ("navlat", "navlon", "navalt", "navvn", "navve", "navvd", "phi", "theta", "psi")
_STATUS = ("navValid", "imuStatus")


def read_umn(path: Path) -> Flight:
    """Read a recording.

    Parameters
    ----------
    path : Path
        A ``.mat`` file with the structure ``flight_data``.

    Returns
    -------
    Flight
        With fixes, accelerometer, gyroscope and the on-board filter's solution as ``truth``. The
        file has seconds of the GPS week but no week: ``start_gps_s`` counts from the week's start.

    Raises
    ------
    BadInputError
        If the file is no such recording, or a column is missing or not finite.
    """
    data = _columns(path)
    sampled = data["imuStatus"] != 0
    filtered = (data["navValid"] == 0) & (data["navlat"] != 0)
    new_fix = np.flatnonzero(np.diff(data["GPS_TOW"], prepend=0.0) != 0)
    if len(new_fix) < 2 or not filtered.any():
        raise BadInputError(f"{path}: flight_data: needs two GPS fixes and a filter solution")
    start_s = float(data["time"][new_fix[0]])
    sampled &= data["time"] >= start_s
    filtered &= data["time"] >= start_s
    t_s = data["time"] - start_s
    place = _stack(data, _GNSS[:3], new_fix)
    place[:, :2] = np.radians(place[:, :2])
    origin = Origin(latitude_rad=place[0, 0], longitude_rad=place[0, 1], height_m=place[0, 2])
    reference = _stack(data, _FILTER, filtered)
    p_n_m, reference_n_m = _local(origin, place), _local(origin, reference[:, :3])
    turned = origin.local_ned(reference_n_m)
    lost = int((~sampled).sum())
    return Flight(
        name=path.stem,
        start_gps_s=round(float(data["GPS_TOW"][new_fix[0]]), 3),
        origin=origin,
        antennas=(Antenna(name="gps", position_b_m=np.zeros(3)),),
        imu=_imu(
            t_s=t_s[sampled],
            f_b_mps2=_stack(data, _FORCES, sampled),
            w_b_radps=_stack(data, _RATES, sampled),
        ),
        fixes=Fixes(
            t_s=t_s[new_fix],
            antenna="gps",
            p_n_m=p_n_m,
            v_n_mps=_turned(origin, p_n_m, _stack(data, _GNSS[3:6], new_fix)),
            position_sigma_m=np.tile(POSITION_SIGMA_M, (len(new_fix), 1)),
            velocity_sigma_mps=np.tile(VELOCITY_SIGMA_MPS, (len(new_fix), 1)),
        ),
        truth=Truth(
            t_s=t_s[filtered],
            p_n_m=reference_n_m,
            v_n_mps=_turned(origin, reference_n_m, reference[:, 3:6]),
            R_nb=turned @ from_euler(*reference[:, 6:].T),
        ),
        losses=(Loss(what="imu sample", reason="before the first fix, or flagged", count=lost),),
    )


def _columns(path: Path) -> dict[str, FloatArray]:
    """Return the columns that are used, all of one length, times increasing."""
    from scipy.io import loadmat, matlab  # noqa: PLC0415  # lazy: keeps the command line quick

    if not path.is_file():
        raise BadInputError(f"{path}: no such file; check the name")
    rule = f"{path}: must be a MATLAB file of version 7.2 or older"
    with path.open("rb") as file:
        if file.read(len(_HDF5)) == _HDF5:
            raise BadInputError(f"{rule}, this is 7.3; save it with -v7")
    try:
        content: dict[str, Any] = loadmat(path, struct_as_record=False, squeeze_me=True)
    except (matlab.MatReadError, ValueError, OSError) as error:
        raise BadInputError(rule) from error
    data = content.get("flight_data")
    if data is None:
        raise BadInputError(f"{path}: has no structure flight_data")
    columns: dict[str, FloatArray] = {}
    for name in ("time", *_RATES, *_FORCES, *_GNSS, *_FILTER, *_STATUS):
        value = getattr(data, name, None)
        if value is None:
            raise BadInputError(f"{path}: flight_data.{name}: missing")
        columns[name] = np.atleast_1d(np.asarray(value, dtype=np.float64))
    rows = len(columns["time"])
    for name, column in columns.items():
        if column.shape != (rows,):
            raise BadInputError(f"{path}: flight_data.{name}: {column.shape}, must be ({rows},)")
        if not np.isfinite(column).all():
            row = int(np.argmax(~np.isfinite(column)))
            raise BadInputError(f"{path}: flight_data.{name}: row {row} is not finite")
    return columns


def _stack(
    data: dict[str, FloatArray], names: tuple[str, ...], rows: BoolArray | IntArray
) -> FloatArray:
    return np.stack([data[name][rows] for name in names], axis=1)


def _local(origin: Origin, place: FloatArray) -> FloatArray:
    return origin.to_n(ecef(*place.T))


def _turned(origin: Origin, p_n_m: FloatArray, v_ned_mps: FloatArray) -> FloatArray:
    """Turn velocities from north where the vehicle is to north at the origin."""
    return np.asarray(np.einsum("nij,nj->ni", origin.local_ned(p_n_m), v_ned_mps))
