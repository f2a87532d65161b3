"""Axes of accelerometer and gyroscope, and units of rates, against a track.

Of 48 ways to exchange and reverse the accelerometer's axes, both hands and three units of the
gyroscope, all are ranked by the rotation of each window that is best in closed form (Wahba's
problem); the best are fitted with biases, and one is named if its squares are significantly smaller
than those of the samples as given. A rotation of both sensors is no error here, unless attitudes
are known.
"""

from itertools import permutations, product

import numpy as np

from fgnav.checks import FloatArray
from fgnav.diagnostics.array import MIN_EPOCHS, ArrayAttitudes
from fgnav.diagnostics.contents import SAMPLES, Finding
from fgnav.diagnostics.track import (
    Motion,
    WindowValues,
    covered,
    most_curved,
    prior,
    rotation_and_rates,
)
from fgnav.diagnostics.windows import fitted, is_better
from fgnav.geometry.interpolation import corrected_integral, integral, interpolate
from fgnav.types.flight import Imu

_FITTED = 24  # hypotheses
_BETTER = 0.5  # share of the squares that another set-up of the gyroscope leaves at most
_RATIO = 1.5  # of squares, at least: less may be a bias of the gyroscope


def signed_permutations() -> FloatArray:
    """Return all ways to exchange and reverse three axes, (48, 3, 3), identity first."""
    ways = np.zeros((48, 3, 3))
    for k, (order, signs) in enumerate(product(permutations(range(3)), product((1, -1), repeat=3))):
        ways[k, range(3), order] = signs
    return ways


def named_axes(axes: FloatArray, names: tuple[str, str, str] = ("x", "y", "z")) -> str:
    """Return the names of the axes that a signed permutation reads."""
    return ", ".join(
        f"{'-' if axis.sum() < 0 else ''}{names[np.abs(axis).argmax()]}" for axis in axes
    )


def axes_finding(motion: Motion, offset_s: float) -> Finding | None:
    """Return axes and units that explain a track significantly better than the given ones.

    Beside an array's attitudes only the accelerometer is tested. ``offset_s``: to add to inertial
    timestamps.
    """
    imu, attitudes, series = motion.imu_at(offset_s), motion.attitudes, motion.series[-1]
    aligned = attitudes is not None
    if attitudes is not None:
        imu = imu[(imu.t_s >= attitudes.t_s[0]) & (imu.t_s <= attitudes.t_s[-1])]
    windows = most_curved(series, covered(series, imu.t_s))
    if not len(windows):
        return None
    values, hypotheses = WindowValues(series, windows), []
    for rate in [1.0] if aligned else _rates(imu):
        inner = values.resampled(imu.t_s, _integrals(motion, imu, rate))
        levels = _levels(values, inner, aligned=aligned)
        both = zip(levels, signed_permutations(), strict=True)
        hypotheses += [(level, rate, axes, inner) for level, axes in both]
    ranked = sorted(range(len(hypotheses)), key=lambda k: hypotheses[k][0])[:_FITTED]
    ridge, fits = prior(imu, series.order, aligned=aligned)[:-3], []
    for _, rate, axes, inner in (hypotheses[k] for k in dict.fromkeys([0, *ranked])):
        moved, by_bias = inner[..., :9] @ axes.ravel() + inner[..., 12], -inner[..., 9:12]
        _, y, local = values.solved(moved, [by_bias], ridge, aligned=aligned)
        squares = fitted(y, local, np.zeros((*y.shape, 0)), ridge).squares
        fits.append((squares, _changes(rate, axes), rate, axes))
    best = min(fits, key=lambda fit: _level(fit[0]))
    if best is fits[0] or not is_better(fits[0][0], best[0], len(hypotheses)):
        return None
    equal = [fit for fit in fits[1:] if not is_better(fit[0], best[0])]
    squares, _, rate, axes = min(equal, key=lambda fit: (fit[1], _level(fit[0])))
    ratio = float(np.exp(_level(fits[0][0]) - _level(squares)))
    return _finding(rate, axes, imu, ratio) if ratio > _RATIO else None


def gyroscope_finding(imu: Imu, array: ArrayAttitudes) -> Finding | None:
    """Return unit or axes by which the gyroscope's rotations fit those of the array."""
    t_s, rate_hz = array.t_s, 1.0 / float(np.median(np.diff(imu.t_s)))
    covered = (t_s[:-1] >= imu.t_s[0]) & (t_s[1:] <= imu.t_s[-1])
    if imu.w_b_radps is None or covered.sum() < MIN_EPOCHS:
        return None
    angles = interpolate(t_s, imu.t_s, integral(imu.t_s, imu.w_b_radps))
    by_gyro, by_array = np.diff(angles, axis=0)[covered], array.rotations()[covered]
    units = {"": 1.0, "in degrees per second": np.pi / 180, "increments": rate_hz}
    left = {
        (unit, k): float(((by_array - factor * by_gyro @ M.T) ** 2).sum())
        for unit, factor in units.items()
        for k, M in enumerate(signed_permutations())
    }
    (unit, k), best = min(left.items(), key=lambda item: item[1])
    if (unit, k) == ("", 0) or best > _BETTER * left["", 0]:
        return None
    names = named_axes(signed_permutations()[k], ("wx", "wy", "wz"))
    text = (
        f"{f'rates are {unit}' if unit else 'axes are exchanged or reversed'}: squares beside the "
        f"array's rotations are {left['', 0] / max(best, 1e-300):.3g} times larger"
    )
    mend = f"multiply by {units[unit]:.6g}" if unit else f"wx, wy, wz should read {names}"
    return Finding(f"gyroscope {'unit' if unit else 'axes'}", text, mend, SAMPLES, certain=True)


def _rates(imu: Imu) -> list[float]:
    """Return factors of rates to try: unit and hand, below half a turn from sample to sample."""
    if imu.w_b_radps is None:
        return []
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    usual = float(np.quantile(np.linalg.norm(imu.w_b_radps, axis=1), 0.9)) / rate_hz
    factors = [1.0, *(x for x in (np.pi / 180, rate_hz) if x * usual < np.pi)]
    return [sign * x for x in factors for sign in (1.0, -1.0)]


def _integrals(motion: Motion, imu: Imu, rate: float) -> FloatArray:
    """Return integrals, (m, 3, 13): of each force along each axis, of R_sb, and the arm's swing."""
    R_sb, w_b = rotation_and_rates(imu, motion.attitudes, rate)
    force = R_sb[..., None] * imu.f_b_mps2[:, None, None]  # (m, 3, axis, component)
    parts = np.concatenate([force.reshape(len(R_sb), 3, 9), R_sb], axis=2)
    for _ in range(motion.series[-1].order):
        parts = corrected_integral(imu.t_s, parts)
    lever_b = np.cross(w_b, motion.arm_b_m)
    if motion.series[-1].order == 2:
        lever_b = np.broadcast_to(motion.arm_b_m, w_b.shape)
    return np.concatenate([parts, R_sb @ lever_b[..., None]], axis=2)


def _levels(values: WindowValues, inner: FloatArray, *, aligned: bool) -> list[float]:
    """Return mean log squares left by the best rotation of each window, for all 48 axes."""
    weight = values.white.mean(axis=2, keepdims=True)
    y, X, levels = weight * values.value, weight[..., None] * inner, []
    of_y = (y**2).sum(axis=(1, 2))
    gram, cross = np.einsum("wnip,wniq->wpq", X, X), np.einsum("wni,wnjp->wijp", y, X)
    for axes in signed_permutations():
        read = np.concatenate([axes.ravel(), [0.0, 0.0, 0.0, 1.0]])
        U, sizes, Vt = np.linalg.svd(cross @ read)
        sizes[:, 2] *= np.linalg.det(U @ Vt)
        gain = np.trace(cross @ read, axis1=1, axis2=2) if aligned else sizes.sum(axis=1)
        levels.append(_level(of_y - 2 * gain + np.einsum("p,wpq,q->w", read, gram, read)))
    return levels


def _level(squares: FloatArray) -> float:
    return float(np.log(np.maximum(squares, 1e-12)).mean())


def _of_rates(rate: float, axes: FloatArray) -> FloatArray:
    """Return the gyroscope's axes, (3, 3), if it is to blame."""
    return np.asarray(np.sign(rate) * axes.T)


def _changes(rate: float, axes: FloatArray) -> int:
    """Return the number of axes and units to change."""
    count = int((np.diag(axes) < 1).sum())
    if rate < 0:
        is_gyroscope = np.linalg.det(axes) > 0
        count = int((np.diag(_of_rates(rate, axes)) < 1).sum()) if is_gyroscope else count + 3
    return count + (abs(rate) != 1.0)


def _finding(rate: float, axes: FloatArray, imu: Imu, ratio: float) -> Finding:
    """Return the finding: the sensor of the other hand is to blame, or either."""
    rate_hz = 1.0 / float(np.median(np.diff(imu.t_s)))
    mends, parts, is_proper = [], [], np.linalg.det(axes) > 0
    if abs(rate) != 1.0:
        is_increment = np.isclose(abs(rate), rate_hz)
        parts.append(f"rates are {'increments' if is_increment else 'in degrees per second'}")
        mends.append(f"multiply them by {abs(rate):.6g}")
    if (axes != np.eye(3)).any() or rate < 0:
        parts.append("axes of accelerometer and body or gyroscope are not the same")
        forces = f"fx, fy, fz should read {named_axes(axes, ('fx', 'fy', 'fz'))}"
        names = named_axes(_of_rates(rate, axes), ("wx", "wy", "wz"))
        rates = f"wx, wy, wz should read {names}"
        if rate < 0:
            mends.append(rates if is_proper else f"{forces} and wx, wy, wz be reversed")
        else:
            is_either = is_proper and imu.w_b_radps is not None
            mends.append(f"{forces}, or {rates}" if is_either else forces)
    name = "imu axes" if "axes" in parts[-1] else "imu unit"
    text = f"{' and '.join(parts)}: residual squares of the track are {ratio:.3g} times larger"
    return Finding(name, text, "; ".join(mends), SAMPLES, certain=True)
