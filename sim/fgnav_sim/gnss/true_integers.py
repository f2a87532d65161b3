"""The integers that simulated receivers have given to their phase, as rows of arcs."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray
from fgnav.types.flight import LinkIntegers


def link_integers(
    antennas: tuple[str, ...],
    channels: tuple[tuple[str, str], ...],
    t_s: FloatArray,
    tracked: BoolArray,
    cycles: FloatArray,
) -> LinkIntegers:
    """Return one row wherever a link begins to be tracked or its integer changes.

    Parameters
    ----------
    antennas : tuple of str, length a
    channels : tuple of (satellite, signal), length m
    t_s : ndarray, shape (n,)
    there : ndarray of bool, shape (n, a, m)
        What is tracked.
    cycles : ndarray, shape (n, a, m)
    """
    begins = tracked.copy()
    begins[1:] &= ~tracked[:-1] | (cycles[1:] != cycles[:-1])
    antenna, channel, epoch = np.nonzero(begins.transpose(1, 2, 0))  # link by link, in time
    return LinkIntegers(
        antennas=tuple(antennas[i] for i in antenna),
        satellites=tuple(channels[j][0] for j in channel),
        signals=tuple(channels[j][1] for j in channel),
        from_s=t_s[epoch],
        cycles=cycles[epoch, antenna, channel],
    )
