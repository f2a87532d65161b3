"""Trajectories for programs that compare them: TUM's for evo, RTKLIB's .pos for rtkplot."""

from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray
from fgnav.geometry.rotations import quaternion_wxyz
from fgnav.io.atomic_write import write_text
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.flight.local_frame import place_of_n, velocity_of_n
from fgnav.io.gps_time import GPS_EPOCH, utc_of_gps

_SINGLE = 5  # RTKLIB's quality flag of a position that stands against no base
_POS_HEAD = (
    "%  GPST                      latitude(deg)  longitude(deg)    height(m)   Q  ns   sdn(m)   "
    "sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)"
    "      sdvn      sdve      sdvu     sdvne     sdveu     sdvun"
)


def write_tum(recorded: RecordedEstimate, path: Path) -> None:
    """Write ``timestamp tx ty tz qx qy qz qw`` of each epoch with a position.

    Timestamps are UTC, seconds since 1970-01-01; positions are north, east, down of the origin that
    the first lines state, and the quaternion turns body axes, forward, right, down, into these.
    """
    rows, p_n_m = positions(recorded)
    w, x, y, z = quaternion_wxyz(recorded.estimate.R_nb[rows]).T
    utc = utc_of_gps(gps_times(recorded)[rows])
    microseconds = ((utc - np.datetime64(0, "us")) / np.timedelta64(1, "us")).astype(np.int64)
    at = recorded.origin
    lines = [
        "# timestamp: UTC, s since 1970-01-01; t: m north, east, down of latitude "
        f"{np.degrees(at.latitude_rad):.9f} deg, longitude {np.degrees(at.longitude_rad):.9f} deg, "
        f"height {at.height_m:.3f} m (WGS-84)",
        "# q: from body axes, forward, right, down, to north, east, down of that origin",
        "# timestamp tx ty tz qx qy qz qw",
    ]
    table = np.column_stack([p_n_m, x, y, z, w]).tolist()
    for time_us, row in zip(microseconds.tolist(), table, strict=True):
        stamp = f"{time_us // 1_000_000}.{time_us % 1_000_000:06d}"
        lines.append(" ".join([stamp, *(f"{value:.9f}" for value in row)]))
    write_text(path, "\n".join([*lines, ""]))


def write_pos(recorded: RecordedEstimate, path: Path) -> None:
    """Write RTKLIB's solution format [1]_: GPS time, geodetic place, velocity, their covariances.

    What the method states no covariance of has zeros there, as RTKLIB itself writes it.

    References
    ----------
    .. [1] RTKLIB 2.4.2 manual, appendix B.1.
    """
    rows, p_n_m = positions(recorded)
    estimate, origin = recorded.estimate, recorded.origin
    place, enu = place_of_n(origin, p_n_m), np.diag([1.0, 1.0, -1.0])  # north, east, up
    to_ned = origin.local_ned(p_n_m).swapaxes(1, 2)
    v_n_mps = np.zeros_like(p_n_m) if estimate.v_n_mps is None else estimate.v_n_mps[rows]
    velocity = velocity_of_n(origin, p_n_m, np.nan_to_num(v_n_mps)) @ enu
    spreads = []
    for covariance in (estimate.position_covariance_m2, estimate.velocity_covariance_m2ps2):
        n_frame = np.zeros((len(p_n_m), 3, 3)) if covariance is None else covariance[rows]
        spreads.append(_roots(enu @ to_ned @ np.nan_to_num(n_frame) @ to_ned.swapaxes(1, 2) @ enu))
    times = gps_times(recorded)[rows]
    lines = [f"% program   : fgnav {estimate.method}", _POS_HEAD]
    for k, when in enumerate(times):
        day, clock = str(when).split("T")
        lat, lon, height = place[k].tolist()
        sigma, sigma_v = (" ".join(f"{x:8.4f}" for x in part[k].tolist()) for part in spreads)
        speed = " ".join(f"{x:10.5f}" for x in velocity[k].tolist())
        lines.append(
            f"{day.replace('-', '/')} {clock[:12]} {lat:15.9f} {lon:14.9f} {height:12.4f} "
            f"{_SINGLE:3d} {0:3d} {sigma} {0:6.2f} {0:6.1f} {speed} {sigma_v}"
        )
    write_text(path, "\n".join([*lines, ""]))


def positions(recorded: RecordedEstimate) -> tuple[BoolArray, FloatArray]:
    """Return which epochs have a position, (n,), and the positions of those, (m, 3), in ``n``.

    Raises
    ------
    BadInputError
        If none has.
    """
    p_n_m = recorded.estimate.p_n_m
    rows = np.isfinite(np.zeros((0, 3)) if p_n_m is None else p_n_m).all(axis=1)
    if p_n_m is None or not rows.any():
        raise BadInputError(
            f"{recorded.estimate.method}: has no positions, which this format needs; "
            "csv and parquet do without"
        )
    return np.asarray(rows), p_n_m[rows]


def gps_times(recorded: RecordedEstimate) -> np.ndarray:
    """Return (n,) calendar times, GPS time, to the microsecond."""
    microseconds = np.rint((recorded.start_gps_s + recorded.estimate.t_s) * 1e6)
    return np.asarray(GPS_EPOCH + microseconds.astype("timedelta64[us]"))


def _roots(covariance: FloatArray) -> FloatArray:
    """Return (n, 6) of RTKLIB: sigmas, then signed roots of the covariances 01, 12, 20."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    values = np.stack([covariance[:, i, j] for i, j in pairs], axis=1)
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))
