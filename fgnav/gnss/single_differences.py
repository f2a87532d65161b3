"""Each antenna against the reference, the satellites' motion between their clocks removed."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError, Unused
from fgnav.geometry.earth import C_MPS
from fgnav.geometry.interpolation import interpolate
from fgnav.gnss.orbits.satellites import angles, signal_paths, states_at_clock
from fgnav.gnss.signals import Selection, carriers, select, wavelengths_m
from fgnav.gnss.single_point.adjustment import growing
from fgnav.gnss.single_point.model import orbits_of
from fgnav.gnss.single_point.solution import BLOCK, CodeSolution, code_solution
from fgnav.types.flight import Flight
from fgnav.types.observations import HALF_CYCLE, Observations

_LONGEST_BRIDGE_S = 30.0  # without a code solution, positions are interpolated over as much
_GAP = 1.5  # usual intervals: ways across longer ones are bent
_RATE_BASE_S = 0.5  # positions this far to both sides make a velocity where there is no Doppler


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class SingleDifferences:
    """Antennas 2, 3, … minus antenna 1, channel by channel."""

    t_s: FloatArray  # (n,)
    baselines_b_m: FloatArray  # (b, 3)
    satellites: tuple[str, ...]  # length m
    signals: tuple[str, ...]  # length m
    wavelength_m: FloatArray  # (m,)
    group: IntArray  # (m,); constellation and carrier
    e_n: FloatArray  # (n, m, 3); from the reference antenna; NaN where a channel is not usable
    elevation_rad: FloatArray  # (n, m); the same
    code_m: FloatArray  # (n, b, m)
    phase_m: FloatArray  # (n, b, m)
    # code_there, phase_there: (n, a, m); usable observations of every antenna, phases without
    # half-cycle doubt
    code_there: BoolArray
    phase_there: BoolArray
    lock_flags: IntArray  # (n, a, m) of uint8
    # of one undifferenced link, (n, m); 1 where a channel is not usable
    code_variance_m2: FloatArray
    phase_variance_m2: FloatArray
    unused: tuple[Unused, ...]  # observations of signals that no channel takes
    lost: Counter[tuple[str, str]]  # links by antenna and reason


def single_differences(flight: Flight, *, causal: bool = False) -> SingleDifferences:
    """Return all single differences of a flight.

    Every receiver samples at its own time. Satellite j's signal that antenna i measured left
    ``dt_ij = (tag_i - tag_1) - (code_ij - code_1j) / c`` after the one antenna 1 measured, whatever
    the clocks say; the range changed by the range rate times that meanwhile, up to 0.8 m in 1 ms,
    and this is removed. The satellite's clock and the atmosphere cancel. What is left is the
    baseline along the line of sight, the difference of two clocks, integers and noise.

    Parameters
    ----------
    causal : bool
        Each epoch by epochs up to it alone: signals, and where the reference antenna is.

    Raises
    ------
    NoSolutionError
        If the flight has no observations of two antennas, or no position can be computed.
    """
    observations = flight.observations
    if observations is None or len(flight.antennas) < 2:
        raise NoSolutionError(
            f"flight {flight.name}: attitude from GNSS needs observations of two antennas or more, "
            f"it has {len(flight.antennas) if observations is not None else 'no observations'}"
        )
    chosen = select(observations, causal=causal)
    n, m = len(observations.t_s), len(chosen.satellites)
    a = len(flight.antennas)
    positions = np.array([antenna.position_b_m for antenna in flight.antennas])
    out = SingleDifferences(
        t_s=observations.t_s,
        baselines_b_m=positions[1:] - positions[0],
        satellites=chosen.satellites,
        signals=chosen.signals,
        wavelength_m=wavelengths_m(chosen.satellites, chosen.signals),
        group=carriers(chosen.satellites, chosen.signals),
        e_n=np.full((n, m, 3), np.nan),
        elevation_rad=np.full((n, m), np.nan),
        code_m=np.full((n, a - 1, m), np.nan),
        phase_m=np.full((n, a - 1, m), np.nan),
        code_there=np.zeros((n, a, m), dtype=np.bool_),
        phase_there=np.zeros((n, a, m), dtype=np.bool_),
        lock_flags=np.zeros((n, a, m), dtype=np.uint8),
        code_variance_m2=np.ones((n, m)),
        phase_variance_m2=np.ones((n, m)),
        unused=chosen.unused,
        lost=Counter(),
    )
    motion = motion_so_far if causal else reference_motion
    p_e_m, v_e_mps = motion(flight, observations.t_s)
    for start in range(0, n, BLOCK):
        epochs = slice(start, min(start + BLOCK, n))
        _fill(flight, observations, chosen, epochs, p_e_m[epochs], v_e_mps[epochs], out)
    return out


def reference_motion(flight: Flight, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity of the reference antenna, (n, 3); NaN far from any solution."""
    solution = code_solution(flight)

    after = np.searchsorted(solution.t_s, t_s).clip(0, len(solution.t_s) - 1)
    around = np.stack([solution.t_s[after], solution.t_s[(after - 1).clip(0)]])
    far = np.abs(around - t_s).min(axis=0) > _LONGEST_BRIDGE_S
    p_n_m = np.where(far[:, None], np.nan, interpolate(t_s, solution.t_s, solution.p_n_m))
    _bend(p_n_m, t_s, solution)
    # Positions before and after: one epoch away, or _RATE_BASE_S if epochs are closer.
    before_s = np.minimum(t_s - _RATE_BASE_S, np.append(t_s[:1], t_s[:-1]))
    after_s = np.maximum(t_s + _RATE_BASE_S, np.append(t_s[1:], t_s[-1:]))
    before_s, after_s = before_s.clip(*t_s[[0, -1]]), after_s.clip(*t_s[[0, -1]])
    span_s = np.maximum(after_s - before_s, _RATE_BASE_S)[:, None]
    ends = [interpolate(at_s, solution.t_s, solution.p_n_m) for at_s in (before_s, after_s)]
    for p, when_s in zip(ends, (before_s, after_s), strict=True):
        _bend(p, when_s, solution)
    v_n_mps = (ends[1] - ends[0]) / span_s
    if solution.v_n_mps is not None:
        valid = np.isfinite(solution.v_n_mps).all(axis=1)
        v_n_mps[solution.epoch[valid]] = solution.v_n_mps[valid]
    return flight.origin.to_e(p_n_m), v_n_mps @ flight.origin.R_ne


def motion_so_far(flight: Flight, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return position and velocity of the reference antenna by what is known by then, (n, 3).

    The causal code solution; where it has none, the last one carried on at its velocity, for 30 s
    at most, then NaN. A velocity without Doppler is the change of position since the last solution
    a second or more before, 0 where there is none.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
    """
    solution = code_solution(flight, causal=True)
    v_n_mps = _velocities_so_far(solution)
    last = np.searchsorted(solution.t_s, t_s, side="right") - 1
    age_s = t_s - solution.t_s[last.clip(0)]
    valid = (last >= 0) & (age_s <= _LONGEST_BRIDGE_S)
    p_n_m = solution.p_n_m[last.clip(0)] + v_n_mps[last.clip(0)] * age_s[:, None]
    p_n_m = np.where(valid[:, None], p_n_m, np.nan)
    v_n_mps = np.where(valid[:, None], v_n_mps[last.clip(0)], np.nan)
    return flight.origin.to_e(p_n_m), v_n_mps @ flight.origin.R_ne


def _velocities_so_far(solution: CodeSolution) -> FloatArray:
    """Return the velocity at each solution, (k, 3): by Doppler, else by positions up to it."""
    t_s, p_n_m = solution.t_s, solution.p_n_m
    before = np.searchsorted(t_s, t_s - 2 * _RATE_BASE_S, side="right") - 1
    span_s = t_s - t_s[before.clip(0)]
    near = (before >= 0) & (span_s <= _LONGEST_BRIDGE_S)
    change_m = p_n_m - p_n_m[before.clip(0)]
    by_position = np.where(near[:, None], change_m / np.where(near, span_s, 1.0)[:, None], 0.0)
    if solution.v_n_mps is None:
        return by_position
    unknown = np.isnan(solution.v_n_mps)
    return np.where(unknown.any(axis=1, keepdims=True), by_position, solution.v_n_mps)


def _bend(p_n_m: FloatArray, t_s: FloatArray, solution: CodeSolution) -> None:
    """Put the cubic through velocities at both ends in place of straight ways across gaps.

    In a turn a straight way of 20 s is off by hundreds of metres, and ranges from there to the
    satellites by centimetres that no linear equation has.
    """
    have_s, v_n_mps = solution.t_s, solution.v_n_mps
    if v_n_mps is None or len(have_s) < 2:
        return
    after = np.searchsorted(have_s, t_s).clip(1, len(have_s) - 1)
    span_s = have_s[after] - have_s[after - 1]
    inside = (span_s > _GAP * np.median(np.diff(have_s))) & (have_s[after - 1] < t_s)
    inside &= (t_s < have_s[after]) & np.isfinite(v_n_mps[[after - 1, after]]).all(axis=(0, 2))
    k = after[inside]
    span_s = span_s[inside, None]
    share = (t_s[inside] - have_s[k - 1])[:, None] / span_s
    rest = solution.p_n_m[k] - solution.p_n_m[k - 1]
    first, last = v_n_mps[k - 1] * span_s - rest, rest - v_n_mps[k] * span_s
    p_n_m[inside] += share * (1 - share) * ((1 - share) * first + share * last)


def _fill(
    flight: Flight,
    observations: Observations,
    chosen: Selection,
    epochs: slice,
    p_e_m: FloatArray,
    v_e_mps: FloatArray,
    out: SingleDifferences,
) -> None:
    """Compute one block of epochs into ``out``."""
    antenna, channel = np.arange(len(chosen.channel))[:, None], chosen.channel

    def of(values: FloatArray) -> FloatArray:
        taken = values[epochs][:, antenna, channel.clip(0)]
        return np.asarray(np.where(channel >= 0, taken, np.nan))

    code_m, cycles = of(observations.code_m), of(observations.phase_cycles)
    flags = observations.lock_flags[epochs][:, antenna, channel.clip(0)]
    doubtful = (flags & HALF_CYCLE) != 0
    tag_s = observations.tag_s[epochs]
    left_s = tag_s[:, :1] - code_m[:, 0] / C_MPS
    states = states_at_clock(orbits_of(flight), chosen.satellites, left_s)
    paths = signal_paths(states, p_e_m, v_e_mps)
    here = np.asarray(np.isfinite(p_e_m).all(axis=1))
    elevation = np.full(left_s.shape, np.nan)
    elevation[here] = angles(p_e_m[here], paths.e_e[here])[0]
    high = elevation >= flight.elevation_mask_rad
    later_s = (tag_s[:, 1:] - tag_s[:, :1])[:, :, None] - (code_m[:, 1:] - code_m[:, :1]) / C_MPS
    moved_m = paths.range_rate_mps[:, None] * later_s
    phase_m = np.where(doubtful, np.nan, cycles) * out.wavelength_m
    usable = high[:, None]
    out.code_m[epochs] = np.where(usable, code_m[:, 1:] - code_m[:, :1] - moved_m, np.nan)
    out.phase_m[epochs] = np.where(usable, phase_m[:, 1:] - phase_m[:, :1] - moved_m, np.nan)
    out.code_there[epochs] = np.isfinite(code_m) & usable
    out.phase_there[epochs] = np.isfinite(phase_m)
    out.lock_flags[epochs] = flags
    out.elevation_rad[epochs] = np.where(high, elevation, np.nan)
    e_n = paths.e_e @ flight.origin.R_ne.T
    out.e_n[epochs] = np.where(high[:, :, None], e_n, np.nan)
    for name, sigma in (("code", flight.gnss_noise.code_m), ("phase", flight.gnss_noise.phase_m)):
        variance = getattr(out, f"{name}_variance_m2")
        variance[epochs] = np.where(high, growing(flight.gnss_noise, sigma, elevation) ** 2, 1.0)
    coded = np.asarray(np.isfinite(code_m))
    clocked = np.asarray(np.isfinite(states.clock_s))
    reasons = {
        "half-cycle ambiguity of the phase not resolved": doubtful & np.isfinite(cycles),
        "not tracked by the reference antenna": coded & ~coded[:, :1],
        "satellite not healthy": coded & states.unhealthy[:, None],
        "no usable ephemeris": coded & (coded[:, 0] & ~clocked & ~states.unhealthy)[:, None],
        "no position of the reference antenna": coded & (clocked & ~here[:, None])[:, None],
        "below the elevation mask": coded & (elevation < flight.elevation_mask_rad)[:, None],
    }
    for reason, links in reasons.items():
        for antenna_, count in zip(flight.antennas, links.sum(axis=(0, 2)), strict=True):
            out.lost[f"{antenna_.name} link", reason] += int(count)
