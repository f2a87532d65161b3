"""A few satellites chosen of all in view, as small receivers and the source paper's network do."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray

_EVERY_S = 900.0  # a satellite moves by some 7 degrees meanwhile


def chosen(
    wanted: int,
    above: BoolArray,
    elevation_rad: FloatArray,
    azimuth_rad: FloatArray,
    t_s: FloatArray,
) -> BoolArray:
    """Return where satellites are both above the mask and among those chosen, (n, s).

    The choice is made anew every 15 min, so that integers last: of the satellites that stay above
    the mask until the next choice (of all above it now, if those are too few), the one without
    which the geometric dilution of precision is least is left out, until ``wanted`` remain.

    Parameters
    ----------
    wanted : int
        How many; all where fewer are in view.
    above : ndarray of bool, shape (n, s)
    elevation_rad, azimuth_rad : ndarray, shape (n, s)
    t_s : ndarray, shape (n,)
    """
    out = np.zeros_like(above)
    period = np.floor(t_s / _EVERY_S)
    for begin, end in zip(*_spans(period), strict=True):
        lasting = above[begin:end].all(axis=0)
        candidates = lasting if lasting.sum() >= wanted else above[begin]
        kept = np.flatnonzero(candidates)
        rows = _rows(elevation_rad[begin, kept], azimuth_rad[begin, kept])
        while len(kept) > wanted:
            dop = [_gdop(np.delete(rows, k, axis=0)) for k in range(len(kept))]
            least = int(np.argmin(dop))
            kept, rows = np.delete(kept, least), np.delete(rows, least, axis=0)
        out[begin:end, kept] = above[begin:end, kept]
    return out


def _spans(period: FloatArray) -> tuple[list[int], list[int]]:
    """Return begins and ends of runs of equal values."""
    edges = np.flatnonzero(np.diff(period)) + 1
    return [0, *edges.tolist()], [*edges.tolist(), len(period)]


def _rows(elevation_rad: FloatArray, azimuth_rad: FloatArray) -> FloatArray:
    """Return rows of the geometry matrix, (k, 4)."""
    flat = np.cos(elevation_rad)
    return np.column_stack(
        [
            flat * np.cos(azimuth_rad),
            flat * np.sin(azimuth_rad),
            np.sin(elevation_rad),
            np.ones_like(flat),
        ]
    )


def _gdop(rows: FloatArray) -> float:
    """Return the geometric dilution of precision; infinite where there is no solution."""
    scales = np.linalg.svd(rows, compute_uv=False)
    if scales[-1] < 1e-9:
        return float("inf")
    return float(np.sqrt(np.sum(scales**-2.0)))
