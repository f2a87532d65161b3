"""Links of an array, one of an antenna to a satellite each: how far off, left out, listed."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.types.differences import DoubleDifferences
from fgnav.types.estimate import Rejected


def without(ranges_m: FloatArray, links: BoolArray) -> FloatArray:
    """Return ranges without some links, (n, a, m); the reference antenna takes all."""
    return np.where(links[:, 1:] | links[:, :1], np.nan, ranges_m)


def link_sigmas(
    differences: DoubleDifferences, ranges_m: FloatArray, R_nb: FloatArray
) -> FloatArray:
    """Return by how many sigmas each link is off the others, (n, a, m).

    Medians over channels take the receiver terms off, medians over antennas the satellites'. So a
    bad link shows as itself, be it of the reference antenna or of the reference channel.
    """
    off_m = ranges_m - differences.array_m(R_nb)
    off_m = np.concatenate([np.zeros_like(off_m[:, :1]), off_m], axis=1)
    off_m[:, 0][np.isnan(off_m[:, 1:]).all(axis=1)] = np.nan
    for g in np.unique(differences.group):
        channels = differences.group == g
        off_m[:, :, channels] -= _median(off_m[:, :, channels], axis=2)
    off_m -= _median(off_m, axis=1)
    return np.nan_to_num(np.abs(off_m) / np.sqrt(differences.phase_variance_m2)[:, None, :])


def _median(values: FloatArray, axis: int) -> FloatArray:
    """Return the median along an axis, kept; of a NaN slice 0."""
    middle = np.sort(values, axis=axis)  # NaN last
    count = np.isfinite(values).sum(axis=axis, keepdims=True)
    low, high = (count - 1).clip(0) // 2, np.minimum(count // 2, (count - 1).clip(0))
    pair = [np.take_along_axis(middle, at, axis=axis) for at in (low, high)]
    return np.asarray(np.where(count > 0, (pair[0] + pair[1]) / 2, 0.0))


def listed(
    differences: DoubleDifferences,
    antennas: tuple[str, ...],
    change: IntArray,
    by_arc: BoolArray,
    excluded: BoolArray,
) -> tuple[Rejected, ...]:
    """Return each integer changed, (n, b, m), and each link excluded, (n, a, m), with its span."""
    contradictions = []
    for i, j, first, last, cycles in _runs(change):
        who = "its arc" if by_arc[first : last + 1, i, j].all() else "the rest of the array"
        contradictions.append(
            (i + 1, j, first, last, f"integer off by {-cycles:+d}: mended by {who}")
        )
    for i, j, first, last, _ in _runs(excluded.astype(np.int64)):
        contradictions.append((i, j, first, last, "contradicts the rest of the array: left out"))
    return tuple(
        Rejected(
            what="phase",
            link=f"{antennas[i]} {differences.satellites[j]} {differences.signals[j]}",
            from_s=float(differences.t_s[first]),
            until_s=float(differences.t_s[last]),
            reason=reason,
        )
        for i, j, first, last, reason in contradictions
    )


def _runs(values: IntArray) -> list[tuple[int, int, int, int, int]]:
    """Return row, column, first and last epoch and value of every run of one value but 0."""
    edged = np.pad(values, ((1, 1), (0, 0), (0, 0)))
    changes = np.diff(edged, axis=0) != 0
    first = np.argwhere((changes[:-1] & (values != 0)).transpose(1, 2, 0))
    last = np.argwhere((changes[1:] & (values != 0)).transpose(1, 2, 0))
    return [
        (int(i), int(j), int(begin), int(end), int(values[begin, i, j]))
        for (i, j, begin), (_, _, end) in zip(first, last, strict=True)
    ]
