"""Specific force turned by the gyroscope and integrated: velocity and position but for gravity.

The frame ``s`` is that in which the unit lay at its first sample, as far as the gyroscope knows. It
drifts against ``n``, so that its rotation is an unknown of every window of a few seconds.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import FloatArray
from fgnav.geometry.rotation_kernel import accumulated
from fgnav.geometry.rotations import skew


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Integrals:
    """Of an inertial unit's m samples, first to last.

    Attributes
    ----------
    t_s : ndarray, shape (m,)
    R_sb : ndarray, shape (m, 3, 3)
    w_b_radps : ndarray, shape (m, 3)
    f_s : ndarray, shape (m, 3)
        Specific force.
    once, twice : ndarray, shape (m, 3)
        Its integrals.
    turned : ndarray, shape (3, m, 3, 3)
        R_sb and its integrals, once and twice: what a bias of the accelerometer adds.
    drifted : ndarray, shape (2, m, 3, 3)
        What a bias of the gyroscope adds to ``once`` and to ``twice``.
    """

    t_s: FloatArray
    R_sb: FloatArray
    w_b_radps: FloatArray
    f_s: FloatArray
    once: FloatArray
    twice: FloatArray
    turned: FloatArray
    drifted: FloatArray


def integrated(t_s: FloatArray, f_b_mps2: FloatArray, w_b_radps: FloatArray) -> Integrals:
    """Integrate specific force, (m, 3), along the rotation by the gyroscope, (m, 3)."""
    R_sb = rotated(t_s, w_b_radps)
    f_s = np.einsum("nij,nj->ni", R_sb, f_b_mps2)
    once = summed(t_s, f_s)
    turned = summed(t_s, R_sb)
    leaning = skew(f_s) @ turned
    drifted = summed(t_s, leaning)
    return Integrals(
        t_s=t_s,
        R_sb=R_sb,
        w_b_radps=w_b_radps,
        f_s=f_s,
        once=once,
        twice=summed(t_s, once),
        turned=np.stack([R_sb, turned, summed(t_s, turned)]),
        drifted=np.stack([drifted, summed(t_s, drifted)]),
    )


def rotated(t_s: FloatArray, w_b_radps: FloatArray) -> FloatArray:
    """Return the rotation since the first sample, (m, 3, 3), of a rate linear within each step.

    By its mean and the commutator of its ends (A. Iserles et al.: Lie-group methods, Acta Numerica
    9, 2000, section 4: Magnus).
    """
    step_s = np.diff(t_s)[:, None]
    before, after = w_b_radps[:-1], w_b_radps[1:]
    turns = (before + after) / 2 * step_s + step_s**2 / 12 * np.cross(before, after)
    return accumulated(turns)


def sampled(t_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return values, (m, ...), at other times, (k, ...), on straight lines; ends beyond them."""
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
