"""One satellite at many times: a polynomial through its orbit at a few of them.

An orbit is smooth: ten nodes tell ten minutes of it to rounding, and their slopes its velocity.
Pieces begin at whole multiples of ten minutes, and the polynomial of a piece is the same whatever
times are asked for: what is said of one time depends on no other.
"""

from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebpts1, chebval, chebvander
from numpy.typing import NDArray

from fgnav.checks import FloatArray
from fgnav.gnss.orbits.broadcast import Chosen, kepler_orbit

_NODES = 10
_PIECE_S = 600.0  # 2.5 degrees to both sides of the middle: what is cut off is below 1e-8 m
_AT = chebpts1(_NODES)
_FIT = np.linalg.inv(chebvander(_AT, _NODES - 1))


def orbit_at(
    satellite: str, chosen: Chosen, t_s: FloatArray, *, rates: bool, by_clock: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return where a satellite is and how its clock stands, and the rates of both, (n, 4) each.

    Parameters
    ----------
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
    piece = np.floor(t_s[usable] / _PIECE_S).astype(np.int64)
    label = piece * len(chosen.records) + chosen.row[usable]  # each piece has one message
    while len(usable):
        one = label == label[0]
        rows = usable[one]
        message = chosen.records[chosen.row[rows[:1]]]
        middle_s = (piece[0] + 0.5) * _PIECE_S
        state[rows], rate[rows] = _in_piece(
            satellite, message, middle_s, t_s[rows], rates=rates, by_clock=by_clock
        )
        usable, label, piece = usable[~one], label[~one], piece[~one]
    return state, rate


def _orbit(satellite: str, message: NDArray[Any], t_s: FloatArray) -> FloatArray:
    return np.column_stack(kepler_orbit(satellite, message, t_s))


def _in_piece(
    satellite: str,
    message: NDArray[Any],
    middle_s: float,
    t_s: FloatArray,
    *,
    rates: bool,
    by_clock: bool,
) -> tuple[FloatArray, FloatArray]:
    half_s = _PIECE_S / 2
    c = _FIT @ _orbit(satellite, message, middle_s + half_s * _AT)
    u = (t_s - middle_s) / half_s
    if by_clock:
        u = u - chebval(u, c[:, 3]) / half_s
    state = chebval(u, c).T
    rate = chebval(u, chebder(c) / half_s).T if rates else np.full_like(state, np.nan)
    return state, rate
