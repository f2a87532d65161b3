"""Attitudes of single epochs, where the smoother starts: of the array, or of other vectors."""

from dataclasses import dataclass

import numpy as np

from fgnav.attitude.array import agreeing
from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.vector_pairs import wahba
from fgnav.checks import BoolArray, FloatArray, Loss
from fgnav.flight import Flight
from fgnav.integers.resolve import resolve
from fgnav.integers.resolver import Integers, Resolver

# Vectors told without an array lean on a velocity along x_b and an attitude that holds for two
# epochs: this is what they are good for when rates are told from them.
_VECTOR_SIGMA_RAD = 0.1


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Start:
    """Attitudes at the flight's GNSS epochs, each from that epoch alone.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    R_nb : ndarray, shape (n, 3, 3)
    covariance_rad2 : ndarray, shape (n, 3, 3)
    told : ndarray of bool, shape (n,)
        Whether the epoch has an attitude that its own residuals do not contradict.
    form : RotationQuadratic or None
        What the array's phases say; None without an array.
    integers : Integers or None
    refused : ndarray of bool, shape (n,)
        Epochs whose array phases contradict each other.
    losses : tuple of Loss
    notes : tuple of str
    """

    t_s: FloatArray
    R_nb: FloatArray
    covariance_rad2: FloatArray
    told: BoolArray
    form: RotationQuadratic | None
    integers: Integers | None
    refused: BoolArray
    losses: tuple[Loss, ...]
    notes: tuple[str, ...]


def start_of(flight: Flight, resolver: Resolver, false_alarm: float) -> Start:
    """Return single-epoch attitudes by the best means that the flight has.

    Raises
    ------
    NoSolutionError
        If it has neither an array nor a track.
    """
    if flight.observations is not None and len(flight.antennas) > 1:
        return _of_array(flight, resolver, false_alarm)
    return _of_vectors(flight)


def _of_array(flight: Flight, resolver: Resolver, false_alarm: float) -> Start:
    differences, integers = resolve(flight, resolver)
    stated = RotationQuadratic.of_double_differences(differences, integers)
    form, attitude, notes = agreeing(stated)
    consistent = attitude.consistent(false_alarm)
    return Start(
        t_s=differences.t_s,
        R_nb=attitude.R_nb,
        covariance_rad2=attitude.covariance_rad2,
        told=attitude.solved & consistent,
        form=form,
        integers=integers,
        refused=attitude.solved & ~consistent,
        losses=(*differences.losses, *integers.losses),
        notes=notes,
    )


def _of_vectors(flight: Flight) -> Start:
    """Specific force, line of sight and, where they leave an angle open, the velocity as x_b."""
    track = track_of(flight)
    pairs, losses = measured_vectors(flight, track)
    attitude = wahba(with_velocity(pairs, track).directions())
    told = attitude.rank == 2
    n = len(track.t_s)
    return Start(
        t_s=track.t_s,
        R_nb=np.where(told[:, None, None], attitude.R_nb, np.eye(3)),
        covariance_rad2=np.tile(_VECTOR_SIGMA_RAD**2 * np.eye(3), (n, 1, 1)),
        told=told,
        form=None,
        integers=None,
        refused=np.zeros(n, dtype=np.bool_),
        losses=losses,
        notes=(),
    )
