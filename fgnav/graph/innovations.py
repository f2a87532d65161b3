"""Normalised innovations: tests of measurements against the solution without them.

Each measurement is held against what the solution would be without it: of a filter's states that
is the innovation, of smoothed ones the deletion residual [1]_. A whitened residual r of Jacobian J
at a solution of covariance P has the covariance ``S = I - J P J'``, and ``r' S^-1 r`` has the
chi-square distribution either way.

References
----------
.. [1] Cook, Weisberg: Residuals and Influence in Regression, 1982, section 2.2.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import gtsam
import numpy as np
from scipy.special import chdtr, chdtri

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.graph import keys
from fgnav.graph.build import Layout, insert_constants, insert_keyframe
from fgnav.graph.custom import NamedFactor, touched_keyframes
from fgnav.graph.innovation.phase_redundancy import phase_innovations
from fgnav.graph.innovation.place_by_code import place_innovation
from fgnav.graph.types.problem import Problem
from fgnav.graph.types.sensor import Sensor
from fgnav.graph.types.solution import Solution
from fgnav.graph.types.states import AUX, VELOCITY
from fgnav.types.estimate import Consistency

_GATE = 0.01  # share of right measurements beyond it
# A measurement that holds this share of what is known of its own residual tests nothing.
_UNTESTED = 1e-6
_HELD = 0.1  # 1 - J P J' of a measurement that the solution holds is zero at least, but rounding
_AT_ONCE = 2000  # measurements: 20 MB of nine rows, 21 columns and their squares


class Innovations(NamedTuple):
    """Normalised innovations of k measurements."""

    squared: FloatArray  # (k,)
    freedom: IntArray  # (k,)
    tested: BoolArray  # (k,): whether anything but the measurement itself determines its residual
    lagged: FloatArray  # (k,): product with that of the measurement before; 0 of the first


class InnovationSeries(NamedTuple):
    """Normalised innovations of one sensor, (k,) each, in order of time."""

    name: str
    t_s: FloatArray
    squared: FloatArray
    freedom: IntArray
    lagged: FloatArray | None = None  # products of neighbours; None where they are not known

    @property
    def nis(self) -> float:
        """Normalised innovation squared per degree of freedom."""
        return float(self.squared.sum() / max(int(self.freedom.sum()), 1))

    @property
    def correlation(self) -> float | None:
        """Correlation of neighbours by the nominal variance; None where it is not known."""
        if self.lagged is None or len(self.lagged) < 2:
            return None
        return float(self.lagged.sum() / max(int(self.freedom[1:].sum()), 1))

    @property
    def summary(self) -> Consistency:
        """Its statistics."""
        squared, freedom = self.squared, self.freedom
        beyond = squared > chdtri(freedom, _GATE)
        decile = (10 * chdtr(freedom, squared.clip(0))).astype(np.int64).clip(0, 9)
        return Consistency(
            what=self.name,
            count=len(squared),
            freedom=int(freedom.sum()),
            nis=self.nis,
            beyond_99=float(beyond.mean()) if len(beyond) else 0.0,
            deciles=tuple(np.bincount(decile, minlength=10).tolist()),
            correlation=self.correlation,
        )


def innovation_series(problem: Problem, solution: Solution) -> tuple[InnovationSeries, ...]:
    """Return the normalised innovations of every sensor.

    Parameters
    ----------
    problem : Problem
    solution : Solution
        Of all its keyframes.
    """
    of_sensors = _by_name(
        (sensor.name, normalised_innovations(sensor, solution), problem.t_s[sensor.row])
        for sensor in problem.sensors
        if len(sensor.row)
    )
    phase = problem.phase
    if phase is None:
        return of_sensors
    squared, freedom = phase_innovations(phase)
    tested = freedom > 0
    of_phases = InnovationSeries(
        phase.name, problem.t_s[phase.row][tested], squared[tested], freedom[tested]
    )
    position = place_innovation(phase, solution)
    if position is None:
        return (*of_sensors, of_phases)
    name, *values = position
    first_s = problem.t_s[phase.row[:1]]
    return (*of_sensors, of_phases, InnovationSeries(name, first_s, *map(np.array, values)))


def normalised_innovations(measurement: Sensor, solution: Solution) -> Innovations:
    """Return the normalised innovations squared of one sensor's measurements.

    Parameters
    ----------
    measurement : Sensor
        k measurements of keyframes that the solution has.
    solution : Solution
    """
    k = len(measurement.row)
    squared, lagged = np.empty(k), np.zeros(k)
    tested, rounding = np.empty(k, dtype=np.bool_), _UNTESTED
    for first in range(0, k, _AT_ONCE):
        indices = np.arange(first, min(first + _AT_ONCE, k))
        innovations, rounding = innovations_of(
            measurement, indices, solution, measurement.row[indices], rounding
        )
        squared[indices], tested[indices] = innovations.squared, innovations.tested
        lagged[indices] = innovations.lagged
    return Innovations(squared, measurement.freedom, tested, lagged)


def innovations_of(
    measurement: Sensor,
    indices: IntArray,
    solution: Solution,
    rows: IntArray,
    rounding: float = _UNTESTED,
) -> tuple[Innovations, float]:
    """Return the normalised innovations squared of some measurements, (k,), at rows of a solution.

    ``rounding``: what earlier ones had of it, which is returned with these.
    """
    value, state, shared = measurement.linearise(solution.states.at(rows), indices)
    if solution.constants is not None:  # known worse by then than at the end
        change = solution.constants[rows] - solution.states.constants
        value = value + np.einsum("kib,kb->ki", shared, change)
    J = np.concatenate([state, shared], axis=2)
    used = J.any(axis=(0, 1))
    P = _covariance(solution, rows[:, None])[:, used][:, :, used]
    white, tested, rounding = _whitened(value, J[:, :, used], P, rounding)
    lagged = np.append(np.zeros(1), np.einsum("ki,ki->k", white[1:], white[:-1]))[: len(white)]
    squared = (white**2).sum(axis=1)
    return Innovations(squared, measurement.freedom[indices], tested, lagged), rounding


def custom_innovations(
    factors: Sequence[NamedFactor],
    layout: Layout,
    t_s: FloatArray,
    solution: Solution,
    first: int = 0,
) -> tuple[InnovationSeries, ...]:
    """Return the normalised innovations of custom factors, by name.

    Of one keyframe, or two neighbours whose cross-covariance is known, and constants: as of the
    measurements. Of others nothing is known of the residual beside its noise: the mean square of
    what is left of it at the solution stands in, which is smaller.

    Parameters
    ----------
    factors : sequence of NamedFactor
    layout : Layout
    t_s : ndarray, shape (n,)
        Of the solution's keyframes.
    solution : Solution
    first : int
        Number of the solution's first keyframe, as in the factors' keys.
    """
    evaluated = [_evaluated(factor.factor, layout, solution, first) for factor in factors]
    squared = np.array([test.r @ test.r for test in evaluated])
    tested = np.ones(len(evaluated), dtype=np.bool_)
    for indices in _alike(evaluated, solution):  # at once, not one by one
        rows, seen = np.array([evaluated[i].rows for i in indices]), evaluated[indices[0]].seen
        P = _covariance(solution, rows)[:, seen[:, None], seen]
        r, J = (np.stack([evaluated[i][part] for i in indices]) for part in (0, 1))
        white, tested[indices], _ = _whitened(r, J, P)
        squared[indices] = (white**2).sum(axis=1)
    freedom = np.array([int(test.J.any(axis=1).sum()) for test in evaluated])
    last = len(solution.covariance) - 1
    at = np.array([test.rows[-1] if test.rows else last for test in evaluated], dtype=np.int64)
    names: dict[str, list[int]] = {}
    for i, factor in enumerate(factors):
        names.setdefault(factor.name, []).append(i)
    found = Innovations(squared, freedom, tested, np.zeros(len(squared)))
    return tuple(
        _series(name, [(Innovations._make(column[of] for column in found), t_s[at[of]])])
        for name, of in names.items()
    )


class _Evaluated(NamedTuple):
    """A custom factor, linearised at a solution."""

    r: FloatArray  # (m,), whitened
    J: FloatArray  # (m, d)
    rows: tuple[int, ...]  # its keyframes
    seen: IntArray  # (d,), where its variables stand among their states, then the constants


def _evaluated(
    factor: gtsam.NonlinearFactor, layout: Layout, solution: Solution, first: int
) -> _Evaluated:
    """Linearise a custom factor at a solution."""
    involved = list(factor.keys())
    rows = tuple(k - first for k in touched_keyframes(factor))
    values, constants = gtsam.Values(), solution.states.constants
    if rows and solution.constants is not None:
        constants = solution.constants[rows[-1]]
    insert_constants(values, layout, constants)
    for row in rows:
        insert_keyframe(values, layout, row + first, solution.states, row)
    J, minus_r = factor.linearize(values).jacobian()
    column_of = {row + first: layout.width * i for i, row in enumerate(rows)}
    columns = [_columns(layout, key, column_of) for key in involved]
    return _Evaluated(-minus_r, J, rows, np.concatenate(columns))


def _columns(layout: Layout, key: int, place: Mapping[int, int]) -> IntArray:
    """Return where a variable stands, the state of keyframe k at ``place[k]``."""
    if keys.is_constant(key):
        i, constants = layout.constant_keys.index(key), layout.constants
        first = layout.width * len(place) + constants.first[i]
        return first + np.arange(constants.parts[i].size)
    k = keys.index(key)
    spans = ((0, VELOCITY.start), (VELOCITY.start, AUX), (AUX, layout.width))
    begin, end = spans[layout.keyframe(k).index(key)]
    return place[k] + np.arange(begin, end)


def _alike(evaluated: Sequence[_Evaluated], solution: Solution) -> list[list[int]]:
    """Return factors of the same dimensions whose variables' joint covariance is known."""
    alike: dict[tuple[object, ...], list[int]] = {}
    for i, test in enumerate(evaluated):
        separation = test.rows[-1] - test.rows[0] if test.rows else 0
        if len(test.rows) < 2 or (separation == 1 and solution.cross is not None):
            kind = (len(test.rows), test.J.shape, *test.seen.tolist())
            alike.setdefault(kind, []).append(i)
    return list(alike.values())


def _covariance(solution: Solution, rows: IntArray) -> FloatArray:
    """Return covariances of the states of some rows, (k, 0 to 2), and the constants."""
    if not rows.shape[1]:
        return np.repeat(solution.constant_covariance[-1:], len(rows), axis=0)
    shared = solution.constant_covariance[rows[:, -1]]
    keyframes = [solution.covariance[row] for row in rows.T]
    cross = [solution.constant_cross[row] for row in rows.T]
    if len(keyframes) == 1 or solution.cross is None:
        return np.block([[keyframes[0], cross[0]], [cross[0].swapaxes(1, 2), shared]])
    between = solution.cross[rows[:, 0]]
    return np.block(
        [
            [keyframes[0], between, cross[0]],
            [between.swapaxes(1, 2), keyframes[1], cross[1]],
            [cross[0].swapaxes(1, 2), cross[1].swapaxes(1, 2), shared],
        ]
    )


def _whitened(
    r: FloatArray, J: FloatArray, P: FloatArray, before: float = _UNTESTED
) -> tuple[FloatArray, BoolArray, float]:
    """Return ``(I - J P J')^-1/2 r``, (k, m), which of them test anything, and rounding so far.

    By the root of P: constants of which little is known would cost ``J P J'`` its digits.
    """
    B = J @ _root(P)
    S = np.eye(r.shape[1]) - B @ B.swapaxes(1, 2)
    smallest = np.linalg.eigvalsh(S)[:, 0]
    # Negative is what the solution does not hold (wheels that wait for a heading: -30,000), or
    # rounding, hundredths where antennas are estimated: as much as there was of it so far.
    rounding = np.where(smallest > -_HELD, -smallest, 0.0)
    so_far = np.maximum.accumulate(np.maximum(rounding, before))
    tested = smallest > so_far
    S[~tested] = np.eye(r.shape[1])
    values, vectors = np.linalg.eigh(S)
    along = np.einsum("kji,kj->ki", vectors, r) / np.sqrt(values)
    white = np.einsum("kij,kj->ki", vectors, along)
    return white, tested, float(so_far.max(initial=before))


def _root(P: FloatArray) -> FloatArray:
    """Return a root of covariances, (k, d, d), of singular ones, too."""
    try:
        return np.asarray(np.linalg.cholesky(P))
    except np.linalg.LinAlgError:
        sigma = np.sqrt(np.einsum("nii->ni", P).clip(0))
        scale = np.where(sigma > 0, sigma, 1.0)[:, :, None]
        values, vectors = np.linalg.eigh(P / scale / scale.swapaxes(1, 2))
        return np.asarray(scale * vectors * np.sqrt(values.clip(0))[:, None])


def _by_name(
    parts: Iterable[tuple[str, Innovations, FloatArray]],
) -> tuple[InnovationSeries, ...]:
    """Return the series of each name, in the order in which they come first."""
    collected: dict[str, list[tuple[Innovations, FloatArray]]] = {}
    for name, part, t_s in parts:
        collected.setdefault(name, []).append((part, t_s))
    return tuple(_series(name, found) for name, found in collected.items())


def _series(name: str, parts: Sequence[tuple[Innovations, FloatArray]]) -> InnovationSeries:
    every = Innovations._make(map(np.concatenate, zip(*(part for part, _ in parts), strict=True)))
    t_s = np.concatenate([t_s for _, t_s in parts])
    kept = np.flatnonzero(every.tested)
    kept = kept[np.argsort(t_s[kept], kind="stable")]
    return InnovationSeries(
        name, t_s[kept], every.squared[kept], every.freedom[kept], every.lagged[kept]
    )
