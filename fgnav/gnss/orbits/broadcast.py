"""One satellite by its broadcast messages: which message, where, what clock, what group delays."""

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.earth import C_MPS, SEMI_MAJOR_AXIS_M
from fgnav.gnss.orbits.turning import turned
from fgnav.types.orbits import BroadcastOrbits

# m3/s2 and rad/s of each interface document: IS-GPS-200N table 20-IV (QZSS the same), Galileo OS
# SIS ICD 2.1 table 58, BDS-SIS-ICD-B1I-3.0 section 3.2.
_GM = {"G": 3.9860050e14, "J": 3.9860050e14, "E": 3.986004418e14, "C": 3.986004418e14}
_EARTH_RATE = {"G": 7.2921151467e-5, "J": 7.2921151467e-5, "E": 7.2921151467e-5, "C": 7.2921150e-5}
_MAX_AGE_S = {"G": 7200.0, "J": 7200.0, "E": 14400.0, "C": 21600.0}  # from the time of ephemeris
_GEO_TILT_RAD = np.radians(-5.0)  # BDS-SIS-ICD-B1I-3.0, table 5-11
_GEO = {f"C{prn:02d}" for prn in (*range(1, 6), *range(59, 64))}
_INAV_CLOCK, _FNAV_CLOCK = 1 << 9, 1 << 8  # RINEX data source: clock of (E5b, E1), of (E5a, E1)
_QZSS_LEX = 1  # health bit of a signal nobody here uses

_L1_HZ, _L5_HZ = 1575.42e6, 1176.45e6
_B1I_HZ, _B2I_HZ, _B3I_HZ = 1561.098e6, 1207.14e6, 1268.52e6  # B2I shares its carrier with E5b


class Chosen(NamedTuple):
    """A satellite's messages, and which of them is to be used at each of n times."""

    records: NDArray[Any]
    row: IntArray  # (n,)
    usable: BoolArray  # (n,)
    unhealthy: BoolArray  # (n,), not usable because of the message's health


class _Messages(NamedTuple):
    """A satellite's k messages in order of their times of ephemeris."""

    records: NDArray[Any]
    toe_s: FloatArray  # (k,)
    until_s: FloatArray  # (k - 1,); when the next one's time of ephemeris is nearer
    sound: BoolArray  # (k,)
    ill: BoolArray  # (k,)


_MESSAGES: WeakKeyDictionary[BroadcastOrbits, dict[str, _Messages]] = WeakKeyDictionary()


def choose(orbits: BroadcastOrbits, satellite: str, t_s: FloatArray) -> Chosen:
    """Return the message for each time, whether it is usable, and whether its health forbids it."""
    by_satellite = _MESSAGES.setdefault(orbits, {})
    if satellite not in by_satellite:
        by_satellite[satellite] = _messages(orbits, satellite)
    records, toe_s, until_s, sound, ill = by_satellite[satellite]
    if not len(records):
        nobody = np.zeros(len(t_s), dtype=bool)
        return Chosen(records, nobody.astype(np.int64), nobody, nobody)
    k = np.searchsorted(until_s, t_s)
    fresh = (np.abs(t_s - toe_s[k]) <= _MAX_AGE_S[satellite[0]]) & sound[k]
    return Chosen(records, k, fresh & ~ill[k], fresh & ill[k])


def _messages(orbits: BroadcastOrbits, satellite: str) -> _Messages:
    bounds = (np.searchsorted(orbits.records["satellite"], satellite, s) for s in ("left", "right"))
    records = orbits.records[slice(*bounds)]
    if satellite[0] not in _GM:
        records = records[:0]
    if satellite[0] == "E" and (records["data_source"] & _INAV_CLOCK).any():
        records = records[(records["data_source"] & _INAV_CLOCK) != 0]
    records = records[np.lexsort((records["transmission_s"], records["toe_s"]))]
    # The latest of equal toe.
    records = records[np.diff(records["toe_s"], append=np.inf) > 0]
    toe_s = records["toe_s"]
    # Receivers write down empty messages, too.
    sound = (records["eccentricity"] < 1.0) & (records["semi_major_axis_m"] > SEMI_MAJOR_AXIS_M)
    ill = (records["health"] & (~_QZSS_LEX if satellite[0] == "J" else ~0)) != 0
    return _Messages(records, toe_s, (toe_s[1:] + toe_s[:-1]) / 2, sound, ill)


def _eccentric_anomaly(mean_rad: FloatArray, eccentricity: FloatArray) -> FloatArray:
    """Solve Kepler's equation; NaN where Newton's method fails (eccentricity near 1)."""
    E = mean_rad + eccentricity * np.sin(mean_rad)
    step = np.full_like(E, np.inf)
    for _ in range(20):  # 4 are enough below an eccentricity of 0.2
        step = (E - eccentricity * np.sin(E) - mean_rad) / (1 - eccentricity * np.cos(E))
        E = E - step
        if (np.abs(step) < 1e-14).all():
            break
    return np.asarray(np.where(np.abs(step) < 1e-12, E, np.nan))


def kepler_orbit(
    satellite: str, message: NDArray[Any], t_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return positions (n, 3) and clocks (n,) of one satellite by its own message for each time."""
    gm, earth_rate = _GM[satellite[0]], _EARTH_RATE[satellite[0]]
    a, e = message["semi_major_axis_m"], message["eccentricity"]
    tk = t_s - message["toe_s"]
    n = np.sqrt(gm / a**3) + message["mean_motion_difference_radps"]
    E = _eccentric_anomaly(message["mean_anomaly_rad"] + n * tk, e)
    phi = np.arctan2(np.sqrt(1 - e**2) * np.sin(E), np.cos(E) - e) + message["perigee_rad"]
    s2, c2 = np.sin(2 * phi), np.cos(2 * phi)
    u = phi + message["cus_rad"] * s2 + message["cuc_rad"] * c2
    r = a * (1 - e * np.cos(E)) + message["crs_m"] * s2 + message["crc_m"] * c2
    i = message["inclination_rad"] + message["inclination_rate_radps"] * tk
    i = i + message["cis_rad"] * s2 + message["cic_rad"] * c2
    geo = satellite in _GEO
    node_rate = message["node_rate_radps"] - (0.0 if geo else earth_rate)
    node = message["node_rad"] + node_rate * tk - earth_rate * message["toe_sow_s"]
    x, y = r * np.cos(u), r * np.sin(u)
    p = np.stack(
        [
            x * np.cos(node) - y * np.cos(i) * np.sin(node),
            x * np.sin(node) + y * np.cos(i) * np.cos(node),
            y * np.sin(i),
        ],
        axis=1,
    )
    if geo:  # elements refer to axes tilted by 5 degrees that do not turn with the Earth
        s, c = np.sin(_GEO_TILT_RAD), np.cos(_GEO_TILT_RAD)
        tilted = np.stack([p[:, 0], c * p[:, 1] + s * p[:, 2], -s * p[:, 1] + c * p[:, 2]], axis=1)
        p = turned(tilted, -earth_rate * tk)
    tc = t_s - message["toc_s"]
    clock = message["af0_s"] + (message["af1_sps"] + message["af2_sps2"] * tc) * tc
    return p, clock - 2 * np.sqrt(gm * a) * e * np.sin(E) / C_MPS**2


def signal_delay_s(
    satellite: str,
    carrier_hz: float,
    message: NDArray[Any],
    precise_clocks: bool,
) -> FloatArray:
    """Return the delay of one signal by each message, (n,)."""
    first, second = message["group_delay_s"].T
    gamma = (_L1_HZ / carrier_hz) ** 2
    if satellite[0] == "C":  # BDS-SIS-ICD-B1I-3.0, 5.2.4.10: the clock is that of B3I
        of_carrier = np.asarray(
            {_B1I_HZ: first, _B2I_HZ: second}.get(carrier_hz, np.zeros_like(first))
        )
        pair = first * _B1I_HZ**2 / (_B1I_HZ**2 - _B3I_HZ**2)
        return of_carrier - pair if precise_clocks else of_carrier
    if satellite[0] == "E":  # OS SIS ICD 2.1, 5.1.5: each clock is that of its pair with E1
        fnav = (message["data_source"] & _FNAV_CLOCK) != 0
        e1 = np.where(fnav | precise_clocks, first, second)
        of_carrier = np.asarray(
            {_L5_HZ: first, _B2I_HZ: second}.get(carrier_hz, np.zeros_like(first))
        )
        return np.asarray(e1 + (gamma - 1) * of_carrier)
    return np.asarray(gamma * first)  # IS-GPS-200N, 20.3.3.3.3.2
