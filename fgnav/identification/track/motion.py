"""Equations of an inertial unit beside a track, by windows: their own start, rotation and biases.

A velocity within a window is ``v + g t + R (S(t - d) + w x l)``: v and R are the window's alone, S
the specific force turned by the gyroscope and integrated (``integrals``), d by how much the unit's
times are to be raised, l the lever arm from unit to antenna. A position is one integral further.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotations import exp, nearest, skew
from fgnav.identification.track.integrals import Integrals, sampled
from fgnav.identification.track.windows import Fitted, Windows, fitted
from fgnav.types.flight import Imu

LATE, ARM, RATE = 0, slice(1, 4), 4  # common unknowns
BIASES = 5.0  # a bias may be so many times the stated: what units sold as one grade differ by
_TURNS = 2  # steps to a window's rotation
_TELLING = 40  # windows that searches look at: a mistake of the set-up shows in a dozen


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Series:
    """Positions or velocities of an antenna, n of them.

    Attributes
    ----------
    what : str
        ``"position"`` or ``"velocity"``.
    t_s : ndarray, shape (n,)
    value : ndarray, shape (n, 3)
        In ``n``, what gravity gave since the first epoch taken off.
    sigma : ndarray, shape (n, 3)
    windows : Windows
    """

    what: str
    t_s: FloatArray
    value: FloatArray
    sigma: FloatArray
    windows: Windows

    @property
    def order(self) -> int:
        """How many terms of a window's start there are: place and velocity, or velocity."""
        return 2 if self.what == "position" else 1


def covered(series: Series, integrals: Integrals, late_s: float) -> Windows:
    """Return the windows that lie within the inertial record."""
    t_s = series.t_s[series.windows.row] - late_s
    inside = (t_s[:, 0] >= integrals.t_s[0]) & (t_s[:, -1] <= integrals.t_s[-1])
    return series.windows.some(inside)


def telling(series: Series, imu_s: FloatArray, late_s: tuple[float, ...]) -> Windows:
    """Return so many windows, within a record at all those clocks, that bend most."""
    windows = series.windows
    for late in late_s:
        at_s = series.t_s[windows.row] - late
        windows = windows.some((at_s[:, 0] >= imu_s[0]) & (at_s[:, -1] <= imu_s[-1]))
    if not len(windows):
        return windows
    bent = detrended(windows, series.t_s, series.value[windows.row], series.order + 1)
    size = (bent**2).sum(axis=(1, 2))
    return windows.some(size >= np.sort(size)[-min(_TELLING, len(size))])


def detrended(windows: Windows, t_s: FloatArray, values: FloatArray, order: int) -> FloatArray:
    """Take the mean, or the line, of each window off values, (W, n, ...); zero outside."""
    time = np.where(windows.inside, t_s[windows.row] - t_s[windows.row[:, :1]], 0.0)
    terms = np.stack([windows.inside * time**p for p in range(order)], axis=2)
    Q = np.linalg.qr(terms)[0]
    flat = values.reshape(*values.shape[:2], -1) * windows.inside[:, :, None]
    return np.asarray((flat - Q @ (Q.swapaxes(1, 2) @ flat)).reshape(values.shape))


def fit(
    series: Series,
    integrals: Integrals,
    imu: Imu,
    late_s: float,
    arm_b_m: FloatArray,
    windows: Windows | None = None,
    *,
    rate: float | None = None,
) -> tuple[Fitted, FloatArray]:
    """Fit every window, and to all of them a correction of clock and lever arm.

    Returns
    -------
    fitted : Fitted
        Of seconds to raise the unit's times by, and metres; with ``rate`` also of what its times
        are to be raised by, beyond it, in each second from the middle of the series.
    R_ns : ndarray, shape (W, 3, 3)
        Of each window.
    """
    windows = covered(series, integrals, late_s) if windows is None else windows
    row, order = windows.row, series.order
    W, n = row.shape
    since_s = series.t_s[row] - (series.t_s[0] + series.t_s[-1]) / 2
    at_s = series.t_s[row] - late_s - (rate or 0.0) * since_s

    def of(values: FloatArray) -> FloatArray:
        inner = sampled(integrals.t_s, values, at_s.ravel())
        return detrended(windows, series.t_s, inner.reshape(W, n, *values.shape[1:]), order)

    one_more = order - 1
    R_sb, spin = integrals.R_sb, integrals.R_sb @ skew(integrals.w_b_radps)
    force = of(integrals.twice if one_more else integrals.once)
    arm = of(R_sb if one_more else spin)
    value = detrended(windows, series.t_s, series.value[row], order)
    moved = force + arm @ arm_b_m
    slope = of(
        (integrals.once if one_more else integrals.f_s)
        + ((spin if one_more else spin @ skew(integrals.w_b_radps)) @ arm_b_m)
    )
    bias = of(integrals.turned[1 + one_more])
    middle = sampled(integrals.t_s, integrals.turned[1], at_s[:, n // 2])
    drift = (
        of(integrals.drifted[one_more])
        - skew(force.reshape(-1, 3)).reshape(W, n, 3, 3) @ middle[:, None]
    )
    white = np.where(windows.inside[:, :, None], 1.0 / series.sigma[row], 0.0)
    start = starts(series, windows)
    gyroscope_bias = imu.gyroscope_bias_radps or 0.0
    ridge = np.zeros(3 * order + 9)
    ridge[-6:-3] = (BIASES * imu.accelerometer_bias_mps2) ** -2
    ridge[-3:] = (BIASES * gyroscope_bias) ** -2 if gyroscope_bias else 1e12
    R_ns = _procrustes(value, moved, white)

    def system(R_ns: FloatArray) -> tuple[FloatArray, FloatArray]:
        turned = R_ns[:, None]
        left = value - np.einsum("wij,wnj->wni", R_ns, moved)
        lean = -turned @ skew(moved.reshape(-1, 3)).reshape(W, n, 3, 3)
        local = np.concatenate([*start, lean, -turned @ bias, turned @ drift], axis=3)
        return (white * left).reshape(W, -1), (white[..., None] * local).reshape(W, 3 * n, -1)

    y, local = system(R_ns)
    for _ in range(_TURNS):
        R_ns = R_ns @ exp(solved(local, y, ridge)[:, 3 * order : 3 * order + 3])
        y, local = system(R_ns)
    common = np.concatenate([-slope[..., None], arm], axis=3)
    if rate is not None:
        common = np.concatenate([common, common[..., :1] * since_s[..., None, None]], axis=3)
    common = (white[..., None] * (R_ns[:, None] @ common)).reshape(W, 3 * n, -1)
    return fitted(y, local, common, ridge), R_ns


def starts(series: Series, windows: Windows) -> list[FloatArray]:
    """Return the derivatives of values by a window's start, each (W, n, 3, 3)."""
    time = series.t_s[windows.row] - series.t_s[windows.row[:, :1]]
    return [time[:, :, None, None] ** p * np.eye(3) for p in range(series.order)]


def _procrustes(value: FloatArray, moved: FloatArray, white: FloatArray) -> FloatArray:
    """Return rotations, (W, 3, 3), that lay what moved onto values best."""
    weight = white.mean(axis=2, keepdims=True) ** 2
    return nearest(np.einsum("wni,wnj->wij", weight * value, moved))


def solved(local: FloatArray, y: FloatArray, ridge: FloatArray) -> FloatArray:
    """Return each window's own unknowns, (W, a)."""
    size = np.sqrt((local**2).sum(axis=1) + ridge).clip(1e-300)
    A = local / size[:, None]
    information = A.swapaxes(1, 2) @ A + np.eye(len(ridge)) * (ridge / size**2)[:, None]
    information += 1e-12 * np.eye(len(ridge))
    x = np.linalg.solve(information, np.einsum("wka,wk->wa", A, y)[..., None])[..., 0]
    return np.asarray(x / size)
