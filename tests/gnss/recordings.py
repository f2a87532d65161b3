"""The reference recordings the front end is checked on."""

from functools import cache
from pathlib import Path

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.earth import Origin, ecef, geodetic
from fgnav.io.antennas import merge
from fgnav.io.rinex.reader import read_navigation, read_rinex
from fgnav.io.sp3 import read_precise
from fgnav.types.flight import Antenna, Flight
from fgnav.types.orbits import BroadcastOrbits, PreciseOrbits

START_UNIX_S = 1_593_043_200  # 2020-06-25 00:00:00, as RTKLIB counts GPS time
START_GPS_S = START_UNIX_S - 315_964_800.0
# Antenna reference points, from the README of the recording: WTZR, and WTZZ against it.
_WTZR_E_M = np.array([4075580.3111, 931854.0543, 4801568.2808])
_WTZR_HEIGHT_M = 0.071
BASELINE_N_M = np.array([1.53566, -0.41788, -0.08652])


@cache
def broadcast(shared: Path) -> BroadcastOrbits:
    path = shared / "orbits" / "ESBC00DNK_R_20201770000_01D_MN.rnx"
    return read_navigation([path], START_GPS_S)


@cache
def precise(shared: Path) -> PreciseOrbits:
    return read_precise([shared / "orbits" / "COD0MGXFIN_20201770000_01D_05M_ORB.SP3"], START_GPS_S)


def observation_files(shared: Path) -> list[Path]:
    return sorted((shared / "wettzell").glob("*.rnx"))


@cache
def wettzell(shared: Path) -> Flight:
    """Return the pair as a flight: 120 epochs of 30 s, origin at the antenna of WTZR."""
    names = ("WTZR", "WTZZ")
    arms = (np.zeros(3), np.array([1.59385, 0.0, 0.0]))
    return Flight(
        name="wettzell",
        start_gps_s=START_GPS_S,
        origin=_origin(),
        antennas=tuple(
            Antenna(name=name, position_b_m=arm) for name, arm in zip(names, arms, strict=True)
        ),
        observations=merge(read_rinex([], observation_files(shared), START_GPS_S)[1], names),
        broadcast=broadcast(shared),
    )


def _origin() -> Origin:
    latitude, longitude, height = geodetic(_WTZR_E_M[None])[0]
    return Origin(latitude_rad=latitude, longitude_rad=longitude, height_m=height + _WTZR_HEIGHT_M)


def esbjerg_e_m() -> FloatArray:
    """Return roughly where the station stood that recorded the messages, (3,)."""
    return ecef(*np.radians([[55.49], [8.46]]), np.array([50.0]))[0]
