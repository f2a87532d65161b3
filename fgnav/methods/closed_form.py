"""The paper's method: the matrix that carries vectors in body axes into the same in local axes."""

from dataclasses import dataclass, field

import numpy as np

from fgnav import rotations
from fgnav.attitude.array import axis_name
from fgnav.attitude.baselines import body_motion, paper_baselines
from fgnav.attitude.vector_pairs import (
    VectorPairs,
    collinear,
    paper_matrix,
    paper_rotation,
    wahba,
)
from fgnav.checks import BoolArray, FloatArray, Loss, NoSolutionError
from fgnav.estimate import Estimate
from fgnav.flight import Flight
from fgnav.gnss.code_solution import code_solution
from fgnav.gravity import specific_force_pair
from fgnav.integers.lambda_ import Lambda
from fgnav.integers.resolve import resolve
from fgnav.integers.resolver import Resolver
from fgnav.seeker import line_of_sight, to_landmark_b_m

_CROWDED = np.cos(np.radians(30))  # of the angle that velocity keeps from the other vectors
_SLOW_MPS = 2.0  # below, GNSS noise and wind turn the direction of travel by too much
# What one vector alone leaves open.
_OPEN_ABOUT = {
    "specific force": "yaw",
    "velocity": "roll",
    "line of sight": "rotation about the line of sight",
}
_SEEN_TOGETHER = 2.5  # sample intervals over which the line of sight is interpolated


@dataclass(frozen=True, slots=True, kw_only=True)
class ClosedForm:
    """Attitude of each epoch from unit vectors in two frames (Eqs. 18-32) [1]_.

    The vectors are the antenna array's baselines. A flight without an array is left with specific
    force, the line of sight to the landmark, and, where those two leave an angle open, the velocity
    (Eqs. 21-23). No covariance: the paper states none.

    Attributes
    ----------
    resolver : Resolver
        Of the integers.
    orthogonalise : bool
        Take the rotation nearest to the paper's matrix; the paper itself reads the angles from the
        matrix as it is. Neither is better on all angles.
    moves_forward : bool
        Let the velocity stand for the body's x axis. The paper integrates accelerations with a rate
        that nothing measures (Eq. 22); without sideslip and angle of attack this is what it yields.
    name : str

    References
    ----------
    .. [1] Neural Networks for Estimating Attitude, Line of Sight, and GNSS Ambiguity Through
       Onboard Sensor Fusion, Sensors, 2025.
    """

    resolver: Resolver = field(default_factory=Lambda)
    orthogonalise: bool = False
    moves_forward: bool = True
    name: str = "closed-form"

    def __call__(self, flight: Flight) -> Estimate:
        """Estimate attitude, position and velocity.

        Raises
        ------
        NoSolutionError
            If the flight has neither an array nor other vectors, or no epoch has enough of them.
        """
        if flight.observations is not None and len(flight.antennas) > 1:
            return self._from_array(flight, len(flight.observations.t_s))
        return self._from_vectors(flight)

    def _from_array(self, flight: Flight, epochs: int) -> Estimate:
        differences, integers = resolve(flight, self.resolver)
        names = tuple(antenna.name for antenna in flight.antennas[1:])
        baselines = paper_baselines(differences, integers)
        pairs = baselines.pairs(differences.baselines_b_m, names)
        line = collinear(differences.baselines_b_m)
        R_nb = wahba(pairs.directions()).R_nb if line else self._rotations(pairs)
        keep = np.isfinite(R_nb[:, 0, 0])
        few = "no baseline is fixed" if line else "no two baselines out of line are fixed"
        lost = self._lost(few, keep)
        t_s, R_nb = differences.t_s[keep], R_nb[keep]
        motion = body_motion(flight, t_s, R_nb)
        return Estimate(
            method=self.name,
            t_s=t_s,
            epochs=epochs,
            R_nb=R_nb,
            p_n_m=motion.p_n_m,
            v_n_mps=motion.v_n_mps,
            unobservable=(axis_name(differences.baselines_b_m[0]),) if line else (),
            integers=integers,
            losses=(*differences.losses, *integers.losses, *lost),
            notes=(*([] if line else [self._reading()]), *motion.notes),
        )

    def _from_vectors(self, flight: Flight) -> Estimate:
        track = _track(flight)
        pairs, losses = _measured(flight, track)
        if self.moves_forward:
            pairs = _with_velocity(pairs, track)
        attitude = wahba(pairs.directions())
        rank = min(2, int(attitude.rank.max(initial=0)))
        R_nb = self._rotations(pairs) if rank == 2 else attitude.R_nb
        keep = np.isfinite(R_nb[:, 0, 0]) & (attitude.rank == rank)
        lost = self._lost("no two vectors out of line" if rank == 2 else "no vector", keep)
        used = (pairs.valid & keep[:, None]).any(axis=0)
        sources = [source for source, has in zip(pairs.sources, used, strict=True) if has]
        swing = "Velocity is that of the antenna: its swing about the body is unknown."
        v_n_mps = None if track.v_n_mps is None else track.v_n_mps[keep]
        has_velocity = v_n_mps is not None and bool(np.isfinite(v_n_mps).all())
        notes = [f"Vectors: {', '.join(sources)}."]
        notes += [self._reading()] if rank == 2 else []
        if "velocity" in sources:
            count = int((pairs.valid[:, -1] & keep).sum())
            notes += [
                f"Velocity stands for x_b at {count} epochs: no sideslip, no angle of attack."
            ]
        notes += [swing] if has_velocity and track.arm_b_m.any() else []
        return Estimate(
            method=self.name,
            t_s=track.t_s[keep],
            epochs=track.epochs,
            R_nb=R_nb[keep],
            p_n_m=track.p_n_m[keep] - R_nb[keep] @ track.arm_b_m,
            v_n_mps=v_n_mps if has_velocity else None,
            unobservable=tuple(_OPEN_ABOUT[s] for s in sources) if rank == 1 else (),
            losses=(*losses, *lost),
            notes=tuple(notes),
        )

    def _rotations(self, pairs: VectorPairs) -> FloatArray:
        """Return rotations of the paper's matrices, (n, 3, 3), NaN where there is none."""
        if self.orthogonalise:
            return paper_rotation(pairs)
        return rotations.from_euler(*rotations.to_euler(paper_matrix(pairs)).T)

    def _reading(self) -> str:
        if self.orthogonalise:
            return "Attitude is the rotation nearest to the paper's matrix."
        return "Angles are read from the paper's matrix, which is not quite a rotation."

    def _lost(self, reason: str, keep: BoolArray) -> tuple[Loss, ...]:
        """Return the loss of epochs that are not kept; raise if none is."""
        count = int((~keep).sum())
        if not keep.any():
            raise NoSolutionError(f"attitude: {reason} at any of {count} epochs")
        return (Loss(what="epoch", reason=reason, count=count),) if count else ()


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class _Track:
    """Where one antenna at ``arm_b_m`` was and how it moved, (k, 3); velocity NaN where unknown."""

    t_s: FloatArray
    epochs: int
    p_n_m: FloatArray
    v_n_mps: FloatArray | None
    arm_b_m: FloatArray


def _track(flight: Flight) -> _Track:
    """Return the track by the receiver's fixes, else by code.

    Raises
    ------
    NoSolutionError
        If the flight has neither.
    """
    if flight.fixes is not None:
        return _Track(
            t_s=flight.fixes.t_s,
            epochs=len(flight.fixes.t_s),
            p_n_m=flight.fixes.p_n_m,
            v_n_mps=flight.fixes.v_n_mps,
            arm_b_m=flight.antenna(flight.fixes.antenna).position_b_m,
        )
    if flight.observations is None:
        raise NoSolutionError(
            f"attitude: flight {flight.name} has no antenna array, no raw data, no fixes"
        )
    code = code_solution(flight)
    return _Track(
        t_s=code.t_s,
        epochs=len(flight.observations.t_s),
        p_n_m=code.p_n_m,
        v_n_mps=code.v_n_mps,
        arm_b_m=flight.antennas[0].position_b_m,
    )


def _measured(flight: Flight, track: _Track) -> tuple[VectorPairs, tuple[Loss, ...]]:
    """Return the pairs that instruments give in both frames: specific force, line of sight."""
    v_n: list[FloatArray] = []
    v_b: list[FloatArray] = []
    sources: list[str] = []
    losses: tuple[Loss, ...] = ()
    if flight.imu is not None and track.v_n_mps is not None:
        f_n, f_b = specific_force_pair(
            flight.imu, flight.origin, track.t_s, track.p_n_m, track.v_n_mps
        )
        v_n, v_b, sources = [*v_n, f_n], [*v_b, f_b], [*sources, "specific force"]
    if flight.seeker is not None:
        sight = line_of_sight(flight.seeker)
        losses = sight.losses
        to_n_m = flight.seeker.landmark_n_m - track.p_n_m
        distance_m = np.linalg.norm(to_n_m, axis=1)
        e_b = _interpolated(sight.t_s, sight.e_b, track.t_s)
        v_n.append(to_n_m)
        v_b.append(to_landmark_b_m(flight.seeker, e_b, track.arm_b_m, distance_m))
        sources.append("line of sight")
    n, k = len(track.t_s), len(sources)
    pairs = VectorPairs(
        v_n=np.stack(v_n, axis=1) if k else np.zeros((n, 0, 3)),
        v_b=np.stack(v_b, axis=1) if k else np.zeros((n, 0, 3)),
        weight=np.ones((n, k)),
        sources=tuple(sources),
    )
    return pairs, losses


def _with_velocity(pairs: VectorPairs, track: _Track) -> VectorPairs:
    """Add the velocity as the body's x axis at epochs whose other vectors leave an angle open.

    Not beside a vector of nearly its own direction: the line of sight of a body that flies to the
    landmark says the same as the velocity, and a few degrees of sideslip would roll it by tens.
    """
    if track.v_n_mps is None:
        return pairs
    speed_mps = np.linalg.norm(track.v_n_mps, axis=1)
    others = pairs.directions()
    forward_n = track.v_n_mps / np.where(speed_mps > 0, speed_mps, 1.0)[:, None]
    cosine = np.abs(np.einsum("nki,ni->nk", others.v_n, forward_n))
    crowded = np.nan_to_num(cosine).max(axis=1, initial=0.0) > _CROWDED
    wanted = (wahba(others).rank < 2) & ~crowded & (speed_mps > _SLOW_MPS)
    v_n = np.where(wanted[:, None], track.v_n_mps, np.nan)
    v_b = speed_mps[:, None] * np.array([1.0, 0.0, 0.0])
    return VectorPairs(
        v_n=np.concatenate([pairs.v_n, v_n[:, None]], axis=1),
        v_b=np.concatenate([pairs.v_b, v_b[:, None]], axis=1),
        weight=np.ones((len(v_n), len(pairs.sources) + 1)),
        sources=(*pairs.sources, "velocity"),
    )


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
