"""Origin and start of files: by a fix, by a RINEX header, by the code of the first epochs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray, NoSolutionError
from fgnav.geometry.earth import Origin, geodetic
from fgnav.gnss.single_point.solution import code_solution
from fgnav.io.flight.columns import PLACE
from fgnav.io.gps_time import date_to_gps_s
from fgnav.io.importers.recording import Recording
from fgnav.io.rinex.header import Header, read_header
from fgnav.io.rinex.reader import read_rinex
from fgnav.io.rinex.text import read_text
from fgnav.io.sp3 import read_precise
from fgnav.types.flight import Antenna, Flight

_NOWHERE = Origin(latitude_rad=0.0, longitude_rad=0.0, height_m=0.0)


def origin_of(recordings: Sequence[Recording], start_gps_s: float) -> Origin | None:
    """Return the place of the first fix, of a RINEX header, or of the code; None of nothing."""
    for kind in ("fixes", "truth"):
        for table in (recording.tables.get(kind) for recording in recordings):
            if table is not None:
                latitude_deg, longitude_deg, height_m = (float(table[name][0]) for name in PLACE)
                return Origin(
                    latitude_rad=np.radians(latitude_deg),
                    longitude_rad=np.radians(longitude_deg),
                    height_m=height_m,
                )
    observations = [path for recording in recordings for path in recording.observations]
    for path in observations:
        words = _header(path).text_of("APPROX POSITION XYZ").split()
        p_e_m = np.array([[float(word) for word in words[:3]]]) if len(words) >= 3 else np.zeros(3)
        if p_e_m.any():
            return _origin(p_e_m)
    navigation = [path for recording in recordings for path in recording.navigation]
    orbits = [path for recording in recordings for path in recording.orbits]
    if not observations or not (navigation or orbits):
        return None
    broadcast, (first,) = read_rinex(navigation, observations[:1], start_gps_s)
    flight = Flight(
        name="first epochs",
        start_gps_s=start_gps_s,
        origin=_NOWHERE,
        antennas=(Antenna(name="first", position_b_m=np.zeros(3)),),
        observations=first,
        broadcast=broadcast,
        precise=read_precise(orbits, start_gps_s) if orbits else None,
    )
    try:
        return _origin(_NOWHERE.to_e(code_solution(flight).p_n_m[:1]))
    except (NoSolutionError, BadInputError):  # a receiver in orbit has no origin on the ground
        return None


def first_epoch_gps_s(path: Path) -> float | None:
    """Return the first epoch of a RINEX header, its seconds cut off; None of none."""
    gps_s = np.floor(date_to_gps_s(_header(path).text_of("TIME OF FIRST OBS").split()))
    return float(gps_s) if np.isfinite(gps_s) else None


def _header(path: Path) -> Header:
    return read_header(path, read_text(path), "observations")


def _origin(p_e_m: FloatArray) -> Origin:
    latitude_rad, longitude_rad, height_m = geodetic(p_e_m)[0].tolist()
    return Origin(latitude_rad=latitude_rad, longitude_rad=longitude_rad, height_m=height_m)
