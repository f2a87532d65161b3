"""Statistics of samples and of double differences."""

import numpy as np

from tests.integers.arrays import link_covariance


def allan_deviation(samples, step_s, averaging_s):
    """Return the overlapping Allan deviation of samples (k, c), pooled over their columns."""
    width = round(averaging_s / step_s)
    total = np.vstack([np.zeros(samples.shape[1]), np.cumsum(samples, axis=0)])
    mean = (total[width:] - total[:-width]) / width
    return np.sqrt(0.5 * np.mean((mean[width:] - mean[:-width]) ** 2))


def whitened_square(differences, residual_m, variance_m2):
    """Return the sum of whitened squares over all epochs and links, and its freedom."""
    links = np.isfinite(residual_m) & ~differences.is_reference[:, None]
    square = freedom = 0
    for k in np.flatnonzero(links.any(axis=(1, 2))):
        e = residual_m[k][links[k]]
        square += e @ np.linalg.solve(link_covariance(differences, k, links[k], variance_m2), e)
        freedom += len(e)
    return square, freedom
