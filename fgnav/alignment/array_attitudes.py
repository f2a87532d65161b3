"""Attitudes of single epochs, where the smoother starts: of the array, or of other vectors."""

from dataclasses import replace
from itertools import chain

import numpy as np

from fgnav.alignment.alignment import Alignment
from fgnav.alignment.array.pivot import View, pivot_notes, pivot_unused, pivot_views
from fgnav.alignment.gaps import gap_notes, spans
from fgnav.alignment.in_motion.attitudes import gyroscope_alignment
from fgnav.alignment.in_motion.windows import EarlierMotion
from fgnav.alignment.matching import nearest
from fgnav.alignment.vector_alignment import (
    VECTOR_SIGMA_RAD,
    vector_attitudes,
    wahba_alignment,
)
from fgnav.attitude.array import maximum_likelihood
from fgnav.attitude.flight_vectors import measured_vectors, track_of, with_velocity
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.checks import BoolArray, FloatArray, NoSolutionError
from fgnav.gravity import GravityDirection
from fgnav.integers.validation import ValidatedArray
from fgnav.types.differences import DoubleDifferences
from fgnav.types.flight import Flight


def alignment_without_array(
    flight: Flight,
    gravity: GravityDirection | None = None,
    *,
    causal: bool = False,
    earlier: EarlierMotion | None = None,
) -> Alignment:
    """Return attitudes by motion beside a gyroscope, or of single epochs by other vectors.

    Parameters
    ----------
    flight : Flight
    gravity : GravityDirection or None
        A vector; not of causal attitudes.
    causal : bool
        Whether each is by what came up to it.
    earlier : EarlierMotion, optional
        Of a flight that goes on: what sums up its beginning.

    Raises
    ------
    NoSolutionError
        If it has no track.
    """
    imu, sees = flight.imu, flight.photodetector is not None
    if imu is not None and imu.w_b_radps is not None and not (causal and sees):
        by_gyroscope = gyroscope_alignment(flight, imu, causal=causal, earlier=earlier)
        if by_gyroscope.valid.any() or not sees:
            return by_gyroscope
    if not causal:
        return vector_attitudes(flight, gravity)
    track = track_of(flight, causal=True)
    pairs, unused = measured_vectors(flight, track, causal=True)
    return wahba_alignment(track.t_s, with_velocity(pairs, track), unused)


def array_alignment(
    flight: Flight, phases: tuple[ValidatedArray | None, ...], *, causal: bool = False
) -> Alignment:
    """Return attitudes of the array, by another reference where the first tracks nothing.

    Causal: each from its own epoch, integers and all.

    Parameters
    ----------
    flight : Flight
    phases : tuple of ValidatedArray or None
        Of these observations by each view of ``pivot_views``; None where one has no integers.
    causal : bool

    Raises
    ------
    NoSolutionError
        If an angle is open and the flight has no track.
    """
    views = pivot_views(flight, causal=causal)
    parts: list[tuple[View, Alignment]] = []
    for view, phase in zip(views, phases, strict=True):
        if phase is None:
            continue
        try:
            parts.append((view, _of_array(view.flight, phase, causal=causal)))
        except NoSolutionError:
            if not parts:
                raise
    start = parts[0][1]
    for view, other in parts[1:]:
        start = start.with_rows(view.rows, other)
    notes, unused, rejections = (
        tuple(chain.from_iterable(getattr(part, name) for _, part in parts))
        for name in ("notes", "unused", "rejections")
    )
    return replace(
        start,
        unused=pivot_unused(views, unused),
        rejections=rejections,
        notes=tuple(dict.fromkeys((*notes, *pivot_notes(views)))),
    )


def _of_array(flight: Flight, phases: ValidatedArray, *, causal: bool) -> Alignment:
    differences, attitude = phases.differences, phases.attitude
    names = tuple(antenna.name for antenna in flight.antennas)
    is_open = attitude.solved & attitude.open_axis_b.any(axis=1)
    if is_open.any():
        form = _with_vectors(flight, phases.form, differences.t_s, is_open, causal=causal)
        attitude = maximum_likelihood(form)
    return Alignment(
        t_s=differences.t_s,
        R_nb=attitude.R_nb,
        covariance_rad2=attitude.covariance_rad2,
        valid=attitude.solved & ~phases.refused & ~attitude.open_axis_b.any(axis=1),
        form=phases.form,
        integers=phases.integers,
        refused=phases.refused,
        unused=(*differences.unused, *phases.integers.unused),
        rejections=phases.rejections,
        notes=(*phases.notes, *_antenna_gaps(names, differences)),
        unobservable=attitude.unobservable(),
        phases=(differences, phases.ranges_m),
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


def _antenna_gaps(names: tuple[str, ...], differences: DoubleDifferences) -> tuple[str, ...]:
    """Tell where one antenna has no phase while another has."""
    tracked = np.isfinite(differences.phase_m).any(axis=2)
    missing = ~tracked & np.any(tracked, axis=1)[:, None]
    return tuple(
        sentence
        for name, column in zip(names[1:], missing.T, strict=True)
        for sentence in gap_notes(f"phase of antenna {name}", spans(differences.t_s, column))
    )
