"""In-motion alignment: attitude of a flight with a gyroscope, before any smoothing.

Specific forces of two frames (``force_pairs``), ``alpha = R_nu beta``, tell how one is turned.
Level comes from the mean over a window. Heading is the phase of the complex regression of alpha's
horizontal part on beta's, each less a straight line in time, which takes out tilt, bias of the
accelerometer and drift of the gyroscope. Neither needs a noise: with N pairs and a squared
coherence C the heading's variance is (1 - C) / (2 C N), and chance alone exceeds C with the
probability (1 - C)^N [1]_.

References
----------
.. [1] Carter: Coherence and time delay estimation, Proceedings of the IEEE 75(2), 1987.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from fgnav.attitude.flight_vectors import Track
from fgnav.attitude.own_rotation import OwnRotation, own_rotation
from fgnav.checks import FloatArray, IntArray
from fgnav.frontend.attitude.force_pairs import Integrated, Pairs, specific_forces
from fgnav.frontend.attitude.gyroscope_bias import gyroscope_bias
from fgnav.geometry.rotations import exp
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

ComplexArray: TypeAlias = NDArray[np.complexfloating[Any]]


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
    integrated = Integrated(imu, own, track.arm_b_m - imu.position_b_m)
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
    """Return the same, the gyroscope's bias taken out where headings get surer by it."""
    first = in_motion(imu, track, gravity_n_mps2)
    if first is None or imu.w_b_radps is None or len(first.until_s) < 2:
        return first
    best = int(np.argmin(first.sigma_rad))
    middle_s = float(first.middle_s[best])
    R_nb = first.R_nu[best] @ first.own.at(np.array([middle_s]))[0]
    half_s = min(float(first.until_s[best]) - middle_s, middle_s - float(first.begun_s[best]))
    bias = gyroscope_bias(imu, track, gravity_n_mps2, R_nb, (middle_s - half_s, middle_s + half_s))
    if bias is None:
        return first
    unbiased = replace(imu, w_b_radps=imu.w_b_radps - bias.bias_b_radps)
    again = in_motion(unbiased, track, gravity_n_mps2)
    if again is None or not _surer(again, first):
        return first
    return replace(again, bias_b_radps=bias.bias_b_radps, bias_sigma_radps=bias.sigma_radps)


def _surer(motion: InMotion, other: InMotion) -> bool:
    """Return whether headings are known better than others, all together."""
    return float(np.sum(motion.sigma_rad**-2)) > float(np.sum(other.sigma_rad**-2))


def levelled(f_u: FloatArray) -> FloatArray:
    """Return the R_nu, (3, 3), of heading zero by which a mean specific force, (3,), points up."""
    e_u = f_u / np.linalg.norm(f_u)
    return _between(e_u, _UP_U)


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
