"""Tracks for maps: KML with attitudes for Google Earth, GPX for everything else.

Both want heights above the sea. RTKLIB brings the geoid of EGM96, every degree; where it is not
installed, a KML track is laid on the ground, and a GPX track has no heights.
"""

from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import to_euler
from fgnav.io.atomic_write import write_text
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.exports.track import Track, track_of

_HEAD = '<?xml version="1.0" encoding="UTF-8"?>'
_SEA = "heights above the sea, EGM96"
_NO_GEOID = "no heights above the sea: pip install 'fgnav[importers]' brings a geoid"


def write_kml(recorded: RecordedEstimate, path: Path) -> None:
    """Write a ``gx:Track`` of places and angles in time."""
    track = track_of(recorded)
    place, above_sea = _above_sea(track.place)
    euler_deg = np.degrees(to_euler(track.R_ln @ track.R_nb))
    title = escape(track.title)
    when = [f"<when>{one}</when>" for one in _milliseconds(track)]
    where = [f"<gx:coord>{lon:.9f} {lat:.9f} {up:.3f}</gx:coord>" for lat, lon, up in place]
    angles = [f"<gx:angles>{y:.4f} {p:.4f} {r:.4f}</gx:angles>" for r, p, y in euler_deg]
    lines = [
        _HEAD,
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        f"<Document><name>{title}</name><Placemark><name>{title}</name>",
        f"<description>{escape(_SEA if above_sea else _NO_GEOID)}</description><gx:Track>",
        f"<altitudeMode>{'absolute' if above_sea else 'clampToGround'}</altitudeMode>",
        *(when + where + angles),
        "</gx:Track></Placemark></Document></kml>",
        "",
    ]
    write_text(path, "\n".join(lines))


def write_gpx(recorded: RecordedEstimate, path: Path) -> None:
    """Write a GPX 1.1 track."""
    track = track_of(recorded)
    place, above_sea = _above_sea(track.place)
    points = [
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}">'
        f"{f'<ele>{up:.3f}</ele>' if above_sea else ''}<time>{when}</time></trkpt>"
        for (lat, lon, up), when in zip(place, _milliseconds(track), strict=True)
    ]
    lines = [
        _HEAD,
        '<gpx version="1.1" creator="fgnav" xmlns="http://www.topografix.com/GPX/1/1">',
        f"<trk><name>{escape(recorded.flight)}</name>",
        f"<desc>{escape(_SEA if above_sea else _NO_GEOID)}</desc><trkseg>",
        *points,
        "</trkseg></trk></gpx>",
        "",
    ]
    write_text(path, "\n".join(lines))


def _above_sea(place: FloatArray) -> tuple[FloatArray, bool]:
    """Return places with heights above the sea, and whether a geoid was there to tell them.

    Parameters
    ----------
    place : ndarray, shape (k, 3)
        Latitude and longitude, deg; height above the ellipsoid, m.
    """
    try:
        import pyrtklib5 as rtklib  # noqa: PLC0415  # lazy: an extra
    except ModuleNotFoundError:
        return place, False
    at, undulation_m = rtklib.Arr1Ddouble(3), np.empty(len(place))
    for k, (latitude, longitude) in enumerate(np.radians(place[:, :2]).tolist()):
        at[0], at[1] = latitude, longitude
        undulation_m[k] = rtklib.geoidh(at)
    return place - undulation_m[:, None] * [0.0, 0.0, 1.0], True


def _milliseconds(track: Track) -> np.ndarray:
    """Return (n,) texts of UTC times, to the millisecond."""
    utc = track.utc + np.timedelta64(500, "us")
    return np.char.add(utc.astype("datetime64[ms]").astype(str), "Z")
