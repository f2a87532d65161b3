"""The two real antennas of the Wettzell recordings, as a flight whose integers are known."""

from pathlib import Path

import numpy as np

from fgnav.checks import BoolArray, IntArray
from fgnav.geometry import rotations
from fgnav.integers.resolvers.truth import true_integers
from fgnav.types.differences import DoubleDifferences

from .test_wettzell import BASELINE_ENU_M, FLIGHT_TOML, of_signals

__all__ = ["of_signals", "right_cycles", "surveyed_cycles", "write_flight"]


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
