"""One satellite at many times: a polynomial through its orbit at a few of them.

An orbit is smooth: ten nodes tell ten minutes of it to rounding, and their slopes its velocity.
Pieces begin at whole multiples of ten minutes, and the polynomial of a piece is the same whatever
times are asked for: what is said of one time depends on no other.
"""

from functools import lru_cache

import numpy as np
from numpy.polynomial.chebyshev import chebder, chebpts1, chebval, chebvander

from fgnav.checks import FloatArray
from fgnav.gnss.orbits.broadcast import Chosen, kepler_orbit
from fgnav.types.orbits import EPHEMERIS_DTYPE

_NODES = 10
_PIECE_S = 600.0  # 2.5 degrees to both sides of the middle: what is cut off is below 1e-8 m
_HALF_S = _PIECE_S / 2
_KEPT = 8192  # pieces, 1 kB each: a day of all that is seen at a place
_AT = chebpts1(_NODES)
_FIT = np.linalg.inv(chebvander(_AT, _NODES - 1))


def orbit_at(
    chosen: Chosen, t_s: FloatArray, *, rates: bool, by_clock: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return where a satellite is and how its clock stands, and the rates of both, (n, 4) each.

    Parameters
    ----------
    chosen : Chosen
        Its messages for these times.
    t_s : ndarray, shape (n,)
        Where the message is not usable the answer is NaN.
    rates : bool
        Rates are wanted; else they are NaN.
    by_clock : bool
        Times are those that the satellite's own clock shows.
    """
    out = np.full((len(t_s), 8), np.nan)
    wanted = slice(8 if rates else 4)
    usable = np.flatnonzero(chosen.usable)
    piece = np.floor(t_s[usable] / _PIECE_S).astype(np.int64)
    label = piece * len(chosen.records) + chosen.row[usable]  # each piece has one message
    while len(usable):
        is_same = label == label[0]
        rows = usable[is_same]
        middle_s = (piece[0] + 0.5) * _PIECE_S
        c = _polynomials(chosen.records[chosen.row[rows[0]]].tobytes(), middle_s)
        u = (t_s[rows] - middle_s) / _HALF_S
        if by_clock:
            u = u - chebval(u, c[:, 3]) / _HALF_S
        out[rows, wanted] = chebval(u, c[:, wanted]).T
        usable, label, piece = usable[~is_same], label[~is_same], piece[~is_same]
    return out[:, :4], out[:, 4:]


@lru_cache(_KEPT)
def _polynomials(message: bytes, middle_s: float) -> FloatArray:
    """Return coefficients of the state in a piece, and of its rates, (10, 8)."""
    record = np.frombuffer(message, EPHEMERIS_DTYPE)
    at_nodes = kepler_orbit(str(record["satellite"][0]), record, middle_s + _HALF_S * _AT)
    c = _FIT @ np.column_stack(at_nodes)
    return np.hstack([c, np.vstack([chebder(c) / _HALF_S, np.zeros(4)])])
