"""Trajectories for programs that compare them: TUM's for evo, RTKLIB's .pos for rtkplot."""

from pathlib import Path

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import quaternion_wxyz
from fgnav.io.atomic_write import write_text
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.exports.track import track_of

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
    track = track_of(recorded)
    w, x, y, z = quaternion_wxyz(track.R_nb).T
    microseconds = (track.utc - np.datetime64(0, "us")).astype(np.int64)
    at = recorded.origin
    lines = [
        "# timestamp: UTC, s since 1970-01-01; t: m north, east, down of latitude "
        f"{np.degrees(at.latitude_rad):.9f} deg, longitude {np.degrees(at.longitude_rad):.9f} deg, "
        f"height {at.height_m:.3f} m (WGS-84)",
        "# q: from body axes, forward, right, down, to north, east, down of that origin",
        "# timestamp tx ty tz qx qy qz qw",
    ]
    table = np.column_stack([track.p_n_m, x, y, z, w]).tolist()
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
    track = track_of(recorded)
    to_enu = np.diag([1.0, 1.0, -1.0]) @ track.R_ln  # north, east, up
    velocity = np.einsum("kij,kj->ki", to_enu, np.nan_to_num(track.v_n_mps))
    spreads = [
        _roots(to_enu @ np.nan_to_num(P) @ to_enu.swapaxes(1, 2))
        for P in (track.P_position, track.P_velocity)
    ]
    lines = [f"% program   : fgnav {recorded.estimate.method}", _POS_HEAD]
    for k, when in enumerate(track.gps):
        day, clock = str(when).split("T")
        lat, lon, height = track.place[k].tolist()
        sigma, sigma_v = (" ".join(f"{x:8.4f}" for x in part[k].tolist()) for part in spreads)
        speed = " ".join(f"{x:10.5f}" for x in velocity[k].tolist())
        lines.append(
            f"{day.replace('-', '/')} {clock[:12]} {lat:15.9f} {lon:14.9f} {height:12.4f} "
            f"{_SINGLE:3d} {0:3d} {sigma} {0:6.2f} {0:6.1f} {speed} {sigma_v}"
        )
    write_text(path, "\n".join([*lines, ""]))


def _roots(covariance: FloatArray) -> FloatArray:
    """Return (n, 6) of RTKLIB: sigmas, then signed roots of the covariances 01, 12, 20."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    values = np.stack([covariance[:, i, j] for i, j in pairs], axis=1)
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))
