"""How an antenna moved, at keyframes: by code and Doppler, or by the receiver's own fixes."""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError
from fgnav.estimate import open_angle_variance_rad2
from fgnav.flight import Fixes, Flight, Imu
from fgnav.frontend.array.pivot import pivot_views
from fgnav.frontend.attitude.alignment import Alignment
from fgnav.frontend.attitude.rates import swing_n_mps
from fgnav.frontend.matching import nearest, unused
from fgnav.frontend.position.phase_positions import Attitudes, positions
from fgnav.frontend.position.rank_deficient import RankDeficient, rank_deficient_of
from fgnav.frontend.position.series import VectorSeries
from fgnav.gnss.code_solution import code_solution
from fgnav.rotations import skew, transpose


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AntennaMotion:
    """Position of an antenna and velocity at keyframes.

    Attributes
    ----------
    name : str
        Of the antenna.
    position : VectorSeries or None
    velocity : VectorSeries or None
        Both covariances are the noise that is new at each keyframe.
    arcs_m2 : ndarray, shape (n, 3, 3)
        Variance that positions of a segment have in common, see ``VectorSeries.segment``.
    common_m2 : ndarray, shape (n, 3, 3)
        Variance of positions that is common to all keyframes: no smoothing reduces it.
    drift_m2ps2 : ndarray, shape (n, 3, 3)
        Variance of the velocity at which such errors move as the sky turns.
    losses : tuple of Loss
    notes : tuple of str
    few : RankDeficient or None
        Directions known at keyframes without a position of the reference antenna.
    """

    name: str
    position: VectorSeries | None
    velocity: VectorSeries | None
    arcs_m2: FloatArray
    common_m2: FloatArray
    drift_m2ps2: FloatArray
    losses: tuple[Loss, ...]
    notes: tuple[str, ...] = ()
    few: RankDeficient | None = None


def antenna_motion(
    flight: Flight, imu: Imu, start: Alignment, w_b_radps: FloatArray
) -> AntennaMotion:
    """Return what code and Doppler, or else the receiver's own fixes, say at keyframes.

    Where the reference antenna has no solution, that of one which stands in for it is moved there
    by the attitudes of single epochs, and their doubt with it.

    Parameters
    ----------
    flight : Flight
    imu : Imu
    start : Alignment
        Attitudes at keyframes.
    w_b_radps : ndarray, shape (n, 3)
        Approximate rates: velocities of an antenna that stands in for another are moved by them.

    Raises
    ------
    NoSolutionError
        If no antenna has a single code solution.
    """
    if flight.observations is None:
        return motion_of_fixes(flight, imu, start.t_s)
    found: list[AntennaMotion] = []
    failure = None
    for view in pivot_views(flight):
        try:
            found.append(_of_code(view.flight, imu, start))
        except NoSolutionError as error:
            failure = failure or error
    if not found:
        raise failure or NoSolutionError("position: no antenna has observations")
    whole = found[0]
    for other in found[1:]:
        whole = completed_by(whole, other, start, w_b_radps)
    return whole


def _of_code(flight: Flight, imu: Imu, start: Alignment) -> AntennaMotion:
    code, antenna = code_solution(flight), flight.antennas[0]
    arm_b_m = antenna.position_b_m - imu.position_b_m
    row, found = nearest(code.t_s, start.t_s)
    best = positions(flight, code, Attitudes(t_s=start.t_s, R_nb=start.R_nb))
    few = rank_deficient_of(flight, code, best.adjustment, start.t_s)
    drift_per_s = code.drift_per_s[row]
    drift_m2ps2 = drift_per_s @ best.drifting_m2[row] @ transpose(drift_per_s)
    if best.unsure_n_m.any():
        drift_n_mps = np.gradient(best.unsure_n_m, code.t_s, axis=0)[row]
        drift_m2ps2 += drift_n_mps[:, :, None] * drift_n_mps[:, None, :]
    return AntennaMotion(
        name=antenna.name,
        position=replace(
            _timed(best.p_n_m, best.noise_m2, row, found, arm_b_m), segment=best.segment[row]
        ),
        velocity=_velocity(code.v_n_mps, code.velocity_covariance_m2ps2, row, found, arm_b_m),
        arcs_m2=best.arcs_m2[row],
        common_m2=best.common_m2[row]
        + best.unsure_n_m[row, :, None] * best.unsure_n_m[row, None, :],
        drift_m2ps2=drift_m2ps2,
        losses=(
            *code.losses,
            *best.losses,
            *(() if few is None else few.losses),
            *unused("code solution", len(code.t_s), found),
        ),
        notes=best.notes,
        few=few,
    )


def motion_of_fixes(flight: Flight, imu: Imu, t_s: FloatArray) -> AntennaMotion:
    """Return what the receiver's own fixes say at keyframes."""
    none, fixes = np.zeros((len(t_s), 3, 3)), flight.fixes
    if fixes is None:
        return AntennaMotion(
            name="",
            position=None,
            velocity=None,
            arcs_m2=none,
            common_m2=none,
            drift_m2ps2=none,
            losses=(),
        )
    arm_b_m = flight.antenna(fixes.antenna).position_b_m - imu.position_b_m
    row, found = nearest(fixes.t_s, t_s)
    return AntennaMotion(
        name=fixes.antenna,
        position=_timed(fixes.p_n_m, _diagonal(fixes.position_sigma_m), row, found, arm_b_m),
        velocity=_velocity(fixes.v_n_mps, _velocity_covariance(fixes), row, found, arm_b_m),
        arcs_m2=none,
        common_m2=none,
        drift_m2ps2=none,
        losses=unused("fix", len(fixes.t_s), found),
    )


def completed_by(
    whole: AntennaMotion, other: AntennaMotion, start: Alignment, w_b_radps: FloatArray
) -> AntennaMotion:
    """Take what is missing from another antenna's motion."""
    position = whole.position
    if position is None or other.position is None:
        return whole
    lever_b_m = position.arm_b_m - other.position.arm_b_m
    lever_n_m = start.R_nb @ lever_b_m
    known = start.valid[:, None, None]
    doubt_rad2 = np.where(known, start.covariance_rad2, open_angle_variance_rad2() * np.eye(3))
    turn = start.R_nb @ skew(lever_b_m[None])
    moved = replace(
        other.position,
        value=other.position.value + lever_n_m,
        covariance=other.position.covariance + turn @ doubt_rad2 @ transpose(turn),
        segment=_numbered_on(position, other.position),
    )
    missing = np.isnan(position.value[:, 0]) & np.isfinite(moved.value[:, 0])
    velocity = whole.velocity or other.velocity
    if whole.velocity is not None and other.velocity is not None:
        swing = swing_n_mps(start.R_nb, w_b_radps, whole.velocity.arm_b_m - other.velocity.arm_b_m)
        there = replace(other.velocity, value=other.velocity.value + swing)
        velocity = _with(whole.velocity, there, ~whole.velocity.valid)
    return replace(
        whole,
        position=_with(position, moved, missing),
        velocity=velocity,
        arcs_m2=np.where(missing[:, None, None], other.arcs_m2, whole.arcs_m2),
        common_m2=np.where(missing[:, None, None], other.common_m2, whole.common_m2),
        drift_m2ps2=np.where(missing[:, None, None], other.drift_m2ps2, whole.drift_m2ps2),
        losses=(*whole.losses, *other.losses),
        notes=tuple(dict.fromkeys((*whole.notes, *other.notes))),
    )


def _numbered_on(timed: VectorSeries, other: VectorSeries) -> IntArray | None:
    """Return the other's stretches, numbered on from one's own: no arc is common to both."""
    if timed.segment is None or other.segment is None:
        return other.segment
    return np.where(other.segment >= 0, other.segment + timed.segment.max() + 1, -1)


def _with(timed: VectorSeries, other: VectorSeries, missing: BoolArray) -> VectorSeries:
    segment = timed.segment
    if segment is not None and other.segment is not None:
        segment = np.where(missing, other.segment, segment)
    return replace(
        timed,
        value=np.where(missing[:, None], other.value, timed.value),
        covariance=np.where(missing[:, None, None], other.covariance, timed.covariance),
        segment=segment,
    )


def _velocity(
    v_n_mps: FloatArray | None,
    covariance: FloatArray | None,
    row: IntArray,
    found: BoolArray,
    arm_b_m: FloatArray,
) -> VectorSeries | None:
    if v_n_mps is None or covariance is None:
        return None
    return _timed(v_n_mps, covariance, row, found, arm_b_m)


def _timed(
    value: FloatArray, covariance: FloatArray, row: IntArray, found: BoolArray, arm_b_m: FloatArray
) -> VectorSeries:
    value = np.where(found[:, None], value[row], np.nan)
    return VectorSeries(value=value, covariance=covariance[row], arm_b_m=arm_b_m)


def _diagonal(sigma: FloatArray) -> FloatArray:
    return np.asarray(sigma[:, :, None] ** 2 * np.eye(3))


def _velocity_covariance(fixes: Fixes) -> FloatArray | None:
    return None if fixes.velocity_sigma_mps is None else _diagonal(fixes.velocity_sigma_mps)
