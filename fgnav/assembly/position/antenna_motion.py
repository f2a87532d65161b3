"""Motion of antennas at keyframes, by phase, code and Doppler, or by a receiver's fixes."""

from dataclasses import dataclass, replace
from functools import partial, reduce

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.matching import nearest, unmatched
from fgnav.assembly.position.by_observations import AntennaRecord, ByObservations
from fgnav.assembly.position.numbered_arcs import Observed
from fgnav.assembly.position.series import VectorSeries
from fgnav.checks import BoolArray, FloatArray, IntArray, Unused
from fgnav.gnss.single_point.partial_velocity import PartialVelocity
from fgnav.types.flight import Flight, Imu


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class AntennaMotion:
    """Positions and velocities of antennas at keyframes."""

    positions: tuple[VectorSeries, ...]  # by fixes; else by code, where a search starts
    velocities: tuple[VectorSeries, ...]  # of raw observations no two at one keyframe
    phases: tuple[Observed, ...] = ()  # empty of fixes
    unused: tuple[Unused, ...] = ()

    @property
    def position(self) -> VectorSeries | None:
        """Position of the first antenna, where a search starts."""
        return self.positions[0] if self.positions else None


def antenna_motion(
    flight: Flight, imu: Imu, start: Alignment, by: ByObservations | None
) -> AntennaMotion:
    """Return motion by phase, code and Doppler, or else by the receiver's fixes, at keyframes.

    Where the first antenna tracks fewer than four satellites another one that does takes its place.

    Parameters
    ----------
    flight : Flight
    imu : Imu
    start : Alignment
        Attitudes at keyframes.
    by : ByObservations or None
        None of a flight without observations.

    Raises
    ------
    NoSolutionError
        If no antenna has a single code solution.
    """
    if by is None:
        return _of_fixes(flight, imu, start.t_s)
    first, *others = (_of_record(antenna, imu, start) for antenna in by.antennas)
    motion = reduce(partial(_completed_by, start=start), others, first)
    count = sum(len(fixes.t_s) for fixes in flight.fixes)
    instead = (Unused(what="fix", reason="raw observations are used instead", count=count),)
    return replace(motion, unused=motion.unused + (instead if count else ()))


def _of_record(record: AntennaRecord, imu: Imu, start: Alignment) -> AntennaMotion:
    antenna, code, directions, of = record
    arm_b_m = antenna.position_b_m - imu.position_b_m
    at = nearest(code.t_s, start.t_s)
    epoch, same = nearest(of.t_s, start.t_s)
    velocities: tuple[VectorSeries, ...] = ()
    P = code.velocity_covariance_m2ps2
    if directions is not None and code.v_n_mps is not None and P is not None:
        velocity = _timed(code.v_n_mps, P, at, arm_b_m, antenna.name)
        velocities = (_with_partial(velocity, directions, start.t_s),)
    return AntennaMotion(
        positions=(_timed(code.p_n_m, code.position_noise_m2, at, arm_b_m, antenna.name),),
        velocities=velocities,
        phases=(Observed(of, np.flatnonzero(same), epoch[same], arm_b_m, antenna.name),),
        unused=(*code.unused, *of.unused, *unmatched("code solution", len(code.t_s), at[1])),
    )


def _with_partial(velocity: VectorSeries, part: PartialVelocity, t_s: FloatArray) -> VectorSeries:
    """Take in directions of velocity at keyframes with too few satellites for a position."""
    if not len(part.t_s):
        return velocity
    at, same = nearest(part.t_s, t_s)
    same &= ~velocity.valid
    value, root = velocity.value.copy(), np.zeros((len(t_s), 3, 3))
    value[same], root[same] = part.v_n_mps[at[same]], part.root[at[same]]
    return replace(velocity, value=value, partial=root)


def _of_fixes(flight: Flight, imu: Imu, t_s: FloatArray) -> AntennaMotion:
    """Return motion by the receivers' fixes at keyframes."""
    positions, velocities = [], []
    unused: list[Unused] = []
    for fixes in flight.fixes:
        name, at = fixes.antenna, nearest(fixes.t_s, t_s)
        arm_b_m = flight.antenna(name).position_b_m - imu.position_b_m
        noise = _diagonal(fixes.position_sigma_m)
        positions.append(_timed(fixes.p_n_m, noise, at, arm_b_m, name))
        if fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
            noise = _diagonal(fixes.velocity_sigma_mps)
            velocities.append(_timed(fixes.v_n_mps, noise, at, arm_b_m, name))
        unused += unmatched("fix", len(fixes.t_s), at[1])
    return AntennaMotion(
        positions=tuple(positions), velocities=tuple(velocities), unused=tuple(unused)
    )


def _completed_by(first: AntennaMotion, other: AntennaMotion, start: Alignment) -> AntennaMotion:
    """Take what is missing from another antenna's motion."""
    positions, position, theirs = first.positions, first.position, other.position
    if position is not None and theirs is not None:
        lever_n_m = start.R_nb @ (position.arm_b_m - theirs.arm_b_m)
        missing = ~position.valid[:, None]
        value = np.where(missing, theirs.value + lever_n_m, position.value)
        positions = (replace(position, value=value),)
    none = np.zeros(len(start.t_s), dtype=np.bool_)
    has_velocity = np.any([none, *(series.valid for series in first.velocities)], axis=0)
    velocities = [
        replace(series, value=np.where(has_velocity[:, None], np.nan, series.value))
        for series in other.velocities
    ]
    return replace(
        first,
        positions=positions,
        velocities=(*first.velocities, *velocities),
        phases=(*first.phases, *other.phases),
        unused=(*first.unused, *other.unused),
    )


def _timed(
    value: FloatArray,
    covariance: FloatArray,
    at: tuple[IntArray, BoolArray],
    arm_b_m: FloatArray,
    antenna: str,
) -> VectorSeries:
    """Return values at keyframes: the row of each, and whether it is of the same time."""
    row, matched = at
    value = np.where(matched[:, None], value[row], np.nan)
    return VectorSeries(value=value, covariance=covariance[row], arm_b_m=arm_b_m, antenna=antenna)


def _diagonal(sigma: FloatArray) -> FloatArray:
    return np.asarray(sigma[:, :, None] ** 2 * np.eye(3))
