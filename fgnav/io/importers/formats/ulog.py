"""ULog files of PX4 [1]_: inertial samples, fixes, barometer, magnetometer, on-board filter.

Axes are forward, right, down. ``eph`` and ``epv`` become the standard deviation of each horizontal
axis and of the height; times since boot become GPS time by the median of ``time_utc_usec``.

References
----------
.. [1] PX4 User Guide, "ULog File Format", and the messages SensorCombined, SensorGps,
   VehicleAirData, VehicleMagnetometer, VehicleAttitude, VehicleGlobalPosition,
   VehicleLocalPosition.
"""

from pathlib import Path
from typing import Any

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss
from fgnav.geometry.rotations import to_euler
from fgnav.io.flight import columns as col
from fgnav.io.flight.columns import Samples, samples
from fgnav.io.gps_time import gps_of_utc
from fgnav.io.importers.formats.readers import foreign, reader
from fgnav.io.importers.recording import Recording
from fgnav.io.importers.settings import Settings

_US = 1e-6
_UT_PER_GAUSS = 100.0
_FIX_3D = 3  # fix_type: 2 and less have no height
_GPS = ("sensor_gps", "vehicle_gps_position")
_AROUND = ("vehicle_air_data", "vehicle_magnetometer")
_FILTER = ("vehicle_attitude", "vehicle_global_position", "vehicle_local_position")
_RELATIVE = "sensor_gnss_relative"
_READ = ("sensor_combined", *_AROUND, *_GPS, *_FILTER, _RELATIVE)


def read_ulog(path: Path, _settings: Settings, _scratch: Path) -> Recording:
    """Read a log's first inertial unit, and its receiver with the most fixes that have a height."""
    pyulog = reader("pyulog", "ulog")
    with foreign(path, "ULog") as output, path.open("rb") as file:
        log = pyulog.ULog(file)
        used = {one.name: one for one in reversed(log.data_list) if one.name in _READ}  # instance 0
        receivers = [one for one in log.data_list if one.name in _GPS]
        if receivers:
            best = max(receivers, key=lambda one: (one.data["fix_type"] >= _FIX_3D).sum())
            used = {name: one for name, one in used.items() if name not in _GPS} | {"gps": best}
        topics = {name: one.data for name, one in used.items()}
        damaged = int(log.file_corruption or "corruption" in output.getvalue())
        lost = [("logger dropout", "the logger could not keep up", len(log.dropouts))]
        lost += [("message", "the log is damaged there", damaged)]
        lost += [
            (f"{one.name} message", reason, len(one.data["timestamp"]))
            for one in log.data_list
            if one not in used.values()
            for reason in ["of another instance" if one.name in _READ else "not read"]
        ]
        tables: dict[str, Samples] = {}
        if (unit := topics.get("sensor_combined")) is not None:
            force, rate = (
                _triple(unit, name) for name in ("accelerometer_m_s2[{}]", "gyro_rad[{}]")
            )
            tables["imu"] = samples(unit["timestamp"] * _US, (col.FORCE, force), (col.RATE, rate))
        if (air := topics.get("vehicle_air_data")) is not None:
            height_m = _numbers(air, "baro_alt_meter")
            tables["barometer"] = samples(air["timestamp"] * _US, (col.HEIGHT, height_m))
        if (magnet := topics.get("vehicle_magnetometer")) is not None:
            field_b_ut = _triple(magnet, "magnetometer_ga[{}]") * _UT_PER_GAUSS
            tables["magnetometer"] = samples(magnet["timestamp"] * _US, (col.FIELD, field_b_ut))
        start_s = None
        if (gps := topics.get("gps")) is not None:
            flying = gps["fix_type"] >= _FIX_3D
            tables["fixes"] = {name: column[flying] for name, column in _fixes(gps).items()}
            lost += [("fix", "has no height (fix_type)", int((~flying).sum()))]
            start_s = _start(gps, flying)
        if (relative := topics.get(_RELATIVE)) is not None:
            tables["baseline"], count = _baseline(relative)
            lost += [("baseline", "is not valid, of a float solution or of a still base", count)]
        if all(name in topics for name in _FILTER):
            tables["truth"] = _reference(topics)
        else:
            reason = f"a reference needs {', '.join(_FILTER)}"
            alone = {name: topics[name] for name in _FILTER if name in topics}
            lost += [(f"{n} message", reason, len(x["timestamp"])) for n, x in alone.items()]
    return Recording(
        source=path,
        tables={kind: table for kind, table in tables.items() if len(table["t_s"])},
        clock="own" if start_s is None else "gps",
        gps_start_s=start_s or 0.0,
        baseline_ends_at_fixes=True,  # as u-blox's
        losses=tuple(Loss(what=w, reason=why, count=count) for w, why, count in lost),
        truth_source="filter" if "truth" in tables else None,
        notes={"truth": "the on-board filter's estimate, not truth"} if "truth" in tables else {},
    )


def _start(gps: dict[str, Any], flying: BoolArray) -> float | None:
    """Return the GPS time of boot, None where the receiver never knew the time."""
    dated = flying & (gps["time_utc_usec"] > 0)
    if not dated.any():
        return None
    utc_s = _numbers(gps, "time_utc_usec")[dated] * _US
    return float(np.median(gps_of_utc(utc_s) - _numbers(gps, "timestamp")[dated] * _US))


def _numbers(topic: dict[str, Any], name: str) -> FloatArray:
    return np.asarray(topic[name], np.float64)


def _triple(topic: dict[str, Any], name: str, count: int = 3) -> FloatArray:
    """Return (k, count) of a field that is an array."""
    return np.stack([_numbers(topic, name.format(k)) for k in range(count)], axis=1)


def _fixes(topic: dict[str, Any]) -> Samples:
    """Return fixes, of releases that log degrees and metres, or 1e-7 degrees and millimetres."""
    if "latitude_deg" in topic:
        names, scale = ("latitude_deg", "longitude_deg", "altitude_ellipsoid_m"), (1.0, 1.0, 1.0)
    else:
        names, scale = ("lat", "lon", "alt_ellipsoid"), (1e-7, 1e-7, 1e-3)
    place = np.stack([_numbers(topic, name) for name in names], axis=1) * scale
    velocity = np.stack([_numbers(topic, f"vel_{axis}_m_s") for axis in "ned"], axis=1)
    horizontal, vertical = _numbers(topic, "eph"), _numbers(topic, "epv")
    sigma_mps = np.repeat(_numbers(topic, "s_variance_m_s")[:, None], 3, axis=1)
    return samples(
        topic["timestamp"] * _US,
        (col.PLACE, place),
        (col.VELOCITY, velocity),
        (col.POSITION_SIGMA, np.stack([horizontal, horizontal, vertical], axis=1)),
        (col.VELOCITY_SIGMA, sigma_mps),
    )


def _baseline(topic: dict[str, Any]) -> tuple[Samples, int]:
    """Return vectors between antennas that move together, and how many others there are."""
    flags = ("relative_position_valid", "carrier_solution_fixed", "moving_base_mode")
    good = np.all([topic[name].astype(bool) for name in flags], axis=0)
    if topic.get("relative_position_normalized") is not None:
        good &= ~topic["relative_position_normalized"].astype(bool)
    vectors, sigmas = _triple(topic, "position[{}]"), _triple(topic, "position_accuracy[{}]")
    blocks = (col.BASELINE, vectors[good]), (col.POSITION_SIGMA, sigmas[good])
    return samples(topic["timestamp"][good] * _US, *blocks), int((~good).sum())


def _reference(topics: dict[str, dict[str, Any]]) -> Samples:
    """Return the filter's estimates at its positions: attitudes nearest in time."""
    from scipy.spatial.transform import Rotation  # noqa: PLC0415  # lazy: not every log has one

    at, local, turned = (
        topics[name]
        for name in ("vehicle_global_position", "vehicle_local_position", "vehicle_attitude")
    )
    t = at["timestamp"]
    wxyz = _triple(turned, "q[{}]", 4)[_nearest(turned["timestamp"], t)]
    R_nb = Rotation.from_quat(wxyz, scalar_first=True).as_matrix()
    near = _nearest(local["timestamp"], t)
    velocity = np.stack([_numbers(local, name) for name in ("vx", "vy", "vz")], axis=1)[near]
    height = "alt_ellipsoid" if "alt_ellipsoid" in at else "alt"
    place = np.stack([_numbers(at, name) for name in ("lat", "lon", height)], axis=1)
    euler_deg = np.degrees(to_euler(R_nb))
    return samples(t * _US, (col.PLACE, place), (col.VELOCITY, velocity), (col.EULER, euler_deg))


def _nearest(times: FloatArray, at: FloatArray) -> IntArray:
    """Return the rows of ``times`` nearest to each of ``at``."""
    middles = times[1:] / 2 + times[:-1] / 2
    return np.searchsorted(middles, at)
