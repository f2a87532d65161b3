"""Attitudes of single epochs, where the smoother starts: of the array, or of other vectors."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.flight_vectors import measured_vectors, track_of
from fgnav.attitude.own_rotation import OwnRotation, despun
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, IntArray, Loss, NoSolutionError
from fgnav.frontend.array.adaptation import adapted
from fgnav.frontend.array.pivot import pivot_losses, pivot_notes, pivot_views
from fgnav.frontend.attitude.carried import carried_attitudes
from fgnav.frontend.attitude.in_motion import EarlierMotion
from fgnav.frontend.attitude.vector_alignment import (
    VECTOR_SIGMA_RAD,
    VectorAttitudes,
    vector_attitudes,
)
from fgnav.frontend.gaps import gap_notes, spans
from fgnav.frontend.matching import nearest
from fgnav.gravity import GravityDirection
from fgnav.integers.resolvers.resolve import resolve
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected
from fgnav.types.flight import Flight, Imu
from fgnav.types.integers import Integers, Resolver

_Rows = FloatArray | BoolArray | IntArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Alignment:
    """Attitudes at the flight's GNSS epochs, each from that epoch alone.

    Attributes
    ----------
    t_s : ndarray, shape (n,)
    R_nb : ndarray, shape (n, 3, 3)
    covariance_rad2 : ndarray, shape (n, 3, 3)
    valid : ndarray of bool, shape (n,)
        Whether the epoch has an attitude that its own residuals do not contradict.
    form : RotationQuadratic or None
        Of the array's phases; None without an array.
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
        Angles that neither the array nor another vector determines.
    rough : bool
        Whether the covariance is a guess.
    own : OwnRotation or None
        How the body turns by its gyroscope, or spins without an array.
    gyroscope_bias_b_radps : ndarray, shape (3,), or None
        Where the search for it starts.
    heading_from_s, heading_known_s : float
        When information about heading begins, and when it is enough.
    motion : EarlierMotion or None
        Of attitudes that a gyroscope carries, for those to come.
    """

    t_s: FloatArray
    R_nb: FloatArray
    covariance_rad2: FloatArray
    valid: BoolArray
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
    gyroscope_bias_b_radps: FloatArray | None = None
    heading_from_s: float = -np.inf
    heading_known_s: float = -np.inf
    motion: EarlierMotion | None = None

    @property
    def R_nu(self) -> FloatArray:
        """Attitudes of axes that do not spin, (n, 3, 3)."""
        return despun(self.own, self.t_s, self.R_nb)

    def epochs_of(self, t_s: FloatArray) -> IntArray:
        """Return which of some times, (m,), each keyframe is at, (n,); -1 of none."""
        row = np.searchsorted(self.t_s, t_s).clip(max=len(self.t_s) - 1)
        same = np.flatnonzero(self.t_s[row] == t_s)
        epoch = np.full(len(self.t_s), -1, dtype=np.int64)
        epoch[row[same]] = same
        return epoch

    def __getitem__(self, rows: IntArray) -> "Alignment":
        """Return the start at some of its epochs, in their order."""
        if len(rows) == len(self.t_s):
            return self
        return replace(
            self,
            t_s=self.t_s[rows],
            R_nb=self.R_nb[rows],
            covariance_rad2=self.covariance_rad2[rows],
            valid=self.valid[rows],
            form=None if self.form is None else self.form[rows],
            refused=self.refused[rows],
        )


def at_keyframes(start: Alignment, t_s: FloatArray) -> Alignment:
    """Return an alignment at keyframes, (n,), among them all its epochs; the others have none."""
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
        valid=spread(start.valid),
        form=form,
        refused=spread(start.refused),
    )


def align(
    flight: Flight,
    resolver: Resolver,
    false_alarm: float,
    gravity: GravityDirection | None = None,
) -> Alignment:
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
        if flight.imu is not None and flight.imu.w_b_radps is not None:
            carried = of_motion(flight, flight.imu)
            if carried.valid.any() or flight.seeker is None:
                return carried
        return _of_vectors(vector_attitudes(flight, gravity))
    return of_arrays(flight, resolver, false_alarm)


def of_arrays(
    flight: Flight, resolver: Resolver, false_alarm: float, *, causal: bool = False
) -> Alignment:
    """Return attitudes of the array, by another reference where the first tracks nothing.

    Causal: each from its own epoch, integers and all.

    Raises
    ------
    BadInputError
        If the resolver has no causal form, and needs one.
    NoSolutionError
        If the array has no attitudes by the first reference.
    """
    first, *others = pivot_views(flight, causal=causal)
    start = _of_array(first.flight, resolver, false_alarm, causal=causal)
    for view in others:
        try:
            other = _of_array(view.flight, resolver, false_alarm, causal=causal)
        except NoSolutionError:  # then these epochs stay without
            continue
        start = _completed_by(start, other, view.rows)
    return replace(
        start,
        losses=pivot_losses((first, *others), start.losses),
        notes=tuple(dict.fromkeys((*start.notes, *pivot_notes((first, *others))))),
    )


def _completed_by(start: Alignment, other: Alignment, rows: IntArray) -> Alignment:
    """Fill some epochs, (k,), that have none with the attitudes by another reference antenna."""

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
        valid=put(start.valid, other.valid),
        form=form,
        refused=put(start.refused, other.refused),
        losses=(*start.losses, *other.losses),
        rejections=(*start.rejections, *other.rejections),
        notes=(*start.notes, *other.notes),
    )


def _of_array(flight: Flight, resolver: Resolver, false_alarm: float, *, causal: bool) -> Alignment:
    differences, integers = resolve(flight, resolver, causal=causal)
    names = tuple(antenna.name for antenna in flight.antennas)
    clean = adapted(differences, integers, names, false_alarm, causal=causal)
    attitude = clean.attitude
    is_open = attitude.solved & attitude.open_axis_b.any(axis=1)
    if is_open.any():
        form = _with_vectors(flight, clean.form, differences.t_s, is_open, causal=causal)
        attitude = maximum_likelihood(form)
    return Alignment(
        t_s=differences.t_s,
        R_nb=attitude.R_nb,
        covariance_rad2=attitude.covariance_rad2,
        valid=attitude.solved & ~clean.refused & ~attitude.open_axis_b.any(axis=1),
        form=clean.form,
        integers=replace(clean.integers, evidence=clean.evidence, source=clean.source),
        refused=clean.refused,
        losses=(*differences.losses, *integers.losses),
        rejections=clean.rejections,
        notes=(*clean.notes, *_antenna_gaps(names, differences)),
        unobservable=attitude.unobservable(),
        phases=(differences, clean.ranges_m),
    )


def _with_vectors(
    flight: Flight, form: RotationQuadratic, t_s: FloatArray, wanted: BoolArray, *, causal: bool
) -> RotationQuadratic:
    """Return forms with other vectors added at epochs of which an angle is open.

    For where to start alone: the smoother has these vectors as factors of their own.
    """
    track = track_of(flight, causal=causal)
    pairs, _ = measured_vectors(flight, track, causal=causal)
    row, same = nearest(track.t_s, t_s)
    for v_n, v_b in zip(np.moveaxis(pairs.v_n, 1, 0), np.moveaxis(pairs.v_b, 1, 0), strict=True):
        valid = same & wanted & np.isfinite(v_n[row]).all(axis=1)
        valid &= np.isfinite(v_b[row]).all(axis=1)
        size = np.where(valid, np.linalg.norm(v_b[row], axis=1), 1.0)
        form = form + RotationQuadratic.of_vector_pairs(
            np.where(valid[:, None], v_n[row], 0.0),
            np.where(valid[:, None], v_b[row], np.nan),
            (VECTOR_SIGMA_RAD * size)[:, None, None] ** 2 * np.eye(3),
        )
    return form


def of_motion(
    flight: Flight, imu: Imu, *, causal: bool = False, earlier: EarlierMotion | None = None
) -> Alignment:
    """Return attitudes propagated by a gyroscope from where gravity and motion determine them.

    Epochs are valid whose heading is known by then: by any time of the flight or, causal, by the
    past. The others have the heading that the search starts with.
    """
    propagated = carried_attitudes(flight, imu, causal=causal, earlier=earlier)
    return Alignment(
        t_s=propagated.t_s,
        R_nb=propagated.R_nb,
        covariance_rad2=propagated.sigma_rad[:, None, None] ** 2 * np.eye(3),
        valid=propagated.valid,
        form=None,
        integers=None,
        refused=np.zeros(len(propagated.t_s), dtype=np.bool_),
        losses=(),
        rejections=(),
        notes=propagated.notes,
        own=propagated.own,
        gyroscope_bias_b_radps=propagated.bias_b_radps,
        heading_from_s=propagated.heading_from_s,
        heading_known_s=propagated.heading_known_s,
        motion=propagated.motion,
    )


def _of_vectors(attitudes: VectorAttitudes) -> Alignment:
    return Alignment(
        t_s=attitudes.t_s,
        R_nb=attitudes.R_nb,
        covariance_rad2=attitudes.covariance_rad2,
        valid=attitudes.valid,
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
    tracked = np.isfinite(differences.phase_m).any(axis=2)
    missing = ~tracked & np.any(tracked, axis=1)[:, None]
    return tuple(
        sentence
        for name, column in zip(names[1:], missing.T, strict=True)
        for sentence in gap_notes(f"phase of antenna {name}", spans(differences.t_s, column))
    )
