"""Receiver clocks: an offset, and an oscillator whose frequency walks at random."""

import numpy as np

from fgnav.checks import FloatArray
from fgnav_sim.gnss.tables import ClockTable


def clocks(
    clock: ClockTable, t_s: FloatArray, antennas: int, *, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Return offsets, s, and drifts, s/s, of the receivers' clocks, each (n, a).

    The drift walks at random and the offset is its integral (trapezoids).
    """
    oscillators = antennas if clock.oscillator == "separate" else 1
    step_s = np.diff(t_s, prepend=t_s[:1])[:, None]
    steps_sps = np.sqrt(step_s) * rng.standard_normal((len(t_s), oscillators))
    drift_sps = clock.drift_sps * rng.standard_normal(oscillators)
    drift_sps = drift_sps + clock.drift_walk_sps_per_sqrt_s * np.cumsum(steps_sps, axis=0)
    mean_sps = 0.5 * (drift_sps + np.vstack([drift_sps[:1], drift_sps[:-1]]))
    offset_s = clock.offset_s * rng.standard_normal(antennas)
    offset_s = offset_s + np.cumsum(mean_sps * step_s, axis=0)
    return offset_s, np.broadcast_to(drift_sps, offset_s.shape)
