"""Sensors of antennas at keyframes: an array's phases, positions, velocities, baselines."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from fgnav.alignment.array.multipath import symmetric_root
from fgnav.alignment.matching import nearest, unmatched
from fgnav.assembly.position.series import VectorSeries
from fgnav.attitude.quadratic import RotationQuadratic
from fgnav.attitude.receiver_baselines import BodyBaseline, body_baseline
from fgnav.checks import BoolArray, FloatArray, IntArray, Unused
from fgnav.graph.factors.array_phase import ArrayPhase
from fgnav.graph.factors.array_shape import ArrayShape
from fgnav.graph.factors.baseline import BaselineVector
from fgnav.graph.factors.position import Position
from fgnav.graph.factors.velocity import Velocity
from fgnav.graph.inertial.multipath import Multipath
from fgnav.graph.types.sensor import Sensor
from fgnav.types.flight import Flight

_DIMENSIONS = {"vector": 3, "direction": 2, "heading": 1}  # of a baseline


def array_sensors(
    form: RotationQuadratic,
    shape: ArrayShape | None,
    valid: BoolArray,
    stretch: IntArray,
    multipath: tuple[Multipath | None, bool],
) -> Iterator[Sensor]:
    """Yield the phases of an array at keyframes, (n,).

    Parameters
    ----------
    form : RotationQuadratic
    shape : ArrayShape or None
        Where antennas are estimated: in place of ``form``.
    valid : ndarray of bool, shape (n,)
        Keyframes whose phases take part.
    stretch : ndarray of int, shape (n,)
        Stretch of epochs without integers that a keyframe is in, or -1.
    multipath : tuple of Multipath or None, and bool
        What of their errors is correlated in time, and whether it is a state; else it is as loud
        as white noise of the same density at low frequencies.
    """
    if shape is not None:
        yield shape
        valid = valid.copy()
        valid[shape.row] = False
    row = np.flatnonzero(valid & (form.count > 0))
    form, (correlated, is_state) = form[row], multipath
    if correlated is not None and not is_state:
        form, correlated = form.with_variance_factor(correlated.inflation()[row]), None
    root, minimum = form.square_root()
    phases = ArrayPhase(row=row, root=root, minimum=minimum, stretch=stretch[row])
    if correlated is not None:
        root = symmetric_root(form.information)[0]
        phases = replace(phases, root=root, share=correlated.share[row], basis=correlated.basis)
    yield phases


def positions(of_antennas: Iterable[VectorSeries]) -> Iterator[Position]:
    """Yield the positions of antennas."""
    for series in of_antennas:
        row = np.flatnonzero(series.valid)
        yield Position(
            row=row,
            value_n_m=series.value[row],
            white=series.white(row),
            arm_b_m=series.arm_b_m,
        )


def velocities(
    of_antennas: Iterable[VectorSeries],
    measured_b_radps: FloatArray | None,
    earth_rate_n_radps: FloatArray,
    usable: BoolArray | None = None,
) -> Iterator[Velocity]:
    """Yield the velocities of antennas.

    Parameters
    ----------
    of_antennas : iterable of VectorSeries
    measured_b_radps : ndarray, shape (n, 3), or None
        The gyroscope's rates at keyframes.
    earth_rate_n_radps : ndarray, shape (3,)
    usable : ndarray of bool, shape (n,), optional
        Keyframes whose velocities may be late; all by default.
    """
    for series in of_antennas:
        row = np.flatnonzero(series.valid if usable is None else series.valid & usable)
        yield Velocity(
            row=row,
            value_n_mps=series.value[row],
            white=series.white(row),
            arm_b_m=series.arm_b_m,
            measured_b_radps=None if measured_b_radps is None else measured_b_radps[row],
            earth_rate_n_radps=earth_rate_n_radps,
        )


def baselines(
    flight: Flight, t_s: FloatArray
) -> tuple[tuple[BaselineVector, ...], tuple[Unused, ...]]:
    """Return the baselines of a flight's receivers at keyframes, (n,).

    Raises
    ------
    BadInputError
        If both antennas of one are at the same place.
    """
    parts: list[BaselineVector] = []
    unused: list[Unused] = []
    for baseline in flight.baselines:
        if not len(baseline.t_s):
            continue
        at, same = nearest(baseline.t_s, t_s)
        row = np.flatnonzero(same)
        parts.append(_rows(body_baseline(flight, baseline), at[row], row))
        unused += unmatched(f"baseline {' to '.join(baseline.antennas)}", len(baseline.t_s), same)
    return tuple(parts), tuple(unused)


def _rows(between: BodyBaseline, at: IntArray, row: IntArray) -> BaselineVector:
    """Return rows that whiten a baseline's samples ``at``, (k,)."""
    of = between.of
    value, dimensions = of.vector_n_m[at], _DIMENSIONS[of.measured]
    if dimensions == 1:
        right = np.stack([-value[:, 1], value[:, 0]], axis=1)
        white = np.zeros((len(row), 3, 3))
        white[:, 0, :2] = right / of.heading_sigma_rad[at, None]
    else:
        white = np.linalg.inv(np.linalg.cholesky(of.covariance_m2[at]))
    return BaselineVector(
        row=row,
        value_n_m=value,
        white=white,
        baseline_b_m=between.vector_b_m,
        dimensions=dimensions,
    )
