"""Phases of an antenna that are louder than stated, for seconds or all along.

Steps of phase from epoch to epoch, place and clocks eliminated, are of noise, unless a channel
slipped. With s_j the squares, over the variance of a step as stated, that d steps more than there
are unknowns leave without the j largest, noise f times as loud has, slips being as few as fit best,

    -ln p = min over j  s_j / 2 f^2 + (d - j) ln f + j ln(a / sigma)

a what is known of a new arc, sigma of a step [1]_. The span of epochs in which some f gains most is
louder if it gains the odds of any contradiction and of as many spans as there are. Steps that are
neighbours have the correlation -1/2: their squares are worth two thirds. Errors of satellites that
move are no noise, so all arcs and errors are to be likelier with it, too.

References
----------
.. [1] Teunissen, de Bakker: Single-receiver single-channel multi-frequency GNSS integrity, Journal
   of Geodesy 87, 2013: slips as outliers of time differences.
"""

from dataclasses import replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.frontend.position.live_arcs import UNKNOWN_M
from fgnav.frontend.position.numbered_arcs import Observed
from fgnav.frontend.position.phases import antenna_phase
from fgnav.gnss.cycle_slips.detection import LONGEST_GAP
from fgnav.gnss.signals import select
from fgnav.gnss.undifferenced import Undifferenced, undifferenced
from fgnav.graph.types.constants import Constants
from fgnav.identification.likelihood.satellite_errors import phase_evidence
from fgnav.identification.likelihood.span_offsets import LIKELY
from fgnav.identification.noise.identified import TOLERATED
from fgnav.identification.track.windows import EXCLUDED
from fgnav.types.flight import Flight
from fgnav.types.instruments import GnssNoise, LoudPhases
from fgnav.types.observations import LOST_LOCK, Observations

_FACTORS = np.exp(np.arange(TOLERATED, np.log(100.0), 0.1))  # beyond, codes tell as much
_WORTH = 2 / 3  # of squares of neighbouring steps: 1 / (1 + 2 (1/2)^2)
_PLACE_M = 3.0  # of a place by code, usually (io.flight.usual_noise): of a sight that turns a step
_LEAST = 1e-9  # of the normal equations, clocks that no channel has


def loud_phases(flight: Flight) -> tuple[LoudPhases, ...]:
    """Return when, and how far, phases of a flight's first antenna are louder than stated."""
    if flight.observations is None or flight.base is not None:
        return ()
    try:
        spans = loud_spans(flight.observations, undifferenced(flight))
        if not spans or _evidence(with_loud_phases(flight, spans)) <= _evidence(flight) + EXCLUDED:
            return ()
    except NoSolutionError:  # without a place by code, or next to nothing
        return ()
    return spans


def with_loud_phases(flight: Flight, spans: tuple[LoudPhases, ...]) -> Flight:
    """Return a flight that states the noise which its phases have."""
    if not spans:
        return flight
    return replace(flight, gnss_noise=replace(flight.gnss_noise, loud_phases=spans))


def _evidence(flight: Flight) -> float:
    """Return ln of the density of a flight's phases by the arcs that its noise leaves."""
    of = undifferenced(flight)
    rows = np.arange(len(of.t_s))
    level = np.broadcast_to(np.eye(3), (len(rows), 3, 3))  # what turns wind up is a clock's, nearly
    observed = Observed(of, rows, rows, np.zeros(3))
    phase = antenna_phase((observed,), of.t_s, level, Constants()).phase
    if phase is None:
        return -np.inf
    return phase_evidence(phase, flight.gnss_noise.phase_factor(of.t_s[phase.row]))


def loudness_notes(noise: GnssNoise) -> tuple[str, ...]:
    """Return a sentence for each span in which phases are louder than stated."""
    stated = "the usual figure" if "phase_m" in noise.unstated else "what flight.toml states"
    return tuple(
        f"Noise of phases {_when(one)} is {one.factor:.2g} x {stated}, "
        f"{one.factor * noise.phase_m:.2g} m: used instead."
        for one in noise.loud_phases
    )


def _when(one: LoudPhases) -> str:
    if np.isfinite(one.from_s) and np.isfinite(one.until_s):
        return f"from {one.from_s:.1f} to {one.until_s:.1f} s"
    if np.isfinite(one.from_s):
        return f"from {one.from_s:.1f} s on"
    return f"until {one.until_s:.1f} s" if np.isfinite(one.until_s) else "throughout"


def loud_spans(observations: Observations, of: Undifferenced) -> tuple[LoudPhases, ...]:
    """Return the spans in which steps of an antenna's phases are louder than stated."""
    if len(of.t_s) < 2 or not np.isfinite(of.phase_m).any():
        return ()
    squares, freedom = _left(*_steps(observations, of))
    new_arc = float(np.log(UNKNOWN_M / (np.sqrt(2) * np.nanmedian(of.phase_sigma_m))))
    slips = (freedom[0] - freedom) * new_arc

    def cost(f: float) -> FloatArray:
        return np.asarray((squares / (2 * f**2) + freedom * np.log(f) + slips).min(axis=0))

    stated = cost(1.0)
    inside = _WORTH * np.array([stated - cost(f) for f in _FACTORS])
    # Into and out of a span: one of both epochs is loud.
    at_ends = _WORTH * np.array([stated - cost(np.sqrt((1 + f**2) / 2)) for f in _FACTORS])
    n = len(of.t_s)
    limit, between_s = EXCLUDED + np.log(n * (n + 1) / 2), (of.t_s[1:] + of.t_s[:-1]) / 2
    edges_s = np.concatenate([[-np.inf], between_s, [np.inf]])
    return tuple(
        LoudPhases(float(edges_s[first]), float(edges_s[last + 1]), float(_FACTORS[k]))
        for first, last, k in _greatest(inside, at_ends, (0, n), float(limit))
    )


def _greatest(
    inside: FloatArray, at_ends: FloatArray, within: tuple[int, int], limit: float
) -> list[tuple[int, int, int]]:
    """Return first and last epoch of spans that gain most and do not overlap, and which factor.

    As far out as spans reach that are a hundredth as likely.

    Parameters
    ----------
    inside, at_ends : ndarray, shape (f, n)
        What each factor gains of the step into an epoch: between two of a span, or into its first
        or out of its last.
    within : tuple of int
        The first epoch, and that after the last.
    limit : float
        What is to be gained.
    """
    begin, end = within
    if end <= begin:
        return []
    so_far = inside.cumsum(axis=1)[:, begin:end]
    into, out = at_ends[:, begin:end] - so_far, np.zeros_like(so_far)
    out[:, : at_ends.shape[1] - begin - 1] = at_ends[:, begin + 1 : end + 1]
    gains = np.maximum.accumulate(into, axis=1) + so_far + out
    k, last = divmod(int(gains.argmax()), end - begin)
    if gains[k, last] <= limit:
        return []
    until = (so_far + out)[k]
    first = int(into[k, : last + 1].argmax())
    begins = into[k, : last + 1] >= into[k, first] - LIKELY
    ends = until[first:] >= until[last] - LIKELY
    first, last = begin + int(begins.argmax()), begin + first + int(np.flatnonzero(ends)[-1])
    return [
        *_greatest(inside, at_ends, (begin, first), limit),
        (first, last, k),
        *_greatest(inside, at_ends, (last + 1, end), limit),
    ]


def _steps(
    observations: Observations, of: Undifferenced
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return steps into each epoch, (n, m), whitened, rows of their unknowns, and which are there.

    Unknowns, 3 + g, are how far the place and the g clocks went. Nothing leads to the first epoch,
    nor across a gap or a loss of lock that the receiver reports.
    """
    channel = select(observations, causal=True).channel[0]
    flags = observations.lock_flags[:, 0][:, channel[channel >= 0]]
    step_s = np.diff(of.t_s)
    use = np.zeros(of.phase_m.shape, dtype=np.bool_)
    use[1:] = np.isfinite(np.diff(of.phase_m, axis=0)) & ((flags[1:] & LOST_LOCK) == 0)
    use[1:] &= step_s[:, None] <= LONGEST_GAP * np.median(step_s)
    turn = np.diff(of.e_n, axis=0, prepend=of.e_n[:1])
    dt_s = np.append(0.0, step_s)
    sigma_m = np.nan_to_num(of.phase_sigma_m, nan=1.0)
    moved_m2 = of.error_walk_m_per_sqrt_s**2 * dt_s + (of.error_rate_mps * dt_s) ** 2
    variance_m2 = sigma_m**2 + np.roll(sigma_m, 1, axis=0) ** 2 + moved_m2[:, None]
    variance_m2 += _PLACE_M**2 * (turn**2).sum(axis=2)
    clocks = np.eye(1 + int(of.group.max(initial=0)))[of.group]
    rows = np.concatenate(
        [turn / 2 - of.e_n, np.broadcast_to(clocks, (*use.shape, clocks.shape[1]))], axis=2
    )
    root = np.sqrt(variance_m2)
    step_m = np.where(use, np.diff(of.phase_m, axis=0, prepend=np.nan), 0.0)
    # What a clock jumps by, 300 km for a millisecond, would cost the normal equations their digits.
    step_m -= np.median(step_m, axis=1, keepdims=True)
    whitened = np.where(use, step_m / root, 0.0)
    return whitened, np.where(use[:, :, None], rows / root[:, :, None], 0.0), use


def _left(steps: FloatArray, rows: FloatArray, use: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return squares that steps leave without the j largest, (q, n), and of how many beyond need.

    The largest are taken out in turn; where no step is one too many, both are zero.
    """
    use, squares, freedom = use.copy(), [], []
    epochs = np.arange(len(steps))
    for _ in range(steps.shape[1]):
        taken = np.where(use[:, :, None], rows, 0.0)
        normal = np.swapaxes(taken, 1, 2) @ taken
        size = np.einsum("nii->ni", normal)
        count = use.sum(axis=1) - (size > 0).sum(axis=1)
        least = _LEAST * size.max(axis=1).clip(np.finfo(float).tiny / _LEAST)
        cofactor = np.linalg.inv(normal + least[:, None, None] * np.eye(len(size.T)))
        y = np.where(use, steps, 0.0)
        of_fit = taken @ cofactor
        left = y - (of_fit @ (y[:, None] @ taken).swapaxes(1, 2))[..., 0]
        squares.append(np.where(count > 0, (left**2).sum(axis=1), 0.0))
        freedom.append(count.clip(0))
        share = 1 - (of_fit * taken).sum(axis=2)
        worst = np.where(use, np.abs(left) / np.sqrt(share.clip(1e-3)), -1.0).argmax(axis=1)
        use[epochs, worst] = False
        if not (freedom[-1] > 0).any():
            break
    return np.array(squares), np.array(freedom)
