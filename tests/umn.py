"""Flights of the University of Minnesota's UAV laboratory: a MATLAB file with ``flight_data``.

Inertial samples at 50 Hz in body axes, a receiver's fixes at 1 Hz, and the on-board filter's
solution, which becomes the flight's reference: it is an estimate too, not truth [1]_. Where they
are there, heights by pressure, ``h``, and the magnetic field, ``hx``, ``hy``, ``hz`` in gauss,
whose second and third axis are the body's turned round.

References
----------
.. [1] UAV Laboratory, University of Minnesota, flight data in the format ``UMN1``.
"""

from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray, Unused
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, vectors
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

# The recordings do not state them: an ADIS16405 on a vibrating airframe, a code receiver. Vibration
# and the gyroscope's alignment, not the data sheet, set the densities.
_IMU_NOISE = {
    "accelerometer_noise_mps2_per_sqrt_hz": 0.05,
    "accelerometer_bias_mps2": 0.5,
    "accelerometer_bias_walk_mps2_per_sqrt_s": 5e-3,
    "gyroscope_noise_radps_per_sqrt_hz": 1e-3,
    "gyroscope_bias_radps": 0.02,
    "gyroscope_bias_walk_radps_per_sqrt_s": 1e-4,
}
_SIGMAS = (3.0, 3.0, 6.0, 0.3, 0.3, 0.5)  # m, m/s: north, east, down

_HDF5 = b"MATLAB 7.3"  # another format under the same name
_INERTIAL = ("ax", "ay", "az", "p", "q", "r")
_AROUND = ("h", "hx", "hy", "hz")  # not in every recording
_FIELD_TO_BODY_UT = 100.0 * np.array([1.0, -1.0, -1.0])
_GNSS = ("lat", "lon", "alt", "vn", "ve", "vd", "GPS_TOW")
_FILTER = ("navlat", "navlon", "navalt", "navvn", "navve", "navvd", "phi", "theta", "psi")
_ANGLES = ("navlat", "navlon", "phi", "theta", "psi")  # rad
_FILTER_SCALE = np.where(np.isin(_FILTER, _ANGLES), np.degrees(1.0), 1.0)
_STATUS = ("navValid", "imuStatus")


def read_umn(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a recording: a ``.mat`` file with the structure ``flight_data``.

    The file has seconds of the GPS week but no week. Samples before the first fix are left out.

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
    t_s = data["time"] - start_s + round(float(data["GPS_TOW"][new_fix[0]]), 3)
    sigmas = np.tile(_SIGMAS, (len(new_fix), 1))
    tables: dict[str, Samples] = {
        "imu": {"t_s": t_s[sampled]}
        | vectors(col.FORCE + col.RATE, _stack(data, _INERTIAL, sampled)),
        "fixes": {"t_s": t_s[new_fix]}
        | vectors(col.PLACE + col.VELOCITY, _stack(data, _GNSS[:6], new_fix))
        | vectors(col.POSITION_SIGMA + col.VELOCITY_SIGMA, sigmas),
        "truth": {"t_s": t_s[filtered]}
        | vectors(
            col.PLACE + col.VELOCITY + col.EULER, _stack(data, _FILTER, filtered) * _FILTER_SCALE
        ),
    }
    if "h" in data:
        height_m = _stack(data, ("h",), sampled)
        tables["barometer"] = {"t_s": t_s[sampled]} | vectors(col.HEIGHT, height_m)
    if "hx" in data:
        field_b_ut = _stack(data, _AROUND[1:], sampled) * _FIELD_TO_BODY_UT
        tables["magnetometer"] = {"t_s": t_s[sampled]} | vectors(col.FIELD, field_b_ut)
    lost = int((~sampled).sum())
    return Recording(
        source=path,
        tables=tables,
        clock="week",
        imu_noise=_IMU_NOISE,
        unused=(Unused(what="imu sample", reason="before the first fix, or flagged", count=lost),),
        truth_source="filter",
        notes={"truth": "the on-board filter's estimate, not truth"},
    )


def _columns(path: Path) -> dict[str, FloatArray]:
    """Return the columns that are used, all of one length, times increasing."""
    from scipy.io import loadmat, matlab  # lazy: keeps the command line quick

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
    around = [name for name in _AROUND if hasattr(data, name)]
    around = around if {"hx", "hy", "hz"} <= set(around) else [n for n in around if n == "h"]
    for name in ("time", *_INERTIAL, *_GNSS, *_FILTER, *_STATUS, *around):
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
