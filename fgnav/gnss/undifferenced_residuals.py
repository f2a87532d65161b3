"""Code and phase of one receiver less what orbits, clocks and models of the atmosphere explain."""

from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray, IntArray, NoSolutionError
from fgnav.geometry.earth import C_MPS, geodetic
from fgnav.gnss.atmosphere import saastamoinen_m
from fgnav.gnss.orbits.satellites import angles, signal_paths
from fgnav.gnss.signals import band, frequency_hz, select
from fgnav.gnss.single_point.model import CodeChannels, atmosphere_m, code_ranges
from fgnav.gnss.single_point.solution import BLOCK
from fgnav.types.flight import Flight
from fgnav.types.observations import HALF_CYCLE, Observations

_LEAST_ERROR_M = 0.01  # of satellites that are stated without errors: far below code noise
_SAME_S = 1e-3  # epochs of vehicle and base this close are one
_LOWEST_RAD = 0.05  # models of the atmosphere are not asked about less


class Residuals(NamedTuple):
    """Residuals of one receiver's observations, (n, m); NaN where there are none."""

    code_m: FloatArray
    phase_m: FloatArray
    e_n: FloatArray
    elevation_rad: FloatArray
    error_m: FloatArray


def residuals_of_base(
    flight: Flight, t_s: FloatArray, names: list[tuple[str, str]]
) -> tuple[Residuals, IntArray]:
    """Return the residuals of the base's observations at epochs, (n,), and its flags."""
    base = flight.base
    if base is None:
        raise NoSolutionError(f"flight {flight.name}: has no base station")
    of_rover = {(s[0], band(s, g)): g for s, g in names}
    chosen = select(base.observations, causal=True, preferred=of_rover)
    pairs = zip(chosen.satellites, chosen.signals, strict=True)
    column_of = {
        (s, band(s, g)): int(c) for (s, g), c in zip(pairs, chosen.channel[0], strict=True)
    }
    columns = np.array([column_of.get((s, band(s, g)), -1) for s, g in names], dtype=np.int64)
    k = np.searchsorted(base.observations.t_s, t_s - _SAME_S)
    k = k.clip(max=len(base.observations.t_s) - 1)
    same = np.abs(base.observations.t_s[k] - t_s) < _SAME_S
    place_e_m = np.where(same[:, None], base.position_e_m, np.nan)
    channels = named_channels(names, columns)
    residual = residuals(flight, base.observations, channels, k, place_e_m)
    return residual, base.observations.lock_flags[k, 0][:, columns]


def named_channels(names: list[tuple[str, str]], columns: IntArray) -> CodeChannels:
    """Return satellites and signals, (m,), and their columns of the observations."""
    return CodeChannels(
        column=columns,
        satellites=tuple(satellite for satellite, _ in names),
        signals=tuple(signal for _, signal in names),
        frequency_hz=np.array([frequency_hz(*pair) for pair in names]),
        constellations=(),
        clock_of=np.zeros((len(names), 0)),
    )


def residuals(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
    rows: IntArray,
    p_e_m: FloatArray,
) -> Residuals:
    """Return the residuals of a receiver's first antenna at rows, (n,), and its positions.

    Parameters
    ----------
    p_e_m : ndarray, shape (n, 3)
    """
    if len(rows) > BLOCK:
        blocks = [
            residuals(flight, observations, channels, rows[k], p_e_m[k])
            for k in np.array_split(np.arange(len(rows)), -(-len(rows) // BLOCK))
        ]
        return Residuals._make(map(np.concatenate, zip(*blocks, strict=True)))
    ranges = code_ranges(flight, observations, channels, 0, rows, rates=False)
    here = np.asarray(np.isfinite(p_e_m).all(axis=1))
    p_e_m = np.where(here[:, None], p_e_m, flight.origin.p_e_m)
    paths = signal_paths(ranges.states, p_e_m, np.zeros_like(p_e_m))
    direction = angles(p_e_m, paths.e_e)
    delay_m, left_m2 = atmosphere_m(flight, channels, p_e_m, direction, ranges.gps_s)
    air_m = saastamoinen_m(geodetic(p_e_m), direction[0].clip(_LOWEST_RAD))
    on = flight.gnss_noise.atmosphere
    air_m, ions_m = on * air_m, on * (delay_m - air_m)
    usable = here[:, None] & (direction[0] >= flight.elevation_mask_rad) & (channels.column >= 0)
    flags = observations.lock_flags[rows, 0][:, channels.column]
    resolved = usable & ((flags & HALF_CYCLE) == 0)
    wavelength_m = C_MPS / channels.frequency_hz
    phase_m = observations.phase_cycles[rows, 0][:, channels.column] * wavelength_m
    phase_m = phase_m + C_MPS * ranges.states.clock_s - paths.range_m - air_m + ions_m
    code_m = ranges.range_m - paths.range_m - air_m - ions_m
    return Residuals(
        np.where(usable, code_m, np.nan),
        np.where(resolved, phase_m, np.nan),
        np.where(usable[:, :, None], paths.e_e @ flight.origin.R_ne.T, np.nan),
        np.where(usable, direction[0], np.nan),
        np.sqrt(ranges.message_variance_m2 + on * left_m2).clip(_LEAST_ERROR_M),
    )
