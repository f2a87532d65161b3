"""Compiled formatting of RINEX observation epochs into a buffer of characters."""

import numpy as np

from fgnav.checks import FloatArray, IntArray
from fgnav.io.rinex.text import Bytes
from fgnav.kernels.compiled import inlined, inner, kernel

EPOCH_WIDTH = 36  # with its line end
FIELD_WIDTH = 16
_BLANK, _DOT, _MINUS, _ZERO, _NEWLINE = 32, 46, 45, 48, 10


@inner
def _put_whole(out: Bytes, start: int, end: int, value: int, pad: int) -> None:
    """Write a whole number right-adjusted, padded with ``pad``."""
    for i in range(end - 1, start - 1, -1):
        out[i] = _ZERO + value % 10 if value or i == end - 1 else pad
        value //= 10


@inlined
def _put_thousandths(out: Bytes, p: int, value: float) -> None:
    """Write F14.3. Zero means "not measured" in RINEX, so what rounds to zero is written 0.001."""
    thousandths = int(np.rint(abs(value) * 1e3))
    thousandths = max(thousandths, 1)
    for i in range(p, p + FIELD_WIDTH):
        out[i] = _BLANK
    i = p + 13
    for k in range(14):
        if k == 3:
            out[i] = _DOT
        elif k < 5 or thousandths > 0:
            out[i] = _ZERO + thousandths % 10
            thousandths //= 10
        else:
            break
        i -= 1
    if value < 0:
        out[i] = _MINUS


@inlined
def _put_satellite(
    out: Bytes, p: int, name: Bytes, channels: IntArray, values: FloatArray, flags: Bytes
) -> int:
    """Write one satellite's line if anything was measured; return the offset after it.

    ``channels`` are the columns of ``values`` (4, m) and ``flags`` (m,), -1 where the satellite has
    no such signal; each takes four fields: code, phase, Doppler, carrier-to-noise density.
    """
    end = p
    q = p + 3
    for k in range(len(channels)):
        for c in range(4):
            for i in range(q, q + FIELD_WIDTH):
                out[i] = _BLANK
            channel = channels[k]
            if channel >= 0:
                value = values[c, channel]
                if np.isfinite(value):
                    _put_thousandths(out, q, value)
                    end = q + 14
                if c == 1 and flags[channel]:
                    out[q + 14] = _ZERO + flags[channel]
                    end = q + 15
            q += FIELD_WIDTH
    if end == p:
        return p
    for i in range(3):  # numba takes two seconds for a slice
        out[p + i] = name[i]
    out[end] = _NEWLINE
    return end + 1


@kernel
def format_epochs(
    out: Bytes,
    dates: IntArray,
    names: Bytes,
    channels: IntArray,
    values: FloatArray,
    flags: Bytes,
) -> int:
    """Write epochs of RINEX 3 or 4.

    Parameters
    ----------
    out : ndarray of uint8
        Large enough for every field of every satellite.
    dates : ndarray, (n, 7)
        Year, month, day, hour, minute, second, 1e-7 s.
    names : ndarray of uint8, (s, 3)
        Satellites.
    channels : ndarray, (s, k)
        Columns of each satellite's signals, -1 where it has none.
    values : ndarray, (4, n, m)
        Code, phase, Doppler, carrier-to-noise density; NaN where not measured.
    flags : ndarray of uint8, (n, m)
        Loss-of-lock indicators.

    Returns
    -------
    int
        Characters written.
    """
    p = 0
    for n in range(len(dates)):
        head = p
        for i in range(head, head + EPOCH_WIDTH):
            out[i] = _BLANK
        out[head] = 62  # '>'
        _put_whole(out, head + 2, head + 6, dates[n, 0], _ZERO)
        for k in range(4):
            q = head + 7 + 3 * k
            _put_whole(out, q, q + 2, dates[n, k + 1], _ZERO)
        _put_whole(out, head + 18, head + 21, dates[n, 5], _BLANK)
        out[head + 21] = _DOT
        _put_whole(out, head + 22, head + 29, dates[n, 6], _ZERO)
        out[head + 31] = _ZERO
        out[head + 35] = _NEWLINE
        p += EPOCH_WIDTH
        count = 0
        for s in range(len(names)):
            q = _put_satellite(out, p, names[s], channels[s], values[:, n], flags[n])
            count += q > p
            p = q
        _put_whole(out, head + 32, head + 35, count, _BLANK)
    return p
