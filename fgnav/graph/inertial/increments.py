"""Inertial samples between keyframes at the middles of equal sub-steps, none of them of later.

The values of an interval use samples up to its end and no others, so that a recording cut at any
keyframe has the same intervals before it.
"""

from dataclasses import dataclass

import numpy as np

from fgnav.checks import BadInputError, BoolArray, FloatArray, IntArray
from fgnav.types.flight import Imu

SUB_STEPS = 5  # of one sample
_AT_END_S = 1e-6  # a sample this much later than a keyframe is of its time
_NODES = 4  # of a cubic
_RECENT = 8  # spacings of samples whose median is the sample period of an interval
_GAP = 2.5  # a cell longer than that many sample periods is bridged by a straight line


@dataclass(frozen=True, eq=False, slots=True, kw_only=True)
class Increments:
    """Specific force and rate at the middles of the sub-steps between n keyframes."""

    step_s: FloatArray  # (n - 1,): length of the sub-steps of each interval
    # Index of each interval's first sub-step; the last entry is their number, k.
    first: IntArray  # (n,)
    f_b_mps2: FloatArray  # (k, 3)
    w_b_radps: FloatArray | None  # (k, 3): against inertial space; None without a gyroscope

    def interval(self, k: int, most: int | None = None) -> tuple[float, FloatArray, FloatArray]:
        """Return length, forces and rates of interval k's sub-steps.

        Of ``most`` of them, or fewer, each for as many as there are.
        """
        first, count = int(self.first[k]), int(self.first[k + 1] - self.first[k])
        kept = count if most is None else min(count, most)
        row = first + ((np.arange(kept) + 0.5) * (count / kept)).astype(np.int64)
        rates = np.zeros((kept, 3)) if self.w_b_radps is None else self.w_b_radps[row]
        return float(self.step_s[k]) * count / kept, self.f_b_mps2[row], rates


def increments(imu: Imu, t_s: FloatArray, sub_steps: int = SUB_STEPS) -> Increments:
    """Cut the time between keyframes into equal sub-steps of samples.

    Between samples a cubic through the four nearest ones that are not later than the interval's
    end (Lagrange): 1e-4 m/s2 off for 10 m/s2 that turn at 2 Hz, sampled at 100 Hz. A straight line
    in gaps and, for one sample period, past the last sample; then that value holds.

    Parameters
    ----------
    imu : Imu
    t_s : ndarray, shape (n,)
        Keyframes.
    sub_steps : int
        Of one sample period.

    Raises
    ------
    BadInputError
        If there are less than one sub-step.
    """
    if sub_steps < 1:
        raise BadInputError(f"sub_steps: must be 1 or more, got {sub_steps}")
    span_s = np.diff(t_s)
    last = np.searchsorted(imu.t_s, t_s[1:] + _AT_END_S, side="right").clip(1) - 1
    period_s = _periods_s(imu.t_s, last, span_s)
    counts = np.maximum(1, np.rint(span_s / period_s * sub_steps)).astype(np.int64)
    first = np.concatenate([[0], np.cumsum(counts)])
    step_s = span_s / counts
    # Counted from each interval's own beginning: what was before is not to change the rounding.
    within = np.arange(first[-1]) - np.repeat(first[:-1], counts) + 0.5
    middle_s = np.repeat(t_s[:-1], counts) + within * np.repeat(step_s, counts)
    nodes, weights = _interpolation(
        imu.t_s, middle_s, np.repeat(last, counts), np.repeat(period_s, counts)
    )
    return Increments(
        step_s=step_s,
        first=first,
        f_b_mps2=_combined(imu.f_b_mps2, nodes, weights),
        w_b_radps=None if imu.w_b_radps is None else _combined(imu.w_b_radps, nodes, weights),
    )


def at_latest(t_s: FloatArray, values: FloatArray, at_s: FloatArray) -> FloatArray:
    """Return samples, (k, 3), at other times, (m, 3), each from samples up to that time."""
    last = np.searchsorted(t_s, at_s + _AT_END_S, side="right").clip(1) - 1
    period_s = _periods_s(t_s, last, np.ones(len(at_s)))
    return _combined(values, *_interpolation(t_s, at_s, last, period_s))


def parents(t_s: FloatArray, finer_s: FloatArray) -> IntArray:
    """Find the interval of a timeline that contains the middle of each of a finer one."""
    middle_s = (finer_s[1:] + finer_s[:-1]) / 2
    return np.searchsorted(t_s, middle_s, side="right").clip(1, len(t_s) - 1) - 1


def _periods_s(t_s: FloatArray, last: IntArray, span_s: FloatArray) -> FloatArray:
    """Return the sample period at the end of each interval, the median of the latest spacings."""
    if len(t_s) < 2:
        return span_s
    recent = (last[:, None] - 1 - np.arange(_RECENT)).clip(0)
    return np.asarray(np.median(np.diff(t_s)[recent], axis=1))


def _interpolation(
    t_s: FloatArray, at_s: FloatArray, last: IntArray, period_s: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return samples, (k, 4), and their weights, (k, 4), at times, (k,).

    Parameters
    ----------
    t_s : ndarray
        Of the samples.
    at_s : ndarray, shape (k,)
    last : ndarray of int, shape (k,)
        Latest sample that each may use.
    period_s : ndarray, shape (k,)
    """
    cell = np.searchsorted(t_s, at_s, side="right") - 1
    start = np.minimum(cell - 1, last - _NODES + 1).clip(0)
    nodes = start[:, None] + np.arange(_NODES)
    usable = nodes[:, -1] <= last
    nodes = np.minimum(nodes, last[:, None])
    cubic = usable & _even(t_s[nodes], at_s, period_s)
    inner = np.where(cubic, at_s, 0.0)
    weights = _lagrange(np.where(cubic[:, None], t_s[nodes], np.arange(_NODES)), inner)
    line = ~cubic
    before = np.minimum(cell, last - 1).clip(0)[line]
    after = np.minimum(before + 1, last[line])
    nodes[line], weights[line] = before[:, None], 0.0
    nodes[line, 1] = after
    length_s = np.where(after > before, t_s[after] - t_s[before], 1.0)
    clipped_s = at_s[line].clip(t_s[before] - period_s[line], t_s[after] + period_s[line])
    weights[line, 1] = np.where(after > before, (clipped_s - t_s[before]) / length_s, 0.0)
    weights[line, 0] = 1 - weights[line, 1]
    return nodes, weights


def _even(nodes_s: FloatArray, at_s: FloatArray, period_s: FloatArray) -> BoolArray:
    """Return where a cubic through samples, (k, 4), is trusted: inside them, and no gap."""
    inside = (at_s >= nodes_s[:, 0]) & (at_s <= nodes_s[:, -1] + _AT_END_S)
    return np.asarray(inside & (np.diff(nodes_s, axis=1).max(axis=1) <= _GAP * period_s))


def _lagrange(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Return the weights, (k, 4), of values at nodes, (k, 4), in their cubic at places, (k,)."""
    difference, weights = at[:, None] - nodes, np.ones(nodes.shape)
    for i in range(_NODES):
        for j in range(_NODES):
            if i != j:
                weights[:, i] *= difference[:, j] / (nodes[:, i] - nodes[:, j])
    return weights


def _combined(values: FloatArray, nodes: IntArray, weights: FloatArray) -> FloatArray:
    """Return weighted sums of samples, (k, 3)."""
    return np.asarray(np.einsum("km,kmi->ki", weights, values[nodes]))
