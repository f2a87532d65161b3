"""Position, velocity and clock of one antenna from its code and Doppler, epoch by epoch."""

from collections import Counter
from dataclasses import dataclass, field, fields
from weakref import WeakKeyDictionary

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError, freeze
from fgnav.geometry.earth import C_MPS
from fgnav.gnss.least_squares import fit, fit_consistent
from fgnav.gnss.orbits.satellites import signal_paths
from fgnav.gnss.single_point.adjustment import Adjusted, adjust, adjust_each, growing
from fgnav.gnss.single_point.atmosphere_choice import atmosphere_so_far
from fgnav.gnss.single_point.model import CodeChannels, CodeRanges, code_channels, code_ranges
from fgnav.gnss.single_point.trial import trial
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

BLOCK = 2000  # epochs worked on at once: temporaries stay within some 10 MB
_MAX_DOP = 100.0


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CodeSolution:
    """Where one antenna was, by its code observations alone, at the epochs that have an answer.

    Attributes
    ----------
    t_s : ndarray, shape (k,)
        Nominal epochs. Positions are moved there from the true time of reception where a velocity
        is known.
    epoch : ndarray of int, shape (k,)
        Their rows in the observations.
    p_n_m : ndarray, shape (k, 3)
    position_covariance_m2 : ndarray, shape (k, 3, 3)
        With what messages and atmosphere models leave unexplained. That part hardly changes from
        epoch to epoch: a filter that takes it for white noise would average it away.
    position_noise_m2 : ndarray, shape (k, 3, 3)
        The part of it that is new at every epoch: the receiver's noise.
    drift_per_s : ndarray, shape (k, 3, 3)
        Times an error of position that stays with satellites: how fast it moves as the sky turns.
    v_n_mps : ndarray, shape (k, 3), or None
        From Doppler; NaN at epochs without enough of it, None if there is none at all.
    velocity_covariance_m2ps2 : ndarray, shape (k, 3, 3), or None
    constellations : tuple of str, length c
        Letters: ``"G"``.
    clock_s : ndarray, shape (k, c)
        Receiver clock minus each constellation's time; NaN where it was not seen.
    clock_drift_sps : ndarray, shape (k,)
        NaN without Doppler.
    dop : ndarray, shape (k, 4)
        Geometric, position, horizontal, vertical dilution of precision.
    satellites : tuple of str, length m
    used : ndarray of bool, shape (k, m)
        Satellites that took part in the position.
    atmosphere : bool
        Whether models of ionosphere and troposphere were applied; of causal solutions, at the last
        epoch.
    """

    t_s: FloatArray
    epoch: IntArray
    p_n_m: FloatArray
    position_covariance_m2: FloatArray
    position_noise_m2: FloatArray
    drift_per_s: FloatArray
    v_n_mps: FloatArray | None
    velocity_covariance_m2ps2: FloatArray | None
    constellations: tuple[str, ...]
    clock_s: FloatArray
    clock_drift_sps: FloatArray
    dop: FloatArray
    satellites: tuple[str, ...]
    used: BoolArray
    atmosphere: bool
    losses: tuple[Loss, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k, c, m = len(self.t_s), len(self.constellations), len(self.satellites)
        shapes: dict[str, tuple[int, ...]] = {
            "t_s": (k,),
            "p_n_m": (k, 3),
            "position_covariance_m2": (k, 3, 3),
            "position_noise_m2": (k, 3, 3),
            "drift_per_s": (k, 3, 3),
            "v_n_mps": (k, 3),
            "velocity_covariance_m2ps2": (k, 3, 3),
            "clock_s": (k, c),
            "clock_drift_sps": (k,),
            "dop": (k, 4),
        }
        gaps = ("v_n_mps", "velocity_covariance_m2ps2", "clock_s", "clock_drift_sps")
        for name, shape in shapes.items():
            if getattr(self, name) is not None:
                freeze("code solution", self, {name: shape}, gaps=name in gaps)
        freeze("code solution", self, {"epoch": (k,)}, dtype=np.int64)
        freeze("code solution", self, {"used": (k, m)}, dtype=np.bool_)


_Key = tuple[int, bool | None, bool]
_CACHE: WeakKeyDictionary[Flight, dict[_Key, CodeSolution]] = WeakKeyDictionary()


def code_solution(
    flight: Flight, *, antenna: int = 0, atmosphere: bool | None = None, causal: bool = False
) -> CodeSolution:
    """Return the code solution of one antenna; computed once per flight.

    Weighted least squares per epoch: position and one receiver clock per constellation from one
    carrier of each, satellites above the flight's elevation mask. Variances add the flight's code
    noise, the message's accuracy and what the atmosphere models leave. While the chi-square test
    fails at 1e-4, the satellite with the largest normalised residual is dropped.

    Parameters
    ----------
    antenna : int
        Row in ``flight.antennas``.
    atmosphere : bool or None
        Apply the broadcast ionosphere and Saastamoinen's troposphere. None asks the data, because
        a simulated flight may have no atmosphere: it is left out where that makes the median
        residuals of a sample of epochs smaller, and as small as the stated code noise.
    causal : bool
        Each epoch by epochs up to it alone: channels by those first seen, the atmosphere by the
        first 64 epochs with redundant code, decided anew whenever their number doubles. Velocities
        are never None then.

    Raises
    ------
    NoSolutionError
        If the flight lacks observations or orbits, or no epoch has a solution.
    """
    known = _CACHE.setdefault(flight, {})
    key = (antenna, atmosphere, causal)
    if key not in known:
        known[key] = _solve(flight, antenna, atmosphere, causal=causal)
    return known[key]


def _solve(flight: Flight, antenna: int, atmosphere: bool | None, *, causal: bool) -> CodeSolution:
    observations = flight.observations
    if observations is None:
        raise NoSolutionError(f"flight {flight.name}: position needs GNSS observations")
    name = flight.antennas[antenna].name
    channels = code_channels(observations, antenna, causal=causal)
    if not channels.satellites:
        raise NoSolutionError(f"antenna {name}: no code observation of a supported satellite")
    n = len(observations.t_s)
    starts, model = None, np.full(n, atmosphere is not False)
    if not causal:
        starts, applied = trial(flight, observations, channels, antenna, atmosphere)
        model = np.full(n, applied)
    elif atmosphere is None:
        model = atmosphere_so_far(flight, observations, channels, antenna)
    lost: Counter[tuple[str, str]] = Counter()
    blocks = []
    for first in range(0, n, BLOCK):
        epoch = np.arange(first, min(first + BLOCK, n))
        ranges = code_ranges(flight, observations, channels, antenna, epoch)
        solve = _Solver(flight, channels, ranges, model[epoch], causal=causal)
        blocks.append(_block(solve, epoch, lost, None if starts is None else starts.at(epoch)))
    columns = ([getattr(block, one.name) for block in blocks] for one in fields(_Solved))
    solved = _Solved(*(np.concatenate(column) for column in columns))
    losses = tuple(
        Loss(what=f"{name} {what}", reason=reason, count=count)
        for (what, reason), count in lost.items()
        if count
    )
    return _finish(
        flight, observations, antenna, channels, solved, losses, model=model, causal=causal
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Solver:
    """How positions of a block of epochs are found."""

    flight: Flight
    channels: CodeChannels
    ranges: CodeRanges
    model: BoolArray  # (n,)
    causal: bool = field(kw_only=True)

    def __call__(self, wanted: BoolArray, start_e_m: FloatArray | None) -> Adjusted:
        problem = (self.flight, self.channels, self.ranges, wanted)
        if self.causal:
            return adjust_each(*problem, model=self.model)
        return adjust(*problem, model=self.model, start_e_m=start_e_m)


@dataclass(frozen=True, eq=False, slots=True)
class _Solved:
    """Epochs of one block that have an answer."""

    epoch: IntArray
    p_e_m: FloatArray
    covariance_m2: FloatArray
    noise_m2: FloatArray
    drift_per_s: FloatArray
    clock_s: FloatArray
    v_e_mps: FloatArray
    velocity_covariance_m2ps2: FloatArray
    drift_sps: FloatArray
    used: BoolArray
    geometry: FloatArray  # (n, 3 + c, 3 + c) covariance for unit variances


def _block(
    solve: _Solver,
    epoch: IntArray,
    lost: Counter[tuple[str, str]],
    start_e_m: FloatArray | None,
) -> _Solved:
    """Solve some epochs, and count what is lost."""
    flight, ranges = solve.flight, solve.ranges
    wanted = np.isfinite(ranges.range_m)
    at = solve(wanted, start_e_m)
    eq, kept = at.equations, at.use
    if not at.fits.consistent[at.fits.solved].all():
        _, kept = fit_consistent(eq.A, eq.y, eq.variance_m2, at.use)
    dropped = at.use & ~kept
    if dropped.any():
        at = solve(wanted & ~dropped, at.p_e_m)
        eq = at.equations
    geometry = fit(eq.A, eq.y, np.ones_like(eq.y), at.use).covariance
    flat = np.trace(geometry, axis1=1, axis2=2) > _MAX_DOP**2
    good = at.converged & at.fits.consistent & ~flat
    turning = _turning(ranges, at)
    v, velocity_covariance, drift = _velocities(flight, ranges, at, good, lost)
    code = "code observation"
    lost[code, "satellite not healthy"] += int((ranges.coded & ranges.states.unhealthy).sum())
    blind = ranges.coded & ~wanted & ~ranges.states.unhealthy
    lost[code, "no usable ephemeris"] += int(blind.sum())
    lost[code, "contradicts the other satellites"] += int(dropped.sum())
    lost[code, "below the elevation mask"] += int((wanted & ~at.use & ~dropped).sum())
    lost["epoch", "fewer satellites than unknowns"] += int((~at.fits.solved).sum())
    lost["epoch", "position did not converge"] += int((at.fits.solved & ~at.converged).sum())
    lost["epoch", "satellites contradict each other"] += int(
        (at.converged & ~at.fits.consistent).sum()
    )
    lost["epoch", "geometry is too weak"] += int((at.converged & at.fits.consistent & flat).sum())
    sigma_m = growing(flight, flight.gnss_noise.code_m, eq.elevation_rad)
    gain = at.fits.gain[good, :3]
    noise_m2 = np.where(at.use, sigma_m, 0.0)[good] ** 2
    return _Solved(
        epoch[good],
        at.p_e_m[good],
        at.fits.covariance[good, :3, :3],
        np.einsum("nim,nm,njm->nij", gain, noise_m2, gain),
        gain @ turning[good],
        at.fits.x[good, 3:] / C_MPS,
        v[good],
        velocity_covariance[good],
        drift[good],
        at.use[good],
        geometry[good],
    )


def _turning(ranges: CodeRanges, at: Adjusted) -> FloatArray:
    """Return how fast directions to satellites turn, (n, m, 3), 1/s, Earth-fixed axes; 0 unused.

    Of an antenna at rest: a hundred metres a second add 3 %.
    """
    paths = signal_paths(ranges.states, at.p_e_m, np.zeros_like(at.p_e_m))
    across = ranges.states.v_e_mps - paths.range_rate_mps[:, :, None] * paths.e_e
    return np.where(at.use[:, :, None], across / paths.range_m[:, :, None], 0.0)


def _velocities(
    flight: Flight,
    ranges: CodeRanges,
    at: Adjusted,
    good: BoolArray,
    lost: Counter[tuple[str, str]],
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return velocities (n, 3), covariances and clock drifts from Doppler; NaN where too few."""
    paths = signal_paths(ranges.states, at.p_e_m, np.zeros_like(at.p_e_m))
    y = ranges.rate_mps - paths.range_rate_mps
    sigma_mps = growing(flight, flight.gnss_noise.doppler_mps, at.equations.elevation_rad)
    lag = 1 - paths.range_rate_mps / C_MPS  # as transmission lags behind while the range grows
    A = np.concatenate([-paths.e_e * lag[:, :, None], np.ones((*y.shape, 1))], axis=2)
    use = at.use & np.isfinite(y) & good[:, None]
    fits, kept = fit_consistent(A, y, sigma_mps**2, use)
    lost["Doppler observation", "contradicts the other satellites"] += int((use & ~kept).sum())
    fine = fits.consistent & np.isfinite(fits.x).all(axis=1)
    v = np.where(fine[:, None], fits.x[:, :3], np.nan)
    covariance = np.where(fine[:, None, None], fits.covariance[:, :3, :3], np.nan)
    return v, covariance, np.where(fine, fits.x[:, 3], np.nan) / C_MPS


def _finish(
    flight: Flight,
    observations: Observations,
    antenna: int,
    channels: CodeChannels,
    solved: _Solved,
    losses: tuple[Loss, ...],
    *,
    model: BoolArray,
    causal: bool,
) -> CodeSolution:
    """Turn what was solved in ECEF into the local frame, at the nominal epochs."""
    R = flight.origin.R_ne
    if not len(solved.epoch):
        reasons = "; ".join(f"{loss.count} {loss.what}: {loss.reason}" for loss in losses)
        raise NoSolutionError(f"position: no epoch has a code solution ({reasons})")
    t_s = observations.t_s[solved.epoch]
    first = np.isfinite(solved.clock_s).argmax(axis=1)
    clock_s = solved.clock_s[np.arange(len(t_s)), first]
    late_s = observations.tag_s[solved.epoch, antenna] - clock_s - t_s
    moving = np.asarray(np.isfinite(solved.v_e_mps).all(axis=1))
    doppler = causal or bool(moving.any())
    v_e_mps = np.where(moving[:, None], solved.v_e_mps, 0.0)
    geometry = solved.geometry[:, :3, :3]
    variances = np.diagonal(R @ geometry @ R.T, axis1=1, axis2=2)
    position = variances.sum(axis=1)
    time = np.diagonal(solved.geometry, axis1=1, axis2=2)[:, 3]
    dop = [position + time, position, variances[:, :2].sum(axis=1), variances[:, 2]]
    return CodeSolution(
        t_s=t_s,
        epoch=solved.epoch,
        p_n_m=flight.origin.to_n(solved.p_e_m - v_e_mps * late_s[:, None]),
        position_covariance_m2=R @ solved.covariance_m2 @ R.T,
        position_noise_m2=R @ solved.noise_m2 @ R.T,
        drift_per_s=R @ solved.drift_per_s @ R.T,
        v_n_mps=solved.v_e_mps @ R.T if doppler else None,
        velocity_covariance_m2ps2=(R @ solved.velocity_covariance_m2ps2 @ R.T if doppler else None),
        constellations=channels.constellations,
        clock_s=solved.clock_s,
        clock_drift_sps=solved.drift_sps,
        dop=np.sqrt(np.stack(dop, axis=1)),
        satellites=channels.satellites,
        used=solved.used,
        atmosphere=bool(model[solved.epoch[-1]]),
        losses=losses,
    )
