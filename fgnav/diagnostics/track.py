"""Positions and velocities of an antenna against the inertial sensors, window by window.

A velocity in a window is ``v + g t + R_ns (S(t - d) + R_sb (w x l))``: v is the window's alone, S
the specific force rotated to s and integrated, d the offset to add to inertial timestamps, l the
lever arm from accelerometer to antenna. A position is one integral further. The frame s is that of
the IMU at its first sample, carried on by the gyroscope, so that each window has a rotation R_ns of
its own; by an array's attitudes s is n, and R_ns within degrees of one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from fgnav.checks import FloatArray, NoSolutionError
from fgnav.diagnostics.windows import Fitted, Windows, fitted, windows_of
from fgnav.geometry.earth import Origin
from fgnav.geometry.rotation_kernel import accumulated
from fgnav.geometry.rotations import exp, nearest, skew
from fgnav.gnss.single_point.solution import code_solution
from fgnav.types.flight import Fixes, Flight, Imu

OFFSET, ARM = 0, slice(1, 4)  # shared unknowns
BIASES = 5.0  # prior sigma of a bias over the nominal: devices of one grade differ so much
_MISALIGNED_RAD = 0.03  # prior sigma of a window's rotation beside known attitudes
_STEPS = 2  # of Gauss-Newton to a window's rotation
_SEARCHED = 40  # windows that searches use
_LONGEST = 3000  # epochs that are used of a longer recording


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Integrals:
    """Specific force of m inertial samples in s, and its integrals.

    Attributes
    ----------
    t_s : ndarray, shape (m,)
    R_sb : ndarray, shape (m, 3, 3)
    w_b_radps : ndarray, shape (m, 3)
    force : ndarray, shape (2, m, 3)
        Integrals of specific force, once and twice.
    by_offset : ndarray, shape (2, m, 3)
        Their derivatives by an offset of the timestamps, negative.
    by_bias : ndarray, shape (3, m, 3, 3)
        R_sb and its integrals: derivatives by a bias of the accelerometer.
    by_rate_bias : ndarray, shape (2, m, 3, 3)
        Derivatives of ``force`` by a bias of the gyroscope.
    known : bool
        Whether s is n, by attitudes of an array.
    """

    t_s: FloatArray
    R_sb: FloatArray
    w_b_radps: FloatArray
    force: FloatArray
    by_offset: FloatArray
    by_bias: FloatArray
    by_rate_bias: FloatArray
    known: bool


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Series:
    """Positions (order 2) or velocities (order 1) of an antenna less what gravity added.

    ``value`` and ``sigma``: (n, 3), frame n.
    """

    order: int
    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    windows: Windows


class Attitudes(Protocol):
    """Attitudes and body rates of an array at GNSS times."""

    t_s: FloatArray  # (n,)

    def at(self, t_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return R_nb, (m, 3, 3), and w_b, (m, 3), rad/s, at times within."""


def integrated(imu: Imu, attitudes: Attitudes | None = None) -> Integrals:
    """Integrate specific force along the gyroscope's rotation, or along known attitudes."""
    if attitudes is None:
        t_s, f_b = imu.t_s, imu.f_b_mps2
        w_b = np.zeros_like(f_b) if imu.w_b_radps is None else imu.w_b_radps
        R_sb = rotated(t_s, w_b)
    else:
        inside = (imu.t_s >= attitudes.t_s[0]) & (imu.t_s <= attitudes.t_s[-1])
        t_s, f_b = imu.t_s[inside], imu.f_b_mps2[inside]
        R_sb, w_b = attitudes.at(t_s)
        w_b = w_b if imu.w_b_radps is None else imu.w_b_radps[inside]
    f_s = np.einsum("nij,nj->ni", R_sb, f_b)
    once, by_bias = summed(t_s, f_s), summed(t_s, R_sb)
    by_rate_bias = summed(t_s, skew(f_s) @ by_bias)
    if attitudes is None:
        by_offset = np.stack([f_s, once])
    else:  # only the samples move, not the rotation
        jerk = summed(t_s, np.einsum("nij,nj->ni", R_sb, np.gradient(f_b, t_s, axis=0)))
        by_offset = np.stack([jerk, summed(t_s, jerk)])
    return Integrals(
        t_s=t_s,
        R_sb=R_sb,
        w_b_radps=w_b,
        force=np.stack([once, summed(t_s, once)]),
        by_offset=by_offset,
        by_bias=np.stack([R_sb, by_bias, summed(t_s, by_bias)]),
        by_rate_bias=np.stack([by_rate_bias, summed(t_s, by_rate_bias)]),
        known=attitudes is not None,
    )


def rotated(t_s: FloatArray, w_b_radps: FloatArray) -> FloatArray:
    """Return the rotation since the first sample, (m, 3, 3), of a rate linear within each step.

    By the mean rate and the commutator of the ends (A. Iserles et al.: Lie-group methods, Acta
    Numerica 9, 2000, section 4: Magnus).
    """
    step_s = np.diff(t_s)[:, None]
    before, after = w_b_radps[:-1], w_b_radps[1:]
    angles_rad = (before + after) / 2 * step_s + step_s**2 / 12 * np.cross(before, after)
    return accumulated(angles_rad, np.eye(3))


def sampled(t_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return values, (m, ...), at other times, (k, ...), linearly; ends beyond them."""
    after = np.searchsorted(t_s, at_s).clip(1, len(t_s) - 1)
    share = ((at_s - t_s[after - 1]) / (t_s[after] - t_s[after - 1])).clip(0.0, 1.0)
    share = share.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(values[after - 1] + share * (values[after] - values[after - 1]))


def summed(t_s: FloatArray, values: FloatArray) -> FloatArray:
    """Return the integral of samples, (m, ...), from the first to each: corrected trapezoids."""
    step_s = np.diff(t_s).reshape(-1, *[1] * (values.ndim - 1))
    slope = np.gradient(values, t_s, axis=0)
    parts = (values[1:] + values[:-1]) / 2 * step_s + step_s**2 / 12 * (slope[:-1] - slope[1:])
    return np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(parts, axis=0)])


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """Inertial sensors beside a track, and attitudes of an array where there is one."""

    imu: Imu
    fixes: Fixes
    series: list[Series]
    arm_b_m: FloatArray  # (3,); from accelerometer to antenna
    attitudes: Attitudes | None

    @classmethod
    def of(cls, flight: Flight, imu: Imu, fixes: Fixes, attitudes: Attitudes | None) -> "Motion":
        """Return the motion where the vehicle moves most."""
        fixes = where_it_moves(fixes)
        # By known attitudes a window has fewer unknowns; positions by code are too noisy.
        window = (4.0, 16) if attitudes is None else (1.6, 12)
        series = series_of(flight.origin, fixes, windows_of(fixes.t_s, *window))
        series = series if attitudes is None else series[-1:]
        arm_b_m = flight.antenna(fixes.antenna).position_b_m - imu.position_b_m
        return cls(imu, fixes, series, arm_b_m, attitudes)

    def imu_at(self, offset_s: float) -> Imu:
        """Return the inertial samples with an offset added to their timestamps."""
        return replace(self.imu, t_s=self.imu.t_s + offset_s)

    def integrals_at(self) -> Callable[[float], Integrals]:
        """Return the function from an offset of inertial timestamps to integrals."""
        if self.attitudes is not None:
            return lambda offset_s: integrated(self.imu_at(offset_s), self.attitudes)
        given = integrated(self.imu)
        return lambda offset_s: replace(given, t_s=given.t_s + offset_s)


def fixes_by_code(flight: Flight) -> Fixes:
    """Return positions and velocities of the first antenna by code and Doppler.

    Raises
    ------
    NoSolutionError
        If fewer than two epochs have both.
    """
    code = code_solution(flight)
    if code.v_n_mps is None or code.velocity_covariance_m2ps2 is None:
        raise NoSolutionError("no Doppler, so no velocity")
    rows = np.isfinite(code.v_n_mps).all(axis=1)
    if rows.sum() < 2:
        raise NoSolutionError("no two epochs with a velocity")
    return Fixes(
        t_s=code.t_s[rows],
        antenna=flight.antennas[0].name,
        p_n_m=code.p_n_m[rows],
        v_n_mps=code.v_n_mps[rows],
        position_sigma_m=np.sqrt(np.einsum("nii->ni", code.position_noise_m2[rows])),
        velocity_sigma_mps=np.sqrt(np.einsum("nii->ni", code.velocity_covariance_m2ps2[rows])),
    )


def where_it_moves(fixes: Fixes) -> Fixes:
    """Return the fixes, 3000 at most, over which the vehicle moves most."""
    n = len(fixes.t_s)
    if n <= _LONGEST:
        return fixes
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fixes.p_n_m, axis=0), axis=1))])
    first = int(np.argmax(way[_LONGEST - 1 :] - way[: n - _LONGEST + 1]))
    return fixes[first : first + _LONGEST]


def velocities(fixes: Fixes) -> tuple[FloatArray | None, FloatArray]:
    """Return velocities and their sigma, (n, 3); of positions by central differences."""
    if fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
        return fixes.v_n_mps, fixes.velocity_sigma_mps
    if len(fixes.t_s) < 3:
        return None, fixes.position_sigma_m
    span_s = np.gradient(fixes.t_s)[:, None]
    return np.gradient(fixes.p_n_m, fixes.t_s, axis=0), fixes.position_sigma_m / span_s / np.sqrt(2)


def series_of(origin: Origin, fixes: Fixes, windows: Windows) -> list[Series]:
    """Return positions, and velocities where there are any, less what gravity added."""
    g_n_mps2 = origin.gravity_n_mps2(fixes.p_n_m).mean(axis=0)
    since_s = (fixes.t_s - fixes.t_s[0])[:, None]
    parts: list[tuple[int, FloatArray, FloatArray]] = [
        (2, fixes.p_n_m - g_n_mps2 * since_s**2 / 2, fixes.position_sigma_m)
    ]
    if fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
        parts.append((1, fixes.v_n_mps - g_n_mps2 * since_s, fixes.velocity_sigma_mps))
    return [
        Series(order=order, t_s=fixes.t_s, value=value, sigma=sigma, windows=windows)
        for order, value, sigma in parts
    ]


def covered(series: Series, imu_s: FloatArray) -> Windows:
    """Return the windows within the inertial record."""
    t_s = series.t_s[series.windows.row]
    return series.windows.some((t_s[:, 0] >= imu_s[0]) & (t_s[:, -1] <= imu_s[-1]))


def most_curved(series: Series, windows: Windows) -> Windows:
    """Return the forty of some windows in which the track curves most."""
    if not len(windows):
        return windows
    curved = detrended(windows, series.t_s, series.value[windows.row], series.order + 1)
    size = (curved**2).sum(axis=(1, 2))
    return windows.some(size >= np.sort(size)[-min(_SEARCHED, len(size))])


def detrended(windows: Windows, t_s: FloatArray, values: FloatArray, order: int) -> FloatArray:
    """Subtract the mean, or the line, of each window from values, (W, n, ...); zero outside."""
    time = np.where(windows.inside, t_s[windows.row] - t_s[windows.row[:, :1]], 0.0)
    terms = np.stack([windows.inside * time**p for p in range(order)], axis=2)
    Q = np.linalg.qr(terms)[0]
    flat = values.reshape(*values.shape[:2], -1) * windows.inside[:, :, None]
    return np.asarray((flat - Q @ (Q.swapaxes(1, 2) @ flat)).reshape(values.shape))


@dataclass(frozen=True, eq=False, slots=True)
class WindowValues:
    """A series in windows: detrended values, whitening and derivatives by a window's start."""

    series: Series
    windows: Windows
    value: FloatArray  # (W, n, 3)
    white: FloatArray  # (W, n, 3); 1 / sigma, zero outside of a window
    start: list[FloatArray]  # (W, n, 3, 3) each

    @classmethod
    def of(cls, series: Series, windows: Windows) -> "WindowValues":
        """Return the values of a series in some windows."""
        row, t_s = windows.row, series.t_s
        value = detrended(windows, t_s, series.value[row], series.order)
        white = np.where(windows.inside[..., None], 1.0 / series.sigma[row], 0.0)
        time = (t_s[row] - t_s[row[:, :1]])[:, :, None, None]
        start: list[FloatArray] = [time**p * np.eye(3) for p in range(series.order)]
        return cls(series, windows, value, white, start)

    def resampled(self, t_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
        """Return inertial values, (m, ...), at times, (W, n), detrended: (W, n, ...)."""
        inner = sampled(t_s, values, at_s.ravel()).reshape(*at_s.shape, *values.shape[1:])
        return detrended(self.windows, self.series.t_s, inner, self.series.order)

    def rotation(self, moved: FloatArray, *, known: bool) -> FloatArray:
        """Return each window's rotation, (W, 3, 3), of vectors, (W, n, 3), onto the values."""
        if known:
            return np.tile(np.eye(3), (len(self.windows), 1, 1))
        weight = self.white.mean(axis=2, keepdims=True) ** 2
        return nearest(np.einsum("wni,wnj->wij", weight * self.value, moved))

    def system(
        self, R_ns: FloatArray, moved: FloatArray, biases: list[FloatArray]
    ) -> tuple[FloatArray, FloatArray]:
        """Return whitened residuals, (W, 3 n), and derivatives by a window's start, lean, biases.

        A lean is a rotation vector in s, rad; ``biases`` are derivatives in s, (W, n, 3, 3).
        """
        W, n, _ = self.value.shape
        R = R_ns[:, None]
        residual = self.value - np.einsum("wij,wnj->wni", R_ns, moved)
        lean = -R @ skew(moved.reshape(-1, 3)).reshape(W, n, 3, 3)
        local = np.concatenate([*self.start, lean, *(R @ one for one in biases)], axis=3)
        whitened = (self.white[..., None] * local).reshape(W, 3 * n, -1)
        return (self.white * residual).reshape(W, -1), whitened


def fit(
    series: Series, integrals: Integrals, imu: Imu, arm_b_m: FloatArray, windows: Windows
) -> tuple[Fitted, FloatArray]:
    """Fit each window, and corrections of clock offset, s, and lever arm, m, to all.

    Returns
    -------
    fitted : Fitted
    R_ns : ndarray, shape (W, 3, 3)
        Of each window.
    """
    values, order, at_s = WindowValues.of(series, windows), series.order, series.t_s[windows.row]

    def of(x: FloatArray) -> FloatArray:
        return values.resampled(integrals.t_s, x, at_s)

    spin = integrals.R_sb @ skew(integrals.w_b_radps)
    arm = of(spin if order == 1 else integrals.R_sb)
    by_offset = integrals.by_offset[order - 1]
    if not integrals.known:
        swing = spin @ skew(integrals.w_b_radps) if order == 1 else spin
        by_offset = by_offset + swing @ arm_b_m
    force = of(integrals.force[order - 1])
    moved = force + arm @ arm_b_m
    middle = sampled(integrals.t_s, integrals.by_bias[1], at_s[:, at_s.shape[1] // 2])
    turning = skew(force.reshape(-1, 3)).reshape(*at_s.shape, 3, 3) @ middle[:, None]
    biases = [-of(integrals.by_bias[order]), of(integrals.by_rate_bias[order - 1]) - turning]
    ridge = prior(imu, order, known=integrals.known)
    R_ns = values.rotation(moved, known=integrals.known)
    y, local = values.system(R_ns, moved, biases)
    for _ in range(_STEPS):
        R_ns = R_ns @ exp(solved(local, y, ridge)[:, 3 * order : 3 * order + 3])
        y, local = values.system(R_ns, moved, biases)
    common = np.concatenate([-of(by_offset)[..., None], arm], axis=3)
    common = (values.white[..., None] * (R_ns[:, None] @ common)).reshape(*y.shape, -1)
    return fitted(y, local, common, ridge), R_ns


def prior(imu: Imu, order: int, *, known: bool) -> FloatArray:
    """Return prior information of a window's start, lean and biases, (3 order + 9,)."""
    rate_bias = imu.gyroscope_bias_radps or 0.0
    ridge = np.zeros(3 * order + 9)
    ridge[-9:-6] = _MISALIGNED_RAD**-2 if known else 0.0
    ridge[-6:-3] = (BIASES * imu.accelerometer_bias_mps2) ** -2
    ridge[-3:] = (BIASES * rate_bias) ** -2 if rate_bias and not known else 1e12
    return ridge


def solved(local: FloatArray, y: FloatArray, ridge: FloatArray) -> FloatArray:
    """Return each window's own unknowns, (W, a)."""
    size = np.sqrt((local**2).sum(axis=1) + ridge).clip(1e-300)
    A = local / size[:, None]
    information = A.swapaxes(1, 2) @ A + np.eye(len(ridge)) * (ridge / size**2)[:, None]
    information += 1e-12 * np.eye(len(ridge))
    x = np.linalg.solve(information, np.einsum("wka,wk->wa", A, y)[..., None])[..., 0]
    return np.asarray(x / size)
