"""Position, velocity and clock of one antenna from its code and Doppler, epoch by epoch."""

from collections import Counter
from dataclasses import dataclass, fields
from functools import partial
from typing import NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError, Unused, freeze, unused_of
from fgnav.geometry.earth import Origin
from fgnav.geometry.interpolation import interpolate
from fgnav.gnss.single_point.adjustment import adjust
from fgnav.gnss.single_point.model import CodeChannels, code_channels, code_ranges
from fgnav.gnss.single_point.solved_block import SolvedBlock, solved_block
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

_SAMPLE = 200  # epochs
BLOCK = 2000  # epochs worked on at once: temporaries stay within some 10 MB


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class CodeSolution:
    """Positions of one antenna by its code alone, at the epochs that have a solution."""

    # Nominal epochs. Positions are moved there from the true time of reception where a velocity is
    # known.
    t_s: FloatArray  # (k,)
    epoch: IntArray  # (k,): their rows in the observations
    p_n_m: FloatArray  # (k, 3)
    # With what messages and atmosphere models leave unexplained. That part hardly changes from
    # epoch to epoch: a filter that takes it for white noise would average it away.
    position_covariance_m2: FloatArray  # (k, 3, 3)
    # The part of it that is new at every epoch: the receiver's noise.
    position_noise_m2: FloatArray  # (k, 3, 3)
    # From Doppler; NaN at epochs without enough of it, None if there is none at all.
    v_n_mps: FloatArray | None  # (k, 3)
    velocity_covariance_m2ps2: FloatArray | None  # (k, 3, 3)
    constellations: tuple[str, ...]  # letters: ``"G"``
    # Receiver clock minus each constellation's time; NaN where it was not seen.
    clock_s: FloatArray  # (k, c)
    clock_drift_sps: FloatArray  # (k,): NaN without Doppler
    satellites: tuple[str, ...]
    used: BoolArray  # (k, m): satellites that took part in the position
    unused: tuple[Unused, ...] = ()

    def __post_init__(self) -> None:
        """Check and freeze every field."""
        k, c, m = len(self.t_s), len(self.constellations), len(self.satellites)
        shapes: dict[str, tuple[int, ...]] = {
            "t_s": (k,),
            "p_n_m": (k, 3),
            "position_covariance_m2": (k, 3, 3),
            "position_noise_m2": (k, 3, 3),
            "v_n_mps": (k, 3),
            "velocity_covariance_m2ps2": (k, 3, 3),
            "clock_s": (k, c),
            "clock_drift_sps": (k,),
        }
        gaps = ("v_n_mps", "velocity_covariance_m2ps2", "clock_s", "clock_drift_sps")
        for name, shape in shapes.items():
            if getattr(self, name) is not None:
                freeze("code solution", self, {name: shape}, gaps=name in gaps)
        freeze("code solution", self, {"epoch": (k,)}, dtype=np.int64)
        freeze("code solution", self, {"used": (k, m)}, dtype=np.bool_)


_CACHE: WeakKeyDictionary[Flight, dict[bool, CodeSolution]] = WeakKeyDictionary()  # by causal


def code_solution(flight: Flight, *, causal: bool = False) -> CodeSolution:
    """Return the code solution of the first antenna; computed once per flight.

    Weighted least squares per epoch: position and one receiver clock per constellation from one
    carrier of each, satellites above the flight's elevation mask. Variances add the flight's code
    noise, the message's accuracy and what the atmosphere models leave. While the chi-square test
    fails at 1e-4, the satellite with the largest normalised residual is dropped.

    The broadcast ionosphere and Saastamoinen's troposphere are applied, unless the flight states
    that it has no atmosphere.

    Parameters
    ----------
    causal : bool
        Each epoch by epochs up to it alone: channels by those first seen. Velocities are never None
        then.

    Raises
    ------
    NoSolutionError
        If the flight lacks observations or orbits, or no epoch has a solution.
    """
    cached = _CACHE.setdefault(flight, {})
    if causal not in cached:
        cached[causal] = _solve(flight, causal=causal)
    return cached[causal]


def _solve(flight: Flight, *, causal: bool) -> CodeSolution:
    observations = flight.observations
    if observations is None:
        raise NoSolutionError(f"flight {flight.name}: position needs GNSS observations")
    name = flight.antennas[0].name
    channels = code_channels(observations, 0, causal=causal)
    if not channels.satellites:
        raise NoSolutionError(f"antenna {name}: no code observation of a supported satellite")
    n = len(observations.t_s)
    starts = None if causal else _sampled(flight, observations, channels)
    lost: Counter[tuple[str, str]] = Counter()
    blocks = []
    for first in range(0, n, BLOCK):
        epoch = np.arange(first, min(first + BLOCK, n))
        ranges = code_ranges(flight, observations, channels, 0, epoch)
        solve = partial(adjust, flight, channels, ranges, each=causal)
        start_e_m = None
        if starts is not None and len(starts.epoch):
            start_e_m = interpolate(epoch.astype(np.float64), starts.epoch, starts.p_e_m)
        blocks.append(solved_block(flight.gnss_noise, ranges, solve, epoch, start_e_m, lost))
    columns = ([getattr(block, field.name) for block in blocks] for field in fields(SolvedBlock))
    solved = SolvedBlock(*(np.concatenate(column) for column in columns))
    unused = unused_of({(f"{name} {what}", reason): n for (what, reason), n in lost.items()})
    return _finish(flight.origin, observations, channels, solved, unused, causal=causal)


class _Starts(NamedTuple):
    """Places from which epochs take half the steps that they take from the origin."""

    epoch: FloatArray  # (k,)
    p_e_m: FloatArray


def _sampled(flight: Flight, observations: Observations, channels: CodeChannels) -> _Starts:
    """Return a sample of the flight's epochs, solved from the origin."""
    epoch = np.unique(np.linspace(0, len(observations.t_s) - 1, _SAMPLE).astype(np.int64))
    ranges = code_ranges(flight, observations, channels, 0, epoch, rates=False)
    tried = adjust(flight, channels, ranges, np.isfinite(ranges.range_m))
    return _Starts(epoch[tried.converged].astype(np.float64), tried.p_e_m[tried.converged])


def _finish(
    origin: Origin,
    observations: Observations,
    channels: CodeChannels,
    solved: SolvedBlock,
    unused: tuple[Unused, ...],
    *,
    causal: bool,
) -> CodeSolution:
    """Turn what was solved in ECEF into the local frame, at the nominal epochs."""
    R = origin.R_ne
    if not len(solved.epoch):
        reasons = "; ".join(f"{loss.count} {loss.what}: {loss.reason}" for loss in unused)
        raise NoSolutionError(f"position: no epoch has a code solution ({reasons})")
    t_s = observations.t_s[solved.epoch]
    first = np.isfinite(solved.clock_s).argmax(axis=1)
    clock_s = solved.clock_s[np.arange(len(t_s)), first]
    late_s = observations.tag_s[solved.epoch, 0] - clock_s - t_s
    moving = np.asarray(np.isfinite(solved.v_e_mps).all(axis=1))
    doppler = causal or bool(moving.any())
    v_e_mps = np.where(moving[:, None], solved.v_e_mps, 0.0)
    return CodeSolution(
        t_s=t_s,
        epoch=solved.epoch,
        p_n_m=origin.to_n(solved.p_e_m - v_e_mps * late_s[:, None]),
        position_covariance_m2=R @ solved.covariance_m2 @ R.T,
        position_noise_m2=R @ solved.noise_m2 @ R.T,
        v_n_mps=solved.v_e_mps @ R.T if doppler else None,
        velocity_covariance_m2ps2=(R @ solved.velocity_covariance_m2ps2 @ R.T if doppler else None),
        constellations=channels.constellations,
        clock_s=solved.clock_s,
        clock_drift_sps=solved.drift_sps,
        satellites=channels.satellites,
        used=solved.used,
        unused=unused,
    )
