"""What of a long series is drawn: the same in every format of a report."""

import numpy as np

from fgnav.checks import FloatArray

_GAP = 1.5  # intervals; a line is broken across a longer step
_ROUGH = 1.2  # step over size; white noise has 1.41
_SHOWN = 99.5  # percentile of a method's errors that its share of the axis holds


def drawable(t_s: FloatArray, y: FloatArray, bins: int) -> tuple[FloatArray, FloatArray]:
    """Return a line to draw: broken at gaps, and of a long one the extremes of each bin.

    Ten thousand epochs have more points than a figure has pixels; minimum and maximum per bin keep
    every spike, where plain decimation would lose them.
    """
    if len(t_s) > 2 * bins:
        starts = np.linspace(0, len(t_s), bins, endpoint=False).astype(np.int64)
        extremes = [np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)]
        t_s, y = np.repeat(t_s[starts], 2), np.stack(extremes, axis=1).ravel()
    steps_s = np.diff(t_s)
    usual_s = np.median(steps_s[steps_s > 0]) if (steps_s > 0).any() else 0.0
    breaks = np.flatnonzero(steps_s > 2 * _GAP * usual_s) + 1
    return np.insert(t_s, breaks, t_s[breaks]), np.insert(y, breaks, np.nan)


def every(count: int, most: int) -> slice:
    """Return the rows of a fair sample of at most about so many of ``count``."""
    return slice(None, None, max(1, -(-count // most)))


def unjumped_deg(angle_deg: FloatArray) -> FloatArray:
    """Return an angle with NaN where it wraps or flips, so that no line crosses the figure.

    That is where it changes by more than a quarter turn from one epoch to the next.
    """
    out = angle_deg.copy()
    out[1:][np.abs(np.diff(angle_deg)) > 90] = np.nan
    return out


def is_rough(deviation: FloatArray) -> bool:
    """Return whether (n, 3) angles change from epoch to epoch by about as much as white noise."""
    finite = deviation[:, np.isfinite(deviation).all(axis=0)]
    if len(finite) < 3 or not finite.any():
        return False
    size = np.maximum(finite.std(axis=0), np.finfo(float).tiny)
    return bool(np.median(np.diff(finite, axis=0).std(axis=0) / size) > _ROUGH)


def limit(series: list[FloatArray]) -> float:
    """Return half the height of an error axis: room for most of what the middle method does.

    One bad method would flatten all others; its RMS stands beside, so its lines may leave the axis.
    """
    sizes = [np.abs(y[np.isfinite(y)]) for y in series]
    reach = [float(np.percentile(size, _SHOWN)) for size in sizes if size.size]
    return 1.5 * float(np.median(reach)) if reach and np.median(reach) > 0 else 1.0
