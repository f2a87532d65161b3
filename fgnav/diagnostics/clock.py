"""Clock offset of the IMU: a search within 20 s by course and by specific force, then a fit.

Each search compares, window by window, the residual squares of all offsets. The best is unique if
every other one outside its valley is rejected (level 1e-3), and it is better than the given
timestamps if zero is rejected at ``FALSE_ALARM`` over all offsets tried (Bonferroni). Course: what
travels nose first turns with its course, so that the gyroscope's vertical rate, integrated, is the
course but for a constant of each window and one bias. Specific force: rotated and integrated it is
the velocity, or once more the position, but for a matrix of each window.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.diagnostics import track
from fgnav.diagnostics.array import ArrayAttitudes
from fgnav.diagnostics.track import Integrals, Motion, Series
from fgnav.diagnostics.windows import MIN_WINDOWS, Windows, fitted, is_better, windows_of
from fgnav.geometry.interpolation import corrected_integral, integral, interpolate_tensors
from fgnav.types.flight import Imu

COARSE_S = 0.5  # an offset beyond it is another clock; less is a delay of the recorder
_SIGMA_S = 0.05  # beyond, a coarse offset is not determined
_STEP_S = 0.1  # of the search: a motion of a hertz has a valley of a tenth
_OFFSETS_S = np.round(np.arange(-200, 201) * _STEP_S, 6)  # leap seconds lie within
_COVERED = 0.25  # share of windows within the record at an offset that is tried
_VALLEY_S = 2.0  # a wider one has no minimum to speak of
_SEPARATION_S = 1.0  # between offsets that are not one valley
_NEAR_TESTS = 10  # offsets within half a second
_EXCLUDED = 1e-3  # level at which an offset is rejected beside the best
_COURSES = 24  # windows of a record, of 4 to 20 s
_NOSE_FIRST = 5.0  # speed over its sigma from which course is a direction
_RATE_HZ = 25.0  # to which samples are thinned beside known attitudes
_STEPS, _STILL_S = 12, 1e-4  # of Gauss-Newton


class Search(NamedTuple):
    """Clock offset that a search found best, to add to inertial timestamps.

    Attributes
    ----------
    by : str
    offset_s, sigma_s : float
        Sigma: of rounding to the search's steps, or of the fit by course.
    is_better, is_unique : bool
        Whether the given timestamps, and whether all offsets outside its valley are rejected.
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

    def __str__(self) -> str:
        """Return the evidence."""
        return (
            f"(± {self.sigma_s:.3f} s, by {self.by}; squares {self.ratio:.3g} times smaller, "
            f"runner-up {-self.runner_up_s:+.1f} s {self.runner_up_ratio:.3g} times larger)"
        )


class Clock(NamedTuple):
    """Offset to add to inertial timestamps, and the lever arm that goes with it.

    ``bound_s`` is exceeded by chance with probability ``FALSE_ALARM``; infinite where the motion
    does not determine the offset. ``arm_dof``: of Student's t. ``R_ns``: (W, 3, 3).
    """

    offset_s: float
    sigma_s: float
    bound_s: float
    arm_b_m: FloatArray
    arm_covariance_m2: FloatArray
    arm_dof: float
    windows: Windows
    R_ns: FloatArray


def coarse_offset(searches: Sequence[Search]) -> Search | None:
    """Return a search that excludes the given clock, if no other unique one contradicts it."""
    unique = [search for search in searches if search.is_unique]
    offsets_s = [search.offset_s for search in unique]
    if not unique or max(offsets_s) - min(offsets_s) > _SEPARATION_S:
        return None
    other = [search for search in unique if search.is_better and abs(search.offset_s) > COARSE_S]
    best = min(other, key=lambda search: search.sigma_s, default=None)
    return best if best is not None and best.sigma_s < _SIGMA_S else None


def clock_searches(motion: Motion, integrals_at: Callable[[float], Integrals]) -> list[Search]:
    """Return the results of all searches that the sensors permit."""
    if motion.attitudes is not None:
        force_at = _force_by_attitudes(motion.imu, motion.attitudes)
        searches = [_search_by_force(motion.series[-1], force_at, aligned=True)]
    else:
        given, series = integrals_at(0.0), motion.series[-1]
        force = given.force[series.order - 1]
        searches = [
            _search_by_course(motion, given),
            _search_by_force(series, lambda offset_s: (given.t_s + offset_s, force), aligned=False),
        ]
    return [search for search in searches if search is not None]


def _force_by_attitudes(
    imu: Imu, attitudes: ArrayAttitudes
) -> Callable[[float], tuple[FloatArray, FloatArray]]:
    """Return times and integrals of specific force rotated by attitudes, by offset."""
    t_s = np.arange(attitudes.t_s[0], attitudes.t_s[-1], 1 / _RATE_HZ)
    R_nb, _ = attitudes.interpolated(t_s)

    def force_at(offset_s: float) -> tuple[FloatArray, FloatArray]:
        inside = (t_s >= imu.t_s[0] + offset_s) & (t_s <= imu.t_s[-1] + offset_s)
        f_b = interpolate_tensors(t_s[inside], imu.t_s + offset_s, imu.f_b_mps2)
        return t_s[inside], integral(t_s[inside], np.einsum("nij,nj->ni", R_nb[inside], f_b))

    return force_at


def _search_by_force(
    series: Series, force_at: Callable[[float], tuple[FloatArray, FloatArray]], *, aligned: bool
) -> Search | None:
    """Search by integrals of specific force in s; in n, if aligned, with no matrix but a line."""
    some = track.most_curved(series, series.windows)
    if len(some) < MIN_WINDOWS:
        return None
    t_s, order = series.t_s[some.row], series.order + aligned
    y = track.detrended(some, series.t_s, series.value[some.row], order)
    left = np.full((len(some), len(_OFFSETS_S)), np.nan)
    for k, offset_s in enumerate(_OFFSETS_S):
        imu_s, force = force_at(float(offset_s))
        ends_s = (imu_s[0], imu_s[-1]) if len(imu_s) > 1 else (np.inf, -np.inf)
        inside = (t_s[:, 0] >= ends_s[0]) & (t_s[:, -1] <= ends_s[1])
        if inside.sum() < _COVERED * len(some):
            continue
        X = interpolate_tensors(t_s[inside].ravel(), imu_s, force).reshape(-1, t_s.shape[1], 3)
        X, x = track.detrended(some.some(inside), series.t_s, X, order), y[inside]
        if not aligned:
            gram = X.swapaxes(1, 2) @ X
            gram += 1e-9 * np.trace(gram, axis1=1, axis2=2)[:, None, None] * np.eye(3)
            X = X @ np.linalg.solve(gram, X.swapaxes(1, 2) @ x)
        left[inside, k] = ((x - X) ** 2).sum(axis=(1, 2))
    return _judged("specific force", left)


def _search_by_course(motion: Motion, integrals: Integrals) -> Search | None:
    """Search the offset at which the course of velocities and the gyroscope turn alike."""
    fixes = motion.fixes
    v_n_mps, sigma_mps = track.velocities(fixes)
    if v_n_mps is None:
        return None
    span_s = float(fixes.t_s[-1] - fixes.t_s[0]) / _COURSES
    windows = windows_of(fixes.t_s, float(np.clip(span_s, 4.0, 20.0)))
    speed = np.linalg.norm(v_n_mps[:, :2], axis=1)
    sigma = np.linalg.norm(sigma_mps[:, :2], axis=1) / np.sqrt(2)
    is_used = windows.inside & (speed > _NOSE_FIRST * sigma + 0.5)[windows.row]
    some = is_used.mean(axis=1) > 0.5
    windows, white = windows.some(some), np.where(is_used, (speed / sigma)[windows.row], 0.0)[some]
    if len(windows) < MIN_WINDOWS:
        return None
    course = np.unwrap(np.arctan2(v_n_mps[:, 1], v_n_mps[:, 0])[windows.row], axis=1)
    system = _course_system(integrals, fixes.t_s[windows.row], course, white)
    left = np.full((len(windows), len(_OFFSETS_S)), np.nan)
    for k, offset_s in enumerate(_OFFSETS_S):
        inside, y, common = system(float(offset_s))
        if len(y) < _COVERED * len(left):
            continue
        time = common[..., 1]
        bias = (y * time).sum() / max(float((time**2).sum()), 1e-300)
        left[inside, k] = ((y - bias * time) ** 2).sum(axis=1)
    search = _judged("course", left)
    return None if search is None else _refined_course(system, search)


_System = Callable[[float], tuple[BoolArray, FloatArray, FloatArray]]


def _course_system(
    integrals: Integrals, t_s: FloatArray, course_rad: FloatArray, white: FloatArray
) -> _System:
    """Return the function from an offset to course less gyroscope, (W', n), and derivatives.

    By offset and bias, (W', n, 2); whitened, less each window's mean, of windows within the record,
    (W,). Vertical is the mean specific force of a window.
    """
    imu_s = integrals.t_s
    w_s = np.einsum("nij,nj->ni", integrals.R_sb, integrals.w_b_radps)
    parts = np.concatenate([corrected_integral(imu_s, w_s), w_s], axis=1)

    def system(offset_s: float) -> tuple[BoolArray, FloatArray, FloatArray]:
        at_s = t_s - offset_s
        inside = (at_s[:, 0] >= imu_s[0]) & (at_s[:, -1] <= imu_s[-1])
        at_s, weight = at_s[inside], white[inside][..., None]
        ends = interpolate_tensors(at_s[:, [0, -1]].ravel(), imu_s, integrals.force[0]).reshape(
            -1, 2, 3
        )
        down_s = ends[:, 0] - ends[:, 1]
        down_s /= np.linalg.norm(down_s, axis=1, keepdims=True).clip(1e-12)
        inner = interpolate_tensors(at_s.ravel(), imu_s, parts).reshape(*at_s.shape, 2, 3)
        angle, rate = np.moveaxis(np.einsum("wnai,wi->wna", inner, down_s), 2, 0)
        x = np.stack([course_rad[inside] - angle, -rate, at_s - at_s[:, :1]], axis=2)
        x -= (weight**2 * x).sum(axis=1, keepdims=True) / (weight**2).sum(axis=1, keepdims=True)
        return inside, (weight * x)[..., 0], (weight * x)[..., 1:]

    return system


def _refined_course(system: _System, search: Search) -> Search:
    """Return the search with an offset by Gauss-Newton, and its sigma."""
    offset_s, sigma_s = search.offset_s, np.inf
    for _ in range(_STEPS):
        _, y, common = system(offset_s)
        here = fitted(y, np.zeros((*y.shape, 0)), common, np.zeros(0))
        sigma_s = here.sigma(0)
        offset_s += float(np.clip(here.x[0], -_STEP_S, _STEP_S))
        if abs(here.x[0]) < _STILL_S:
            break
    if abs(offset_s - search.offset_s) > _SEPARATION_S:
        return search._replace(is_unique=False)
    return search._replace(offset_s=offset_s, sigma_s=sigma_s)


def _judged(by: str, left: FloatArray) -> Search | None:
    """Test residual squares, (W, D), of all offsets against each other; NaN where not covered."""
    left = left[np.isfinite(left).any(axis=1)]
    valid: BoolArray = np.asarray(np.isfinite(left).any(axis=0))
    if not valid.any():
        return None
    left = np.maximum(left, 1e-12 * np.nanmax(left))
    level = np.full(len(valid), np.inf)
    usual = np.nanmedian(np.log(left[:, valid]), axis=1)[:, None]
    level[valid] = np.nanmean(np.log(left[:, valid]) - usual, axis=0)
    index, best, zero = np.arange(len(level)), int(level.argmin()), len(level) // 2
    is_open = valid & ~np.array(_is_rejected(left, best))
    closed = np.flatnonzero(~is_open)
    first = closed[closed < best].max(initial=-1)
    last = closed[closed > best].min(initial=len(level))
    is_outside = (index < first) | (index > last)
    padded = np.concatenate([[np.inf], level, [np.inf]])
    is_minimum = (level < padded[:-2]) & (level < padded[2:])
    far = np.abs(index - best) * _STEP_S > _SEPARATION_S
    far = far & is_minimum if (far & is_minimum).any() else far
    runner_up = int(np.where(far, level, np.inf).argmin())
    both = np.isfinite(left[:, zero]) & np.isfinite(left[:, best])
    tests = len(level) if abs(_OFFSETS_S[best]) > COARSE_S else _NEAR_TESTS
    return Search(
        by=by,
        offset_s=float(_OFFSETS_S[best]),
        sigma_s=_STEP_S / np.sqrt(12),
        is_better=best != zero and is_better(left[both, zero], left[both, best], tests),
        is_unique=bool((last - first) * _STEP_S < _VALLEY_S and not is_open[is_outside].any()),
        runner_up_s=float(_OFFSETS_S[runner_up]),
        ratio=float(np.exp(level[zero] - level[best])),
        runner_up_ratio=float(np.exp(level[runner_up] - level[best])),
    )


def _is_rejected(left: FloatArray, best: int) -> list[bool]:
    """Select offsets, (D,), that the residual squares, (W, D), reject in favour of the best."""
    both = np.isfinite(left) & np.isfinite(left[:, [best]])
    return [
        bool(rows.sum() >= MIN_WINDOWS and is_better(x[rows], left[rows, best], level=_EXCLUDED))
        for x, rows in zip(left.T, both.T, strict=True)
    ]


def clock_of(
    motion: Motion, series: Series, integrals_at: Callable[[float], Integrals], start_s: float
) -> Clock | None:
    """Fit offset and lever arm by Gauss-Newton from a start; None where no windows are covered.

    Where both do not settle together, the lever arm alone.
    """
    clock = _clock(motion, series, integrals_at, start_s, timed=True)
    if clock is None or clock.arm_dof > 0:
        return clock
    return _clock(motion, series, integrals_at, start_s, timed=False)


def _clock(
    motion: Motion,
    series: Series,
    integrals_at: Callable[[float], Integrals],
    start_s: float,
    *,
    timed: bool,
) -> Clock | None:
    offset_s, arm_b_m, steps = start_s, motion.arm_b_m, 0
    while True:
        integrals = integrals_at(offset_s)
        windows = track.covered(series, integrals.t_s)
        if not len(windows):
            return None
        here, R_ns = track.fit(series, integrals, motion.imu, arm_b_m, windows, timed=timed)
        x, is_settled = here.x.clip(-1.0, 1.0), here.settled()
        is_far = abs(offset_s + x[track.OFFSET] - start_s) > _SEPARATION_S
        if is_far or steps == _STEPS or (abs(x[track.OFFSET]) < _STILL_S and is_settled):
            break
        offset_s, arm_b_m = offset_s + float(x[track.OFFSET]), arm_b_m + x[track.ARM]
        steps += 1
    return Clock(
        offset_s,
        here.sigma(track.OFFSET),
        here.bound(track.OFFSET) if is_settled and timed else np.inf,
        arm_b_m,
        here.covariance[track.ARM, track.ARM],
        float(here.freedom[track.ARM].min()) if is_settled else 0.0,
        windows,
        R_ns,
    )
