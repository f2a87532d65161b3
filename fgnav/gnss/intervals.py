"""The usual interval between samples, by what has come so far."""

import numpy as np

from fgnav.checks import FloatArray


def usual_interval_so_far_s(t_s: FloatArray) -> FloatArray:
    """Return the median interval by each sample, (n,), renewed whenever their number doubles.

    Of intervals before a sample's own, and infinite without any: then nothing is a gap.

    Parameters
    ----------
    t_s : ndarray, shape (n,)
        Increasing.
    """
    usual_s = np.full(len(t_s), np.inf)
    first = 2  # samples 0 and 1 have no interval before their own
    while first < len(t_s):
        usual_s[first:] = np.median(np.diff(t_s[:first]))
        first *= 2
    return usual_s
