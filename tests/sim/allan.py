"""Allan deviation of samples."""

import numpy as np


def allan_deviation(samples, step_s, averaging_s):
    """Return the overlapping Allan deviation of samples (k, c), pooled over their columns."""
    width = round(averaging_s / step_s)
    total = np.vstack([np.zeros(samples.shape[1]), np.cumsum(samples, axis=0)])
    mean = (total[width:] - total[:-width]) / width
    return np.sqrt(0.5 * np.mean((mean[width:] - mean[:-width]) ** 2))
