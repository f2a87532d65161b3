"""Trajectories for programs that compare them: TUM's for evo, RTKLIB's .pos for rtkplot."""

from pathlib import Path

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import quaternion_wxyz
from fgnav.io.atomic_write import atomic_file
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
    track, at = track_of(recorded), recorded.origin
    w, x, y, z = quaternion_wxyz(track.R_nb).T
    stamps = np.divmod((track.utc - np.datetime64(0, "us")).astype(np.int64), 1_000_000)
    head = (
        "timestamp: UTC, s since 1970-01-01; t: m north, east, down of latitude "
        f"{np.degrees(at.latitude_rad):.9f} deg, longitude {np.degrees(at.longitude_rad):.9f} deg, "
        f"height {at.height_m:.3f} m (WGS-84)\n"
        "q: from body axes, forward, right, down, to north, east, down of that origin\n"
        "timestamp tx ty tz qx qy qz qw"
    )
    table = np.column_stack([*stamps, track.p_n_m, x, y, z, w])
    with atomic_file(path) as part:
        np.savetxt(part, table, fmt="%d.%06d" + 7 * " %.9f", header=head)


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
    when = track.gps.astype("datetime64[ms]").astype(str)
    when = np.char.replace(np.char.replace(when, "-", "/"), "T", " ").astype(object)
    flags, age = np.tile([_SINGLE, 0], (len(when), 1)), np.zeros((len(when), 2))  # and ratio
    table = np.column_stack([when, track.place, flags, spreads[0], age, velocity, spreads[1]])
    form = "%s %15.9f %14.9f %12.4f %3d %3d" + 6 * " %8.4f" + " %6.2f %6.1f" + 3 * " %10.5f"
    head = f"% program   : fgnav {recorded.estimate.method}\n{_POS_HEAD}"
    with atomic_file(path) as part:
        np.savetxt(part, table, fmt=form + 6 * " %8.4f", header=head, comments="")


def _roots(covariance: FloatArray) -> FloatArray:
    """Return (n, 6) of RTKLIB: sigmas, then signed roots of the covariances 01, 12, 20."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    values = np.stack([covariance[:, i, j] for i, j in pairs], axis=1)
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))
