"""Attitudes of single epochs, where the smoother starts: of the array, or of other vectors."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.attitude.array import AttitudeSolution, maximum_likelihood
from fgnav.attitude.flight_vectors import measured_vectors, track_of
from fgnav.attitude.own_rotation import OwnRotation, despun
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError
from fgnav.estimate import Rejected
from fgnav.flight import Flight
from fgnav.gnss.differences import DoubleDifferences
from fgnav.gravity import GravityDirection
from fgnav.integers.resolve import resolve
from fgnav.integers.resolver import Integers, Resolver
from fgnav.methods.smoother.gaps import spans, told
from fgnav.methods.smoother.held import held
from fgnav.methods.smoother.instruments import nearest
from fgnav.methods.smoother.robust import CleanArray, clean_array
from fgnav.methods.smoother.stand_ins import references_told, stood_in, views
from fgnav.methods.smoother.vector_starts import (
    VECTOR_SIGMA_RAD,
    VectorAttitudes,
    vector_attitudes,
)

_Rows = FloatArray | BoolArray | IntArray


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
    phases : tuple of DoubleDifferences and ndarray, or None
        The array's own, and what of them its form is of, without integers, whatever the epochs.
    refused : ndarray of bool, shape (n,)
        Epochs whose array phases contradict each other.
    losses : tuple of Loss
    rejections : tuple of Rejected
    notes : tuple of str
        Among them the gaps.
    unobservable : tuple of str
        Angles that the array leaves open and no other vector tells.
    rough : bool
        Whether the covariance is a guess.
    own : OwnRotation or None
        How a body without an array spins.
    """

    t_s: FloatArray
    R_nb: FloatArray
    covariance_rad2: FloatArray
    told: BoolArray
    form: RotationQuadratic | None
    integers: Integers | None
    refused: BoolArray
    losses: tuple[Loss, ...]
    rejections: tuple[Rejected, ...]
    notes: tuple[str, ...]
    unobservable: tuple[str, ...] = ()
    rough: bool = False
    phases: tuple[DoubleDifferences, FloatArray] | None = None
    own: OwnRotation | None = None

    @property
    def R_nu(self) -> FloatArray:
        """Attitudes of axes that do not spin, (n, 3, 3)."""
        return despun(self.own, self.t_s, self.R_nb)

    def __getitem__(self, rows: IntArray) -> "Start":
        """Return the start at some of its epochs, in their order."""
        if len(rows) == len(self.t_s):
            return self
        return replace(
            self,
            t_s=self.t_s[rows],
            R_nb=self.R_nb[rows],
            covariance_rad2=self.covariance_rad2[rows],
            told=self.told[rows],
            form=None if self.form is None else self.form[rows],
            refused=self.refused[rows],
        )


def at_keyframes(start: Start, t_s: FloatArray) -> Start:
    """Return a start at keyframes, (n,), among them all its own epochs; the others are not told."""
    row = np.searchsorted(t_s, start.t_s)
    n, form = len(t_s), start.form
    if n == len(row):
        return start

    def spread(values: _Rows) -> Any:  # noqa: ANN401
        out = np.zeros((n, *values.shape[1:]), dtype=values.dtype)
        out[row] = values
        return out

    if form is not None:
        form = RotationQuadratic(
            information=spread(form.information),
            vector=spread(form.vector),
            constant=spread(form.constant),
            count=spread(form.count),
        )
    R_nb = np.tile(np.eye(3), (n, 1, 1))
    R_nb[row] = start.R_nb
    return replace(
        start,
        t_s=t_s,
        R_nb=R_nb,
        covariance_rad2=spread(start.covariance_rad2),
        told=spread(start.told),
        form=form,
        refused=spread(start.refused),
    )


def start_of(
    flight: Flight,
    resolver: Resolver,
    false_alarm: float,
    gravity: GravityDirection | None = None,
) -> Start:
    """Return single-epoch attitudes by the best means that the flight has.

    Parameters
    ----------
    flight : Flight
    resolver : Resolver
    false_alarm : float
    gravity : GravityDirection or None
        A vector of epochs without an array.

    Raises
    ------
    NoSolutionError
        If it has neither an array nor a track.
    """
    if flight.observations is None or len(flight.antennas) < 2:
        return _of_vectors(vector_attitudes(flight, gravity))
    whole, *others = views(flight)
    start = _of_array(whole.flight, resolver, false_alarm)
    for view in others:
        try:
            start = _filled(start, _of_array(view.flight, resolver, false_alarm), view.rows)
        except NoSolutionError:  # then these epochs stay without
            continue
    return replace(
        start,
        losses=stood_in((whole, *others), start.losses),
        notes=tuple(dict.fromkeys((*start.notes, *references_told((whole, *others))))),
    )


def _filled(start: Start, other: Start, rows: IntArray) -> Start:
    """Put what another reference antenna tells of some epochs, (k,), in the place of nothing."""

    def put(
        values: FloatArray | BoolArray | IntArray, of: FloatArray | BoolArray | IntArray
    ) -> Any:  # noqa: ANN401
        out = values.copy()
        out[rows] = of
        return out

    form = start.form
    if form is not None and other.form is not None:
        form = RotationQuadratic(
            information=put(form.information, other.form.information),
            vector=put(form.vector, other.form.vector),
            constant=put(form.constant, other.form.constant),
            count=put(form.count, other.form.count),
        )
    return replace(
        start,
        R_nb=put(start.R_nb, other.R_nb),
        covariance_rad2=put(start.covariance_rad2, other.covariance_rad2),
        told=put(start.told, other.told),
        form=form,
        refused=put(start.refused, other.refused),
        losses=(*start.losses, *other.losses),
        rejections=(*start.rejections, *other.rejections),
        notes=(*start.notes, *other.notes),
    )


def _of_array(flight: Flight, resolver: Resolver, false_alarm: float) -> Start:
    differences, integers = resolve(flight, resolver)
    names = tuple(antenna.name for antenna in flight.antennas)
    hold = held(differences, integers, names)
    clean = clean_array(differences, hold.integers, names, false_alarm)
    attitude = _closed(flight, differences, clean)
    return Start(
        t_s=differences.t_s,
        R_nb=attitude.R_nb,
        covariance_rad2=attitude.covariance_rad2,
        told=attitude.solved & ~clean.refused & ~attitude.open_axis_b.any(axis=1),
        form=clean.form,
        integers=clean.integers,
        refused=clean.refused,
        losses=(*differences.losses, *integers.losses),
        rejections=(*hold.rejections, *clean.rejections),
        notes=(*hold.notes, *clean.notes, *_antenna_gaps(names, differences)),
        unobservable=attitude.unobservable(),
        phases=(differences, clean.ranges_m),
    )


def _closed(flight: Flight, differences: DoubleDifferences, clean: CleanArray) -> AttitudeSolution:
    """Return the array's attitudes, an angle that one baseline leaves open told by other vectors.

    They only say where to start: the smoother's own factors know them better.
    """
    is_open = clean.attitude.solved & clean.attitude.open_axis_b.any(axis=1)
    if not is_open.any():
        return clean.attitude
    track = track_of(flight)
    pairs, _ = measured_vectors(flight, track)
    row, found = nearest(track.t_s, differences.t_s)
    form = clean.form
    for v_n, v_b in zip(np.moveaxis(pairs.v_n, 1, 0), np.moveaxis(pairs.v_b, 1, 0), strict=True):
        told = found & np.isfinite(v_n[row]).all(axis=1) & is_open
        size = np.where(told, np.linalg.norm(v_b[row], axis=1), 1.0)
        form = form + RotationQuadratic.of_vector_pairs(
            np.where(told[:, None], v_n[row], 0.0),
            np.where(told[:, None], v_b[row], np.nan),
            (VECTOR_SIGMA_RAD * size)[:, None, None] ** 2 * np.eye(3),
        )
    return maximum_likelihood(form)


def _of_vectors(attitudes: VectorAttitudes) -> Start:
    return Start(
        t_s=attitudes.t_s,
        R_nb=attitudes.R_nb,
        covariance_rad2=attitudes.covariance_rad2,
        told=attitudes.told,
        form=None,
        integers=None,
        refused=np.zeros(len(attitudes.t_s), dtype=np.bool_),
        losses=attitudes.losses,
        rejections=(),
        notes=attitudes.notes,
        rough=attitudes.rough,
        own=attitudes.own,
    )


def _antenna_gaps(names: tuple[str, ...], differences: DoubleDifferences) -> tuple[str, ...]:
    """Tell where one antenna has no phase while another has."""
    there = np.isfinite(differences.phase_m).any(axis=2)
    missing = ~there & np.any(there, axis=1)[:, None]
    return tuple(
        sentence
        for name, column in zip(names[1:], missing.T, strict=True)
        for sentence in told(f"phase of antenna {name}", spans(differences.t_s, column))
    )
