"""Attitudes of single epochs of a flight without an array: vectors known in two frames."""

from dataclasses import replace

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.gaps import time_from_attitude_s
from fgnav.alignment.matching import nearest
from fgnav.attitude.flight_vectors import Track, measured_vectors, track_of, with_velocity
from fgnav.attitude.imu_rotation import imu_rotation
from fgnav.attitude.vector_pairs import VectorPairs, wahba
from fgnav.checks import BoolArray, FloatArray, Unused
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotations import exp, log, skew, transpose
from fgnav.gravity import GravityDirection
from fgnav.messages import note
from fgnav.types.flight import Flight
from fgnav.types.vehicle import FinnedVehicle

# Of attitudes that assume a velocity along x_b, and hold for two epochs, where rates are derived
# from them.
VECTOR_SIGMA_RAD = 0.1
# Of the specific force by velocities: 0.2 to 0.35 m/s2 of 15.
_FORCE_SIGMA_RAD = 0.02
_MIN_SINE = np.sin(np.radians(15.0))  # of gravity and specific force: the turn about either
_MINIMUM = 5  # attitudes for a rate
# And how close: of six turns with gravity every 5.8 s, three ended at a wrong minimum when
# these attitudes alone started the search, none when all epochs assumed velocity.
_NEAR_S = 0.5


def vector_attitudes(flight: Flight, gravity: GravityDirection | None) -> Alignment:
    """Return attitudes by specific force and gravity or, failing that, what else there is.

    Specific force and gravity are two vectors wherever the body accelerates across gravity; they
    determine the attitude without any assumption. Where few epochs are near one with both, line of
    sight closes the angle that specific force leaves open, or else the velocity as x_b, turned as
    those few have it.

    Raises
    ------
    NoSolutionError
        If the flight has no track.
    """
    track = track_of(flight)
    rotation = None if flight.imu is None else imu_rotation(flight.imu)
    pairs, unused = measured_vectors(flight, track, rotation)
    few = None
    if gravity is not None and "specific force" in pairs.sources:
        few = _by_gravity(flight.origin, track, pairs, gravity)
        if few is not None and _dense(few):
            return replace(few, unused=unused, rotation=rotation)
    assumed = with_velocity(pairs, track)
    start = wahba_alignment(track.t_s, assumed, unused)
    if few is not None:
        f_n = assumed.directions().v_n[:, pairs.sources.index("specific force")]
        determined = start.valid & np.isfinite(f_n[:, 0])
        start = replace(start, R_nb=_rotated_as(start.R_nb, determined, np.nan_to_num(f_n), few))
    if isinstance(flight.vehicle, FinnedVehicle):
        return replace(start, rough=False, rotation=rotation)
    # What is assumed is noted where no gyroscope carries attitudes from epoch to epoch: between
    # minima of the smoother's cost a turn apart the data hardly decide; on flights of a body that
    # swings by 20 degrees about all axes their costs were within one percent.
    carries = flight.imu is not None and flight.imu.w_b_radps is not None
    takes_part = assumed.valid[:, [name == "velocity" for name in assumed.sources]].any()
    notes = (note("W202"),) if takes_part and not carries else ()
    return replace(start, notes=notes, rotation=rotation)


def wahba_alignment(t_s: FloatArray, pairs: VectorPairs, unused: tuple[Unused, ...]) -> Alignment:
    """Return attitudes of epochs, (n,), from their vector pairs, of a nominal covariance."""
    attitude = wahba(pairs.directions())
    determined = attitude.rank == 2
    return Alignment(
        t_s=t_s,
        R_nb=np.where(determined[:, None, None], attitude.R_nb, np.eye(3)),
        covariance_rad2=np.tile(VECTOR_SIGMA_RAD**2 * np.eye(3), (len(t_s), 1, 1)),
        valid=determined,
        refused=np.zeros(len(t_s), dtype=np.bool_),
        unused=unused,
        rough=True,
    )


def _dense(attitudes: Alignment) -> bool:
    """Return True if most epochs are close to one with an attitude."""
    valid = attitudes.valid
    away_s = time_from_attitude_s(attitudes.t_s, valid)
    return bool(valid.sum() >= _MINIMUM and (away_s > _NEAR_S).mean() <= 0.5)


def _rotated_as(
    R_nb: FloatArray, determined: BoolArray, f_n: FloatArray, few: Alignment
) -> FloatArray:
    """Return attitudes turned about the specific force, (n, 3), by what a few epochs ask for.

    A body that is not nose first is off by the turn about it alone, and that goes along slowly.
    """
    rows = np.flatnonzero(determined & few.valid)
    if not len(rows):
        return R_nb
    rotation = log(few.R_nb[rows] @ transpose(R_nb[rows]))
    turn = np.unwrap(np.einsum("ni,ni->n", rotation, f_n[rows]))
    between = np.interp(few.t_s, few.t_s[rows], turn)
    return np.asarray(np.where(determined[:, None, None], exp(between[:, None] * f_n) @ R_nb, R_nb))


def _by_gravity(
    origin: Origin, track: Track, pairs: VectorPairs, gravity: GravityDirection
) -> Alignment | None:
    """Return attitudes by gravity and specific force; None where few epochs have any."""
    row, at_epoch = nearest(gravity.t_s, track.t_s) if len(gravity.t_s) else (None, None)
    if row is None or at_epoch is None:
        return None
    down_n = origin.gravity_n_mps2(track.p_n_m)
    force = pairs.sources.index("specific force")
    both = VectorPairs(
        v_n=np.stack([pairs.v_n[:, force], down_n], axis=1),
        v_b=np.stack([pairs.v_b[:, force], gravity.g_b[row]], axis=1),
        weight=np.ones((len(track.t_s), 2)),
        sources=("specific force", "gravity"),
    ).directions()
    across = np.linalg.norm(np.cross(both.v_n[:, 0], both.v_n[:, 1]), axis=1)
    valid = at_epoch & both.valid.all(axis=1) & (across > _MIN_SINE)
    if not valid.any():
        return None
    variance = np.stack(
        [np.full(len(row), _FORCE_SIGMA_RAD**2), np.einsum("nii->n", gravity.covariance)[row] / 2],
        axis=1,
    )
    both = replace(both, weight=both.weight / variance)
    R_nb = wahba(both).R_nb
    v_b = np.einsum("nji,nkj->nki", R_nb, np.nan_to_num(both.v_n))
    across_b = skew(v_b.reshape(-1, 3)).reshape(*v_b.shape, 3)
    information = np.einsum("nkji,nkjl,nk->nil", across_b, across_b, both.weight)
    information[~valid] = np.eye(3)
    return Alignment(
        t_s=track.t_s,
        R_nb=np.where(valid[:, None, None], R_nb, np.eye(3)),
        covariance_rad2=np.linalg.inv(information),
        valid=valid,
        refused=np.zeros(len(valid), dtype=np.bool_),
    )
