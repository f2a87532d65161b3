"""The two real antennas of the Wettzell recordings, as a flight whose integers are known.

IGS stations, 1.594 m apart, an epoch in 30 s (README of the data).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import true_integers
from fgnav.types.differences import DoubleDifferences

BASELINE_ENU_M = np.array([-0.41788, 1.53566, 0.08652])

FLIGHT_TOML = """
format = "fgnav-flight/1"
name = "Wettzell"
start = "2020-06-25T00:00:00"
origin = {{ latitude_deg = 49.144199, longitude_deg = 12.878912, height_m = 666.0 }}
[[antenna]]
name = "WTZR"
position_b_m = [0.0, 0.0, 0.0]
observations = "{data}/wettzell/WTZR00DEU_R_20201770000_01D_30S_MO_120epoch.rnx"
[[antenna]]
name = "WTZZ"
position_b_m = [{length_m}, 0.0, 0.0]
observations = "{data}/wettzell/WTZZ00DEU_R_20201770000_01D_30S_MO_120epoch.rnx"
[gnss]
navigation = ["{data}/orbits/ESBC00DNK_R_20201770000_01D_MN.rnx"]
elevation_mask_deg = 10.0
code_noise_m = 0.5
phase_noise_m = 0.003
elevation_weights = "sine"
"""


def of_signals(d: DoubleDifferences, wanted: set[str], mask_deg: float = 10.0) -> DoubleDifferences:
    """Return the differences without code where a signal is not wanted or a satellite is low."""
    channels = zip(d.satellites, d.signals, strict=True)
    unwanted = [satellite[0] + signal[0] not in wanted for satellite, signal in channels]
    gone = np.array(unwanted) | ~(d.elevation_rad >= np.radians(mask_deg))
    return replace(d, code_m=np.where(gone[:, None, :], np.nan, d.code_m))


def write_flight(folder: Path, data: Path) -> Path:
    """Write the flight's folder and return it."""
    length_m = np.linalg.norm(BASELINE_ENU_M)
    text = FLIGHT_TOML.format(data=data.resolve(), length_m=length_m)
    (folder / "flight.toml").write_text(text)
    return folder


def surveyed_cycles(d: DoubleDifferences) -> IntArray:
    """Return the integers of the surveyed baseline, (n, 1, m)."""
    north, east, up = BASELINE_ENU_M[[1, 0, 2]]
    yaw, pitch = np.arctan2(east, north), np.arcsin(up / np.linalg.norm(BASELINE_ENU_M))
    R_nb = rotations.from_euler(np.zeros(1), np.array([pitch]), np.array([yaw]))
    return true_integers(d, np.repeat(R_nb, len(d.t_s), axis=0))


def right_cycles(d: DoubleDifferences, cycles: IntArray) -> BoolArray:
    """Return the epochs whose integers are all those of the surveyed baseline, (n,)."""
    links = d.resolvable
    return np.asarray(
        ((cycles == surveyed_cycles(d)) | ~links).all(axis=(1, 2)) & links.any(axis=(1, 2))
    )
