"""The paper's method: the matrix that carries vectors in body axes into the same in local axes."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fgnav.attitude.array import axis_name
from fgnav.attitude.baselines import (
    BodyMotion,
    FixedBaselines,
    body_motion,
    paper_baselines,
    weighted_baselines,
)
from fgnav.attitude.flight_vectors import Track, track_of, with_velocity
from fgnav.attitude.vector_pairs import (
    VectorAttitude,
    VectorPairs,
    collinear,
    paper_matrix,
    sensitivity,
    stacked,
    wahba,
)
from fgnav.checks import BoolArray, FloatArray, IntArray, NoSolutionError, Unused, unused_of
from fgnav.geometry import rotations
from fgnav.integers.resolvers.registry import default_resolver
from fgnav.integers.resolvers.resolve import resolve
from fgnav.messages import note
from fgnav.methods.direction_pairs import Gravity, direction_pairs
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Estimate, open_angle_variance_rad2
from fgnav.types.flight import Flight
from fgnav.types.integers import Integers, Resolver

_BASELINE = "baseline"
# What one vector alone leaves open.
_OPEN_ABOUT = {
    "specific force": "yaw",
    "gravity": "yaw",
    "velocity": "roll",
    "line of sight": "rotation about the line of sight",
}


class _Array(NamedTuple):
    differences: DoubleDifferences
    integers: Integers
    baselines: FixedBaselines


class _Epochs(NamedTuple):
    """All pairs of a flight at its epochs, (n,), those of the array's baselines first."""

    t_s: FloatArray
    pairs: VectorPairs
    array_rows: IntArray  # of the array's own epochs


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm:
    """Attitude of each epoch from unit vectors in two frames (Eqs. 18-32) [1]_.

    The vectors are baselines of the array and of receivers, gravity and the line of sight to the
    landmark, whichever an epoch has, stacked (section 4.5). Gravity is that of an estimator or a
    network where one answers, else the specific force by accelerometer and velocities. A flight
    without baselines that leaves an angle open takes the velocity, too (Eqs. 21-23).

    The covariance is that of the vectors to first order, with integers as right; there is none
    where the velocity takes part, whose sideslip has no stated variance.

    Attributes
    ----------
    resolver : Resolver
        Of the integers.
    weights : {"equal", "covariance"}
        Equal as the paper's (Eq. 20), or one over each vector's variance: Wahba's problem, without
        the velocity.
    gravity : GravityEstimator, "specific force" or None
        Source of gravity directions in body axes; with None there are no such pairs.
    factors : tuple or None
        As of ``Smoother``; networks that measure the direction of gravity are used.
    moves_forward : bool
        Let the velocity stand for the body's x axis. The paper integrates accelerations with a rate
        that nothing measures (Eq. 22); without sideslip and angle of attack this is what it yields.
    name : str

    References
    ----------
    .. [1] Neural Networks for Estimating Attitude, Line of Sight, and GNSS Ambiguity Through
       Onboard Sensor Fusion, Sensors, 2025.
    """

    resolver: Resolver = field(default_factory=default_resolver)
    weights: Literal["equal", "covariance"] = "equal"
    gravity: Gravity = "specific force"
    factors: tuple[Any, ...] | None = None
    moves_forward: bool = True
    name: str = "closed-form"

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate attitude, position and velocity.

        Raises
        ------
        NoSolutionError
            If the flight has neither an array nor other vectors, or no epoch has enough of them.
        """
        array = self._array(flight)
        track = _track(flight, needed=array is None)
        epochs, unused = self._epochs(flight, array, track)
        pairs = epochs.pairs
        attitude = wahba(self._weighted(pairs))
        rank = _rank(array, attitude.rank)
        solve = self._rotations if rank == 2 else lambda some: wahba(self._weighted(some)).R_nb
        R_nb, covariance = solve(pairs), _covariance(solve, epochs, array, attitude)
        nose: BoolArray = (pairs.valid & (_kinds(pairs) == "velocity")).any(axis=1)
        largest_rad2 = np.linalg.eigvalsh(covariance)[:, -1]
        determined = nose | (rank < 2) | (largest_rad2 < open_angle_variance_rad2())
        keep = np.isfinite(R_nb[:, 0, 0]) & (attitude.rank >= max(rank, 1)) & determined
        lost = _lost("no two vectors out of line" if rank == 2 else "no vector", keep)
        used = Counter(_kinds(pairs)[np.nonzero(pairs.valid & keep[:, None])[1]].tolist())
        t_s, R_nb = epochs.t_s[keep], R_nb[keep]
        motion = _motion(flight, track, t_s, keep, R_nb)
        return Estimate(
            method=self.name,
            t_s=t_s,
            n_epochs=_recorded(flight),
            R_nb=R_nb,
            attitude_covariance_rad2=None if nose[keep].any() else covariance[keep],
            p_n_m=motion.p_n_m,
            position_covariance_m2=motion.position_covariance_m2,
            v_n_mps=motion.v_n_mps,
            velocity_covariance_m2ps2=motion.velocity_covariance_m2ps2,
            unobservable=_unobservable(array, used) if rank == 1 else (),
            integers=None if array is None else array.integers,
            unused=(*unused, *lost),
            notes=(*self._notes(used, rank), *motion.notes),
        )

    def _array(self, flight: Flight) -> _Array | None:
        if flight.observations is None or len(flight.antennas) < 2:
            return None
        differences, integers = resolve(flight, self.resolver)
        solve = paper_baselines if self.weights == "equal" else weighted_baselines
        return _Array(differences, integers, solve(differences, integers))

    def _epochs(
        self, flight: Flight, array: _Array | None, track: Track | None
    ) -> tuple[_Epochs, tuple[Unused, ...]]:
        """Collect the vectors of array and instruments in both frames, and unused measurements."""
        parts, times, unused = [], [], []
        if array is not None:
            differences, integers, baselines = array
            names = tuple(antenna.name for antenna in flight.antennas[1:])
            parts.append(baselines.pairs(differences.baselines_b_m, names))
            times.append(differences.t_s)
            unused += [*differences.unused, *integers.unused]
        if track is not None:
            pairs, lost = direction_pairs(flight, track, self.gravity, self.factors)
            if array is None and self.moves_forward and self.weights == "equal":
                pairs = with_velocity(pairs, track)
            parts.append(pairs)
            times.append(track.t_s)
            unused += lost
        t_s = np.unique(np.concatenate(times))
        rows = [np.searchsorted(t_s, part_s) for part_s in times]
        pairs = stacked(
            [block.scatter(at, len(t_s)) for block, at in zip(parts, rows, strict=True)]
        )
        return _Epochs(t_s, pairs, rows[0]), tuple(unused)

    def _weighted(self, pairs: VectorPairs) -> VectorPairs:
        return pairs if self.weights == "covariance" else pairs.directions()

    def _rotations(self, pairs: VectorPairs) -> FloatArray:
        """Return rotations of epochs, (n, 3, 3), NaN where there is none."""
        if self.weights == "covariance":
            return wahba(pairs).R_nb
        return rotations.from_euler(*rotations.to_euler(paper_matrix(pairs)).T)

    def _notes(self, used: Mapping[str, int], rank: int) -> list[str]:
        pairs = ", ".join(f"{count} of {kind}" for kind, count in used.items())
        notes: list[str] = [note("I501", pairs=pairs)]
        if rank == 2 and self.weights == "equal":
            notes.append(note("I502"))
        if count := used.get("velocity", 0):
            notes.append(note("W503", count=count))
        return notes


def weighted(**settings: Any) -> ClosedForm:  # noqa: ANN401  # those of ClosedForm
    """Return the closed form with each vector weighted by its variance."""
    return ClosedForm(weights="covariance", name="closed-form-weighted", **settings)


def _track(flight: Flight, *, needed: bool) -> Track | None:
    """Return the track that directions need; None where an array does without."""
    try:
        return track_of(flight)
    except NoSolutionError:
        if needed:
            raise
        return None


def _rank(array: _Array | None, ranks: IntArray) -> int:
    """Return 2 where epochs determine the attitude, 1 where an axis is left open.

    An array on a line leaves it open where other vectors join it at few epochs only.
    """
    if array is not None and collinear(array.differences.baselines_b_m):
        return 2 if (ranks >= 2).sum() >= (ranks == 1).sum() else 1
    return min(2, int(ranks.max(initial=0)))


def _covariance(
    solve: Callable[[VectorPairs], FloatArray],
    epochs: _Epochs,
    array: _Array | None,
    attitude: VectorAttitude,
) -> FloatArray:
    """Return the covariance of attitudes, (n, 3, 3), from the noise of all pairs, first order."""
    pairs = epochs.pairs
    S = sensitivity(solve, pairs)
    variance = np.where(pairs.valid, 1 / np.where(pairs.valid, pairs.weight, 1.0), 0.0)
    if array is not None:  # baselines share antennas: theirs is counted link by link
        variance[:, _kinds(pairs) == _BASELINE] = 0.0
    covariance = np.einsum("nk,nkia,nkja->nij", variance, S, S)
    if array is not None:
        rows, count = epochs.array_rows, len(array.differences.baselines_b_m)
        covariance[rows] += array.baselines.attitude_covariance_rad2(S[rows, :count])
    return attitude.with_open_axis(covariance)


def _kinds(pairs: VectorPairs) -> NDArray[np.str_]:
    """Return the kind of each pair, (k,): its source, of baselines without the antenna."""
    return np.array([_BASELINE if s.startswith(_BASELINE) else s for s in pairs.sources], dtype=str)


def _recorded(flight: Flight) -> int:
    """Return the number of epochs of raw data, or else of fixes."""
    records = (flight.observations, flight.first_fixes)
    return next(len(record.t_s) for record in records if record is not None)


def _motion(
    flight: Flight, track: Track | None, t_s: FloatArray, keep: BoolArray, R_nb: FloatArray
) -> BodyMotion:
    """Return the body's motion by code, or by the fixes of one antenna at some of their epochs."""
    if track is None or flight.observations is not None:
        return body_motion(flight, t_s, R_nb)
    v_n_mps = None if track.v_n_mps is None else track.v_n_mps[keep]
    has_arm_velocity = v_n_mps is not None and track.arm_b_m.any()
    return BodyMotion(
        p_n_m=track.p_n_m[keep] - R_nb @ track.arm_b_m,
        v_n_mps=v_n_mps,
        notes=(note("W504", antenna="the antenna"),) if has_arm_velocity else (),
    )


def _unobservable(array: _Array | None, used: Mapping[str, int]) -> tuple[str, ...]:
    """Return the names of what vectors on one line leave open."""
    if array is not None and _BASELINE in used:
        return (axis_name(array.differences.baselines_b_m),)
    return tuple(_OPEN_ABOUT.get(kind, f"rotation about the {kind}") for kind in used)


def _lost(reason: str, keep: BoolArray) -> tuple[Unused, ...]:
    """Return the loss of epochs that are not kept; raise if none is."""
    if not keep.any():
        raise NoSolutionError(f"attitude: {reason} at any of {len(keep)} epochs")
    return unused_of({("epoch", reason): int((~keep).sum())})
