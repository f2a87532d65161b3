"""Trajectories for other programs: TUM's for evo, RTKLIB's .pos for rtkplot, KML and GPX for maps.

Maps want heights above the sea. RTKLIB brings the geoid of EGM96, every degree; where it is not
installed, a KML track is laid on the ground, and a GPX track has no heights.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.geometry.rotations import quaternion_wxyz, to_euler
from fgnav.io.atomic_write import atomic_file, write_text
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.flight.local_frame import place_of_n
from fgnav.io.gps_time import GPS_EPOCH, utc_of_gps

_SINGLE = 5  # RTKLIB's quality flag of a position that stands against no base
_POS_HEAD = (
    "%  GPST                      latitude(deg)  longitude(deg)    height(m)   Q  ns   sdn(m)   "
    "sde(m)   sdu(m)  sdne(m)  sdeu(m)  sdun(m) age(s)  ratio    vn(m/s)    ve(m/s)    vu(m/s)"
    "      sdvn      sdve      sdvu     sdvne     sdveu     sdvun"
)
_XML = '<?xml version="1.0" encoding="UTF-8"?>'
_SEA = "heights above the sea, EGM96"
_NO_GEOID = "no heights above the sea: pip install 'fgnav[importers]' brings a geoid"


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Track:
    """Epochs with a position, (n,), and covariances in ``n``, of attitudes in body axes.

    What the method does not estimate is NaN.
    """

    title: str  # flight and method
    gps: np.ndarray  # datetime64[us]
    utc: np.ndarray
    p_n_m: FloatArray
    v_n_mps: FloatArray
    rate_b_radps: FloatArray
    place: FloatArray  # latitude, longitude, deg; height above the ellipsoid, m
    R_nb: FloatArray
    R_ln: FloatArray  # into the axes north, east, down at the vehicle
    P_position: FloatArray
    P_velocity: FloatArray
    P_attitude: FloatArray

    @property
    def utc_texts(self) -> list[str]:
        """UTC to the millisecond, as of ISO 8601."""
        utc = (self.utc + np.timedelta64(500, "us")).astype("datetime64[ms]")
        return [f"{text}Z" for text in utc.astype(str)]


def track_of(recorded: RecordedEstimate) -> Track:
    """Return the track of an estimate."""
    estimate, origin = recorded.estimate, recorded.origin
    n = len(estimate.t_s)
    p_n_m = np.full((n, 3), np.nan) if estimate.p_n_m is None else estimate.p_n_m
    rows = np.isfinite(p_n_m).all(axis=1)
    if not rows.any():
        raise BadInputError(
            f"{estimate.method}: has no positions, which this format needs; "
            "csv and parquet do without"
        )

    def of_rows(values: FloatArray | None, *shape: int) -> FloatArray:
        return (np.full((n, *shape), np.nan) if values is None else values)[rows]

    microseconds = np.rint((recorded.start_gps_s + estimate.t_s[rows]) * 1e6)
    gps = GPS_EPOCH + microseconds.astype("timedelta64[us]")
    return Track(
        title=f"{recorded.flight}, {estimate.method}",
        gps=gps,
        utc=utc_of_gps(gps),
        p_n_m=p_n_m[rows],
        v_n_mps=of_rows(estimate.v_n_mps, 3),
        rate_b_radps=of_rows(estimate.angular_rate_b_radps, 3),
        place=place_of_n(origin, p_n_m[rows]),
        R_nb=estimate.R_nb[rows],
        R_ln=origin.local_ned(p_n_m[rows]).swapaxes(1, 2),
        P_position=of_rows(estimate.position_covariance_m2, 3, 3),
        P_velocity=of_rows(estimate.velocity_covariance_m2ps2, 3, 3),
        P_attitude=of_rows(estimate.attitude_covariance_rad2, 3, 3),
    )


def write_tum(recorded: RecordedEstimate, path: Path) -> None:
    """Write ``timestamp tx ty tz qx qy qz qw`` of each epoch with a position.

    Timestamps are UTC, seconds since 1970-01-01; positions are north, east, down of the origin that
    the first lines state, and the quaternion turns body axes, forward, right, down, into these.

    Examples
    --------
    >>> write_tum(fgnav.load_estimate("run"), Path("run.tum"))
    >>> np.loadtxt("run.tum").shape
    (4, 8)
    """
    track, origin = track_of(recorded), recorded.origin
    latitude_deg, longitude_deg = np.degrees([origin.latitude_rad, origin.longitude_rad])
    w, x, y, z = quaternion_wxyz(track.R_nb).T
    stamps = np.divmod((track.utc - np.datetime64(0, "us")).astype(np.int64), 1_000_000)
    head = (
        "timestamp: UTC, s since 1970-01-01; t: m north, east, down of latitude "
        f"{latitude_deg:.9f} deg, longitude {longitude_deg:.9f} deg, "
        f"height {origin.height_m:.3f} m (WGS-84)\n"
        "q: from body axes, forward, right, down, to north, east, down of that origin\n"
        "timestamp tx ty tz qx qy qz qw"
    )
    table = np.column_stack([*stamps, track.p_n_m, x, y, z, w])
    with atomic_file(path) as temporary:
        np.savetxt(temporary, table, fmt="%d.%06d" + 7 * " %.9f", header=head)


def write_pos(recorded: RecordedEstimate, path: Path) -> None:
    """Write RTKLIB's solution format [1]_: GPS time, geodetic place, velocity, their covariances.

    What the method states no covariance of has zeros there, as RTKLIB itself writes it.

    References
    ----------
    .. [1] RTKLIB 2.4.2 manual, appendix B.1.

    Examples
    --------
    >>> write_pos(fgnav.load_estimate("run"), Path("run.pos"))
    >>> importer_named("pos")(Path("run.pos"), Settings(), Path()).gps_start_s
    1277078400.0
    """
    track = track_of(recorded)
    to_enu = np.diag([1.0, 1.0, -1.0]) @ track.R_ln  # north, east, up
    velocity = np.einsum("kij,kj->ki", to_enu, np.nan_to_num(track.v_n_mps))
    position_roots, velocity_roots = (
        _roots(to_enu @ np.nan_to_num(P) @ to_enu.swapaxes(1, 2))
        for P in (track.P_position, track.P_velocity)
    )
    when = track.gps.astype("datetime64[ms]").astype(str)
    when = np.char.replace(np.char.replace(when, "-", "/"), "T", " ").astype(object)
    flags, age = np.tile([_SINGLE, 0], (len(when), 1)), np.zeros((len(when), 2))  # and ratio
    blocks = [when, track.place, flags, position_roots, age, velocity, velocity_roots]
    form = "%s %15.9f %14.9f %12.4f %3d %3d" + 6 * " %8.4f" + " %6.2f %6.1f" + 3 * " %10.5f"
    head = f"% program   : fgnav {recorded.estimate.method}\n{_POS_HEAD}"
    with atomic_file(path) as temporary:
        table = np.column_stack(blocks)
        np.savetxt(temporary, table, fmt=form + 6 * " %8.4f", header=head, comments="")


def _roots(covariance: FloatArray) -> FloatArray:
    """Return (n, 6) of RTKLIB: sigmas, then signed roots of the covariances 01, 12, 20."""
    pairs = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
    values = np.stack([covariance[:, i, j] for i, j in pairs], axis=1)
    return np.asarray(np.sign(values) * np.sqrt(np.abs(values)))


def write_kml(recorded: RecordedEstimate, path: Path) -> None:
    """Write a ``gx:Track`` of places and angles in time, for Google Earth.

    Examples
    --------
    >>> write_kml(fgnav.load_estimate("run"), Path("run.kml"))
    >>> Path("run.kml").read_text().count("<gx:angles>")
    4
    """
    track = track_of(recorded)
    coordinates, above_sea = _above_sea(track.place)
    euler_deg = np.degrees(to_euler(track.R_ln @ track.R_nb))
    title = escape(track.title)
    lines = [
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        f"<Document><name>{title}</name><Placemark><name>{title}</name>",
        f"<description>{escape(_SEA if above_sea else _NO_GEOID)}</description><gx:Track>",
        f"<altitudeMode>{'absolute' if above_sea else 'clampToGround'}</altitudeMode>",
        *(f"<when>{when}</when>" for when in track.utc_texts),
        *(f"<gx:coord>{lon:.9f} {lat:.9f} {up:.3f}</gx:coord>" for lat, lon, up in coordinates),
        *(f"<gx:angles>{y:.4f} {p:.4f} {r:.4f}</gx:angles>" for r, p, y in euler_deg),
        "</gx:Track></Placemark></Document></kml>",
    ]
    _write_xml(path, lines)


def write_gpx(recorded: RecordedEstimate, path: Path) -> None:
    """Write a GPX 1.1 track.

    Examples
    --------
    >>> write_gpx(fgnav.load_estimate("run"), Path("run.gpx"))
    >>> Path("run.gpx").read_text().count("<trkpt")
    4
    """
    track = track_of(recorded)
    coordinates, above_sea = _above_sea(track.place)
    lines = [
        '<gpx version="1.1" creator="fgnav" xmlns="http://www.topografix.com/GPX/1/1">',
        f"<trk><name>{escape(recorded.flight)}</name>",
        f"<desc>{escape(_SEA if above_sea else _NO_GEOID)}</desc><trkseg>",
    ]
    for (lat, lon, up), when in zip(coordinates, track.utc_texts, strict=True):
        height = f"<ele>{up:.3f}</ele>" * above_sea
        lines.append(f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}">{height}<time>{when}</time></trkpt>')
    _write_xml(path, [*lines, "</trkseg></trk></gpx>"])


def _write_xml(path: Path, lines: Sequence[str]) -> None:
    write_text(path, "\n".join([_XML, *lines, ""]))


def _above_sea(place: FloatArray) -> tuple[FloatArray, bool]:
    """Return places with heights above the sea, and whether a geoid was there to tell them."""
    try:
        import pyrtklib5 as rtklib  # noqa: PLC0415  # lazy: an extra
    except ModuleNotFoundError:
        return place, False
    at, undulation_m = rtklib.Arr1Ddouble(3), np.empty(len(place))
    for k, (latitude, longitude) in enumerate(np.radians(place[:, :2]).tolist()):
        at[0], at[1] = latitude, longitude
        undulation_m[k] = rtklib.geoidh(at)
    return place - undulation_m[:, None] * [0.0, 0.0, 1.0], True
