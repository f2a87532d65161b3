"""Tracks for maps: KML with attitudes for Google Earth, GPX for everything else."""

from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np

from fgnav.checks import FloatArray
from fgnav.io.atomic_write import write_text
from fgnav.io.exports.recorded import RecordedEstimate
from fgnav.io.exports.trajectories import gps_times, positions
from fgnav.io.flight.local_frame import attitude_of_n, place_of_n
from fgnav.io.gps_time import utc_of_gps


def write_kml(recorded: RecordedEstimate, path: Path) -> None:
    """Write a ``gx:Track`` of places and angles in time; heights are above the WGS-84 ellipsoid."""
    rows, p_n_m = positions(recorded)
    place = place_of_n(recorded.origin, p_n_m)
    euler_deg = attitude_of_n(recorded.origin, p_n_m, recorded.estimate.R_nb[rows])
    title = escape(f"{recorded.flight}, {recorded.estimate.method}")
    when = [f"<when>{one}</when>" for one in _utc(recorded)[rows]]
    where = [f"<gx:coord>{lon:.9f} {lat:.9f} {up:.3f}</gx:coord>" for lat, lon, up in place]
    angles = [f"<gx:angles>{y:.4f} {p:.4f} {r:.4f}</gx:angles>" for r, p, y in euler_deg]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<kml xmlns="http://www.opengis.net/kml/2.2" xmlns:gx="http://www.google.com/kml/ext/2.2">',
        f"<Document><name>{title}</name><Placemark><name>{title}</name><gx:Track>",
        "<altitudeMode>absolute</altitudeMode>",
        *(when + where + angles),
        "</gx:Track></Placemark></Document></kml>",
        "",
    ]
    write_text(path, "\n".join(lines))


def write_gpx(recorded: RecordedEstimate, path: Path) -> None:
    """Write a GPX 1.1 track; heights are above the WGS-84 ellipsoid."""
    rows, p_n_m = positions(recorded)
    place: FloatArray = place_of_n(recorded.origin, p_n_m)
    points = [
        f'<trkpt lat="{lat:.9f}" lon="{lon:.9f}"><ele>{up:.3f}</ele><time>{when}</time></trkpt>'
        for (lat, lon, up), when in zip(place, _utc(recorded)[rows], strict=True)
    ]
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<gpx version="1.1" creator="fgnav" xmlns="http://www.topografix.com/GPX/1/1">',
        f"<trk><name>{escape(recorded.flight)}</name><trkseg>",
        *points,
        "</trkseg></trk></gpx>",
        "",
    ]
    write_text(path, "\n".join(lines))


def _utc(recorded: RecordedEstimate) -> np.ndarray:
    """Return (n,) texts of UTC times, to the millisecond."""
    utc = utc_of_gps(gps_times(recorded)) + np.timedelta64(500, "us")
    return np.char.add(utc.astype("datetime64[ms]").astype(str), "Z")
