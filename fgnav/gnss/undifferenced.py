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

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError, Unused
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.cycle_slips.detection import phase_arcs
from fgnav.gnss.cycle_slips.doppler import slipped
from fgnav.gnss.signals import carriers, select, wavelengths_m
from fgnav.gnss.single_differences import SingleDifferences, motion_so_far
from fgnav.gnss.single_point.adjustment import growing
from fgnav.gnss.single_point.model import CodeChannels
from fgnav.gnss.single_point.solution import code_solution
from fgnav.gnss.undifferenced_residuals import (
    Residuals,
    named_channels,
    residuals,
    residuals_of_base,
)
from fgnav.types.flight import Flight
from fgnav.types.observations import LOST_LOCK, Observations

_SPATIAL = 1e-6  # a choice for quiet days: 1 mm per km that the zenith's ionosphere differs
_LEAST_ERROR_M = 1e-3  # of phase centres and echoes that stay, however near a base is


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
    unused: tuple[Unused, ...]  # breaks of arcs, by cause


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
    channels = named_channels(names, chosen.channel[0, has])
    p_e_m, v_e_mps = motion_so_far(flight, observations.t_s)
    late_s = _late_s(flight, observations)
    received_e_m = p_e_m + v_e_mps * late_s[:, None]
    rows = np.arange(len(observations.t_s))
    ours = residuals(flight, observations, channels, rows, received_e_m)
    noise = flight.gnss_noise
    share = np.ones(len(observations.t_s))
    flags = observations.lock_flags[:, 0][:, channels.column]
    if base and flight.base is not None:
        theirs, flags_of_base = residuals_of_base(flight, observations.t_s, names)
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
    group = carriers(channels.satellites, channels.signals)
    phase_sigma_m = receivers * growing(noise, noise.phase_m, elevation_rad)
    wavelength_m = wavelengths_m(channels.satellites, channels.signals)
    arc, unused = _arcs(flight, observations, channels, ours, flags, (phase_sigma_m, group))
    return Undifferenced(
        t_s=observations.t_s,
        place_n_m=flight.origin.to_n(p_e_m),
        e_n=np.where(np.isfinite(e_n), e_n, 0.0),
        phase_m=phase_m,
        code_m=code_m,
        arc=arc,
        phase_sigma_m=phase_sigma_m,
        code_sigma_m=receivers * growing(noise, noise.code_m, elevation_rad),
        error_sigma_m=error_sigma_m,
        error_rate_mps=share * noise.satellite_error_rate_mps,
        error_walk_m_per_sqrt_s=share * noise.satellite_error_walk_m_per_sqrt_s,
        satellites=channels.satellites,
        signals=channels.signals,
        group=group,
        wavelength_m=wavelength_m,
        integers=base,
        pole_n=flight.origin.R_ne[:, 2] if noise.wind_up else None,
        unused=unused,
    )


def _refused(flight: Flight, observations: Observations, satellites: tuple[str, ...]) -> BoolArray:
    """Return the mask of codes that contradict the others of their epoch, (n, m)."""
    solution = code_solution(flight, causal=True)
    column_of = {satellite: k for k, satellite in enumerate(solution.satellites)}
    column = np.array([column_of.get(satellite, -1) for satellite in satellites])
    out = np.zeros((len(observations.t_s), len(satellites)), dtype=np.bool_)
    out[solution.epoch] = (column >= 0) & ~solution.used[:, column]
    return out


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


def _arcs(
    flight: Flight,
    observations: Observations,
    channels: CodeChannels,
    residual: Residuals,
    flags: IntArray,
    of: tuple[FloatArray, IntArray],
) -> tuple[IntArray, tuple[Unused, ...]]:
    """Return arcs, (n, m), and their breaks."""
    phase_sigma_m, group = of
    phase_m, e_n, elevation_rad = residual.phase_m, residual.e_n, residual.elevation_rad
    steps = slipped(
        observations,
        channels.column,
        C_MPS / channels.frequency_hz,
        phase_sigma_m,
        growing(flight.gnss_noise, flight.gnss_noise.doppler_mps, elevation_rad),
    )
    flags = np.where(steps, flags | LOST_LOCK, flags)
    has_phase, n = np.isfinite(phase_m), len(phase_m)
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
        code_there=np.stack([has_phase, has_phase], axis=1),
        phase_there=np.stack([has_phase, has_phase], axis=1),
        lock_flags=np.stack([0 * flags, flags], axis=1),
        code_variance_m2=np.ones_like(phase_m),
        phase_variance_m2=np.where(has_phase, phase_sigma_m**2 / 2, 1.0),
        unused=(),
        lost=Counter(),
    )
    earlier_s = None if observations.earlier is None else observations.earlier.t_s
    names = ("models", flight.antennas[0].name)
    arcs = phase_arcs(single, names, causal=True, earlier_s=earlier_s)
    arc, m = arcs.arc[:, 1].astype(np.int64), phase_m.shape[1]
    return np.where(arc >= 0, arc * m + np.arange(m), -1), arcs.unused
