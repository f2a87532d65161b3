"""In-motion alignment: attitude of a flight with a gyroscope, before any smoothing.

The gyroscope turns specific force into axes ``u`` that do not turn, the body's at first [1]_. Over
spans T between fixes it is the same vector in two frames, ``alpha = R_nu beta``:

    alpha = (v(t + T) - v(t)) / T - g              beta = mean of R_ub f      (velocities)
    alpha = (p(t + T) - 2 p(t) + p(t - T)) / T2 - g     the same of the double integral (positions)

Level comes from the mean over a window. Heading is the phase of the complex regression of alpha's
horizontal part on beta's, each less a straight line in time, which takes out tilt, bias of the
accelerometer and drift of the gyroscope. Neither needs a noise: with N pairs and a squared
coherence C the heading's variance is (1 - C) / (2 C N), and chance alone exceeds C with the
probability (1 - C)^N [2]_.

References
----------
.. [1] Wu, Pan: Velocity/position integration formula, part I: application to in-flight coarse
   alignment, IEEE Transactions on Aerospace and Electronic Systems 49(2), 2013.
.. [2] Carter: Coherence and time delay estimation, Proceedings of the IEEE 75(2), 1987.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fgnav.attitude.flight_vectors import Track
from fgnav.attitude.own_rotation import OwnRotation, own_rotation
from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.frontend.gaps import LONGEST_GAP_S
from fgnav.geometry.rotations import exp, log, transpose
from fgnav.types.flight import Imu

# T: vehicles speed up and turn within seconds; of positions good to metres only the longer ones
# tell anything.
_SPANS_S = (1.0, 2.0, 4.0)
WINDOW_S = (
    30.0  # a bias of 0.02 rad/s, a straight line in tilt, turns heading by 0.3 rad to its middle
)
_FEWEST = 4  # pairs beside the two of a straight line
_CHANCE = 1e-7  # of a heading where there is none: six spans a second are one in half a month
KNOWN_RAD = 0.25  # 1-sigma of a heading that counts: half a radian is two
_BEGUN = 0.05  # of what tells the heading lies before motion began: noise, at rest
_GAIN = (0.5, 2.0)  # of alpha over beta: beyond, fixes and accelerometer tell of different motions
_UP_U = np.array([0.0, 0.0, -1.0])  # specific force at rest, frame n, in units of gravity
_BIAS_SPAN_S = (5.0, 60.0)  # between headings that tell of the gyroscope's bias


ComplexArray: TypeAlias = NDArray[np.complexfloating[Any]]


class Pairs(NamedTuple):
    """The same specific forces in two frames, means over spans of T, (m, 3)."""

    from_s: FloatArray
    until_s: FloatArray
    f_n_mps2: FloatArray
    f_u_mps2: FloatArray


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class InMotion:
    """Headings of windows, each from what lies in it.

    Attributes
    ----------
    until_s : ndarray, shape (k,)
        Ends of the windows, increasing: nothing later takes part.
    begun_s, middle_s : ndarray, shape (k,)
        When motion began to tell the heading, and when half of what tells it lies behind.
    R_nu : ndarray, shape (k, 3, 3)
        Of the axes that do not turn.
    sigma_rad : ndarray, shape (k,)
        Of the heading.
    own : OwnRotation
        How the body turns in ``u``.
    bias_b_radps : ndarray, shape (3,)
        Of the gyroscope, taken out of ``own``.
    bias_sigma_radps : float
        Of what is left of it.
    """

    until_s: FloatArray
    begun_s: FloatArray
    middle_s: FloatArray
    R_nu: FloatArray
    sigma_rad: FloatArray
    own: OwnRotation
    bias_b_radps: FloatArray
    bias_sigma_radps: float

    @property
    def windows(self) -> "list[_Window]":
        """Return each of them."""
        columns = self.until_s, self.begun_s, self.middle_s, self.R_nu, self.sigma_rad
        return [_Window._make(one) for one in zip(*columns, strict=True)]

    def at(self, which: IntArray) -> "InMotion":
        """Return some of the windows."""
        names = ("until_s", "begun_s", "middle_s", "R_nu", "sigma_rad")
        rows: dict[str, Any] = {name: getattr(self, name)[which] for name in names}
        return replace(self, **rows)

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
    """What an alignment that goes on needs of its beginning, which is not kept."""

    first_s: float  # epoch of the track
    step_s: float  # from there to the next
    until_s: float  # windows that end later are still to come
    gravity_n_mps2: FloatArray  # (3,), at that epoch
    R_level: FloatArray  # (3, 3), by which the first specific force points up
    R_ub: FloatArray  # (3, 3), of the first inertial sample that is kept
    windows: InMotion

    def after(self, from_s: float, R_ub: FloatArray) -> "EarlierMotion":
        """Return what is needed of it by samples after a time, the first of which is at R_ub.

        Of windows the first, which says when the heading was known, and those that they may follow.
        """
        count = len(self.windows.until_s)
        last = int(np.searchsorted(self.windows.until_s, from_s, side="right")) - 1
        kept = np.unique(np.r_[:1, max(last, 0) : count])[:count]
        return self._replace(R_ub=R_ub, windows=self.windows.at(kept))


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
    own = own_rotation(imu, None if earlier is None else earlier.R_ub)
    if own is None:
        return None
    integrated = _Integrated(imu, own, track.arm_b_m - imu.position_b_m)
    first_s, until_s = None, -np.inf
    if earlier is not None:
        first_s, until_s = earlier.first_s, earlier.until_s
    found = [
        one
        for span_s in _SPANS_S
        for pairs in specific_forces(integrated, track, span_s, gravity_n_mps2, first_s)
        for one in _windows(pairs, until_s)
    ]
    found.sort(key=lambda one: (one.until_s, one.sigma_rad))
    keep = [k for k, one in enumerate(found) if not k or one.until_s > found[k - 1].until_s]
    best = [found[k] for k in keep]
    if earlier is not None:
        told = [one for one in earlier.windows.windows if one.until_s <= until_s]
        best = [*told, *best]
    return InMotion(
        until_s=np.array([one.until_s for one in best]),
        begun_s=np.array([one.begun_s for one in best]),
        middle_s=np.array([one.middle_s for one in best]),
        R_nu=np.array([one.R_nu for one in best]).reshape(-1, 3, 3),
        sigma_rad=np.array([one.sigma_rad for one in best]),
        own=own,
        bias_b_radps=np.zeros(3),
        bias_sigma_radps=imu.gyroscope_bias_radps or np.inf,
    )


def in_motion_smoothed(imu: Imu, track: Track, gravity_n_mps2: FloatArray) -> InMotion | None:
    """Return the same, the gyroscope's bias taken out that headings of different times tell."""
    first = in_motion(imu, track, gravity_n_mps2)
    if first is None or imu.w_b_radps is None or len(first.until_s) < 2:
        return first
    bias_b_radps, sigma_radps = _gyroscope_bias(first)
    unbiased = replace(imu, w_b_radps=imu.w_b_radps - bias_b_radps)
    again = in_motion(unbiased, track, gravity_n_mps2)
    if again is None or not len(again.until_s):
        return first
    return replace(again, bias_b_radps=bias_b_radps, bias_sigma_radps=sigma_radps)


def levelled(f_u: FloatArray) -> FloatArray:
    """Return the R_nu, (3, 3), of heading zero by which a mean specific force, (3,), points up."""
    e_u = f_u / np.linalg.norm(f_u)
    return _between(e_u, _UP_U)


def specific_forces(
    integrated: "_Integrated",
    track: Track,
    span_s: float,
    gravity_n_mps2: FloatArray,
    first_s: float | None = None,
) -> Iterator[Pairs]:
    """Yield the pairs of velocities and of positions over spans between fixes about T apart."""
    row = _spaced(track.t_s, span_s, first_s)
    row = row[integrated.covers(track.t_s[row])]
    t_s = track.t_s[row]
    velocity_u, place_u = integrated.at(t_s)
    if track.v_n_mps is not None and len(row) > 1:
        dt = np.diff(t_s)[:, None]
        f_n = np.diff(track.v_n_mps[row], axis=0) / dt - gravity_n_mps2
        valid = _regular(t_s[:-1], t_s[1:], span_s) & np.isfinite(f_n).all(axis=1)
        yield Pairs(
            t_s[:-1][valid], t_s[1:][valid], f_n[valid], (np.diff(velocity_u, axis=0) / dt)[valid]
        )
    if len(row) > 2:
        f_n = _second_difference(t_s, track.p_n_m[row]) - gravity_n_mps2
        valid = _regular(t_s[:-2], t_s[2:], 2 * span_s) & np.isfinite(f_n).all(axis=1)
        f_u = _second_difference(t_s, place_u)
        yield Pairs(t_s[:-2][valid], t_s[2:][valid], f_n[valid], f_u[valid])


class _Window(NamedTuple):
    until_s: float
    begun_s: float
    middle_s: float
    R_nu: FloatArray
    sigma_rad: float


def _windows(pairs: Pairs, after_s: float) -> Iterator[_Window]:
    """Yield the windows whose heading is known, and that end after a time."""
    first = np.searchsorted(pairs.from_s, pairs.until_s - WINDOW_S)
    for last, begin in enumerate(first.tolist()):
        rows = slice(begin, last + 1)
        if last + 1 - begin < _FEWEST + 2 or pairs.until_s[last] <= after_s:
            continue
        f_n, f_u = pairs.f_n_mps2[rows], pairs.f_u_mps2[rows]
        t_s = (pairs.from_s[rows] + pairs.until_s[rows]) / 2
        heading = _heading(t_s, f_n, f_u)
        if heading is not None:
            R_nu, sigma_rad, size = heading
            share = np.cumsum(size) / size.sum()
            begun, middle = np.searchsorted(share, (_BEGUN, 0.5))
            yield _Window(
                float(pairs.until_s[last]),
                float(pairs.from_s[rows][begun]),
                float(t_s[middle]),
                R_nu,
                sigma_rad,
            )


def _heading(
    t_s: FloatArray, f_n: FloatArray, f_u: FloatArray
) -> tuple[FloatArray, float, FloatArray] | None:
    """Return R_nu, the sigma of its heading, and what each pair says of it, (m,), in proportion.

    None where the forces do not tell it.
    """
    mean_n, mean_u = f_n.mean(axis=0), f_u.mean(axis=0)
    if np.linalg.norm(mean_u) == 0 or np.linalg.norm(mean_n) == 0:
        return None
    line = np.stack([np.ones_like(t_s), t_s - t_s.mean()], axis=1)
    line /= np.linalg.norm(line, axis=0)
    alpha = _without_line(line, f_n[:, 0] + 1j * f_n[:, 1])
    count = len(t_s) - line.shape[1]
    R_nu = _turned(line, alpha, f_u, levelled(mean_u)) @ levelled(mean_u)
    R_nu = _between(R_nu @ mean_u / np.linalg.norm(mean_u), mean_n / np.linalg.norm(mean_n)) @ R_nu
    R_nu = _turned(line, alpha, f_u, R_nu) @ R_nu  # level is off by the mean force before
    beta = _horizontal(line, f_u, R_nu)
    size, scale = np.vdot(beta, beta).real, np.vdot(alpha, alpha).real
    if not size * scale > 0.0:
        return None
    product = abs(np.vdot(beta, alpha))
    coherence = min(float(product**2 / (size * scale)), 1.0 - 1e-9)
    sigma_rad = np.sqrt((1 - coherence) / (2 * coherence * count)) if coherence else np.inf
    is_known = sigma_rad < KNOWN_RAD and (1 - coherence) ** (count - 1) < _CHANCE
    if not is_known or not _GAIN[0] < product / size < _GAIN[1]:
        return None
    return R_nu, float(sigma_rad), np.abs(beta) ** 2


def _turned(line: FloatArray, alpha: ComplexArray, f_u: FloatArray, R_nu: FloatArray) -> FloatArray:
    """Return the turn about the vertical, (3, 3), that the regression asks for."""
    angle = np.angle(np.vdot(_horizontal(line, f_u, R_nu), alpha))
    return np.asarray(exp(np.array([[0.0, 0.0, angle]]))[0])


def _horizontal(line: FloatArray, f_u: FloatArray, R_nu: FloatArray) -> ComplexArray:
    """Return beta: north + i east of forces, (m,), less a straight line in time."""
    level = f_u @ R_nu.T
    return _without_line(line, level[:, 0] + 1j * level[:, 1])


def _without_line(line: FloatArray, values: ComplexArray) -> ComplexArray:
    return np.asarray(values - line @ (line.T @ values))


def _between(e_from: FloatArray, e_to: FloatArray) -> FloatArray:
    """Return the least rotation, (3, 3), that takes one unit vector, (3,), to another."""
    axis, cosine = np.cross(e_from, e_to), float(e_from @ e_to)
    sine = float(np.linalg.norm(axis))
    if sine < 1e-12:
        axis = np.cross(e_from, np.eye(3)[np.abs(e_from).argmin()])
        axis /= np.linalg.norm(axis)
        return np.asarray(exp((axis * (0.0 if cosine > 0 else np.pi))[None])[0])
    return np.asarray(exp((axis / sine * np.arctan2(sine, cosine))[None])[0])


def _gyroscope_bias(motion: InMotion) -> tuple[FloatArray, float]:
    """Return the bias, (3,), by which different windows turn against each other, and its sigma."""
    own, step_s = motion.own, np.diff(motion.own.t_s)[:, None, None]
    total = np.concatenate([np.zeros((1, 3, 3)), np.cumsum(own.R_ub[:-1] * step_s, axis=0)])
    at = total[np.searchsorted(own.t_s, motion.middle_s).clip(0, len(total) - 1)]
    order = np.argsort(motion.middle_s, kind="stable")
    row = order[_spaced(motion.middle_s[order], _BIAS_SPAN_S[0])]
    a, b = row[:-1], row[1:]
    near = motion.middle_s[b] - motion.middle_s[a] < _BIAS_SPAN_S[1]
    a, b = a[near], b[near]
    turned = log(transpose(motion.R_nu[a]) @ motion.R_nu[b])
    A = -(at[b] - at[a])
    weight = 1 / (motion.sigma_rad[a] ** 2 + motion.sigma_rad[b] ** 2)
    H = np.einsum("nji,njk,n->ik", A, A, weight) + np.eye(3) / motion.bias_sigma_radps**2
    bias_b_radps = np.linalg.solve(H, np.einsum("nji,nj,n->i", A, turned, weight))
    return bias_b_radps, float(np.sqrt(np.linalg.eigvalsh(np.linalg.inv(H))[-1]))


class _Integrated:
    """Velocity and place of an antenna in ``u`` that specific force alone adds up to."""

    def __init__(self, imu: Imu, own: OwnRotation, arm_b_m: FloatArray) -> None:
        self._own, self._arm_b_m, self._t_s = own, arm_b_m, imu.t_s
        dt = np.diff(imu.t_s)[:, None]
        self._f_u = np.einsum("nij,nj->ni", own.R_ub, imu.f_b_mps2)
        steps = (self._f_u[1:] + self._f_u[:-1]) / 2 * dt
        self._v_u = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        steps = self._v_u[:-1] * dt + (2 * self._f_u[:-1] + self._f_u[1:]) / 6 * dt**2
        self._p_u = np.vstack([np.zeros(3), np.cumsum(steps, axis=0)])
        self._gaps = np.concatenate([[0], np.cumsum(dt[:, 0] > LONGEST_GAP_S)])

    def covers(self, t_s: FloatArray) -> BoolArray:
        """Return which times, (n,), are in the record before its first gap, or between gaps."""
        row = np.searchsorted(self._t_s, t_s, side="right") - 1
        late_s = t_s - self._t_s[row.clip(0)]
        return np.asarray((row >= 0) & (late_s <= LONGEST_GAP_S))

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return velocity and place, (n, 3), by samples up to each time, the last one held."""
        row = (np.searchsorted(self._t_s, t_s, side="right") - 1).clip(0)
        since_s = (t_s - self._t_s[row])[:, None]
        f_u, R_ub = self._f_u[row], self._own.at(t_s)
        swing_b = np.cross(self._own.w_b_radps[row], self._arm_b_m)
        v_u = self._v_u[row] + f_u * since_s + np.einsum("nij,nj->ni", R_ub, swing_b)
        p_u = self._p_u[row] + self._v_u[row] * since_s + f_u * since_s**2 / 2
        return v_u, p_u + R_ub @ self._arm_b_m


def _spaced(t_s: FloatArray, span_s: float, first_s: float | None = None) -> IntArray:
    """Return rows of times, (n,), that are about a span apart: the first within each.

    Spans are counted from the first time, or an earlier one.
    """
    number = np.floor((t_s - (t_s[0] if first_s is None else first_s)) / span_s + 1e-6)
    return np.flatnonzero(np.append(True, np.diff(number) > 0))


def _regular(from_s: FloatArray, until_s: FloatArray, span_s: float) -> BoolArray:
    return np.asarray((until_s - from_s > span_s / 2) & (until_s - from_s < 2 * span_s))


def _second_difference(t_s: FloatArray, values: FloatArray) -> FloatArray:
    slopes = np.diff(values, axis=0) / np.diff(t_s)[:, None]
    return np.asarray(2 * np.diff(slopes, axis=0) / (t_s[2:] - t_s[:-2])[:, None])
