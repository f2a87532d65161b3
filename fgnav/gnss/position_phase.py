"""Phase and code of the reference antenna less all that models or a base station know of them.

What is left is where the antenna is, against where its code alone puts it: the same equations for
double differences against a base and for one antenna on its own, so that one search for integers
and one adjustment serve both.
"""

from collections import Counter
from dataclasses import dataclass, replace
from functools import partial
from weakref import WeakKeyDictionary

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError
from fgnav.earth import C_MPS, geodetic
from fgnav.flight import Flight
from fgnav.gnss.atmosphere import saastamoinen_m
from fgnav.gnss.code_adjustment import growing
from fgnav.gnss.code_model import CodeChannels, atmosphere_m, code_ranges
from fgnav.gnss.code_solution import BLOCK, code_solution
from fgnav.gnss.doppler_slips import slipped
from fgnav.gnss.satellites import angles, signal_paths
from fgnav.gnss.signals import Selection, band, frequency_hz, select, wavelengths_m
from fgnav.gnss.single_differences import SingleDifferences, reference_motion
from fgnav.gnss.wind_up import wind_up_cycles
from fgnav.observations import HALF_CYCLE, LOST_LOCK, Observations

_SAME_S = 1e-3  # epochs of vehicle and base this close are one
_SPATIAL = 1e-6  # a choice for quiet days: 1 mm per km that the zenith's ionosphere differs


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class PositionPhase:
    """Equations for the reference antenna's distance from ``start_n_m``.

    Attributes
    ----------
    single : SingleDifferences
        The antenna against the base, or against a perfect one: then variances are halved, since two
        antennas count. ``-e . (p - start)`` plus a clock, integers and noise is left. The baseline,
        (1, 3), only stands for an unknown vector.
    start_n_m, late_n_m : ndarray, shape (n, 3)
        By code, at the true time of reception; and how far the antenna moves from the nominal epoch
        to that.
    """

    single: SingleDifferences
    start_n_m: FloatArray
    late_n_m: FloatArray

    def unwound(self, R_nb: FloatArray, pole_n: FloatArray) -> "PositionPhase":
        """Return the equations without the wind-up of an antenna on top of the body.

        A base's antenna looks up and its front north.

        Parameters
        ----------
        R_nb : ndarray, shape (n, 3, 3)
            Attitudes at the epochs.
        pole_n : ndarray, shape (3,)
            The Earth's axis.
        """
        single = self.single
        cycles = wind_up_cycles(single.e_n, R_nb, pole_n)
        cycles -= wind_up_cycles(single.e_n, np.broadcast_to(np.eye(3), R_nb.shape), pole_n)
        phase_m = single.phase_m - (single.wavelength_m * cycles)[:, None]
        return replace(self, single=replace(single, phase_m=phase_m))


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Left:
    """What one receiver's observations leave, (n, m); NaN where there is nothing."""

    code_m: FloatArray
    phase_m: FloatArray
    flags: IntArray
    e_n: FloatArray
    elevation_rad: FloatArray


_KNOWN: WeakKeyDictionary[Flight, dict[bool, PositionPhase]] = WeakKeyDictionary()


def position_phase(flight: Flight, *, base: bool) -> PositionPhase:
    """Return the equations of a flight, at epochs that the base has, too, where it is asked for.

    Computed once per flight.

    Raises
    ------
    NoSolutionError
        If the flight has no observations, no base or no position by code.
    """
    known = _KNOWN.setdefault(flight, {})
    if base not in known:
        known[base] = _equations(flight, base=base)
    return known[base]


def _equations(flight: Flight, *, base: bool) -> PositionPhase:
    observations = flight.observations
    if observations is None or (base and flight.base is None):
        missing = "observations" if observations is None else "a base station"
        raise NoSolutionError(f"flight {flight.name}: a position by phase needs {missing}")
    chosen = select(observations)
    kept = np.flatnonzero(chosen.channel[0] >= 0)
    names = [(chosen.satellites[j], chosen.signals[j]) for j in kept]
    motion = reference_motion(flight, observations.t_s)
    row, of_base = _paired(flight, observations.t_s, base=base)
    late_s = _late_s(flight, observations)[row]
    p_e_m, v_e_mps = motion[0][row], motion[1][row]
    late_e_m = v_e_mps * late_s[:, None]
    of = partial(_left, flight, model=code_solution(flight).atmosphere)
    ours = of(observations, _channels(names, chosen.channel[0, kept]), row, p_e_m + late_e_m)
    slips = _slips(flight, names, ours, chosen.channel[0, kept], row)
    ours = replace(ours, flags=ours.flags | slips)
    theirs = None
    if base and flight.base is not None:
        place_e_m = np.repeat(flight.base.position_e_m[None], len(row), axis=0)
        columns = _columns(select(flight.base.observations), names)
        theirs = of(flight.base.observations, _channels(names, columns), of_base, place_e_m)
    single = _single(flight, observations.t_s[row], names, ours, theirs, p_e_m)
    if theirs is None:
        single = replace(single, code_m=_without_constants(single.code_m, single.group))
    late_n_m = late_e_m @ flight.origin.R_ne.T
    start_n_m = flight.origin.to_n(p_e_m) + late_n_m
    return PositionPhase(single=single, start_n_m=start_n_m, late_n_m=late_n_m)


def _without_constants(code_m: FloatArray, group: IntArray) -> FloatArray:
    """Return code, (n, 1, m), without what each channel's is off its group's, (m,), all along.

    An error of the satellite's message or of a model of the atmosphere: phase has it, too, and its
    arcs have constants for it. In code it is metres that no averaging reduces, and would be taken
    for noise, or for a motion that phase denies. The positions of code, where all of this starts
    from, have had their share of it.
    """
    out = code_m.copy()
    for one in np.unique(group):
        own = np.flatnonzero(group == one)
        there = np.isfinite(code_m[:, 0, own])
        apart_m = np.where(there, code_m[:, 0, own], 0.0)
        clock_m = apart_m.sum(axis=1) / there.sum(axis=1).clip(1)
        apart_m = np.where(there, apart_m - clock_m[:, None], 0.0)
        out[:, 0, own] -= apart_m.sum(axis=0) / there.sum(axis=0).clip(1)
    return out


def _paired(flight: Flight, t_s: FloatArray, *, base: bool) -> tuple[IntArray, IntArray]:
    """Return the rows of epochs, and those of the base at the same times."""
    if not base or flight.base is None:
        return np.arange(len(t_s)), np.empty(0, dtype=np.int64)
    have_s = flight.base.observations.t_s
    near = np.searchsorted(have_s, t_s - _SAME_S).clip(max=len(have_s) - 1)
    row = np.flatnonzero(np.abs(have_s[near] - t_s) < _SAME_S)
    return row, near[row]


def _slips(
    flight: Flight,
    names: list[tuple[str, str]],
    left: _Left,
    columns: IntArray,
    row: IntArray,
) -> IntArray:
    """Return flags of lost lock, (n, m), where few satellites leave slips to Doppler."""
    observations, noise = flight.observations, flight.gnss_noise
    if observations is None or not left.elevation_rad.size:
        return np.zeros_like(left.flags)
    lowest = np.where(np.isfinite(left.elevation_rad), left.elevation_rad, np.pi / 2).min(axis=0)
    slips = slipped(
        observations,
        columns,
        wavelengths_m(*zip(*names, strict=True)),
        growing(flight, noise.phase_m, lowest),
        growing(flight, noise.doppler_mps, lowest),
    )
    return np.where(slips[row], LOST_LOCK, 0).astype(left.flags.dtype)


def _late_s(flight: Flight, observations: Observations) -> FloatArray:
    """Return by how much each nominal epoch precedes the true time of reception, (n,)."""
    solution = code_solution(flight)
    first = np.isfinite(solution.clock_s).argmax(axis=1)
    clock_s = solution.clock_s[np.arange(len(first)), first]
    late_s = observations.tag_s[solution.epoch, 0] - clock_s - solution.t_s
    return np.asarray(np.interp(observations.t_s, solution.t_s, late_s))


def _channels(names: list[tuple[str, str]], columns: IntArray) -> CodeChannels:
    return CodeChannels(
        column=columns,
        satellites=tuple(satellite for satellite, _ in names),
        signals=tuple(signal for _, signal in names),
        frequency_hz=np.array([frequency_hz(*pair) for pair in names]),
        constellations=(),
        clock_of=np.zeros((len(names), 0)),
    )


def _columns(chosen: Selection, names: list[tuple[str, str]]) -> IntArray:
    """Return where another receiver has the channels; -1 where it has not."""
    pairs = zip(chosen.satellites, chosen.signals, strict=True)
    place = {(s, band(s, g)): int(c) for (s, g), c in zip(pairs, chosen.channel[0], strict=True)}
    return np.array([place.get((s, band(s, g)), -1) for s, g in names], dtype=np.int64)


def _left(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
    row: IntArray,
    p_e_m: FloatArray,
    *,
    model: bool,
) -> _Left:
    """Return what observations of a receiver's first antenna leave at places, (n, 3)."""
    parts = []
    for first in range(0, max(len(row), 1), BLOCK):
        block = slice(first, first + BLOCK)
        parts.append(_block(flight, observations, channels, row[block], p_e_m[block], model=model))
    code_m, phase_m, flags, e_n, elevation = (
        np.concatenate(columns) for columns in zip(*parts, strict=True)
    )
    return _Left(code_m=code_m, phase_m=phase_m, flags=flags, e_n=e_n, elevation_rad=elevation)


def _block(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
    row: IntArray,
    p_e_m: FloatArray,
    *,
    model: bool,
) -> tuple[FloatArray, FloatArray, IntArray, FloatArray, FloatArray]:
    ranges = code_ranges(flight, observations, channels, 0, row, rates=False)
    paths = signal_paths(ranges.states, p_e_m, np.zeros_like(p_e_m))
    seen = angles(p_e_m, paths.e_e)
    air_m = ions_m = np.zeros_like(paths.range_m)
    if model:
        air_m = saastamoinen_m(geodetic(p_e_m), seen[0].clip(0.05))
        ions_m = atmosphere_m(flight, channels, p_e_m, seen, ranges.gps_s)[0] - air_m
    wavelength_m = C_MPS / channels.frequency_hz
    there = (channels.column >= 0) & (seen[0] >= flight.elevation_mask_rad)
    flags = observations.lock_flags[row, 0][:, channels.column]
    cycles = observations.phase_cycles[row, 0][:, channels.column]
    phase_m = cycles * wavelength_m + C_MPS * ranges.states.clock_s
    return (
        np.where(there, ranges.range_m - paths.range_m - air_m - ions_m, np.nan),
        np.where(
            there & ((flags & HALF_CYCLE) == 0), phase_m - paths.range_m - air_m + ions_m, np.nan
        ),
        np.where(channels.column >= 0, flags, 0),
        paths.e_e @ flight.origin.R_ne.T,
        np.where(there, seen[0], np.nan),
    )


def _single(
    flight: Flight,
    t_s: FloatArray,
    names: list[tuple[str, str]],
    ours: _Left,
    theirs: _Left | None,
    p_e_m: FloatArray,
) -> SingleDifferences:
    satellites, signals = tuple(s for s, _ in names), tuple(g for _, g in names)
    carriers = [(s[0], band(s, g)) for s, g in names]
    numbered = {carrier: k for k, carrier in enumerate(dict.fromkeys(carriers))}
    other = ours if theirs is None else theirs
    less_code, less_phase = (other.code_m, other.phase_m) if theirs is not None else (0.0, 0.0)
    used = np.isfinite(ours.elevation_rad)

    def variance(sigma_m: float) -> FloatArray:
        own = growing(flight, sigma_m, ours.elevation_rad) ** 2
        if theirs is None or flight.base is None:
            return np.where(used, own / 2, 1.0)
        away_m = np.linalg.norm(p_e_m - flight.base.position_e_m, axis=1)[:, None]
        between_m = _SPATIAL * away_m / np.sin(ours.elevation_rad).clip(0.1)
        return np.where(used, own + between_m**2 / 2, 1.0)

    def both(ours_there: BoolArray, theirs_there: BoolArray) -> BoolArray:
        return np.stack([theirs_there, ours_there], axis=1)

    return SingleDifferences(
        t_s=t_s,
        baselines_b_m=np.array([[1.0, 0.0, 0.0]]),
        satellites=satellites,
        signals=signals,
        wavelength_m=wavelengths_m(satellites, signals),
        group=np.array([numbered[carrier] for carrier in carriers], dtype=np.int64),
        e_n=np.where(used[:, :, None], ours.e_n, np.nan),
        elevation_rad=ours.elevation_rad,
        code_m=(ours.code_m - less_code)[:, None],
        phase_m=(ours.phase_m - less_phase)[:, None],
        code_there=both(np.isfinite(ours.code_m), np.isfinite(other.code_m)),
        phase_there=both(np.isfinite(ours.phase_m), np.isfinite(other.phase_m)),
        lock_flags=np.stack([0 * ours.flags if theirs is None else theirs.flags, ours.flags], 1),
        code_variance_m2=variance(flight.gnss_noise.code_m),
        phase_variance_m2=variance(flight.gnss_noise.phase_m),
        unused=(),
        lost=Counter(),
    )
