"""RINEX observation epochs as text: characters of many epochs at once, then those that count."""

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import FloatArray, IntArray
from fgnav.io.rinex.text import Bytes

_BLANK, _DOT, _MINUS, _ZERO, _NEWLINE = b" .-0\n"
_FIELD = 16  # columns: F14.3, loss-of-lock indicator, signal strength


def epochs_text(
    dates: IntArray, names: Bytes, channels: IntArray, values: FloatArray, flags: Bytes
) -> bytes:
    """Return epochs of RINEX 3 or 4.

    Parameters
    ----------
    dates : ndarray, (n, 7)
        Year, month, day, hour, minute, second, 1e-7 s.
    names : ndarray of uint8, (s, 3)
        Satellites.
    channels : ndarray, (s, k)
        Columns of each satellite's signals, -1 where it has none.
    values : ndarray, (n, m, 4)
        Code, phase, Doppler, carrier-to-noise density; NaN where not measured.
    flags : ndarray of uint8, (n, m)
        Loss-of-lock indicators.
    """
    n, s = len(dates), len(names)
    fields = _thousandths(values)
    fields[:, :, 1, 14] = np.where(flags, _ZERO + flags, _BLANK)
    fields = np.where(channels[:, :, None, None] < 0, _BLANK, fields[:, channels])
    lines = np.full((n, s, 4 + fields[0, 0].size), _BLANK, np.uint8)
    lines[:, :, :3] = names
    lines[:, :, 3:-1] = fields.reshape(n, s, -1)
    ends = np.where(lines[:, :, 3:] != _BLANK, np.arange(4, lines.shape[2] + 1), 0).max(axis=2)
    np.put_along_axis(lines, ends[:, :, None], _NEWLINE, axis=2)
    measured = ends > 0
    kept = measured[:, :, None] & (np.arange(lines.shape[2]) <= ends[:, :, None])
    heads = _heads(dates, measured.sum(axis=1))
    text = np.concatenate([heads, lines.reshape(n, -1)], axis=1)
    kept = np.concatenate([np.ones(heads.shape, np.bool_), kept.reshape(n, -1)], axis=1)
    out: bytes = text[kept].tobytes()
    return out


def _heads(dates: IntArray, satellites: IntArray) -> Bytes:
    """Return the line that begins each epoch, (n, 36)."""
    out = np.full((len(dates), 36), _BLANK, np.uint8)
    out[:, [0, 21, 31, 35]] = b">"[0], _DOT, _ZERO, _NEWLINE
    _put_digits(out[:, 2:6], dates[:, 0], 4)
    for k in range(4):
        _put_digits(out[:, 7 + 3 * k : 9 + 3 * k], dates[:, k + 1], 2)
    _put_digits(out[:, 18:21], dates[:, 5], 1)
    _put_digits(out[:, 22:29], dates[:, 6], 7)
    _put_digits(out[:, 32:35], satellites, 1)
    return out


def _thousandths(values: FloatArray) -> Bytes:
    """Return F14.3 in fields of 16 columns, blank where nothing was measured.

    Zero means "not measured" in RINEX, so what rounds to zero is written 0.001.
    """
    measured = np.isfinite(values)
    whole = np.rint(np.abs(np.where(measured, values, 0.0)) * 1e3).astype(np.int64)
    whole = np.maximum(whole, 1)
    out = np.full((*values.shape, _FIELD), _BLANK, np.uint8)
    _put_digits(out[..., 11:14], whole % 1000, 3)
    out[..., 10] = _DOT
    before = _put_digits(out[..., :10], whole // 1000, 1)
    sign = np.where(values < 0.0, _MINUS, _BLANK).astype(np.uint8)
    np.put_along_axis(out, 9 - before[..., None], sign[..., None], axis=-1)
    out[~measured] = _BLANK
    return out


def _put_digits(out: NDArray[np.uint8], number: IntArray, least: int) -> IntArray:
    """Write whole numbers right-adjusted, with so many digits at the least; return how many."""
    count = np.zeros(number.shape, np.int64)
    for place in range(out.shape[-1] - 1, -1, -1):
        written = (number > 0) | (out.shape[-1] - place <= least)
        out[..., place] = np.where(written, _ZERO + number % 10, out[..., place])
        count += written
        number = number // 10
    return count
