"""Axes of accelerometer and gyroscope, and units of rates, against a track.

Of 48 ways to exchange and reverse the accelerometer's axes, both hands and three units of the
gyroscope, all are ranked by the rotation of each window that is best in closed form (Wahba's
problem); the best are fitted with biases, and one is named if its squares are significantly smaller
than those of the samples as given. A rotation of both sensors is no error here, unless attitudes
are known.
"""

from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from fgnav.checks import FloatArray
from fgnav.diagnostics.contents import Finding
from fgnav.diagnostics.track import (
    Attitudes,
    Motion,
    Series,
    WindowValues,
    covered,
    most_curved,
    prior,
    rotated,
    solved,
    summed,
)
from fgnav.diagnostics.windows import fitted, is_better
from fgnav.geometry.rotations import exp
from fgnav.types.flight import Imu

_FITTED = 24  # hypotheses


@dataclass(frozen=True, eq=False, slots=True)
class Reading:
    """Factor of the rates, negative for the other hand, and axes of the accelerometer, (3, 3)."""

    rate: float
    axes: FloatArray  # signed permutation

    @property
    def axes_of_rates(self) -> FloatArray:
        """Axes of the gyroscope if it is to blame, (3, 3)."""
        return np.asarray(np.sign(self.rate) * self.axes.T)

    @property
    def gyroscope_mirrored(self) -> bool:
        """Whether the gyroscope alone is of the other hand."""
        return self.rate < 0 and bool(np.linalg.det(self.axes) > 0)

    @property
    def changes(self) -> int:
        """Number of axes and units to change."""
        axes = int((np.diag(self.axes) < 1).sum())
        if self.rate < 0:
            rates = int((np.diag(self.axes_of_rates) < 1).sum())
            axes = rates if self.gyroscope_mirrored else axes + 3
        return axes + (abs(self.rate) != 1.0)


def signed_permutations() -> FloatArray:
    """Return all ways to exchange and reverse three axes, (48, 3, 3), identity first."""
    ways = np.zeros((48, 3, 3))
    for k, (order, signs) in enumerate(product(permutations(range(3)), product((1, -1), repeat=3))):
        ways[k, range(3), order] = signs
    return ways


def named_axes(axes: FloatArray, names: tuple[str, str, str] = ("x", "y", "z")) -> str:
    """Return the names of the axes that a signed permutation reads."""
    return ", ".join(f"{'-' if row.sum() < 0 else ''}{names[np.abs(row).argmax()]}" for row in axes)


def axes_finding(motion: Motion, offset_s: float) -> Finding | None:
    """Return axes and units that explain a track significantly better than the given ones.

    Beside an array's attitudes only the accelerometer is tested. ``offset_s``: to add to inertial
    timestamps.
    """
    imu, attitudes, arm_b_m = motion.imu_at(offset_s), motion.attitudes, motion.arm_b_m
    series = motion.series[-1]
    if attitudes is not None:
        imu = imu[(imu.t_s >= attitudes.t_s[0]) & (imu.t_s <= attitudes.t_s[-1])]
    windows = most_curved(series, covered(series, imu.t_s)) if len(imu.t_s) > 1 else None
    if not windows:
        return None
    values, at_s = WindowValues.of(series, windows), series.t_s[windows.row]
    hypotheses = []
    for rate in (1.0,) if attitudes is not None else _rates(imu):
        inner = values.resampled(imu.t_s, _integrals(series, imu, rate, arm_b_m, attitudes), at_s)
        levels = _levels(values, inner, known=attitudes is not None)
        hypotheses += [
            (level, Reading(rate, axes), inner)
            for level, axes in zip(levels, signed_permutations(), strict=True)
        ]
    given = hypotheses[0]
    ranked = sorted(hypotheses, key=lambda one: one[0])[:_FITTED]
    ridge = prior(imu, series.order, known=attitudes is not None)[:-3]
    fits = [
        (_squares(values, inner, reading.axes, ridge, known=attitudes is not None), reading)
        for _, reading, inner in [given, *(one for one in ranked if one is not given)]
    ]
    best = min(fits, key=lambda one: _level(one[0]))
    if best is fits[0] or not is_better(fits[0][0], best[0], len(hypotheses)):
        return None
    equal = [one for one in fits[1:] if not is_better(one[0], best[0])]
    squares, reading = min(equal, key=lambda one: (one[1].changes, _level(one[0])))
    return _finding(reading, imu, float(np.exp(_level(fits[0][0]) - _level(squares))))


def _rates(imu: Imu) -> list[float]:
    """Return factors of rates to try: unit and hand, below half a turn from sample to sample."""
    if imu.w_b_radps is None:
        return []
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    usual = float(np.quantile(np.linalg.norm(imu.w_b_radps, axis=1), 0.9)) / rate_hz
    factors = [1.0, *(x for x in (np.pi / 180, rate_hz) if x * usual < np.pi)]
    return [sign * x for x in factors for sign in (1.0, -1.0)]


def _integrals(
    series: Series, imu: Imu, rate: float, arm_b_m: FloatArray, attitudes: Attitudes | None
) -> FloatArray:
    """Return integrals, (m, 3, 13): of each force along each axis, of R_sb, and the arm's swing."""
    w_b = rate * (np.zeros_like(imu.f_b_mps2) if imu.w_b_radps is None else imu.w_b_radps)
    R_sb, rates = (rotated(imu.t_s, w_b), w_b) if attitudes is None else attitudes.at(imu.t_s)
    w_b = rates if imu.w_b_radps is None else w_b
    force = R_sb[..., None] * imu.f_b_mps2[:, None, None]  # (m, 3, axis, component)
    parts = np.concatenate([force.reshape(len(R_sb), 3, 9), R_sb], axis=2)
    for _ in range(series.order):
        parts = summed(imu.t_s, parts)
    swing_b = np.cross(w_b, arm_b_m) if series.order == 1 else np.broadcast_to(arm_b_m, w_b.shape)
    return np.concatenate([parts, R_sb @ swing_b[..., None]], axis=2)


def _levels(values: WindowValues, inner: FloatArray, *, known: bool) -> FloatArray:
    """Return mean log squares left by the best rotation of each window, for all axes, (48,)."""
    weight = values.white.mean(axis=2, keepdims=True)
    y, X = weight * values.value, weight[..., None] * inner
    of_y = (y**2).sum(axis=(1, 2))
    gram, cross = np.einsum("wnip,wniq->wpq", X, X), np.einsum("wni,wnjp->wijp", y, X)
    levels = []
    for axes in signed_permutations():
        read = np.concatenate([axes.ravel(), np.zeros(3), np.ones(1)])
        product_ = cross @ read
        if known:
            gain = np.trace(product_, axis1=1, axis2=2)
        else:
            U, sizes, Vt = np.linalg.svd(product_)
            sizes[:, 2] *= np.linalg.det(U @ Vt)
            gain = sizes.sum(axis=1)
        levels.append(_level(of_y - 2 * gain + np.einsum("p,wpq,q->w", read, gram, read)))
    return np.array(levels)


def _squares(
    values: WindowValues, inner: FloatArray, axes: FloatArray, ridge: FloatArray, *, known: bool
) -> FloatArray:
    """Return squares left, (W,), by each window's start, rotation and accelerometer bias."""
    moved = inner[..., :9] @ axes.ravel() + inner[..., 12]
    R_ns = values.rotation(moved, known=known)
    y, local = values.system(R_ns, moved, [-inner[..., 9:12]])
    if not known:  # the first rotation has the bias in it
        R_ns = R_ns @ exp(solved(local, y, ridge)[:, -6:-3])
        y, local = values.system(R_ns, moved, [-inner[..., 9:12]])
    return fitted(y, local, np.zeros((*y.shape, 0)), ridge).squares


def _level(squares: FloatArray) -> float:
    return float(np.log(np.maximum(squares, 1e-12)).mean())


def _finding(reading: Reading, imu: Imu, ratio: float) -> Finding:
    """Return the finding: the sensor of the other hand is to blame, or either."""
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    mends, parts = [], []
    if abs(reading.rate) != 1.0:
        unit = "increments" if np.isclose(abs(reading.rate), rate_hz) else "in degrees per second"
        parts.append(f"rates are {unit}")
        mends.append(f"multiply them by {abs(reading.rate):.6g}")
    if (reading.axes != np.eye(3)).any() or reading.rate < 0:
        parts.append("axes of accelerometer and body or gyroscope are not the same")
        forces = f"fx, fy, fz should read {named_axes(reading.axes, ('fx', 'fy', 'fz'))}"
        names = named_axes(reading.axes_of_rates, ("wx", "wy", "wz"))
        rates = f"wx, wy, wz should read {names}"
        if reading.gyroscope_mirrored:
            mends.append(rates)
        elif reading.rate < 0:
            mends.append(f"{forces} and wx, wy, wz be reversed")
        else:
            is_proper = np.linalg.det(reading.axes) > 0 and imu.w_b_radps is not None
            mends.append(f"{forces}, or {rates}" if is_proper else forces)
    return Finding(
        name="imu axes" if "axes" in parts[-1] else "imu unit",
        where="[imu] samples, fx_mps2 to wz_radps",
        text=f"{' and '.join(parts)}: residual squares of the track are {ratio:.3g} times larger",
        mend="; ".join(mends),
        certain=True,
    )
