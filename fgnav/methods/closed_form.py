"""The paper's method: the matrix that carries vectors in body axes into the same in local axes."""

from dataclasses import dataclass, field

import numpy as np

from fgnav.attitude.array import axis_name
from fgnav.attitude.baselines import body_motion, paper_baselines
from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.vector_pairs import (
    VectorPairs,
    collinear,
    paper_matrix,
    paper_rotation,
    wahba,
)
from fgnav.checks import BoolArray, FloatArray, Loss, NoSolutionError
from fgnav.geometry import rotations
from fgnav.integers.resolvers.registry import default_resolver
from fgnav.integers.resolvers.resolve import resolve
from fgnav.types.estimate import Estimate
from fgnav.types.flight import Flight
from fgnav.types.integers import Resolver

# What one vector alone leaves open.
_OPEN_ABOUT = {
    "specific force": "yaw",
    "velocity": "roll",
    "line of sight": "rotation about the line of sight",
}


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

    resolver: Resolver = field(default_factory=default_resolver)
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
            unobservable=(axis_name(differences.baselines_b_m),) if line else (),
            integers=integers,
            losses=(*differences.losses, *integers.losses, *lost),
            notes=(*([] if line else [self._reading()]), *motion.notes),
        )

    def _from_vectors(self, flight: Flight) -> Estimate:
        track = track_of(flight)
        pairs, losses = measured_vectors(flight, track)
        if self.moves_forward:
            pairs = with_velocity(pairs, track)
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
