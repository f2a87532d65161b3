"""Vectors that a flight without an antenna array knows in two frames, and its track."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.attitude.imu_rotation import ImuRotation
from fgnav.attitude.receiver_baselines import heading_baselines, with_pitch
from fgnav.attitude.vector_pairs import VectorPairs, stacked, wahba
from fgnav.checks import BoolArray, FloatArray, NoSolutionError, Unused
from fgnav.gnss.intervals import usual_interval_so_far_s
from fgnav.gnss.single_point.solution import code_solution
from fgnav.gravity import specific_force_pair
from fgnav.photodetector import line_of_sight, to_landmark_b_m
from fgnav.types.flight import Antenna, Fixes, Flight, Imu

_CROWDED = np.cos(np.radians(30))  # of the angle that velocity keeps from the other vectors
_SLOW_MPS = 2.0  # below, GNSS noise and wind turn the direction of travel by too much
_SEEN_TOGETHER = 2.5  # sample intervals over which the line of sight is interpolated


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Track:
    """Position and velocity of an antenna at ``arm_b_m``, (k, 3); velocity NaN where unknown.

    Covariances are (k, 3, 3).
    """

    t_s: FloatArray
    p_n_m: FloatArray
    position_covariance_m2: FloatArray
    v_n_mps: FloatArray | None
    velocity_covariance_m2ps2: FloatArray | None
    arm_b_m: FloatArray

    def __getitem__(self, rows: BoolArray) -> "Track":
        v_n_mps, covariance = self.v_n_mps, self.velocity_covariance_m2ps2
        return replace(
            self,
            t_s=self.t_s[rows],
            p_n_m=self.p_n_m[rows],
            position_covariance_m2=self.position_covariance_m2[rows],
            v_n_mps=None if v_n_mps is None else v_n_mps[rows],
            velocity_covariance_m2ps2=None if covariance is None else covariance[rows],
        )


def track_of(flight: Flight, *, causal: bool = False) -> Track:
    """Return the track by code, or, where raw data are absent, by the receiver's fixes.

    With ``causal``, each epoch by epochs up to it alone.

    Raises
    ------
    NoSolutionError
        If the flight has neither.
    """
    if flight.observations is not None:
        code = code_solution(flight, causal=causal)
        return Track(
            t_s=code.t_s,
            p_n_m=code.p_n_m,
            position_covariance_m2=code.position_covariance_m2,
            v_n_mps=code.v_n_mps,
            velocity_covariance_m2ps2=code.velocity_covariance_m2ps2,
            arm_b_m=flight.antennas[0].position_b_m,
        )
    fixes = flight.first_fixes
    if fixes is None:
        raise NoSolutionError(
            f"attitude: flight {flight.name} has no antenna array, no raw data, no fixes"
        )
    return track_by_fixes(fixes, flight.antenna(fixes.antenna))


def track_by_fixes(fixes: Fixes, antenna: Antenna) -> Track:
    """Return the track of an antenna by its receiver's fixes."""
    return Track(
        t_s=fixes.t_s,
        p_n_m=fixes.p_n_m,
        position_covariance_m2=fixes.position_sigma_m[:, None] ** 2 * np.eye(3),
        v_n_mps=fixes.v_n_mps,
        velocity_covariance_m2ps2=None
        if fixes.velocity_sigma_mps is None
        else fixes.velocity_sigma_mps[:, None] ** 2 * np.eye(3),
        arm_b_m=antenna.position_b_m,
    )


def measured_vectors(
    flight: Flight, track: Track, rotation: ImuRotation | None = None, *, causal: bool = False
) -> tuple[VectorPairs, tuple[Unused, ...]]:
    """Return the pairs that instruments give in both frames: force, line of sight, baselines.

    Specific force is a mean over neighbouring epochs, in axes that do not spin where the body's own
    rotation is known: else a spin blurs it. With ``causal`` it is that since the epoch before, and
    the line of sight is the last sample's; ``rotation`` is then the caller's to have without
    the future. Weights are one over the mean variance of the components across a vector.
    """
    at_epochs = _last_seen if causal else _interpolated
    v_n: list[FloatArray] = []
    v_b: list[FloatArray] = []
    variance: list[FloatArray] = []
    sources: list[str] = []
    unused: tuple[Unused, ...] = ()
    if flight.imu is not None and track.v_n_mps is not None:
        imu = flight.imu
        if rotation is not None:
            imu = rotation.forces(imu, track.arm_b_m - imu.position_b_m)
        f_n, f_b = specific_force_pair(
            imu, flight.origin, track.t_s, track.p_n_m, track.v_n_mps, causal=causal
        )
        if rotation is not None:
            f_b = np.einsum("nji,nj->ni", rotation.at(track.t_s), f_b)
        v_n, v_b, sources = [*v_n, f_n], [*v_b, f_b], [*sources, "specific force"]
        covariance = _force_covariance(imu, track, causal=causal)
        variance.append(_variance_across(f_n, covariance))
    if flight.photodetector is not None:
        sight = line_of_sight(flight.photodetector, causal=causal)
        unused = sight.unused
        to_n_m = flight.photodetector.landmark_n_m - track.p_n_m
        distance_m = np.linalg.norm(to_n_m, axis=1)
        e_b = at_epochs(sight.t_s, sight.e_b, track.t_s)
        v_n.append(to_n_m)
        v_b.append(to_landmark_b_m(flight.photodetector, e_b, track.arm_b_m, distance_m))
        of_position_m2 = _variance_across(to_n_m, track.position_covariance_m2)
        variance.append((sight.sigma_rad * distance_m) ** 2 + of_position_m2)
        sources.append("line of sight")
    force = (v_n[0], v_b[0]) if "specific force" in sources else None
    for baseline in heading_baselines(flight):
        e_n = at_epochs(baseline.of.t_s, _unit(baseline.of.vector_n_m), track.t_s)
        e_b = np.tile(_unit(baseline.vector_b_m), (len(e_n), 1))
        if baseline.of.measured == "heading" and force is not None:
            e_n = with_pitch(e_n, e_b[0], *force)
        v_n, v_b, sources = [*v_n, e_n], [*v_b, e_b], [*sources, f"receiver {baseline.name}"]
        last = (np.searchsorted(baseline.of.t_s, track.t_s, side="right") - 1).clip(0)
        variance.append(baseline.variance_rad2[last])
    n, k = len(track.t_s), len(sources)
    pairs = VectorPairs(
        v_n=np.stack(v_n, axis=1) if k else np.zeros((n, 0, 3)),
        v_b=np.stack(v_b, axis=1) if k else np.zeros((n, 0, 3)),
        weight=np.nan_to_num(1 / np.stack(variance, axis=1)) if k else np.zeros((n, 0)),
        sources=tuple(sources),
    )
    return pairs, unused


def _variance_across(v_n: FloatArray, covariance: FloatArray) -> FloatArray:
    """Return the mean variance of vectors, (n, 3), of covariances, (n, 3, 3), across them, (n,).

    What lies along a vector does not turn it.
    """
    square = np.einsum("ni,ni->n", v_n, v_n)
    along = np.einsum("ni,nij,nj->n", v_n, covariance, v_n) / np.where(square > 0, square, 1.0)
    return np.asarray((np.trace(covariance, axis1=1, axis2=2) - along) / 2)


def _force_covariance(imu: Imu, track: Track, *, causal: bool) -> FloatArray:
    """Return the covariance of ``specific_force_pair``, (n, 3, 3); NaN where there is none.

    Of its velocities' difference, of the accelerometer's mean over the span, and of its bias.
    """
    t_s, of_velocity = track.t_s, track.velocity_covariance_m2ps2
    out = np.full((len(t_s), 3, 3), np.nan)
    if of_velocity is None or len(t_s) < 3:
        return out
    spacing = 1 if causal else 2
    span_s = (t_s[spacing:] - t_s[:-spacing])[:, None, None]
    white = imu.accelerometer_noise_mps2_per_sqrt_hz**2 / span_s
    of_force = (white + imu.accelerometer_bias_mps2**2) * np.eye(3)
    out[1 : len(span_s) + 1] = (
        of_velocity[spacing:] + of_velocity[:-spacing]
    ) / span_s**2 + of_force
    return out


def with_velocity(pairs: VectorPairs, track: Track) -> VectorPairs:
    """Add the velocity as the body's x axis at epochs whose other vectors leave an angle open.

    Not beside a vector of nearly its own direction: the line of sight of a body that flies to the
    landmark says the same as the velocity, and a few degrees of sideslip would roll it by tens.
    Nor beside a baseline, which tells the heading of a body that flies in any direction.
    """
    has_baseline = any(source.startswith("receiver") for source in pairs.sources)
    if track.v_n_mps is None or has_baseline:
        return pairs
    speed_mps = np.linalg.norm(track.v_n_mps, axis=1)
    others = pairs.directions()
    forward_n = track.v_n_mps / np.where(speed_mps > 0, speed_mps, 1.0)[:, None]
    cosine = np.abs(np.einsum("nki,ni->nk", others.v_n, forward_n))
    crowded = np.nan_to_num(cosine).max(axis=1, initial=0.0) > _CROWDED
    wanted = (wahba(others).rank < 2) & ~crowded & (speed_mps > _SLOW_MPS)
    v_n = np.where(wanted[:, None], track.v_n_mps, np.nan)
    v_b = speed_mps[:, None] * np.array([1.0, 0.0, 0.0])
    nose = VectorPairs(
        v_n=v_n[:, None], v_b=v_b[:, None], weight=np.ones((len(v_n), 1)), sources=("velocity",)
    )
    return stacked([pairs, nose])


def _unit(v: FloatArray) -> FloatArray:
    return np.asarray(v / np.linalg.norm(v, axis=-1, keepdims=True))


def _interpolated(t_s: FloatArray, e_b: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return directions at other times, (n, 3): between neighbours, NaN across gaps and outside."""
    if len(t_s) < 2:
        return np.full((len(at_s), 3), np.nan)
    before = np.searchsorted(t_s, at_s, side="right").clip(1, len(t_s) - 1) - 1
    step_s = t_s[before + 1] - t_s[before]
    share = (at_s - t_s[before]) / step_s
    inside = (share >= 0) & (share <= 1) & (step_s < _SEEN_TOGETHER * np.median(np.diff(t_s)))
    between = e_b[before] + share[:, None] * (e_b[before + 1] - e_b[before])
    unit = between / np.linalg.norm(between, axis=1, keepdims=True)
    return np.asarray(np.where(inside[:, None], unit, np.nan))


def _last_seen(t_s: FloatArray, e_b: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return directions at other times, (n, 3), by samples up to each: the last one, if recent.

    NaN where it is older than the usual interval, and where nothing tells what is usual.
    """
    last = np.searchsorted(t_s, at_s, side="right") - 1
    if not len(t_s):
        return np.full((len(at_s), 3), np.nan)
    usual_s = usual_interval_so_far_s(t_s)[last.clip(0)]
    recent = (last >= 0) & np.isfinite(usual_s) & (at_s - t_s[last.clip(0)] <= usual_s)
    return np.where(recent[:, None], e_b[last.clip(0)], np.nan)
