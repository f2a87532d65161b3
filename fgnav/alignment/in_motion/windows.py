"""In-motion alignment: attitude of a flight with a gyroscope, before any smoothing.

Specific forces of two frames (``force_pairs``), ``alpha = R_nu beta``, determine R_nu.
Level comes from the mean over a window. Heading is the phase of the complex regression of alpha's
horizontal part on beta's, each less a straight line in time, which takes out tilt, bias of the
accelerometer and drift of the gyroscope. Neither needs a noise: with N pairs and a squared
coherence C the heading's variance is (1 - C) / (2 C N), and chance alone exceeds C with the
probability (1 - C)^N [1]_.

References
----------
.. [1] Carter: Coherence and time delay estimation, Proceedings of the IEEE 75(2), 1987.
"""

from dataclasses import replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fgnav.alignment.in_motion.force_pairs import Integrated, Pairs, specific_forces
from fgnav.alignment.in_motion.gyroscope_bias import gyroscope_bias
from fgnav.attitude.flight_vectors import Track
from fgnav.attitude.imu_rotation import ImuRotation, imu_rotation
from fgnav.attitude.receiver_baselines import KNOWN_RAD
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.geometry.rotations import exp
from fgnav.types.flight import Imu

# T: vehicles speed up and turn within seconds; of positions good to metres only the longer ones
# have any information.
_SPANS_S = (1.0, 2.0, 4.0)
WINDOW_S = (
    30.0  # a bias of 0.02 rad/s, a straight line in tilt, turns heading by 0.3 rad to its middle
)
_MOST = int(WINDOW_S / _SPANS_S[0]) + 2  # pairs: all windows alike add up in the same order
_MINIMUM = 4  # pairs beside the two of a straight line
_CHANCE = 1e-7  # of a heading where there is none: six spans a second are one in half a month
_BEGUN = 0.05  # of the information about heading lies before motion began: noise, at rest
_GAIN = (0.5, 2.0)  # of alpha over beta: beyond, fixes and accelerometer have different motions
_UP_U = np.array([0.0, 0.0, -1.0])  # specific force at rest, frame n, in units of gravity


ComplexArray: TypeAlias = NDArray[np.complexfloating[Any]]
Columns: TypeAlias = tuple[FloatArray, ...]  # of ``InMotion``, by window


class InMotion(NamedTuple):
    """Headings of windows, each from what lies in it."""

    until_s: FloatArray  # (k,): ends of the windows, increasing: nothing later takes part
    # When information about heading begins, and when half of it has come.
    begun_s: FloatArray  # (k,)
    middle_s: FloatArray  # (k,)
    R_nu: FloatArray  # (k, 3, 3): of the axes that do not turn
    sigma_rad: FloatArray  # (k,): of the heading
    rotation: ImuRotation  # how the body turns in ``u``
    bias_b_radps: FloatArray  # (3,): of the gyroscope, taken out of ``rotation``
    bias_sigma_radps: float  # of what is left of it

    @property
    def columns(self) -> "Columns":
        """Fields by window."""
        return self.until_s, self.begun_s, self.middle_s, self.R_nu, self.sigma_rad

    def select(self, rows: IntArray) -> "InMotion":
        """Select windows."""
        return InMotion._make((*_rows(self.columns, rows), *self[len(self.columns) :]))

    def nearest(self, t_s: FloatArray) -> IntArray:
        """Return the windows, (n,), whose middle is nearest to times."""
        order = np.argsort(self.middle_s, kind="stable")
        middle_s = self.middle_s[order]
        return np.asarray(order[np.searchsorted((middle_s[1:] + middle_s[:-1]) / 2, t_s)])

    def latest(self, t_s: FloatArray) -> IntArray:
        """Return the last windows, (n,), that end by times; the first one before."""
        return np.asarray((np.searchsorted(self.until_s, t_s, side="right") - 1).clip(0))

    def sigma_at(self, t_s: FloatArray, window: IntArray) -> FloatArray:
        """Return the 1-sigma, (n,), of attitudes carried from windows, (n,), to times."""
        away_s = np.abs(t_s - self.middle_s[window])
        return np.asarray(np.hypot(self.sigma_rad[window], self.bias_sigma_radps * away_s))


class EarlierMotion(NamedTuple):
    """Summary of earlier samples for an alignment that continues."""

    first_s: float  # epoch of the track
    step_s: float  # from there to the next
    until_s: float  # windows that end later are still to come
    gravity_n_mps2: FloatArray  # (3,), at that epoch
    R_level: FloatArray  # (3, 3), by which the first specific force points up
    R_ub: FloatArray  # (3, 3), of the first inertial sample that is kept
    windows: InMotion
    without_motion_s: float = np.inf  # since when a heading is known without motion

    def after(self, from_s: float, R_ub: FloatArray) -> "EarlierMotion":
        """Return the part that later samples need, from a time on at which the attitude is R_ub.

        Of windows the first, for when the heading was known, and those that they may follow.
        """
        count = len(self.windows.until_s)
        last = int(np.searchsorted(self.windows.until_s, from_s, side="right")) - 1
        kept = np.unique(np.r_[:1, max(last, 0) : count])[:count]
        return self._replace(R_ub=R_ub, windows=self.windows.select(kept))


def in_motion(
    imu: Imu, track: Track, gravity_n_mps2: FloatArray, earlier: EarlierMotion | None = None
) -> InMotion | None:
    """Return attitudes of all windows whose heading is known; None without samples enough.

    Each depends on what came until its end alone, and no bias of the gyroscope is taken out.

    Parameters
    ----------
    imu : Imu
        With a gyroscope.
    track : Track
        Of an antenna.
    gravity_n_mps2 : ndarray, shape (3,)
    earlier : EarlierMotion, optional
    """
    rotation = imu_rotation(imu, None if earlier is None else earlier.R_ub)
    if rotation is None:
        return None
    integrated = Integrated(imu, rotation, track.arm_b_m - imu.position_b_m)
    first_s, until_s = None, -np.inf
    if earlier is not None:
        first_s, until_s = earlier.first_s, earlier.until_s
    windows = [
        _windows(pairs, until_s)
        for span_s in _SPANS_S
        for pairs in specific_forces(integrated, track, span_s, gravity_n_mps2, first_s)
    ]
    best = _concatenated(windows)  # in order of their ends, the surest of those that end together
    best = _rows(best, np.lexsort((best[-1], best[0])))
    best = _rows(best, np.flatnonzero(np.diff(best[0], prepend=-np.inf) > 0))
    if earlier is not None:
        before = earlier.windows.select(np.flatnonzero(earlier.windows.until_s <= until_s))
        best = _concatenated([before.columns, best])
    return InMotion._make((*best, rotation, np.zeros(3), imu.gyroscope_bias_radps or np.inf))


def in_motion_smoothed(imu: Imu, track: Track, gravity_n_mps2: FloatArray) -> InMotion | None:
    """Remove the gyroscope's bias where this reduces heading variance."""
    first = in_motion(imu, track, gravity_n_mps2)
    if first is None or imu.w_b_radps is None or len(first.until_s) < 2:
        return first
    best = int(np.argmin(first.sigma_rad))
    middle_s = float(first.middle_s[best])
    R_nb = first.R_nu[best] @ first.rotation.at(np.array([middle_s]))[0]
    half_s = min(float(first.until_s[best]) - middle_s, middle_s - float(first.begun_s[best]))
    bias = gyroscope_bias(imu, track, gravity_n_mps2, R_nb, (middle_s - half_s, middle_s + half_s))
    if bias is None:
        return first
    unbiased = replace(imu, w_b_radps=imu.w_b_radps - bias.biases[:3])
    again = in_motion(unbiased, track, gravity_n_mps2)
    if again is None or not np.sum(again.sigma_rad**-2) > np.sum(first.sigma_rad**-2):
        return first  # headings are no surer, all together
    return again._replace(bias_b_radps=bias.biases[:3], bias_sigma_radps=bias.sigma_radps)


def levelled(f_u: FloatArray) -> FloatArray:
    """Return the R_nu, (k, 3, 3), of heading zero by which mean specific forces point up."""
    return _between(_normalised(f_u), np.broadcast_to(_UP_U, f_u.shape))


def _rows(windows: Columns, rows: IntArray) -> Columns:
    return tuple(column[rows] for column in windows)


def _concatenated(parts: list[Columns]) -> Columns:
    none = np.empty(0), np.empty(0), np.empty(0), np.empty((0, 3, 3)), np.empty(0)
    return tuple(np.concatenate(columns) for columns in zip(none, *parts, strict=True))


def _windows(pairs: Pairs, after_s: float) -> Columns:
    """Return the windows, (k,), whose heading is known, and that end after a time."""
    first = np.searchsorted(pairs.from_s, pairs.until_s - WINDOW_S)
    count = np.arange(1, len(first) + 1) - first
    selected = np.flatnonzero((count >= _MINIMUM + 2) & (pairs.until_s > after_s))
    if not len(selected):
        return _concatenated([])
    samples = first[selected, None] + np.arange(_MOST)
    within = samples <= selected[:, None]
    samples = np.minimum(samples, selected[:, None])
    t_s = (pairs.from_s + pairs.until_s)[samples] / 2
    f_n, f_u = (f[samples] * within[..., None] for f in (pairs.f_n_mps2, pairs.f_u_mps2))
    R_nu, sigma_rad, size = _headings(t_s, f_n, f_u, within)
    determined = np.flatnonzero(sigma_rad < KNOWN_RAD)
    samples, t_s, size = samples[determined], t_s[determined], size[determined]
    share = np.cumsum(size, axis=1) / size.sum(axis=1, keepdims=True)
    begun, middle = (np.argmax(share >= least, axis=1) for least in (_BEGUN, 0.5))
    k = np.arange(len(determined))
    until_s, begun_s = pairs.until_s[selected[determined]], pairs.from_s[samples[k, begun]]
    return until_s, begun_s, t_s[k, middle], R_nu[determined], sigma_rad[determined]


def _headings(
    t_s: FloatArray, f_n: FloatArray, f_u: FloatArray, within: BoolArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return R_nu, (k, 3, 3), the sigma of its heading, (k,), and each pair's information.

    Sigma is infinite where it is not observable; information, (k, m), is up to a factor.

    Parameters
    ----------
    t_s : ndarray, shape (k, m)
    f_n, f_u : ndarray, shape (k, m, 3)
        Zero where there is no pair.
    within : ndarray of bool, shape (k, m)
        Where there is one.
    """
    pairs = within.sum(axis=1)
    mean_n, mean_u = (f.sum(axis=1) / pairs[:, None] for f in (f_n, f_u))
    felt = (mean_n != 0).any(axis=1) & (mean_u != 0).any(axis=1)
    up_n, up_u = (np.where(felt[:, None], mean, _UP_U) for mean in (mean_n, mean_u))
    line = _line(t_s, within)
    alpha = _without_line(line, f_n[..., 0] + 1j * f_n[..., 1])
    R_nu = levelled(up_u)
    R_nu = _yaw_rotation(line, alpha, f_u, R_nu) @ R_nu
    R_nu = _between(_normalised(np.einsum("kij,kj->ki", R_nu, up_u)), _normalised(up_n)) @ R_nu
    R_nu = _yaw_rotation(line, alpha, f_u, R_nu) @ R_nu  # level is off by the mean force before
    beta = _horizontal(line, f_u, R_nu)
    size, scale = (np.sum(np.abs(value) ** 2, axis=1) for value in (beta, alpha))
    product = np.abs(np.sum(beta.conj() * alpha, axis=1))
    observable = felt & (size * scale > 0.0)
    coherence = np.divide(product**2, size * scale, out=np.zeros(len(size)), where=observable)
    coherence = np.minimum(coherence, 1.0 - 1e-9)
    gain = np.divide(product, size, out=np.zeros(len(size)), where=observable)
    count = pairs - line.shape[1]
    observable &= (1 - coherence) ** (count - 1) < _CHANCE
    observable &= (gain > _GAIN[0]) & (gain < _GAIN[1])
    variance_rad2 = np.full(len(size), np.inf)
    np.divide(1 - coherence, 2 * coherence * count, out=variance_rad2, where=observable)
    return R_nu, np.sqrt(variance_rad2), np.abs(beta) ** 2


def _line(t_s: FloatArray, within: BoolArray) -> FloatArray:
    """Return a constant and a straight line in time, (k, 2, m): orthogonal, of unit length."""
    since_s = t_s - t_s.mean(axis=1, where=within, keepdims=True)
    line = np.stack([np.ones_like(t_s), since_s], axis=1) * within[:, None]
    return np.asarray(line / np.linalg.norm(line, axis=2, keepdims=True))


def _yaw_rotation(
    line: FloatArray, alpha: ComplexArray, f_u: FloatArray, R_nu: FloatArray
) -> FloatArray:
    """Return the turns about the vertical, (k, 3, 3), that the regressions ask for."""
    angle = np.angle(np.sum(_horizontal(line, f_u, R_nu).conj() * alpha, axis=1))
    return np.asarray(exp(angle[:, None] * -_UP_U))


def _horizontal(line: FloatArray, f_u: FloatArray, R_nu: FloatArray) -> ComplexArray:
    """Return beta: north + i east of forces, (k, m), less a straight line in time."""
    level = f_u @ R_nu[:, :2].transpose(0, 2, 1)
    return _without_line(line, level[..., 0] + 1j * level[..., 1])


def _without_line(line: FloatArray, values: ComplexArray) -> ComplexArray:
    share = np.einsum("kim,km->ki", line, values)
    return np.asarray(values - np.einsum("kim,ki->km", line, share))


def _normalised(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))


def _between(e_from: FloatArray, e_to: FloatArray) -> FloatArray:
    """Return the least rotations, (k, 3, 3), that take unit vectors, (k, 3), to others."""
    axis, cosine = np.cross(e_from, e_to), np.sum(e_from * e_to, axis=1)
    sine = np.linalg.norm(axis, axis=1)
    parallel = sine < 1e-12
    across = _normalised(np.cross(e_from, np.eye(3)[np.abs(e_from).argmin(axis=1)]))
    axis = np.where(parallel[:, None], across, axis / np.where(parallel, 1.0, sine)[:, None])
    angle = np.where(parallel, np.where(cosine > 0, 0.0, np.pi), np.arctan2(sine, cosine))
    return np.asarray(exp(angle[:, None] * axis))
