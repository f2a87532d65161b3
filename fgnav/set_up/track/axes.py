"""Units and axes of accelerometer and gyroscope against each other, and against a track.

A rotation that both share is no error here, since every window has its own. What remains are six
ways of the gyroscope, three units and both hands, and three times 48 of the accelerometer.
"""

from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp, nearest, skew
from fgnav.identification.track.integrals import rotated, sampled, summed
from fgnav.identification.track.motion import BIASES, Series, detrended, solved, starts, telling
from fgnav.identification.track.windows import (
    Fitted,
    Windows,
    explains_more,
    fitted,
    least_from,
)
from fgnav.types.flight import Imu

G_MPS2 = 9.80665  # exact, the unit g


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Reading:
    """How samples are to be read: factors of units, and axes."""

    # force, rate: by which samples are to be multiplied; a negative rate is of the other hand
    force: float
    rate: float
    axes: FloatArray  # (3, 3); signed permutation of the accelerometer's axes to the gyroscope's
    from_s: float = -np.inf  # later than the begin of the record where axes change within it

    @property
    def as_is(self) -> bool:
        """Whether nothing is to be changed."""
        return self.force == 1.0 and self.rate == 1.0 and bool((self.axes == np.eye(3)).all())

    @property
    def axes_of_rates(self) -> FloatArray:
        """How the gyroscope's axes are to be read where it is to blame, (3, 3)."""
        return np.asarray(np.sign(self.rate) * self.axes.T)

    @property
    def gyroscope_mirrored(self) -> bool:
        """Whether the gyroscope alone is of the other hand."""
        return self.rate < 0 and bool(np.linalg.det(self.axes) > 0)

    @property
    def changes(self) -> int:
        """How many axes and units are to be changed."""
        axes = int((np.diag(self.axes) < 1).sum())
        if self.rate < 0:
            rates = int((np.diag(self.axes_of_rates) < 1).sum())
            axes = rates if self.gyroscope_mirrored else axes + 3
        return axes + (self.force != 1.0) + (abs(self.rate) != 1.0)


def signed_permutations() -> FloatArray:
    """Return all ways to exchange and reverse three axes, (48, 3, 3), none first."""
    ways = np.zeros((48, 3, 3))
    for k, (order, signs) in enumerate(product(permutations(range(3)), product((1, -1), repeat=3))):
        ways[k, range(3), order] = signs
    return ways


def best_reading(
    series: Series, imu: Imu, late_s: tuple[float, ...], arm_b_m: FloatArray
) -> Reading | None:
    """Return how samples should be read, where that is nearer to the track than as they are.

    Parameters
    ----------
    late_s : tuple of float
        Clocks to try; samples as they are may have the best of them.
    arm_b_m : ndarray, shape (3,)
        From the unit to the antenna.
    """
    windows = telling(series, imu.t_s, late_s)
    if imu.w_b_radps is None or not len(windows):
        return None
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    size = float(np.median(np.linalg.norm(imu.f_b_mps2, axis=1)))
    forces = {1.0, min((1.0, G_MPS2, rate_hz), key=lambda s: abs(np.log(s * size / G_MPS2)))}
    track, tried = _Track.of(series, windows, imu), []
    for rate in (1.0, -1.0, np.pi / 180, -np.pi / 180, rate_hz, -rate_hz):
        turns = abs(rate) / rate_hz * np.linalg.norm(imu.w_b_radps, axis=1)
        if rate != 1.0 and np.quantile(turns, 0.9) > np.pi:
            continue  # more than half a turn from sample to sample
        sums = _turned_forces(series, windows, imu, rate, late_s, arm_b_m)
        for force, axes, late in product(forces, signed_permutations(), late_s):
            here = track.fit(sums[late], force * axes)
            tried.append((_level(here), Reading(force=force, rate=rate, axes=axes), here))
    tried.sort(key=lambda one: one[0])
    best, stated = tried[0], next(one for one in tried if one[1].as_is)
    if best[1].as_is or not explains_more(stated[2], best[2], len(tried)):
        return _from_then_on(stated, tried, series.t_s[windows.row[:, 0]])
    return _least_changed(best, tried)


_Tried = tuple[float, Reading, Fitted]


def _from_then_on(stated: _Tried, tried: list[_Tried], begin_s: FloatArray) -> Reading | None:
    """Return how samples should be read from some window on, where they are right before it."""
    likeliest = least_from(stated[2], [one[2] for one in tried])
    if likeliest is None or likeliest[1] == 0:
        return None
    best, first = likeliest
    if tried[best][1].as_is:
        return None
    parts = [(*one[:2], replace(one[2], squares=one[2].squares[first:])) for one in tried]
    return replace(_least_changed(parts[best], parts), from_s=float(begin_s[first]))


def _least_changed(best: _Tried, tried: list[_Tried]) -> Reading:
    """Return, of all readings that fit as well, the least change: what motion leaves open stays."""
    equal = [one for one in tried if not explains_more(one[2], best[2])]
    return min(equal, key=lambda one: (one[1].changes, one[0]))[1]


def _level(here: Fitted) -> float:
    return float(np.log(here.squares + 1e-12).mean())


def _turned_forces(
    series: Series,
    windows: Windows,
    imu: Imu,
    rate: float,
    late_s: tuple[float, ...],
    arm_b_m: FloatArray,
) -> dict[float, FloatArray]:
    """Return integrals at windows, (W, n, 3, 13), by clock.

    Of each force along each axis, of the rotation (what a bias adds), and the antenna's swing.
    """
    w_b = rate * (np.zeros_like(imu.f_b_mps2) if imu.w_b_radps is None else imu.w_b_radps)
    R_sb = rotated(imu.t_s, w_b)
    force = R_sb[..., None] * imu.f_b_mps2[:, None, None]  # (m, 3, axis, component)
    parts = np.concatenate([force.reshape(len(R_sb), 3, 9), R_sb], axis=2)
    for _ in range(series.order):
        parts = summed(imu.t_s, parts)
    swing_b = np.cross(w_b, arm_b_m) if series.order == 1 else np.broadcast_to(arm_b_m, w_b.shape)
    parts = np.concatenate([parts, R_sb @ swing_b[..., None]], axis=2)
    out = {}
    for late in late_s:
        at_s = series.t_s[windows.row] - late
        inner = sampled(imu.t_s, parts, at_s.ravel()).reshape(*at_s.shape, 3, 13)
        out[late] = detrended(windows, series.t_s, inner, series.order)
    return out


@dataclass(frozen=True, eq=False, slots=True)
class _Track:
    """What each window of a track is, whatever the reading of the samples."""

    value: FloatArray  # (W, n, 3); less its mean, or line
    white: FloatArray  # (W, n, 3); one over the 1-sigmas; zero outside of the window
    start: list[FloatArray]  # (W, n, 3, 3); derivatives by where it begins
    ridge: FloatArray

    @classmethod
    def of(cls, series: Series, windows: Windows, imu: Imu) -> "_Track":
        value = detrended(windows, series.t_s, series.value[windows.row], series.order)
        white = np.where(windows.inside[..., None], 1.0 / series.sigma[windows.row], 0.0)
        ridge = np.zeros(3 * series.order + 6)
        ridge[-3:] = (BIASES * imu.accelerometer_bias_mps2) ** -2
        return cls(value, white, starts(series, windows), ridge)

    def fit(self, sums: FloatArray, matrix: FloatArray) -> Fitted:
        """Fit each window's start, rotation and bias of the accelerometer; nothing is common."""
        W, n, _ = self.value.shape
        force = sums[..., :9] @ matrix.ravel() + sums[..., 12]
        R_ns = nearest(np.einsum("wni,wnj->wij", self.white**2 * self.value, force))

        def system(R_ns: FloatArray) -> tuple[FloatArray, FloatArray]:
            left = self.value - np.einsum("wij,wnj->wni", R_ns, force)
            lean = -R_ns[:, None] @ skew(force.reshape(-1, 3)).reshape(W, n, 3, 3)
            local = np.concatenate([*self.start, lean, -R_ns[:, None] @ sums[..., 9:12]], axis=3)
            whitened = (self.white[..., None] * local).reshape(W, 3 * n, -1)
            return (self.white * left).reshape(W, -1), whitened

        # Linear about there twice: the first rotation has the bias in it.
        y, local = system(R_ns)
        y, local = system(R_ns @ exp(solved(local, y, self.ridge)[:, -6:-3]))
        return fitted(y, local, np.zeros((W, 3 * n, 0)), self.ridge)


def named_axes(axes: FloatArray, names: tuple[str, str, str] = ("x", "y", "z")) -> str:
    """Return in words which axes a signed permutation reads."""
    return ", ".join(f"{'-' if row.sum() < 0 else ''}{names[np.abs(row).argmax()]}" for row in axes)
