"""Phase and code of one antenna less all that models or a base know of them, causally.

What is left of a phase at a place ``s`` is ``-e . (p - s)``, the receiver's clock, an ambiguity per
arc, and what messages and models of the atmosphere leave [1]_; of a code that without ambiguity.
Against a base these are differences of two receivers, and integers but for clocks.

References
----------
.. [1] Teunissen, Montenbruck: Springer Handbook of Global Navigation Satellite Systems, 2017,
   equations 19.6 and 19.7.
"""

from collections import Counter
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError
from fgnav.geometry.earth import C_MPS, geodetic
from fgnav.gnss.atmosphere import saastamoinen_m
from fgnav.gnss.cycle_slips.detection import phase_arcs
from fgnav.gnss.cycle_slips.doppler import slipped
from fgnav.gnss.orbits.satellites import angles, signal_paths
from fgnav.gnss.signals import band, frequency_hz, select, wavelengths_m
from fgnav.gnss.single_differences import SingleDifferences, motion_so_far
from fgnav.gnss.single_point.adjustment import growing
from fgnav.gnss.single_point.atmosphere_choice import atmosphere_so_far
from fgnav.gnss.single_point.model import CodeChannels, atmosphere_m, code_channels, code_ranges
from fgnav.gnss.single_point.solution import BLOCK, code_solution
from fgnav.types.flight import Flight
from fgnav.types.observations import HALF_CYCLE, LOST_LOCK, Observations

_SAME_S = 1e-3  # epochs of vehicle and base this close are one
_SPATIAL = 1e-6  # a choice for quiet days: 1 mm per km that the zenith's ionosphere differs
_LEAST_ERROR_M = 1e-3  # of phase centres and echoes that stay, however near a base is
_LOWEST_RAD = 0.05  # models of the atmosphere are not asked about less


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Undifferenced:
    """Observations of one antenna at n epochs on m channels; NaN where there is none."""

    t_s: FloatArray  # (n,); nominal epochs
    place_n_m: FloatArray  # (n, 3); ``s``, where the antenna is about, at the nominal epochs
    e_n: FloatArray  # (n, m, 3); unit vectors to satellites; zero where there is none
    phase_m: FloatArray  # (n, m)
    code_m: FloatArray  # (n, m)
    arc: IntArray  # (n, m); number of the arc of each phase; -1 without phase
    # phase_sigma_m, code_sigma_m: (n, m); of the receiver's noise
    phase_sigma_m: FloatArray
    code_sigma_m: FloatArray
    error_sigma_m: FloatArray  # (n, m); of what messages and models of the atmosphere leave
    # error_rate_mps, error_walk_m_per_sqrt_s: (n,); how that moves
    error_rate_mps: FloatArray
    error_walk_m_per_sqrt_s: FloatArray
    satellites: tuple[str, ...]  # length m
    signals: tuple[str, ...]  # length m
    group: IntArray  # (m,); number of the carrier: phases of each have a clock of their own
    wavelength_m: FloatArray  # (m,)
    # whether ambiguities of one carrier differ by integers, in cycles: against a base
    integers: bool
    # (3,); the Earth's axis, where turns of the antenna wind up its phases; else None
    pole_n: FloatArray | None
    losses: tuple[Loss, ...]  # breaks of arcs, by cause


def undifferenced(flight: Flight, *, base: bool = False) -> Undifferenced:
    """Return the observations of a flight's first antenna, each epoch by the past alone.

    Parameters
    ----------
    base : bool
        Whether to take off those of the base, at the epochs that it has, too.

    Raises
    ------
    NoSolutionError
        If the flight has no observations, no position by code, or no base where it is asked for.
    """
    observations = flight.observations
    if base and flight.base is None:
        raise NoSolutionError(f"flight {flight.name}: has no base station")
    if observations is None:
        raise NoSolutionError(f"flight {flight.name}: phase needs observations, it has none")
    chosen = select(observations, causal=True)
    has = np.flatnonzero(chosen.channel[0] >= 0)
    names = [(chosen.satellites[j], chosen.signals[j]) for j in has]
    channels = _channels(names, chosen.channel[0, has])
    p_e_m, v_e_mps = motion_so_far(flight, observations.t_s)
    late_s = _late_s(flight, observations)
    received_e_m = p_e_m + v_e_mps * late_s[:, None]
    modelled = atmosphere_so_far(
        flight, observations, code_channels(observations, 0, causal=True), 0
    )
    blocks = [
        _block(flight, observations, channels, rows, received_e_m[rows], modelled[rows])
        for rows in np.array_split(
            np.arange(len(observations.t_s)), -(-len(observations.t_s) // BLOCK)
        )
    ]
    ours = _Left._make(map(np.concatenate, zip(*blocks, strict=True)))
    noise = flight.gnss_noise
    share = np.ones(len(observations.t_s))
    flags = observations.lock_flags[:, 0][:, channels.column]
    if base and flight.base is not None:
        theirs, flags_of_base = _of_base(flight, observations.t_s, names, modelled)
        away_m = np.linalg.norm(p_e_m - flight.base.position_e_m, axis=1)[:, None]
        apart_m = _SPATIAL * away_m / np.sin(ours.elevation_rad).clip(0.1)
        of_links = np.fmin.reduce(_SPATIAL * away_m / ours.error_m, axis=1, initial=1.0)
        share = np.minimum.accumulate(of_links)  # as near as it has been
        ours = ours._replace(
            code_m=ours.code_m - theirs.code_m,
            phase_m=ours.phase_m - theirs.phase_m,
            error_m=apart_m.clip(_LEAST_ERROR_M),
        )
        flags = flags | flags_of_base
    receivers = np.sqrt(1.0 + base)
    code_m, phase_m, e_n, elevation_rad, error_sigma_m = ours
    code_m = np.where(_refused(flight, observations, channels.satellites), np.nan, code_m)
    carriers = [(s[0], band(s, g)) for s, g in names]
    numbered = {carrier: k for k, carrier in enumerate(dict.fromkeys(carriers))}
    group = np.array([numbered[carrier] for carrier in carriers], dtype=np.int64)
    phase_sigma_m = receivers * growing(flight, noise.phase_m, elevation_rad)
    wavelength_m = wavelengths_m(channels.satellites, channels.signals)
    changed = np.diff(modelled, prepend=modelled[:1])
    flags = np.where(changed[:, None], flags | LOST_LOCK, flags)
    arc, losses = _arcs(flight, observations, channels, ours, flags, (phase_sigma_m, group))
    return Undifferenced(
        t_s=observations.t_s,
        place_n_m=flight.origin.to_n(p_e_m),
        e_n=np.where(np.isfinite(e_n), e_n, 0.0),
        phase_m=phase_m,
        code_m=code_m,
        arc=arc,
        phase_sigma_m=phase_sigma_m,
        code_sigma_m=receivers * growing(flight, noise.code_m, elevation_rad),
        error_sigma_m=error_sigma_m,
        error_rate_mps=share * noise.satellite_error_rate_mps,
        error_walk_m_per_sqrt_s=share * noise.satellite_error_walk_m_per_sqrt_s,
        satellites=channels.satellites,
        signals=channels.signals,
        group=group,
        wavelength_m=wavelength_m,
        integers=base,
        pole_n=flight.origin.R_ne[:, 2] if noise.wind_up else None,
        losses=losses,
    )


class _Left(NamedTuple):
    """What one receiver's observations leave, (n, m); NaN where there is nothing."""

    code_m: FloatArray
    phase_m: FloatArray
    e_n: FloatArray
    elevation_rad: FloatArray
    error_m: FloatArray


def _of_base(
    flight: Flight, t_s: FloatArray, names: list[tuple[str, str]], modelled: BoolArray
) -> tuple[_Left, IntArray]:
    """Return what the base's observations leave at epochs, (n,), and its flags."""
    base = flight.base
    if base is None:
        raise NoSolutionError(f"flight {flight.name}: has no base station")
    chosen = select(base.observations, causal=True)
    pairs = zip(chosen.satellites, chosen.signals, strict=True)
    place = {(s, band(s, g)): int(c) for (s, g), c in zip(pairs, chosen.channel[0], strict=True)}
    columns = np.array([place.get((s, band(s, g)), -1) for s, g in names], dtype=np.int64)
    row = np.searchsorted(base.observations.t_s, t_s - _SAME_S)
    row = row.clip(max=len(base.observations.t_s) - 1)
    same = np.abs(base.observations.t_s[row] - t_s) < _SAME_S
    place_e_m = np.where(same[:, None], base.position_e_m, np.nan)
    left = [
        _block(
            flight, base.observations, _channels(names, columns), row[k], place_e_m[k], modelled[k]
        )
        for k in np.array_split(np.arange(len(t_s)), -(-len(t_s) // BLOCK))
    ]
    return (
        _Left._make(map(np.concatenate, zip(*left, strict=True))),
        base.observations.lock_flags[row, 0][:, columns],
    )


def _refused(flight: Flight, observations: Observations, satellites: tuple[str, ...]) -> BoolArray:
    """Return which codes contradict the others of their epoch, (n, m)."""
    solution = code_solution(flight, causal=True)
    place = {satellite: k for k, satellite in enumerate(solution.satellites)}
    column = np.array([place.get(satellite, -1) for satellite in satellites])
    out = np.zeros((len(observations.t_s), len(satellites)), dtype=np.bool_)
    out[solution.epoch] = (column >= 0) & ~solution.used[:, column]
    return out


def _channels(names: list[tuple[str, str]], columns: IntArray) -> CodeChannels:
    return CodeChannels(
        column=columns,
        satellites=tuple(satellite for satellite, _ in names),
        signals=tuple(signal for _, signal in names),
        frequency_hz=np.array([frequency_hz(*pair) for pair in names]),
        constellations=(),
        clock_of=np.zeros((len(names), 0)),
    )


def _late_s(flight: Flight, observations: Observations) -> FloatArray:
    """Return by how much each nominal epoch precedes the true time of reception, (n,).

    Of epochs without a solution as of the last one.
    """
    solution = code_solution(flight, causal=True)
    first = np.isfinite(solution.clock_s).argmax(axis=1)
    clock_s = solution.clock_s[np.arange(len(first)), first]
    late_s = observations.tag_s[solution.epoch, 0] - clock_s - solution.t_s
    last = np.searchsorted(solution.t_s, observations.t_s, side="right") - 1
    return np.asarray(late_s[last.clip(0)])


def _block(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
    rows: IntArray,
    p_e_m: FloatArray,
    modelled: BoolArray,
) -> _Left:
    """Return what a receiver's first antenna leaves at places, (k, 3)."""
    ranges = code_ranges(flight, observations, channels, 0, rows, rates=False)
    here = np.asarray(np.isfinite(p_e_m).all(axis=1))
    p_e_m = np.where(here[:, None], p_e_m, flight.origin.p_e_m)
    paths = signal_paths(ranges.states, p_e_m, np.zeros_like(p_e_m))
    seen = angles(p_e_m, paths.e_e)
    delay_m, left_m2 = atmosphere_m(flight, channels, p_e_m, seen, ranges.gps_s)
    air_m = saastamoinen_m(geodetic(p_e_m), seen[0].clip(_LOWEST_RAD))
    on = modelled[:, None]
    air_m, ions_m = on * air_m, on * (delay_m - air_m)
    usable = here[:, None] & (seen[0] >= flight.elevation_mask_rad) & (channels.column >= 0)
    flags = observations.lock_flags[rows, 0][:, channels.column]
    whole = usable & ((flags & HALF_CYCLE) == 0)
    wavelength_m = C_MPS / channels.frequency_hz
    phase_m = observations.phase_cycles[rows, 0][:, channels.column] * wavelength_m
    phase_m = phase_m + C_MPS * ranges.states.clock_s - paths.range_m - air_m + ions_m
    code_m = ranges.range_m - paths.range_m - air_m - ions_m
    return _Left(
        np.where(usable, code_m, np.nan),
        np.where(whole, phase_m, np.nan),
        np.where(usable[:, :, None], paths.e_e @ flight.origin.R_ne.T, np.nan),
        np.where(usable, seen[0], np.nan),
        np.sqrt(ranges.message_variance_m2 + on * left_m2),
    )


def _arcs(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
    left: _Left,
    flags: IntArray,
    of: tuple[FloatArray, IntArray],
) -> tuple[IntArray, tuple[Loss, ...]]:
    """Return arcs, (n, m), and their breaks."""
    phase_sigma_m, group = of
    phase_m, e_n, elevation_rad = left.phase_m, left.e_n, left.elevation_rad
    steps = slipped(
        observations,
        channels.column,
        C_MPS / channels.frequency_hz,
        phase_sigma_m,
        growing(flight, flight.gnss_noise.doppler_mps, elevation_rad),
    )
    flags = np.where(steps, flags | LOST_LOCK, flags)
    there, n = np.isfinite(phase_m), len(phase_m)
    # Against a perfect antenna: its variance halved, since two count.
    single = SingleDifferences(
        t_s=observations.t_s,
        baselines_b_m=np.array([[1.0, 0.0, 0.0]]),
        satellites=channels.satellites,
        signals=channels.signals,
        wavelength_m=C_MPS / channels.frequency_hz,
        group=group,
        e_n=e_n,
        elevation_rad=elevation_rad,
        code_m=np.full((n, 1, phase_m.shape[1]), np.nan),
        phase_m=phase_m[:, None],
        code_there=np.stack([there, there], axis=1),
        phase_there=np.stack([there, there], axis=1),
        lock_flags=np.stack([0 * flags, flags], axis=1),
        code_variance_m2=np.ones_like(phase_m),
        phase_variance_m2=np.where(there, phase_sigma_m**2 / 2, 1.0),
        unused=(),
        lost=Counter(),
    )
    earlier_s = None if observations.earlier is None else observations.earlier.t_s
    names = ("models", flight.antennas[0].name)
    arcs = phase_arcs(single, names, causal=True, earlier_s=earlier_s)
    arc, m = arcs.arc[:, 1].astype(np.int64), phase_m.shape[1]
    return np.where(arc >= 0, arc * m + np.arange(m), -1), arcs.losses
