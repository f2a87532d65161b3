"""Compiled passes over RTKLIB's observation records: count what they hold, and spread it."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fgnav.checks import BoolArray, FloatArray, IntArray
from fgnav.kernels.compiled import kernel

_OWN = 255  # the record's own code tells the signal


@kernel
def count_records(
    records: NDArray[Any], signals: IntArray, totals: IntArray, present: BoolArray
) -> None:
    """Count the values of each satellite and slot, and note the signals with code or phase.

    Parameters
    ----------
    records : ndarray of RTKLIB's ``Record``, (k,)
    signals : ndarray, (satellites, 3)
        RTKLIB's code of each satellite's slots; 0 where nothing was chosen, 255 where the record
        tells.
    totals : ndarray, (satellites, 3, 7)
        Filled: values other than zero of code, phase, Doppler and carrier-to-noise density, sums of
        code and phase in thousandths, sum of loss-of-lock indicators.
    present : ndarray of bool, (satellites, codes)
        Filled.
    """
    for k in range(len(records)):
        record = records[k]
        sat = record.sat
        for slot in range(3):
            total = totals[sat, slot]
            code, phase = record.P[slot], record.L[slot]
            total[0] += code != 0.0
            total[1] += phase != 0.0
            total[2] += record.D[slot] != 0.0
            total[3] += record.SNR[slot] != 0.0
            total[4] += int(np.rint(code * 1e3))
            total[5] += int(np.rint(phase * 1e3))
            total[6] += record.LLI[slot] & 3
            if code != 0.0 or phase != 0.0:
                signal = signals[sat, slot]
                present[sat, record.code[slot] if signal == _OWN else signal] = True


@kernel
def spread_records(
    records: NDArray[Any],
    signals: IntArray,
    epoch: IntArray,
    column: IntArray,
    values: FloatArray,
    flags: IntArray,
    density: FloatArray,
) -> None:
    """Put the values of each record at its epoch and channel.

    Parameters
    ----------
    records, signals
        As of ``count_records``.
    epoch : ndarray, (k,)
    column : ndarray, (satellites, codes)
        Channel of each satellite and signal, -1 where it has none.
    values : ndarray, (3, n, m)
        Filled: code, phase, Doppler.
    flags : ndarray of uint8, (n, m)
        Filled.
    density : ndarray of float32, (n, m)
        Filled: carrier-to-noise density.
    """
    for k in range(len(records)):
        record = records[k]
        sat = record.sat
        for slot in range(3):
            signal = signals[sat, slot]
            channel = column[sat, record.code[slot] if signal == _OWN else signal]
            if channel < 0:
                continue
            row = epoch[k]
            if record.P[slot] != 0.0:
                values[0, row, channel] = record.P[slot]
            if record.L[slot] != 0.0:
                values[1, row, channel] = record.L[slot]
            if record.D[slot] != 0.0:  # float32 in RTKLIB: back to the three decimals of the file
                values[2, row, channel] = np.rint(float(record.D[slot]) * 1e3) / 1e3
            if record.SNR[slot] != 0.0:
                density[row, channel] = np.rint(float(record.SNR[slot]) * 1e3) / 1e3
            flags[row, channel] |= record.LLI[slot] & 3
