"""Attitudes for keyframes that have none of their own, to start a search from."""

import numpy as np

from fgnav.alignment.gaps import LOST_S, rotation_cubic
from fgnav.alignment.rates import angular_rates
from fgnav.checks import BoolArray, FloatArray
from fgnav.geometry.rotations import exp, log, transpose


def zero_order_hold(t_s: FloatArray, values: FloatArray, valid: BoolArray) -> FloatArray:
    """Hold the last of values, (n, ...), where an epoch is not valid, (n,); first the first."""
    first = int(valid.argmax())
    return np.asarray(values[np.maximum.accumulate(np.where(valid, np.arange(len(t_s)), first))])


def interpolated_attitudes(t_s: FloatArray, R_nb: FloatArray, valid: BoolArray) -> FloatArray:
    """Turn where an epoch is not valid, (n,), by the cubic between its neighbours; hold the last.

    Of attitudes, (n, 3, 3). Evenly in gaps so long that the rates at their ends do not determine
    their middle.
    """
    good = np.flatnonzero(valid)
    if len(good) in (0, len(t_s)):
        return R_nb
    rates = angular_rates(t_s[good], R_nb[good])
    place = np.interp(t_s, t_s[good], np.arange(len(good)))
    before = np.floor(place).astype(np.int64)
    after = np.minimum(before + 1, len(good) - 1)
    first, last, share = (
        R_nb[good[before]],
        R_nb[good[after]],
        (place - before)[:, None],
    )
    span_s = (t_s[good[after]] - t_s[good[before]])[:, None]
    cubic = rotation_cubic(first, last, rates[before], rates[after], span_s, share)
    even = first @ exp(share * log(transpose(first) @ last))
    return np.asarray(np.where(span_s[:, None] <= 2 * LOST_S, cubic, even))
