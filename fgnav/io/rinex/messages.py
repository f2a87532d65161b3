"""RTKLIB's broadcast messages, compared with the scan of the file, as ``BroadcastOrbits``."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, Loss
from fgnav.io.decoder import Decoded
from fgnav.io.gps_time import UNIX_OF_GPS_S
from fgnav.io.rinex.header import Header
from fgnav.io.rinex.navigation import NavigationScan
from fgnav.types.orbits import EPHEMERIS_DTYPE, BroadcastOrbits

# Nominal user range accuracy by index, m: IS-GPS-200N, 20.3.3.3.1.3; 15 states none.
URA_M = np.array(
    [2.4, 3.4, 4.85, 6.85, 9.65, 13.65, 24, 48, 96, 192, 384, 768, 1536, 3072, 6144, 8192]
)
_NO_ACCURACY_M = 8192.0
_DAY_S = 86_400.0
_PLAIN = {  # field of the record: field of RTKLIB's eph_t
    "toe_sow_s": "toes",
    "semi_major_axis_m": "A",
    "eccentricity": "e",
    "inclination_rad": "i0",
    "inclination_rate_radps": "idot",
    "node_rad": "OMG0",
    "node_rate_radps": "OMGd",
    "perigee_rad": "omg",
    "mean_anomaly_rad": "M0",
    "mean_motion_difference_radps": "deln",
    "cuc_rad": "cuc",
    "cus_rad": "cus",
    "crc_m": "crc",
    "crs_m": "crs",
    "cic_rad": "cic",
    "cis_rad": "cis",
    "af0_s": "f0",
    "af1_sps": "f1",
    "af2_sps2": "f2",
    "issue": "iode",
    "health": "svh",
}


def to_broadcast(
    headers: Sequence[Header], scans: Sequence[NavigationScan], decoded: Decoded, start_gps_s: float
) -> BroadcastOrbits:
    """Return the messages of several files, each once.

    Parameters
    ----------
    headers, scans : sequence of Header, NavigationScan
        Of the files, in order.
    decoded : Decoded
        Their records of RTKLIB's ``Message``.

    Returns
    -------
    BroadcastOrbits
        Messages with an impossible orbit and repeated ones are counted as losses.

    Raises
    ------
    BadInputError
        If RTKLIB decoded something else than stands in a file.
    """
    parts = []
    for k, (header, scan) in enumerate(zip(headers, scans, strict=True)):
        messages = decoded.records(k)
        names = decoded.satellites[messages["sat"]]
        if not np.array_equal(names, scan.satellites):
            raise BadInputError(
                f"{header.path}: RTKLIB decoded {len(names)} messages, the file holds "
                f"{len(scan.satellites)}, or of other satellites; please report this file"
            )
        parts.append(_records(names, messages, start_gps_s))
    records = np.concatenate(parts)
    losses = [loss for scan in scans for loss in scan.losses]
    possible = _possible(records)
    if not possible.all():
        reason = "impossible orbit or time"
        count = int(np.count_nonzero(~possible))
        losses.append(Loss(what="broadcast message", reason=reason, count=count))
    records, repeated = _each_once(records[possible])
    if repeated:
        losses.append(Loss(what="broadcast message", reason="repeated", count=repeated))
    if not len(records):
        raise BadInputError(f"{headers[0].path}: no message has a possible orbit")
    models = [scan.klobuchar for scan in scans if scan.klobuchar.any()]
    klobuchar = models[-1] if models else np.zeros(8)
    return BroadcastOrbits(records=records, klobuchar=klobuchar, losses=tuple(losses))


def _records(names: NDArray[np.str_], messages: NDArray[Any], start_gps_s: float) -> NDArray[Any]:
    """Return RTKLIB's messages in our own names and units."""
    records = np.zeros(len(messages), EPHEMERIS_DTYPE)
    records["satellite"] = names
    for field, theirs in _PLAIN.items():
        records[field] = messages[theirs]
    toe_s, toc_s, ttr_s = (_since(messages[name], start_gps_s) for name in ("toe", "toc", "ttr"))
    records["toe_s"], records["toc_s"] = toe_s, toc_s
    # An unknown time of transmission is written 0.9999E+09 or left blank.
    records["transmission_s"] = np.where(np.abs(ttr_s - toe_s) < _DAY_S, ttr_s, toe_s)
    records["group_delay_s"] = messages["tgd"][:, :2]
    galileo = np.char.startswith(names, "E")
    sva = messages["sva"]
    records["accuracy_m"] = np.where(galileo, _sisa_m(sva), URA_M[sva.clip(0, 15)])
    records["data_source"] = np.where(galileo, messages["code"], 0)
    return records


def _since(time: NDArray[Any], start_gps_s: float) -> FloatArray:
    return np.asarray((time["time"] - UNIX_OF_GPS_S) - start_gps_s + time["sec"])


def _sisa_m(index: NDArray[Any]) -> FloatArray:
    """Return Galileo's signal-in-space accuracy of an index (OS SIS ICD 2.1, table 89)."""
    i = index.astype(float)
    steps = [0.01 * i, 0.5 + 0.02 * (i - 50), 1 + 0.04 * (i - 75), 2 + 0.16 * (i - 100)]
    value = np.select([i < 50, i < 75, i < 100, i <= 125], steps, _NO_ACCURACY_M)
    return np.where(i < 0, _NO_ACCURACY_M, value)


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
