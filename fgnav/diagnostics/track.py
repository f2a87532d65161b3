"""Positions and velocities of an antenna against the inertial sensors, window by window.

A velocity in a window is ``v + g t + R_ns (S(t - d) + R_sb (w x l))``: v is the window's alone, S
the specific force rotated to s and integrated, d the offset to add to inertial timestamps, l the
lever arm from accelerometer to antenna. A position is one integral further. The frame s is that of
the IMU at its first sample, carried on by the gyroscope, so that each window has a rotation R_ns of
its own; by an array's attitudes s is n, and R_ns within degrees of one.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from fgnav.checks import FloatArray
from fgnav.diagnostics.array import ArrayAttitudes
from fgnav.diagnostics.windows import Fitted, Windows, fitted, windows_of
from fgnav.geometry.interpolation import corrected_integral, interpolate_tensors
from fgnav.geometry.rotation_kernel import accumulated
from fgnav.geometry.rotations import exp, nearest, skew
from fgnav.types.flight import Fixes, Flight, Imu
from fgnav.types.observations import Observations

OFFSET, ARM = 0, slice(1, 4)  # shared unknowns
LONGEST = 3000  # epochs that are used of a longer recording
_BIASES = 5.0  # prior sigma of a bias over the nominal: devices of one grade differ so much
_MISALIGNED_RAD = 0.03  # prior sigma of a window's rotation beside known attitudes
_SEARCHED = 40  # windows that searches use


class Integrals(NamedTuple):
    """Inertial samples, m of them, in s, and integrals of specific force, once and twice, there.

    ``by_bias`` and ``by_rate_bias`` are derivatives by biases of accelerometer and gyroscope,
    ``by_offset`` by an offset of timestamps, negative. ``aligned``: s is n, as of an array.
    """

    t_s: FloatArray  # (m,)
    R_sb: FloatArray  # (m, 3, 3)
    w_b_radps: FloatArray  # (m, 3)
    force: FloatArray  # (2, m, 3)
    by_offset: FloatArray  # (2, m, 3)
    by_bias: FloatArray  # (3, m, 3, 3); R_sb first
    by_rate_bias: FloatArray  # (2, m, 3, 3)
    aligned: bool


class Series(NamedTuple):
    """Positions (order 2) or velocities (order 1), (n, 3), less what gravity added; frame n."""

    order: int
    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    windows: Windows


def integrated(imu: Imu, attitudes: ArrayAttitudes | None = None) -> Integrals:
    """Integrate specific force along the gyroscope's rotation, or along known attitudes."""
    if attitudes is not None:
        imu = imu[(imu.t_s >= attitudes.t_s[0]) & (imu.t_s <= attitudes.t_s[-1])]
    t_s, f_b = imu.t_s, imu.f_b_mps2
    R_sb, w_b = rotation_and_rates(imu, attitudes)
    f_s = np.einsum("nij,nj->ni", R_sb, f_b)
    once, by_bias = corrected_integral(t_s, f_s), corrected_integral(t_s, R_sb)
    by_rate_bias, by_offset = corrected_integral(t_s, skew(f_s) @ by_bias), np.stack([f_s, once])
    if attitudes is not None:  # only the samples move, not the rotation
        jerk = corrected_integral(t_s, np.einsum("nij,nj->ni", R_sb, np.gradient(f_b, t_s, axis=0)))
        by_offset = np.stack([jerk, corrected_integral(t_s, jerk)])
    return Integrals(
        t_s,
        R_sb,
        w_b,
        np.stack([once, corrected_integral(t_s, once)]),
        by_offset,
        np.stack([R_sb, by_bias, corrected_integral(t_s, by_bias)]),
        np.stack([by_rate_bias, corrected_integral(t_s, by_rate_bias)]),
        attitudes is not None,
    )


def rotation_and_rates(
    imu: Imu, attitudes: ArrayAttitudes | None, factor: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Return R_sb, (m, 3, 3), and w_b, (m, 3), by attitudes or by the gyroscope times a factor.

    Of a rate linear within each step: by its mean and the commutator of its ends (A. Iserles et
    al.: Lie-group methods, Acta Numerica 9, 2000, section 4: Magnus).
    """
    w = np.zeros_like(imu.f_b_mps2) if imu.w_b_radps is None else factor * imu.w_b_radps
    if attitudes is not None:
        R_nb, rates = attitudes.interpolated(imu.t_s)
        return R_nb, rates if imu.w_b_radps is None else w
    step_s = np.diff(imu.t_s)[:, None]
    angles = (w[:-1] + w[1:]) / 2 * step_s + step_s**2 / 12 * np.cross(w[:-1], w[1:])
    return accumulated(angles, np.eye(3)), w


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """Inertial sensors beside a track, and attitudes of an array where there is one."""

    imu: Imu
    fixes: Fixes
    series: list[Series]
    arm_b_m: FloatArray  # (3,); from accelerometer to antenna
    attitudes: ArrayAttitudes | None

    @classmethod
    def from_flight(
        cls, flight: Flight, imu: Imu, fixes: Fixes, attitudes: ArrayAttitudes | None
    ) -> "Motion":
        """Return the motion where the vehicle moves most."""
        fixes = where_it_moves(fixes)
        # By known attitudes a window has fewer unknowns, and positions by code are too noisy.
        windows = windows_of(fixes.t_s, *((4.0, 16) if attitudes is None else (1.6, 12)))
        g_n_mps2 = flight.origin.gravity_n_mps2(fixes.p_n_m).mean(axis=0)
        t_s, since_s, series = fixes.t_s, (fixes.t_s - fixes.t_s[0])[:, None], []
        if attitudes is None:
            value = fixes.p_n_m - g_n_mps2 * since_s**2 / 2
            series.append(Series(2, t_s, value, fixes.position_sigma_m, windows))
        if fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
            value = fixes.v_n_mps - g_n_mps2 * since_s
            series.append(Series(1, t_s, value, fixes.velocity_sigma_mps, windows))
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
        return lambda offset_s: given._replace(t_s=given.t_s + offset_s)


def middle_of(observations: Observations, count: int) -> Observations:
    """Return so many epochs of the middle, or all."""
    first = max(len(observations.t_s) - count, 0) // 2
    return observations[first : len(observations.t_s) - first]


def where_it_moves(fixes: Fixes) -> Fixes:
    """Return the fixes, 3000 at most, over which the vehicle moves most."""
    n = len(fixes.t_s)
    if n <= LONGEST:
        return fixes
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(fixes.p_n_m, axis=0), axis=1))])
    first = int(np.argmax(way[LONGEST - 1 :] - way[: n - LONGEST + 1]))
    return fixes[first : first + LONGEST]


def velocities(fixes: Fixes) -> tuple[FloatArray | None, FloatArray]:
    """Return velocities and their sigma, (n, 3); of positions by central differences."""
    if fixes.v_n_mps is not None and fixes.velocity_sigma_mps is not None:
        return fixes.v_n_mps, fixes.velocity_sigma_mps
    if len(fixes.t_s) < 3:
        return None, fixes.position_sigma_m
    span_s = np.gradient(fixes.t_s)[:, None]
    return np.gradient(fixes.p_n_m, fixes.t_s, axis=0), fixes.position_sigma_m / span_s / np.sqrt(2)


def covered(series: Series, imu_s: FloatArray) -> Windows:
    """Return the windows within the inertial record."""
    imu_s = imu_s if len(imu_s) > 1 else np.array([np.inf, -np.inf])
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


class WindowValues:
    """A series in windows: detrended values and 1 / sigma, (W, n, 3), zero outside."""

    def __init__(self, series: Series, windows: Windows) -> None:
        rows, t_s = windows.row, series.t_s
        self.series, self.windows, self.at_s = series, windows, t_s[rows]
        self.value = detrended(windows, t_s, series.value[rows], series.order)
        self.white = np.where(windows.inside[..., None], 1.0 / series.sigma[rows], 0.0)

    def resampled(self, t_s: FloatArray, values: FloatArray) -> FloatArray:
        """Return inertial values, (m, ...), at the epochs, detrended: (W, n, ...)."""
        inner = interpolate_tensors(self.at_s.ravel(), t_s, values)
        inner = inner.reshape(*self.at_s.shape, *values.shape[1:])
        return detrended(self.windows, self.series.t_s, inner, self.series.order)

    def solved(
        self, moved: FloatArray, biases: list[FloatArray], ridge: FloatArray, *, aligned: bool
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Fit a rotation of each window to vectors in s, (W, n, 3), beside start and biases.

        Returns its R_ns, (W, 3, 3), and there whitened residuals, (W, 3 n), and derivatives by
        start, lean (a rotation vector in s) and biases, given in s, (W, n, 3, 3).
        """
        W, n, _ = self.value.shape
        time = (self.at_s - self.at_s[:, :1])[:, :, None, None]
        start = [time**p * np.eye(3) for p in range(self.series.order)]
        weight = self.white.mean(axis=2, keepdims=True) ** 2
        R_ns = nearest(np.einsum("wni,wnj->wij", weight * self.value, moved))
        R_ns = np.tile(np.eye(3), (W, 1, 1)) if aligned else R_ns
        lean = -skew(moved.reshape(-1, 3)).reshape(W, n, 3, 3)
        columns = slice(3 * len(start), 3 * len(start) + 3)

        def system() -> tuple[FloatArray, FloatArray]:
            local = [*start, *(R_ns[:, None] @ derivative for derivative in (lean, *biases))]
            A = (self.white[..., None] * np.concatenate(local, axis=3)).reshape(W, 3 * n, -1)
            y = self.white * (self.value - np.einsum("wij,wnj->wni", R_ns, moved))
            return y.reshape(W, -1), A

        y, A = system()  # one step of Gauss-Newton, for the first rotation has the biases in it
        information = A.swapaxes(1, 2) @ A + np.diag(ridge + 1e-9)
        step = np.linalg.solve(information, (A * y[..., None]).sum(axis=1)[..., None])
        R_ns = R_ns @ exp(step[:, columns, 0])
        return R_ns, *system()


def fit(
    series: Series,
    integrals: Integrals,
    imu: Imu,
    arm_b_m: FloatArray,
    windows: Windows,
    *,
    timed: bool = True,
) -> tuple[Fitted, FloatArray]:
    """Fit each window, and corrections of clock offset, s, and lever arm, m, to all.

    Returns these, and R_ns, (W, 3, 3). Not ``timed``: the offset stays as it is.
    """
    values, order, aligned = WindowValues(series, windows), series.order, integrals.aligned
    resampled = partial(values.resampled, integrals.t_s)
    spin = integrals.R_sb @ skew(integrals.w_b_radps)
    arm = resampled(spin if order == 1 else integrals.R_sb)
    by_offset = integrals.by_offset[order - 1]
    if not aligned:
        by_offset = by_offset + (spin @ skew(integrals.w_b_radps) if order == 1 else spin) @ arm_b_m
    force = resampled(integrals.force[order - 1])
    middle = interpolate_tensors(
        values.at_s[:, values.at_s.shape[1] // 2], integrals.t_s, integrals.by_bias[1]
    )
    by_rotation = skew(force.reshape(-1, 3)).reshape(*values.at_s.shape, 3, 3) @ middle[:, None]
    biases = [
        -resampled(integrals.by_bias[order]),
        resampled(integrals.by_rate_bias[order - 1]) - by_rotation,
    ]
    ridge = prior(imu, order, aligned=aligned)
    R_ns, y, local = values.solved(force + arm @ arm_b_m, biases, ridge, aligned=aligned)
    common = np.concatenate([-resampled(timed * by_offset)[..., None], arm], axis=3)
    common = (values.white[..., None] * (R_ns[:, None] @ common)).reshape(*y.shape, -1)
    return fitted(y, local, common, ridge), R_ns


def prior(imu: Imu, order: int, *, aligned: bool) -> FloatArray:
    """Return prior information of a window's start, lean and biases, (3 order + 9,)."""
    rate_bias = imu.gyroscope_bias_radps or 0.0
    ridge = np.zeros(3 * order + 9)
    ridge[-9:-6] = _MISALIGNED_RAD**-2 if aligned else 0.0
    ridge[-6:-3] = (_BIASES * imu.accelerometer_bias_mps2) ** -2
    ridge[-3:] = (_BIASES * rate_bias) ** -2 if rate_bias and not aligned else 1e12
    return ridge
