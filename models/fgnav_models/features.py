"""Inputs of the ambiguity networks, from an array's double differences (numpy only).

Satellites stand by falling elevation. Differences are against the first antenna and the first
satellite, baseline by baseline: ``(b1, j1), (b1, j2), …, (b2, j1), …``, 35 for the paper's eight
antennas and six satellites. Phase is wrapped to half a cycle on both sides, so that its integer is
small.
"""

from typing import Literal, TypeAlias, get_args

import numpy as np

from fgnav.checks import BadInputError, FloatArray, IntArray

Input: TypeAlias = Literal["range", "phase", "constellation", "geometry", "time"]
INPUTS: tuple[Input, ...] = get_args(Input)
HARMONICS = 16  # of the day, in the input "time"
_DAY_S = 86_400.0


def by_elevation(elevation_rad: FloatArray) -> IntArray:
    """Return the order of satellites that the networks expect, (n, m): the highest first.

    Empty slots, NaN, come last.
    """
    return np.argsort(-np.nan_to_num(elevation_rad, nan=-np.pi), axis=1, kind="stable")


def double_differences(links: FloatArray) -> FloatArray:
    """Return double differences of undifferenced links: (n, a, m) → (n, (a-1)(m-1))."""
    single = links[:, 1:] - links[:, :1]
    return np.asarray((single[:, :, 1:] - single[:, :, :1]).reshape(len(links), -1))


def wrapped(phase_cycles: FloatArray) -> tuple[FloatArray, IntArray]:
    """Return phase within half a cycle of zero, and the whole cycles taken off.

    The networks answer ``round(range / wavelength)``. For a receiver's phase, whose integer is
    arbitrary, the integer of ``fgnav`` (phase = range + wavelength x integer) is what was taken off
    minus that answer. A gap, NaN, stays one and has no cycles.
    """
    cycles = np.round(phase_cycles)
    integers = np.where(np.isfinite(cycles), cycles, 0.0).astype(np.int64)
    return np.asarray(phase_cycles - cycles), integers


def ambiguity_inputs(
    names: tuple[Input, ...],
    *,
    range_cycles: FloatArray,
    phase_cycles: FloatArray,
    e_n: FloatArray,
    t_s: FloatArray,
) -> FloatArray:
    """Return one row of features per epoch, in the order of ``names``.

    Parameters
    ----------
    names : tuple of str
        ``"range"``: the double-differenced ranges (35 columns); ``"phase"``: sine and cosine of the
        wrapped phases (70); ``"constellation"``: position dilution of precision (1);
        ``"geometry"``: e_j - e_1 of each satellite (15); ``"time"``: sine and cosine of the time of
        day and its harmonics (32).
    range_cycles : ndarray, shape (n, d)
        Double-differenced code, in wavelengths. NaN where there is none; becomes 0.
    phase_cycles : ndarray, shape (n, d)
        Double-differenced phase, any whole cycles, likewise.
    e_n : ndarray, shape (n, m, 3)
        Unit vectors to the satellites, 0 where there is none.
    t_s : ndarray, shape (n,)
        Time of day.

    Returns
    -------
    ndarray, shape (n, f), float32

    Raises
    ------
    BadInputError
        If a name is unknown or there is none.
    """
    if not names or not set(names) <= set(INPUTS):
        raise BadInputError(f"inputs: must be some of {', '.join(INPUTS)}, got {names}")
    columns = []
    for name in names:
        if name == "range":
            columns.append(np.nan_to_num(range_cycles))
        elif name == "phase":
            columns += [_turned(phase_cycles, np.sin), _turned(phase_cycles, np.cos)]
        elif name == "constellation":
            columns.append(_position_dilution(e_n)[:, None])
        elif name == "geometry":
            is_present = (e_n != 0).any(axis=2, keepdims=True)
            columns.append(np.where(is_present, e_n - e_n[:, :1], 0.0)[:, 1:].reshape(len(e_n), -1))
        else:
            angle = 2 * np.pi / _DAY_S * t_s[:, None] * np.arange(1, HARMONICS + 1)
            columns += [np.sin(angle), np.cos(angle)]
    return np.concatenate(columns, axis=1).astype(np.float32)


def _turned(phase_cycles: FloatArray, of: np.ufunc) -> FloatArray:
    is_present = np.isfinite(phase_cycles)
    return np.asarray(
        np.where(is_present, of(2 * np.pi * np.where(is_present, phase_cycles, 0.0)), 0.0)
    )


def _position_dilution(e_n: FloatArray) -> FloatArray:
    """Return the position dilution of precision of unit vectors, (n,), at most 99."""
    is_present = (e_n != 0).any(axis=2, keepdims=True).astype(float)
    design = np.concatenate([e_n, is_present], axis=2)
    normal = design.swapaxes(1, 2) @ design + 1e-9 * np.eye(4)
    variances = np.linalg.inv(normal)[:, range(3), range(3)]
    return np.asarray(np.sqrt(variances.sum(axis=1)).clip(max=99.0))
