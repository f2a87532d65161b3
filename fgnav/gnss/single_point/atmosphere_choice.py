"""Whether a flight has an atmosphere: what the code residuals of its first epochs tell.

A recorded flight has one, a simulated one may not, and no file says so. Residuals of the code are
smaller with the models where there is one, and as small as the stated noise without them where
there is none.
"""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.gnss.single_point.adjustment import adjust, misfits
from fgnav.gnss.single_point.model import CodeChannels, code_ranges
from fgnav.types.flight import Flight
from fgnav.types.observations import Observations

STATED_NOISE = 1.5  # squared residuals per freedom that still agree with the stated noise
_DECIDING = (1, 2, 4, 8, 16, 32, 64)  # epochs with an answer after which it is decided anew
_BLOCK = 64  # epochs looked at together


def without_atmosphere(with_models: float, without: float) -> bool:
    """Return whether residuals speak against atmosphere models, by their median squares.

    Parameters
    ----------
    with_models, without : float
        Per degree of freedom, over the stated variance.
    """
    return without < min(with_models, STATED_NOISE)


def atmosphere_so_far(
    flight: Flight, observations: Observations, channels: CodeChannels, antenna: int
) -> BoolArray:
    """Return whether atmosphere models are to be applied at each epoch, (n,), by those up to it.

    Decided after 1, 2, 4, … 64 epochs with redundant code, and kept from there on; applied before.
    """
    n = len(observations.t_s)
    if observations.earlier is not None:
        return np.full(n, observations.earlier.has_atmosphere)
    applied = np.ones(n, dtype=np.bool_)
    squares, rows = _deciding(flight, observations, channels, antenna)
    for count in _DECIDING:
        if count <= len(rows):
            medians = np.median(squares[:count], axis=0)
            applied[rows[count - 1] :] = not without_atmosphere(*medians)
    return applied


def is_decided(
    flight: Flight, observations: Observations, channels: CodeChannels, antenna: int
) -> bool:
    """Return whether ``atmosphere_so_far`` says the same of all epochs to come."""
    if observations.earlier is not None:
        return True
    return len(_deciding(flight, observations, channels, antenna)[1]) >= _DECIDING[-1]


def _deciding(
    flight: Flight, observations: Observations, channels: CodeChannels, antenna: int
) -> tuple[FloatArray, IntArray]:
    """Return squared residuals with models and without, (k, 2), of epochs that decide, (k,)."""
    n = len(observations.t_s)
    squares, rows = np.empty((0, 2)), np.empty(0, dtype=np.int64)
    for first in range(0, n, _BLOCK):
        epoch = np.arange(first, min(first + _BLOCK, n))
        ranges = code_ranges(flight, observations, channels, antenna, epoch, rates=False)
        wanted = np.isfinite(ranges.range_m)
        of_epochs: list[FloatArray] = [
            misfits(
                flight.gnss_noise,
                adjust(flight, channels, ranges, wanted, model=model, each=True),
            )
            for model in (True, False)
        ]
        redundant = np.isfinite(of_epochs).all(axis=0)
        squares = np.vstack([squares, np.stack(of_epochs, axis=1)[redundant]])
        rows = np.append(rows, epoch[redundant])
        if len(rows) >= _DECIDING[-1]:
            break
    return squares, rows
