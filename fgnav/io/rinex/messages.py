"""The messages of navigation files as ``BroadcastOrbits``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, BoolArray, FloatArray, Loss
from fgnav.io.gps_time import BDT_BEHIND_GPS_S, WEEK_S
from fgnav.io.rinex.navigation import NavigationScan
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits

# Nominal user range accuracy by index, m: IS-GPS-200N, 20.3.3.3.1.3; 15 states none.
URA_M = np.array(
    [2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24, 48, 96, 192, 384, 768, 1536, 3072, 6144, 8192]
)
_NO_ACCURACY_M = 8192.0
_LARGEST_SISA_M = 6.0  # OS SIS ICD 2.1, table 89
_DAY_S = 86_400.0
_WEEKS = 1024  # after which receivers' week numbers begin anew
BDT_WEEK = 1356  # GPS week of BeiDou's week 0
# Field of the record: column of a message's numbers (RINEX 3.05, tables A6, A8, A14).
PLAIN = {
    "af0_s": 0,
    "af1_sps": 1,
    "af2_sps2": 2,
    "issue": 3,
    "crs_m": 4,
    "mean_motion_difference_radps": 5,
    "mean_anomaly_rad": 6,
    "cuc_rad": 7,
    "eccentricity": 8,
    "cus_rad": 9,
    "toe_sow_s": 11,
    "cic_rad": 12,
    "node_rad": 13,
    "cis_rad": 14,
    "inclination_rad": 15,
    "crc_m": 16,
    "perigee_rad": 17,
    "node_rate_radps": 18,
    "inclination_rate_radps": 19,
    "health": 24,
}
ROOT_A, DATA_SOURCE, WEEK, ACCURACY, DELAYS, TRANSMISSION = 10, 20, 21, 23, slice(25, 27), 27


def to_broadcast(
    scans: Sequence[NavigationScan], path: Path, start_gps_s: float
) -> BroadcastOrbits:
    """Return the messages of several files, each once.

    Parameters
    ----------
    scans : sequence of NavigationScan
        Of the files, in order.
    path : Path
        The first file, for the error text.

    Returns
    -------
    BroadcastOrbits
        Messages with an impossible orbit and repeated ones are counted as losses.

    Raises
    ------
    BadInputError
        If none is left.
    """
    parts = [_records(scan, start_gps_s) for scan in scans]
    records = np.concatenate([one for one, _ in parts])
    possible = _possible(records) & np.concatenate([fits for _, fits in parts])
    losses = [loss for scan in scans for loss in scan.losses]
    if not possible.all():
        reason = "impossible orbit or time"
        count = int(np.count_nonzero(~possible))
        losses.append(Loss(what="broadcast message", reason=reason, count=count))
    records, repeated = _each_once(records[possible])
    if repeated:
        losses.append(Loss(what="broadcast message", reason="repeated", count=repeated))
    if not len(records):
        raise BadInputError(f"{path}: no message has a possible orbit")
    models = [scan.klobuchar for scan in scans if scan.klobuchar.any()]
    klobuchar = models[-1] if models else np.zeros(8)
    return BroadcastOrbits(records=records, klobuchar=klobuchar, losses=tuple(losses))


def _records(scan: NavigationScan, start_gps_s: float) -> tuple[NDArray[Any], BoolArray]:
    """Return messages in our own names and units, and whether their weeks are those of their dates.

    The time of ephemeris is the one nearest to the time of clock: week numbers may have begun anew.
    """
    x, names = scan.numbers, scan.satellites
    records = np.zeros(len(names), EPHEMERIS_DTYPE)
    records["satellite"] = names
    for field, column in PLAIN.items():
        records[field] = x[:, column]
    galileo, beidou = (np.char.startswith(names, letter) for letter in "EC")
    records["semi_major_axis_m"] = x[:, ROOT_A] ** 2
    toc_s = scan.clock_times_s + BDT_BEHIND_GPS_S * beidou  # since 1980, as are those below
    toe_s = _nearest_s(x[:, PLAIN["toe_sow_s"]] + BDT_BEHIND_GPS_S * beidou, toc_s)
    ttr_s = _nearest_s(x[:, TRANSMISSION] + BDT_BEHIND_GPS_S * beidou, toe_s)
    # An unknown time of transmission is written 0.9999E+09 or left blank.
    stated = (np.abs(x[:, TRANSMISSION]) < 2 * WEEK_S) & (np.abs(ttr_s - toe_s) < _DAY_S)
    records["toe_s"], records["toc_s"] = toe_s - start_gps_s, toc_s - start_gps_s
    records["transmission_s"] = np.where(stated, ttr_s, toe_s) - start_gps_s
    records["group_delay_s"] = x[:, DELAYS]
    records["group_delay_s"][~(galileo | beidou), 1] = 0.0  # there stands the issue of the clock
    accuracy_m = x[:, ACCURACY]
    sisa_m = np.where((accuracy_m >= 0) & (accuracy_m <= _LARGEST_SISA_M), accuracy_m, np.inf)
    ura_m = URA_M[np.searchsorted(URA_M, accuracy_m).clip(0, 15)]
    records["accuracy_m"] = np.minimum(np.where(galileo, sisa_m, ura_m), _NO_ACCURACY_M)
    records["data_source"] = np.where(galileo, x[:, DATA_SOURCE], 0)
    weeks = x[:, WEEK] + BDT_WEEK * beidou - np.floor(toe_s / WEEK_S)
    return records, np.abs((weeks + _WEEKS // 2) % _WEEKS - _WEEKS // 2) <= 1


def _nearest_s(second_of_week: FloatArray, near_s: FloatArray) -> FloatArray:
    """Return the times of seconds of a week that lie nearest to others."""
    return np.asarray(near_s + (second_of_week - near_s + WEEK_S / 2) % WEEK_S - WEEK_S / 2)


def _possible(records: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell which messages describe an Earth orbit, with a clock of about the same time."""
    a, e = records["semi_major_axis_m"], records["eccentricity"]
    orbit = (a > 1e7) & (a < 1e8) & (e >= 0) & (e < 0.5)
    return np.asarray(orbit & (np.abs(records["toe_s"] - records["toc_s"]) < _DAY_S))


def _each_once(records: NDArray[Any]) -> tuple[NDArray[Any], int]:
    """Return the records without repetitions, and how many there were.

    Two messages that differ only in their time of transmission are the same; the first one counts.
    """
    order = np.lexsort((records["transmission_s"], records["toe_s"], records["satellite"]))
    records = records[order]
    content = records.copy()
    content["transmission_s"] = 0.0
    _, first = np.unique(content, return_index=True)
    return records[np.sort(first)], len(records) - len(first)
