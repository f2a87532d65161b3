"""One satellite at many times: a polynomial through its orbit at a few of them.

An orbit is smooth: ten nodes tell ten minutes of it to rounding, and their slopes its velocity.
"""

from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebpts1, chebvander
from numpy.typing import NDArray

from fgnav.checks import FloatArray
from fgnav.gnss.broadcast import Chosen, kepler_orbit

_NODES = 10
_PIECE_S = 600.0  # 2.5 degrees to both sides of the middle: what is cut off is below 1e-8 m
_FEWEST = 4 * _NODES  # times; of fewer each is looked at
_AT = chebpts1(_NODES)
_FIT = np.linalg.inv(chebvander(_AT, _NODES - 1))
_STEP_S = 0.05  # half step of central differences: errors below 1e-6 m/s


def orbit_at(
    satellite: str, chosen: Chosen, t_s: FloatArray, *, rates: bool, by_clock: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return where a satellite is and how its clock stands, and the rates of both, (n, 4) each.

    Parameters
    ----------
    satellite : str
    chosen : Chosen
        Messages for these times.
    t_s : ndarray, shape (n,)
        Where the message is not usable the answer is NaN.
    rates : bool
        Rates are wanted; else they are NaN.
    by_clock : bool
        Times are those that the satellite's own clock shows.
    """
    state, rate = np.full((2, len(t_s), 4), np.nan)
    usable = np.flatnonzero(chosen.usable)
    piece = ((t_s[usable] - t_s[usable].min(initial=np.inf)) // _PIECE_S).astype(np.int64)
    label = piece * len(chosen.records) + chosen.row[usable]  # each piece has one message
    while len(usable):
        one = label == label[0]
        rows = usable[one]
        message = chosen.records[chosen.row[rows[:1]]]
        found = _smooth if len(rows) >= _FEWEST else _each
        state[rows], rate[rows] = found(satellite, message, t_s[rows], rates, by_clock)
        usable, label = usable[~one], label[~one]
    return state, rate


def _orbit(satellite: str, message: NDArray[Any], t_s: FloatArray) -> FloatArray:
    return np.column_stack(kepler_orbit(satellite, message, t_s))


def _each(
    satellite: str, message: NDArray[Any], t_s: FloatArray, rates: bool, by_clock: bool
) -> tuple[FloatArray, FloatArray]:
    state = _orbit(satellite, message, t_s)
    if by_clock:
        t_s = t_s - state[:, 3]
        state = _orbit(satellite, message, t_s)
    if not rates:
        return state, np.full_like(state, np.nan)
    before, after = (_orbit(satellite, message, t_s + h) for h in (-_STEP_S, _STEP_S))
    return state, (after - before) / (2 * _STEP_S)


def _smooth(
    satellite: str, message: NDArray[Any], t_s: FloatArray, rates: bool, by_clock: bool
) -> tuple[FloatArray, FloatArray]:
    first_s, last_s = t_s.min(), t_s.max()
    middle_s, half_s = (first_s + last_s) / 2, max((last_s - first_s) / 2, _STEP_S)
    c = _FIT @ _orbit(satellite, message, middle_s + half_s * _AT)
    basis = chebvander((t_s - middle_s) / half_s, _NODES - 1)
    if by_clock:
        t_s = t_s - basis @ c[:, 3]
        basis = chebvander((t_s - middle_s) / half_s, _NODES - 1)
    if not rates:
        return basis @ c, np.full((len(t_s), 4), np.nan)
    return basis @ c, basis[:, :-1] @ (chebder(c) / half_s)
