"""Clock offset of the IMU: a search within 20 s by course and by specific force, then a fit.

Each search compares, window by window, the residual squares of all offsets. The offset with the
least mean log square is determined if every other one outside its valley is rejected by Student's t
of the log ratios over windows (level 1e-3), and given timestamps are wrong if zero is rejected at
``FALSE_ALARM`` over all offsets tried (Bonferroni). Course: a vehicle that travels nose first turns
with its course, so that the gyroscope's vertical rate, integrated, is the course but for a constant
of each window and one bias. Specific force: rotated by the gyroscope and integrated, it is the
velocity, or once more the position, but for a matrix of each window.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import fdtri, stdtrit

from fgnav.checks import BoolArray, FloatArray
from fgnav.diagnostics.track import (
    ARM,
    OFFSET,
    Attitudes,
    Integrals,
    Motion,
    Series,
    covered,
    detrended,
    fit,
    most_curved,
    sampled,
    summed,
    velocities,
)
from fgnav.diagnostics.windows import (
    MIN_WINDOWS,
    Windows,
    fitted,
    is_better,
    windows_of,
)
from fgnav.geometry.interpolation import integral
from fgnav.types.flight import Fixes, Imu

STEP_S = 0.1  # of the search: a motion of a hertz has a valley of a tenth
COARSE_S = 0.5  # an offset beyond it is another clock; less is a delay of the recorder
_OFFSETS_S = np.round(np.arange(-200, 201) * STEP_S, 6)  # leap seconds lie within
_COVERED = 0.25  # share of windows within the record at an offset that is tried
_VALLEY_S = 2.0  # a wider one has no minimum to speak of
_NEAR_TESTS = 10  # offsets within half a second
_EXCLUDED = 1e-3  # level at which an offset is rejected beside the best
_COURSES = 24  # windows of a record, of 4 to 20 s
_NOSE_FIRST = 5.0  # speed over its sigma from which course is a direction
_APART_S = 1.0  # between offsets that are not one valley
_STEPS = 12  # of Gauss-Newton at most
_STILL_S = 1e-4


class Search(NamedTuple):
    """Clock offset that a search found best, to add to inertial timestamps.

    Attributes
    ----------
    by : str
    offset_s, sigma_s : float
        Sigma: infinite if unknown.
    is_better : bool
        Whether the given timestamps are rejected beside it.
    is_unique : bool
        Whether all offsets outside its valley are.
    runner_up_s : float
        The best other minimum more than a second from it.
    ratio, runner_up_ratio : float
        Residual squares of the given timestamps, and of the runner-up, over those of the offset:
        geometric means over windows.
    """

    by: str
    offset_s: float
    sigma_s: float
    is_better: bool
    is_unique: bool
    runner_up_s: float
    ratio: float
    runner_up_ratio: float

    @property
    def is_conclusive(self) -> bool:
        """Whether zero and all other offsets are rejected, and it is another clock."""
        return self.is_better and self.is_unique and abs(self.offset_s) > COARSE_S

    def __str__(self) -> str:
        """Return the evidence."""
        return (
            f"(± {self.sigma_s:.3f} s, by {self.by}; residual squares {self.ratio:.3g} times "
            f"smaller, runner-up {-self.runner_up_s:+.1f} s {self.runner_up_ratio:.3g} times "
            "larger)"
        )


class Clock(NamedTuple):
    """Offset to add to inertial timestamps, and the lever arm that goes with it.

    ``bound_s`` is exceeded by chance with probability ``FALSE_ALARM``; infinite where the motion
    does not determine the offset. ``arm_freedom``: of Student's t.
    """

    offset_s: float
    sigma_s: float
    bound_s: float
    arm_b_m: FloatArray
    arm_covariance_m2: FloatArray
    arm_freedom: float
    windows: Windows
    R_ns: FloatArray  # (W, 3, 3)


def coarse_offset(searches: Sequence[Search | None]) -> Search | None:
    """Return a conclusive search that no other one, unique as well, contradicts; else None."""
    found = [one for one in searches if one is not None and one.is_unique]
    if any(abs(one.offset_s - other.offset_s) > _APART_S for one in found for other in found):
        return None
    return min(
        (one for one in found if one.is_conclusive), key=lambda one: one.sigma_s, default=None
    )


def clock_searches(motion: Motion, integrals_at: Callable[[float], Integrals]) -> list[Search]:
    """Return the results of all searches that the sensors permit."""
    imu, attitudes, series = motion.imu, motion.attitudes, motion.series[-1]
    if attitudes is not None:
        step = max(1, round(0.04 / float(np.median(np.diff(imu.t_s)))))  # 25 Hz are enough
        return [s for s in (_by_force_beside(series, imu[::step], attitudes),) if s is not None]
    given = integrals_at(0.0)
    force = given.force[series.order - 1]
    searches = (
        search_by_course(motion.fixes, given),
        search_by_force(series, lambda offset_s: (given.t_s + offset_s, force)),
    )
    return [search for search in searches if search is not None]


def _by_force_beside(series: Series, imu: Imu, attitudes: Attitudes) -> Search | None:
    """Search by specific force that known attitudes rotate, of velocities."""
    t_s = np.linspace(attitudes.t_s[0], attitudes.t_s[-1], len(imu.t_s))
    R_nb, _ = attitudes.at(t_s)

    def force_at(offset_s: float) -> tuple[FloatArray, FloatArray]:
        imu_s = imu.t_s + offset_s
        inside = (t_s >= imu_s[0]) & (t_s <= imu_s[-1])
        if inside.sum() < 2:
            return t_s[:0], np.zeros((0, 3))
        at_s = t_s[inside]
        f_n = np.einsum("nij,nj->ni", R_nb[inside], sampled(imu_s, imu.f_b_mps2, at_s))
        return at_s, integral(at_s, f_n)

    return search_by_force(series, force_at, known=True)


def search_by_force(
    series: Series,
    force_at: Callable[[float], tuple[FloatArray, FloatArray]],
    *,
    known: bool = False,
) -> Search | None:
    """Search the offset at which rotated specific force explains a track best.

    ``force_at``: from an offset to times, (m,), and integrals of specific force of the series'
    order, (m, 3); ``known``: in n, so that no matrix is free, but a line of each window.
    """
    some = most_curved(series, series.windows)
    if len(some) < MIN_WINDOWS:
        return None
    t_s, order = series.t_s[some.row], series.order + known
    y = detrended(some, series.t_s, series.value[some.row], order)
    total = (y**2).sum(axis=(1, 2))
    left = np.full((len(some), len(_OFFSETS_S)), np.nan)
    for k, offset_s in enumerate(_OFFSETS_S):
        imu_s, force = force_at(float(offset_s))
        if len(imu_s) < 2:
            continue
        inside = (t_s[:, 0] >= imu_s[0]) & (t_s[:, -1] <= imu_s[-1])
        if inside.sum() < _COVERED * len(some):
            continue
        X = sampled(imu_s, force, t_s[inside].ravel()).reshape(-1, t_s.shape[1], 3)
        X = detrended(some.some(inside), series.t_s, X, order)
        if known:
            left[inside, k] = ((y[inside] - X) ** 2).sum(axis=(1, 2))
            continue
        gram, product = X.swapaxes(1, 2) @ X, X.swapaxes(1, 2) @ y[inside]
        gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        explained = (product * np.linalg.solve(gram, product)).sum(axis=(1, 2))
        left[inside, k] = total[inside] - explained
    return _judged("specific force", left)


def search_by_course(fixes: Fixes, integrals: Integrals) -> Search | None:
    """Search the offset at which the course of velocities and the gyroscope turn alike."""
    courses = _Courses.of(fixes, integrals)
    if courses is None:
        return None
    left = np.full((len(courses.windows), len(_OFFSETS_S)), np.nan)
    for k, offset_s in enumerate(_OFFSETS_S):
        y, common, inside = courses.system(offset_s)
        if len(y) < _COVERED * len(left):
            continue
        time = common[..., 1]
        bias = (y * time).sum() / max(float((time**2).sum()), 1e-300)
        left[inside, k] = ((y - bias * time) ** 2).sum(axis=1)
    search = _judged("course", left)
    return None if search is None else _refined_course(courses, search)


class _Courses(NamedTuple):
    """Course in windows, and the integrated gyroscope."""

    t_s: FloatArray
    windows: Windows
    course_rad: FloatArray  # (W, n), unwrapped
    white: FloatArray  # (W, n); 1 / sigma, zero where slow or outside of a window
    integrals: Integrals
    angle_s: FloatArray  # (m, 3); integral of the rates in s
    w_s: FloatArray  # (m, 3)

    @classmethod
    def of(cls, fixes: Fixes, integrals: Integrals) -> "_Courses | None":
        v_n_mps, sigma_mps = velocities(fixes)
        if v_n_mps is None or len(fixes.t_s) < 2:
            return None
        span_s = float(fixes.t_s[-1] - fixes.t_s[0]) / _COURSES
        windows = windows_of(fixes.t_s, float(np.clip(span_s, 4.0, 20.0)))
        speed = np.linalg.norm(v_n_mps[:, :2], axis=1)
        sigma = np.linalg.norm(sigma_mps[:, :2], axis=1) / np.sqrt(2)
        is_fast = speed > _NOSE_FIRST * sigma + 0.5
        course = np.unwrap(np.arctan2(v_n_mps[:, 1], v_n_mps[:, 0])[windows.row], axis=1)
        white = np.where(windows.inside & is_fast[windows.row], (speed / sigma)[windows.row], 0.0)
        some = (white > 0).mean(axis=1) > 0.5
        if some.sum() < MIN_WINDOWS:
            return None
        w_s = np.einsum("nij,nj->ni", integrals.R_sb, integrals.w_b_radps)
        angle_s = summed(integrals.t_s, w_s)
        return cls(
            fixes.t_s, windows.some(some), course[some], white[some], integrals, angle_s, w_s
        )

    def system(self, offset_s: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return course less gyroscope, (W', n), and derivatives by offset and bias, (W', n, 2).

        Whitened, less each window's mean, of windows within the record, (W,).
        """
        t_s = self.integrals.t_s
        at_s = self.t_s[self.windows.row] - offset_s
        inside = (at_s[:, 0] >= t_s[0]) & (at_s[:, -1] <= t_s[-1])
        at_s, white = at_s[inside], self.white[inside]
        ends = sampled(t_s, self.integrals.force[0], at_s[:, [0, -1]].ravel()).reshape(-1, 2, 3)
        down_s = ends[:, 0] - ends[:, 1]  # mean specific force is up
        down_s /= np.linalg.norm(down_s, axis=1, keepdims=True).clip(1e-12)
        parts = np.concatenate([self.angle_s, self.w_s], axis=1)
        inner = sampled(t_s, parts, at_s.ravel()).reshape(*at_s.shape, 2, 3)
        angle, rate = np.moveaxis(np.einsum("wnai,wi->wna", inner, down_s), 2, 0)
        x = np.stack([self.course_rad[inside] - angle, -rate, at_s - at_s[:, :1]], axis=2)
        x -= ((white**2)[..., None] * x).sum(axis=1, keepdims=True) / (
            (white**2).sum(axis=1)[:, None, None]
        )
        x *= white[..., None]
        return x[..., 0], x[..., 1:], inside


def _refined_course(courses: _Courses, search: Search) -> Search:
    """Return the search with an offset by Gauss-Newton, and its sigma."""
    offset_s, sigma_s, step_s = search.offset_s, np.inf, np.inf
    for _ in range(_STEPS):
        if abs(step_s) > _STILL_S:
            y, common, _ = courses.system(offset_s)
            here = fitted(y, np.zeros((*y.shape, 0)), common, np.zeros(0))
            step_s, sigma_s = float(np.clip(here.x[0], -STEP_S, STEP_S)), here.sigma(0)
            offset_s += step_s
    if abs(offset_s - search.offset_s) > _APART_S:
        return search._replace(is_unique=False)
    return search._replace(offset_s=offset_s, sigma_s=sigma_s)


def _judged(by: str, left: FloatArray) -> Search | None:
    """Test residual squares, (W, D), of all offsets against each other; NaN where not covered."""
    valid: BoolArray = np.asarray(np.isfinite(left).any(axis=0))
    if valid.sum() < 2:
        return None
    left = np.maximum(left, 1e-12 * np.nanmax(left))
    logs = np.log(left)
    level = np.full(len(valid), np.inf)
    usual = np.nanmedian(logs[:, valid], axis=1)[:, None]
    level[valid] = np.nanmean(logs[:, valid] - usual, axis=0)
    best, zero = int(level.argmin()), len(_OFFSETS_S) // 2
    is_open = valid & ~_is_rejected(left, best)
    is_open[best] = True
    closed = np.flatnonzero(~is_open)
    first = closed[closed < best].max(initial=-1)
    last = closed[closed > best].min(initial=len(level))
    outside = (np.arange(len(level)) <= first) | (np.arange(len(level)) >= last)
    padded = np.concatenate([[np.inf], level, [np.inf]])
    is_minimum = (level < padded[:-2]) & (level < padded[2:])
    far = valid & (np.abs(_OFFSETS_S - _OFFSETS_S[best]) > _APART_S)
    if not far.any():
        return None
    far = far & is_minimum if (far & is_minimum).any() else far
    runner_up = int(np.where(far, level, np.inf).argmin())
    both = np.isfinite(left[:, zero]) & np.isfinite(left[:, best])
    tests = len(_OFFSETS_S) if abs(_OFFSETS_S[best]) > COARSE_S else _NEAR_TESTS
    return Search(
        by=by,
        offset_s=float(_OFFSETS_S[best]),
        sigma_s=np.inf,
        is_better=best != zero and is_better(left[both, zero], left[both, best], tests),
        is_unique=bool((last - first) * STEP_S < _VALLEY_S and not (is_open & outside).any()),
        runner_up_s=float(_OFFSETS_S[runner_up]),
        ratio=float(np.exp(level[zero] - level[best])),
        runner_up_ratio=float(np.exp(level[runner_up] - level[best])),
    )


def _is_rejected(left: FloatArray, best: int) -> BoolArray:
    """Return which offsets, (D,), are rejected beside the best by residual squares, (W, D).

    By Student's t of log ratios, or where both ratio of sums and geometric mean ratio exceed an F
    quantile in which a window counts as one vector of three.
    """
    both = np.isfinite(left) & np.isfinite(left[:, [best]])
    count = both.sum(axis=0).clip(1)
    excess = np.where(both, np.log(left / left[:, [best]]), 0.0)
    mean = excess.sum(axis=0) / count
    square = np.where(both, (excess - mean) ** 2, 0.0).sum(axis=0) / np.maximum(count - 1, 1)
    bound = -stdtrit(np.maximum(count - 1, 1), _EXCLUDED) * np.sqrt(square / count)
    sums = np.where(both, left, 0.0).sum(axis=0)
    ratio = sums / np.where(both, left[:, [best]], 0.0).sum(axis=0).clip(1e-300)
    least = np.minimum(ratio, np.exp(mean)) > fdtri(3.0 * count, 3.0 * count, 1 - _EXCLUDED)
    return np.asarray((count >= MIN_WINDOWS) & ((mean > bound) | least))


def clock_of(
    motion: Motion, series: Series, integrals_at: Callable[[float], Integrals], start_s: float
) -> Clock | None:
    """Fit offset and lever arm by Gauss-Newton from a start; None where no windows are covered."""
    offset_s, arm_b_m, steps = start_s, motion.arm_b_m, 0
    while True:
        integrals = integrals_at(offset_s)
        windows = covered(series, integrals.t_s) if len(integrals.t_s) > 1 else None
        if not windows:
            return None
        here, R_ns = fit(series, integrals, motion.imu, arm_b_m, windows)
        x, is_settled = here.x.clip(-1.0, 1.0), here.settled()
        is_far = abs(offset_s + x[OFFSET] - start_s) > _APART_S
        if is_far or steps == _STEPS or (abs(x[OFFSET]) < _STILL_S and is_settled):
            break
        offset_s, arm_b_m, steps = offset_s + float(x[OFFSET]), arm_b_m + x[ARM], steps + 1
    return Clock(
        offset_s=offset_s,
        sigma_s=here.sigma(OFFSET),
        bound_s=here.bound(OFFSET) if is_settled else np.inf,
        arm_b_m=arm_b_m,
        arm_covariance_m2=here.covariance[ARM, ARM],
        arm_freedom=float(here.freedom[ARM].min()) if is_settled else 0.0,
        windows=windows,
        R_ns=R_ns,
    )
