"""Rotation of a body by its gyroscope or, of a spin, by its accelerometer alone.

Specific force keeps its direction in ``n`` for longer than a spin takes. So it turns through the
body's axes against the body's own rate, and that tells the rate, all three components of it, as
soon as its direction has swept some angle.
"""

from dataclasses import dataclass, replace

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.interpolation import interpolate
from fgnav.geometry.rotation_kernel import accumulated
from fgnav.geometry.rotations import exp, skew, transpose
from fgnav.types.flight import Imu

_SPAN_S = 1.0  # over which the rate is taken as constant
_FAST_RADPS = 1.0  # slower turns blur nothing between fixes a fraction of a second apart
_EXPLAINED = 0.8  # of how the specific force changes, by the spin alone
_SWEPT = 0.02  # least eigenvalue over trace: 0 of a force that keeps its direction in the body
_FEWEST = 5  # samples


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class ImuRotation:
    """Axes ``u`` that do not turn with it: the body's at first, ``v_u = R_ub @ v_b``."""

    t_s: FloatArray  # (n,)
    R_ub: FloatArray  # (n, 3, 3)
    w_b_radps: FloatArray  # (n, 3); as the gyroscope has it, or of the spin; 0 where there is none

    def at(self, t_s: FloatArray) -> FloatArray:
        """Return R_ub at times, (n,), as (n, 3, 3)."""
        k = (np.searchsorted(self.t_s, t_s, side="right") - 1).clip(0)
        since_s = (t_s - self.t_s[k])[:, None]
        return np.asarray(self.R_ub[k] @ exp(self.w_b_radps[k] * since_s))

    def rates(self, t_s: FloatArray) -> FloatArray:
        """Return rates at times, (n,), as (n, 3)."""
        return interpolate(t_s, self.t_s, self.w_b_radps)

    def forces(self, imu: Imu, arm_b_m: FloatArray | None = None) -> Imu:
        """Return a record of the same samples with specific forces in the axes ``u``.

        As felt at the accelerometer or, less what the rotation adds there, (3,) away from it.
        """
        f_b_mps2, w_b_radps = imu.f_b_mps2, self.rates(imu.t_s)
        if arm_b_m is not None:
            f_b_mps2 = f_b_mps2 + np.cross(w_b_radps, np.cross(w_b_radps, arm_b_m))
        return replace(imu, f_b_mps2=np.einsum("nij,nj->ni", self.at(imu.t_s), f_b_mps2))


def despun(rotation: ImuRotation | None, t_s: FloatArray, R_nb: FloatArray) -> FloatArray:
    """Return attitudes R_nu of axes that do not spin, (n, 3, 3), at times, (n,)."""
    return R_nb if rotation is None else np.asarray(R_nb @ transpose(rotation.at(t_s)))


def spun(rotation: ImuRotation | None, t_s: FloatArray, R_nu: FloatArray) -> FloatArray:
    """Return the body's attitudes R_nb, (n, 3, 3), at times, (n,), of those that do not spin."""
    return R_nu if rotation is None else np.asarray(R_nu @ rotation.at(t_s))


def imu_rotation(imu: Imu, R_ub: FloatArray | None = None) -> ImuRotation | None:
    """Return the rotation by the gyroscope, or else that of a spin; None where nothing is told.

    From the identity, or where an earlier record has led, (3, 3).
    """
    if len(imu.t_s) < _FEWEST:
        return None
    w_b_radps = imu.w_b_radps
    if w_b_radps is None:
        spin_b_radps, sure = _spin_rates(imu.t_s, imu.f_b_mps2)
        spins = sure & (np.linalg.norm(spin_b_radps, axis=1) > _FAST_RADPS)
        if not spins.any():
            return None
        w_b_radps = np.where(spins[:, None], spin_b_radps, 0.0)
    turns_rad = (w_b_radps[1:] + w_b_radps[:-1]) / 2 * np.diff(imu.t_s)[:, None]
    led = accumulated(turns_rad, np.eye(3) if R_ub is None else np.ascontiguousarray(R_ub))
    return ImuRotation(t_s=imu.t_s, R_ub=led, w_b_radps=w_b_radps)


def _spin_rates(t_s: FloatArray, f_b_mps2: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return rates by ``df/dt = (f - c) x w`` over a span about each sample, and which are told.

    The constant ``c`` is bias, and what a rotation adds off its axis: 3 m/s2 at 2 cm and two turns
    a second. Least squares, of ``f`` and its slope less their means: with ``A`` the sum of
    ``|f|^2 - f f'``, ``A w`` is the sum of ``df/dt x f``.
    """
    span_s = t_s[2:] - t_s[:-2]
    f, slope = f_b_mps2[1:-1], (f_b_mps2[2:] - f_b_mps2[:-2]) / span_s[:, None]
    K = skew(f)
    first = np.searchsorted(t_s[1:-1], t_s - _SPAN_S / 2)
    last = np.searchsorted(t_s[1:-1], t_s + _SPAN_S / 2, side="right")

    def about(values: FloatArray) -> FloatArray:
        total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
        return np.asarray(total[last] - total[first])

    count = np.maximum(last - first, 1)[:, None]
    f_mean, slope_mean = about(f) / count, about(slope) / count
    K_mean = skew(f_mean)
    A = about(K.swapaxes(1, 2) @ K) - count[:, :, None] * (K_mean.swapaxes(1, 2) @ K_mean)
    b = about(np.cross(slope, f)) - count * np.cross(slope_mean, f_mean)
    changed = about((slope**2).sum(axis=1)) - count[:, 0] * (slope_mean**2).sum(axis=1)
    values = np.linalg.eigvalsh(A)
    sure = values[:, 0] > _SWEPT * values.sum(axis=1)
    A[~sure] = np.eye(3)
    w = np.linalg.solve(A, b[:, :, None])[:, :, 0]
    sure &= np.einsum("ni,ni->n", w, b) > _EXPLAINED * changed
    # A difference over a finite time is the chord of the arc that was turned.
    half_s, size = float(np.median(span_s)) / 2, np.linalg.norm(w, axis=1, keepdims=True)
    chord = (size * half_s).clip(1e-12, 1.0)
    return w * np.arcsin(chord) / chord, sure
