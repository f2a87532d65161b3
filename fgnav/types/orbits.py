"""Orbits and clocks of satellites: broadcast ephemerides and precise tables.

Times are GPS time in seconds since the flight's start, whatever the constellation's own time scale.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BadInputError, FloatArray, Unused, freeze, freeze_times, frozen

# One broadcast message of a Keplerian constellation (GPS, Galileo, BeiDou, QZSS), IS-GPS-200 names.
EPHEMERIS_DTYPE = np.dtype(
    [
        ("satellite", "U3"),
        ("toe_s", "f8"),  # time of ephemeris, since the flight's start, GPS time
        ("toe_sow_s", "f8"),  # the same as broadcast: second of the constellation's own week
        ("toc_s", "f8"),  # time of clock, since the flight's start, GPS time
        ("transmission_s", "f8"),  # time of the message, since the flight's start
        ("semi_major_axis_m", "f8"),
        ("eccentricity", "f8"),
        ("inclination_rad", "f8"),
        ("inclination_rate_radps", "f8"),
        ("node_rad", "f8"),  # Omega_0
        ("node_rate_radps", "f8"),
        ("perigee_rad", "f8"),  # omega
        ("mean_anomaly_rad", "f8"),
        ("mean_motion_difference_radps", "f8"),
        ("cuc_rad", "f8"),
        ("cus_rad", "f8"),
        ("crc_m", "f8"),
        ("crs_m", "f8"),
        ("cic_rad", "f8"),
        ("cis_rad", "f8"),
        ("af0_s", "f8"),
        ("af1_sps", "f8"),
        ("af2_sps2", "f8"),
        ("group_delay_s", "f8", (2,)),  # TGD; BGD E5a/E1, E5b/E1; TGD1 B1/B3, TGD2 B2/B3
        ("issue", "i4"),  # IODE, IODnav, AODE
        ("health", "i4"),  # 0: healthy
        ("accuracy_m", "f8"),
        ("data_source", "i4"),  # Galileo: bits of I/NAV and F/NAV; 0 elsewhere
    ]
)


@dataclass(frozen=True, eq=False, slots=True, kw_only=True, weakref_slot=True)
class BroadcastOrbits:
    """Broadcast messages.

    Attributes
    ----------
    records : ndarray of ``EPHEMERIS_DTYPE``, shape (k,)
        The messages, sorted by satellite, then time of ephemeris.
    klobuchar : ndarray, shape (8,)
        GPS ionosphere model, alpha and beta (IS-GPS-200, 20.3.3.5.2.5); zeros where there is none.
    unused : tuple of Unused
        Messages that were read and not kept.
    """

    records: NDArray[Any]
    klobuchar: FloatArray
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        records = np.array(self.records, dtype=EPHEMERIS_DTYPE)
        order = np.lexsort((records["toe_s"], records["satellite"]))
        records = records[order]
        for name in EPHEMERIS_DTYPE.names or ():
            column = records[name]
            if column.dtype.kind == "f" and not np.isfinite(column).all():
                raise BadInputError(f"broadcast orbits {name}: not finite")
        records.flags.writeable = False
        object.__setattr__(self, "records", records)
        object.__setattr__(self, "klobuchar", frozen("klobuchar", self.klobuchar, (8,)))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PreciseOrbits:
    """Tabulated orbits and clocks (SP3).

    Attributes
    ----------
    t_s : ndarray, shape (k,)
        Epochs, strictly increasing.
    satellites : tuple of str, length s
        RINEX names.
    p_e_m : ndarray, shape (k, s, 3)
        ECEF positions of the centre of mass; NaN where absent.
    clock_s : ndarray, shape (k, s)
        Satellite clock offsets; NaN where absent.
    unused : tuple of Unused
        What was read and not kept.
    """

    t_s: FloatArray
    satellites: tuple[str, ...]
    p_e_m: FloatArray
    clock_s: FloatArray
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k, s = freeze_times("precise orbits", self), len(self.satellites)
        freeze("precise orbits", self, {"p_e_m": (k, s, 3), "clock_s": (k, s)}, gaps=True)
