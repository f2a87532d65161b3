"""Columns of a flight's tables: their names, their numbers together, what they may hold."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TypeAlias

import numpy as np

from fgnav.checks import BadInputError, FloatArray, quoted

PLACE = ("latitude_deg", "longitude_deg", "height_m")
VELOCITY = ("vn_mps", "ve_mps", "vd_mps")
EULER = ("roll_deg", "pitch_deg", "yaw_deg")
FORCE = ("fx_mps2", "fy_mps2", "fz_mps2")
RATE = ("wx_radps", "wy_radps", "wz_radps")
EULER_SIGMA = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_yaw_deg")
CURRENTS = ("i1", "i2", "i3", "i4")
CALIBRATION = ("r_quad", "r_c")
HEIGHT = ("height_m",)
FIELD = ("mx_ut", "my_ut", "mz_ut")
POSITION_SIGMA = ("sigma_n_m", "sigma_e_m", "sigma_d_m")
VELOCITY_SIGMA = ("sigma_vn_mps", "sigma_ve_mps", "sigma_vd_mps")
BASELINE = ("north_m", "east_m", "down_m")
BASELINE_COVARIANCE = ("cov_ne_m2", "cov_nd_m2", "cov_ed_m2")
HEADING, PITCH, LENGTH = ("heading_deg",), ("pitch_deg",), ("length_m",)
HEADING_SIGMA, PITCH_SIGMA = ("sigma_heading_deg",), ("sigma_pitch_deg",)
LENGTH_SIGMA = ("sigma_length_m",)
BASELINE_GROUPS: tuple[tuple[str, ...], ...] = (BASELINE, POSITION_SIGMA, BASELINE_COVARIANCE)
BASELINE_GROUPS += (HEADING, HEADING_SIGMA, PITCH, PITCH_SIGMA, LENGTH, LENGTH_SIGMA)
# Columns that say nothing without others.
NEEDS: Mapping[tuple[str, ...], tuple[str, ...]] = {
    VELOCITY_SIGMA: VELOCITY,
    BASELINE_COVARIANCE: POSITION_SIGMA,
    HEADING_SIGMA: HEADING,
    PITCH: HEADING,
    PITCH_SIGMA: PITCH,
    LENGTH: PITCH,
    LENGTH_SIGMA: LENGTH,
}
Samples: TypeAlias = Mapping[str, FloatArray]
Block: TypeAlias = tuple[tuple[str, ...], FloatArray]  # names of columns, (k, c)
LEAST_SIGMA = 1e-6  # m, m/s, deg: no receiver knows its place or velocity better
# What no instrument and no flight has, by the end of a column's name; beyond lies damage, and the
# squares of such numbers overflow. Seconds: 300 years; lengths: the Moon; accelerations and rates:
# a thousand times those of a fired shell; a field: ten times the strongest magnet.
_LARGEST = {
    "latitude_deg": 90.0,
    "_deg": 360.0,
    "_s": 1e10,
    "_mps": 1e6,
    "_mps2": 1e8,
    "_radps": 1e6,
    "_ut": 1e9,
    "_m": 1e9,
}
_LARGEST_OTHER = 1e12  # currents in any unit, ratios
# 1e-13 deg is 10 nm; seconds are kept to 10 ns.
FORMATS = {"t_s": "%.8f", "itude_deg": "%.13f", "_deg": "%.12f"}


def largest(name: str) -> float:
    """Return the largest magnitude that a column of that name may hold."""
    return next((most for end, most in _LARGEST.items() if name.endswith(end)), _LARGEST_OTHER)


def samples(t_s: FloatArray, *blocks: Block) -> Samples:
    """Return a table of times and of blocks, (k, c) or (k,), under their columns' names."""
    table: dict[str, FloatArray] = {"t_s": np.asarray(t_s, np.float64)}
    for names, block in blocks:
        table |= vectors(names, block.reshape(len(t_s), len(names)))
    return table


def vectors(names: tuple[str, ...], block: FloatArray) -> dict[str, FloatArray]:
    """Return columns by name of a block, (k, c)."""
    return {name: np.asarray(block[:, k], np.float64) for k, name in enumerate(names)}


def columns_to_vectors(table: Samples, names: tuple[str, ...]) -> FloatArray:
    """Return (k, c) of c columns."""
    return np.stack([table[name] for name in names], axis=1)


def stated_sigma(
    where: Path | str, samples: Mapping[str, FloatArray], names: tuple[str, ...]
) -> FloatArray | None:
    """Return standard deviations, (k, c); None where the samples have none."""
    if names[0] not in samples:
        return None
    sigma = columns_to_vectors(samples, names)
    wrong = sigma < LEAST_SIGMA
    if wrong.any():
        index, column = np.argwhere(wrong)[0]
        raise BadInputError(
            f"{where}: line {index + 2}: {names[column]} must be {LEAST_SIGMA:g} or more, "
            f"got {sigma[index, column]:.9g}"
        )
    return sigma


def fault_of_columns(
    names: Sequence[str], required: Sequence[str], groups: Sequence[Sequence[str]]
) -> str:
    """Return the fault of a table's columns; nothing of a table that may be.

    Parameters
    ----------
    names, required : sequence of str
        The columns that are there, and those that must be.
    groups : sequence of sequence of str
        Columns that are there in full or not at all.
    """
    allowed = [*required, *(name for group in groups for name in group)]
    for name in names:
        if name not in allowed:
            near = get_close_matches(name[:80], allowed, n=1, cutoff=0.0)[0]
            return f"unknown column {quoted(name)}; the nearest known one is {near!r}"
        if names.count(name) > 1:
            return f"column {name!r} must appear once"
    wanted = [list(required)] + [list(g) for g in groups if any(name in names for name in g)]
    missing = [name for group in wanted for name in group if name not in names]
    if missing:
        return f"column {missing[0]!r} is missing"
    for group, needed in NEEDS.items():
        if group in groups and group[0] in names and needed[0] not in names:
            return f"{group[0]} needs {', '.join(needed)}"
    return ""
