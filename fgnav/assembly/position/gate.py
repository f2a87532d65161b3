"""Fixes that jump: positions and velocities held against the inertial track about them."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from fgnav.alignment.rates import swing_n_mps
from fgnav.assembly.position.antenna_motion import AntennaMotion
from fgnav.assembly.position.series import VectorSeries
from fgnav.checks import BoolArray, FloatArray, Unused
from fgnav.geometry.interpolation import integral, interpolate
from fgnav.types.estimate import Rejected
from fgnav.types.flight import Imu

_AROUND = 15  # fixes before and after: fourteen in a row may be wrong
_LONGEST_STEP_S = 2.0  # fixes further apart are not held against each other
_AROUND_S = 1.5  # the inertial track drifts; but three on either side are needed to vote
_LEAST = 3
_SIGMAS = 6.0
# What attitudes a third of a degree off make of gravity: how well the track itself is known. Over
# a second and a half it outweighs positions by phase, which are good to millimetres.
_TRACK_MPS2 = 0.05
_NORMAL = 1.4826  # sigma of normal noise over its median size


class Gated(NamedTuple):
    """Motion of antennas, NaN where a position or a velocity is rejected."""

    antenna: AntennaMotion
    rejections: tuple[Rejected, ...]
    unused: tuple[Unused, ...]


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class InertialTrack:
    """Motion by specific force and approximate attitudes."""

    t_s: FloatArray  # (n,): keyframes
    R_nb: FloatArray  # (n, 3, 3): approximate attitudes, in which velocities of antennas swing
    R_nu: FloatArray  # (n, 3, 3): of axes that do not spin, to which ``imu`` speaks
    w_b_radps: FloatArray  # (n, 3): approximate rates
    imu: Imu
    gravity_n_mps2: FloatArray  # (n, 3)
    untested: BoolArray  # (n,): keyframes without specific force or attitude
    # Of the attitudes, beyond a third of a degree: what gravity is turned by.
    attitude_sigma_rad: FloatArray  # (n,)
    causal: bool = False  # whether fixes are held against those before them alone


def gated(track: InertialTrack, antenna: AntennaMotion) -> Gated:
    """Reject positions by fixes, and velocities, that are off their neighbours by more than noise.

    Specific force turned by approximate attitudes determines how velocity changes, and velocity how
    position does, far better over seconds than fixes do. What is left of a fix is nearly constant;
    its distance from the median of its neighbours, a second and a half before and after, is tested
    at six sigmas, of the stated noise and of the flight's own spread together; causal, from the
    median of those before it, and of the stated noise alone. Nothing is tested where the track
    itself has none.

    Parameters
    ----------
    track : InertialTrack
    antenna : AntennaMotion
    """
    t_s, R_nb = track.t_s, track.R_nb
    gained_n_mps = _inertial(track)
    gravity_mps2 = np.linalg.norm(track.gravity_n_mps2, axis=1)
    track_mps2 = np.hypot(_TRACK_MPS2, gravity_mps2 * track.attitude_sigma_rad)
    gated = () if antenna.phases else antenna.positions
    positions = {series.antenna: series for series in gated}
    velocities = {series.antenna: series for series in antenna.velocities}
    tests: list[tuple[str, str, str, FloatArray]] = []
    for name in dict.fromkeys((*positions, *velocities)):
        position, velocity = positions.get(name), velocities.get(name)
        v_n_mps = gained_n_mps
        if velocity is not None:
            arm_mps = swing_n_mps(R_nb, track.w_b_radps, velocity.arm_b_m)
            sigma_mps = track_mps2 * _AROUND_S
            velocities[name], error, middle = _tested(
                track, velocity, gained_n_mps + arm_mps, sigma_mps
            )
            tests.append(("velocity", "m/s", name, error))
            v_n_mps = gained_n_mps + middle
        elif position is not None:
            v_n_mps = gained_n_mps + _drift(t_s, position, gained_n_mps, causal=track.causal)
        if position is not None:
            moved_n_m = integral(t_s, v_n_mps) + R_nb @ position.arm_b_m
            sigma_m = track_mps2 * _AROUND_S**2 / 2
            positions[name], error, _ = _tested(track, position, moved_n_m, sigma_m)
            tests.append(("position", "m", name, error))
    placed = antenna.positions if antenna.phases else tuple(positions.values())
    return Gated(
        replace(antenna, positions=placed, velocities=tuple(velocities.values())),
        tuple(one for test in tests for one in _listed(t_s, *test)),
        tuple(
            Unused(what=what, reason="off its neighbours", count=int((error > 0).sum()))
            for what, _, _, error in tests
            if error.any()
        ),
    )


def _tested(
    track: InertialTrack, series: VectorSeries, expected: FloatArray, track_sigma: FloatArray
) -> tuple[VectorSeries, FloatArray, FloatArray]:
    """Return a series less what is rejected, the errors of that, (n,), and the medians, (n, 3).

    ``expected``, (n, 3), is by the inertial track, whose sigma is ``track_sigma``, (n,).
    """
    t_s, causal = track.t_s, track.causal
    residual = series.value - expected
    valid = np.isfinite(residual[:, 0])
    middle: FloatArray = np.zeros_like(residual)
    error: FloatArray = np.zeros(len(t_s))
    if valid.any():
        medians = _medians(t_s[valid], residual[valid], causal=causal)
        middle = interpolate(t_s, t_s[valid], medians, causal=causal)
        deviation = residual[valid] - medians
        spread = np.zeros(3) if causal else _NORMAL * np.median(np.abs(deviation), axis=0)
        variance = np.einsum("nii->ni", series.covariance[valid]) + spread**2
        sigma = np.sqrt(variance + track_sigma[valid, None] ** 2)
        out = (np.abs(deviation) > _SIGMAS * sigma).any(axis=1)
        error[valid] = np.where(out, np.linalg.norm(deviation, axis=1), 0.0)
    error *= ~_about(t_s, track.untested, causal=causal)
    return replace(series, value=np.where(error[:, None] > 0, np.nan, series.value)), error, middle


def _about(t_s: FloatArray, marked: BoolArray, *, causal: bool) -> BoolArray:
    """Select the keyframes within a median's reach of a marked one."""
    total = np.concatenate([[0], np.cumsum(marked)])
    first = np.searchsorted(t_s, t_s - _AROUND_S)
    last = np.searchsorted(t_s, t_s + (0.0 if causal else _AROUND_S), side="right")
    return np.asarray(total[last] > total[first])


def _inertial(track: InertialTrack) -> FloatArray:
    """Return the velocity gained since the first keyframe, (n, 3), by the accelerometer."""
    imu, t_s = track.imu, track.t_s
    total = integral(imu.t_s, imu.f_b_mps2)
    if track.causal:  # the last sample goes on until the keyframe
        last = (np.searchsorted(imu.t_s, t_s, side="right") - 1).clip(0)
        at = total[last] + (t_s - imu.t_s[last])[:, None] * imu.f_b_mps2[last]
    else:
        at = interpolate(t_s, imu.t_s, total)
    gained_b = np.diff(at, axis=0)
    between = (track.R_nu[1:] + track.R_nu[:-1]) / 2
    gained = np.einsum("nij,nj->ni", between, gained_b)
    gained += track.gravity_n_mps2[1:] * np.diff(t_s)[:, None]
    return np.vstack([np.zeros(3), np.cumsum(gained, axis=0)])


def _drift(
    t_s: FloatArray, position: VectorSeries, gained_n_mps: FloatArray, *, causal: bool
) -> FloatArray:
    """Return the error of the gained velocity by positions, (n, 3), smoothed by medians."""
    valid = np.flatnonzero(np.isfinite(position.value[:, 0]))
    residual = (position.value - integral(t_s, gained_n_mps))[valid]
    if len(valid) < 2:
        return np.zeros_like(gained_n_mps)
    slopes = np.diff(residual, axis=0) / np.diff(t_s[valid])[:, None]
    middle = _medians(t_s[valid][1:], slopes, causal=causal)
    return interpolate(t_s, t_s[valid][1:], middle, causal=causal)


def _medians(t_s: FloatArray, values: FloatArray, *, causal: bool) -> FloatArray:
    """Return the median of each value and its neighbours, (k, 3), none from beyond a gap.

    Causal: of each and those before it.
    """
    deviation = np.diff(t_s) > _LONGEST_STEP_S
    segment = np.concatenate([[0], np.cumsum(deviation)])
    neighbours = np.arange(-_AROUND, 1 if causal else _AROUND + 1)
    rows = np.arange(len(t_s))[:, None] + neighbours
    inside = rows.clip(0, len(t_s) - 1)
    belongs = (rows == inside) & (segment[inside] == segment[:, None])
    near = np.abs(t_s[inside] - t_s[:, None]) <= _AROUND_S
    belongs &= near | (np.abs(neighbours) <= _LEAST)
    # What does not belong is sorted to the end; numpy's own nanmedian takes three times as long.
    ordered = np.sort(np.where(belongs[..., None], values[inside], np.inf), axis=1)
    count, row = belongs.sum(axis=1), np.arange(len(t_s))
    return np.asarray((ordered[row, (count - 1) // 2] + ordered[row, count // 2]) / 2)


def _listed(
    t_s: FloatArray, what: str, unit: str, antenna: str, error: FloatArray
) -> list[Rejected]:
    """List the rejected values, neighbours as one interval."""
    edges = np.diff(np.concatenate([[False], error > 0, [False]]).astype(np.int8))
    first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return [
        Rejected(
            what=what,
            link=antenna,
            from_s=float(t_s[a]),
            until_s=float(t_s[b]),
            reason=f"{error[a : b + 1].max():.3g} {unit} off its neighbours: left out",
        )
        for a, b in zip(first, last, strict=True)
    ]
