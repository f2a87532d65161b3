"""Satellites without a file: nominal constellations, as the messages they would broadcast."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fgnav.checks import BadInputError, FloatArray
from fgnav.gnss.orbits.broadcast import kepler_orbit
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits, PreciseOrbits

# GPS ionosphere coefficients of a quiet summer day, the size of those broadcast in June 2020.
KLOBUCHAR = np.array(
    [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7, 8.1920e4, 9.8304e4, -6.5536e4, -5.2429e5]
)
_WEEK_S = 604_800.0
_REFERENCE_GPS_S = 2111 * _WEEK_S  # 2020-06-21: where the angles of the tables below hold


@dataclass(frozen=True, slots=True, kw_only=True)
class _Walker:
    """An evenly spread constellation (Walker delta pattern) and its constants.

    ``gm_m3ps2`` and ``earth_rate_radps`` are those of the constellation's interface document, so
    that consecutive messages describe one and the same orbit.
    """

    letter: str
    first: int  # number of the first satellite
    planes: int
    per_plane: int
    phasing: int
    semi_major_axis_m: float
    inclination_rad: float
    node_rate_radps: float  # of the equatorial bulge
    gm_m3ps2: float
    earth_rate_radps: float
    step_s: float  # from one time of ephemeris to the next
    offset_s: float  # GPS time minus the constellation's own
    accuracy_m: float
    data_source: int = 0


_WALKERS = {
    # 26,560 km and 55 degrees: IS-GPS-200. Six planes of five, about as many as fly; this phasing
    # keeps the position dilution of 24 h over Madrid below 3.5 (others reach 12).
    "G": _Walker(
        letter="G", first=1, planes=6, per_plane=5, phasing=5,
        semi_major_axis_m=26_559_800.0, inclination_rad=np.radians(55.0), node_rate_radps=-8.0e-9,
        gm_m3ps2=3.9860050e14, earth_rate_radps=7.2921151467e-5,
        step_s=7200.0, offset_s=0.0, accuracy_m=2.0,
    ),
    # Walker 24/3/1 at 29,600 km and 56 degrees: Galileo OS SIS ICD.
    "E": _Walker(
        letter="E", first=1, planes=3, per_plane=8, phasing=1,
        semi_major_axis_m=29_600_318.0, inclination_rad=np.radians(56.0), node_rate_radps=-5.4e-9,
        gm_m3ps2=3.986004418e14, earth_rate_radps=7.2921151467e-5,
        step_s=3600.0, offset_s=0.0, accuracy_m=3.12, data_source=517,  # I/NAV
    ),
    # Walker 24/3/1 at 27,906 km and 55 degrees: BDS-SIS-ICD; the medium orbits only.
    "C": _Walker(
        letter="C", first=19, planes=3, per_plane=8, phasing=1,
        semi_major_axis_m=27_906_100.0, inclination_rad=np.radians(55.0), node_rate_radps=-6.6e-9,
        gm_m3ps2=3.986004418e14, earth_rate_radps=7.2921150e-5,
        step_s=3600.0, offset_s=14.0, accuracy_m=2.0,
    ),
}  # fmt: skip


def built_in_orbits(
    constellations: tuple[str, ...],
    start_gps_s: float,
    duration_s: float,
    klobuchar: FloatArray = KLOBUCHAR,
) -> BroadcastOrbits:
    """Return the messages of nominal constellations for a flight.

    Parameters
    ----------
    constellations : tuple of str
        RINEX letters: ``"G"`` (30 GPS satellites), ``"E"`` (24 Galileo), ``"C"`` (24 BeiDou MEO).
    start_gps_s, duration_s : float
        The flight; messages reach one interval beyond both its ends.
    klobuchar : ndarray, shape (8,)
        Ionosphere model to broadcast.

    Raises
    ------
    BadInputError
        If a constellation has no built-in almanac.
    """
    records = []
    for walker in _walkers(constellations):
        first = np.floor((start_gps_s - walker.offset_s) / walker.step_s) - 1
        last = np.ceil((start_gps_s + duration_s - walker.offset_s) / walker.step_s) + 1
        toe_own_s = np.arange(first, last + 1) * walker.step_s
        records.append(_messages(walker, toe_own_s, start_gps_s).ravel())
    return BroadcastOrbits(records=np.concatenate(records), klobuchar=klobuchar)


def orbits_of_files(
    navigation: tuple[str, ...], orbits: tuple[str, ...], start_gps_s: float
) -> tuple[BroadcastOrbits | None, PreciseOrbits | None]:
    """Return the messages and the tables of files, each None where no file is named."""
    broadcast = precise = None
    if navigation:
        from fgnav.io.rinex.reader import read_navigation  # noqa: PLC0415  # lazy: few have such files

        broadcast = read_navigation([Path(name) for name in navigation], start_gps_s)
    if orbits:
        from fgnav.io.sp3 import read_precise  # noqa: PLC0415  # lazy: few have such files

        precise = read_precise([Path(name) for name in orbits], start_gps_s)
    return broadcast, precise


def satellites_of(
    orbits: BroadcastOrbits | PreciseOrbits, constellations: Iterable[str]
) -> tuple[str, ...]:
    """Return the satellites of some constellations that orbits know, in order."""
    names = orbits.satellites if isinstance(orbits, PreciseOrbits) else orbits.records["satellite"]
    letters = tuple(constellations)
    return tuple(sorted({str(name) for name in names if name[0] in letters}))


def built_in_positions(
    constellations: tuple[str, ...], start_gps_s: float, t_s: FloatArray
) -> tuple[tuple[str, ...], FloatArray]:
    """Return the satellites of nominal constellations and where they are, (n, s, 3), ECEF.

    The same orbits as ``built_in_orbits``, a hundred thousand scattered times at once.

    Parameters
    ----------
    start_gps_s : float
        GPS time of ``t_s = 0``.
    t_s : ndarray, shape (n,)

    Raises
    ------
    BadInputError
        If a constellation has no built-in almanac.
    """
    names, positions = [], []
    for walker in _walkers(constellations):
        toe_own_s = start_gps_s + t_s - walker.offset_s
        for messages in _messages(walker, toe_own_s, start_gps_s):
            names.append(str(messages["satellite"][0]))
            positions.append(kepler_orbit(names[-1], messages, t_s)[0])
    return tuple(names), np.stack(positions, axis=1)


def _walkers(constellations: tuple[str, ...]) -> list[_Walker]:
    """Return the almanacs of constellations; BadInputError where there is none."""
    for letter in constellations:
        if letter not in _WALKERS:
            raise BadInputError(
                f"signals: no built-in almanac of constellation {letter!r}, only of "
                f"{', '.join(_WALKERS)}; name navigation files"
            )
    return [_WALKERS[letter] for letter in constellations]


def _messages(walker: _Walker, toe_own_s: FloatArray, start_gps_s: float) -> np.ndarray:
    """Return the messages of one constellation, (satellites, epochs).

    ``toe_own_s`` counts from the GPS epoch, in the constellation's own time scale.
    """
    toe_gps_s = toe_own_s + walker.offset_s
    number = np.arange(walker.planes * walker.per_plane)[:, None]
    plane, slot = number // walker.per_plane, number % walker.per_plane
    elapsed_s = toe_gps_s - _REFERENCE_GPS_S
    records = np.zeros((number.size, toe_gps_s.size), dtype=EPHEMERIS_DTYPE)

    records["satellite"] = [[f"{walker.letter}{walker.first + k:02d}"] for k in number[:, 0]]
    records["toe_s"] = records["toc_s"] = toe_gps_s - start_gps_s
    records["toe_sow_s"] = toe_own_s % _WEEK_S
    records["transmission_s"] = records["toe_s"] - walker.step_s
    records["issue"] = (np.round(toe_own_s / walker.step_s) % 250).astype(int)
    records["accuracy_m"], records["data_source"] = walker.accuracy_m, walker.data_source

    records["semi_major_axis_m"] = walker.semi_major_axis_m
    records["eccentricity"] = 0.002 + 0.010 * _spread(number, 1)
    records["inclination_rad"] = walker.inclination_rad + np.radians(_spread(number, 2) - 0.5)
    records["node_rate_radps"] = walker.node_rate_radps
    mean_motion = np.sqrt(walker.gm_m3ps2 / walker.semi_major_axis_m**3)
    phase = slot / walker.per_plane + walker.phasing * plane / number.size
    perigee = 2 * np.pi * _spread(number, 3)
    records["perigee_rad"] = _wrapped(perigee)
    records["mean_anomaly_rad"] = _wrapped(2 * np.pi * phase - perigee + mean_motion * elapsed_s)
    # The message counts the node from Greenwich at the week's start; what is steady is the node's
    # longitude, which moves with the bulge's pull and against the Earth's rotation.
    longitude = 2 * np.pi * plane / walker.planes + np.radians(10.0)
    longitude = longitude + (walker.node_rate_radps - walker.earth_rate_radps) * elapsed_s
    records["node_rad"] = _wrapped(longitude + walker.earth_rate_radps * records["toe_sow_s"])

    drift_sps = 1e-11 * (_spread(number, 4) - 0.5)
    records["af1_sps"] = drift_sps
    records["af0_s"] = 4e-4 * (_spread(number, 5) - 0.5) + drift_sps * (toe_gps_s - start_gps_s)
    return records


def _spread(number: np.ndarray, column: int) -> FloatArray:
    """Return figures in [0, 1) that look arbitrary and never change (golden-ratio sequence)."""
    return np.asarray((number * 0.6180339887 + column * 0.7548776662) % 1.0)


def _wrapped(angle_rad: FloatArray) -> FloatArray:
    return np.asarray((angle_rad + np.pi) % (2 * np.pi) - np.pi)
