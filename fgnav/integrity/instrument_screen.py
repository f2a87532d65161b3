"""Barometer, detector and magnetometer without samples that only repeat the one before."""

import numpy as np

from fgnav.checks import BoolArray, FloatArray, Unused, unused_of
from fgnav.integrity.imu_recording import coarse_step
from fgnav.integrity.imu_screen import STUCK, stuck_samples
from fgnav.types.flight import Flight


def screen_instruments(flight: Flight) -> tuple[Flight, tuple[Unused, ...]]:
    """Return a flight without samples of stuck instruments, and their numbers.

    The rule is that of a stuck unit (``imu_screen``). Of a detector that sees nothing all
    samples are alike, and of values that are recorded in steps beyond their noise many.
    """
    barometer, field, photodetector = flight.barometer, flight.magnetometer, flight.photodetector
    stuck: dict[str, BoolArray] = {}
    if barometer is not None:
        stuck["barometer"] = _stuck(barometer.height_m[:, None], barometer.noise_m)
    if field is not None:
        stuck["magnetometer"] = _stuck(field.field_b_ut, field.noise_ut)
    if photodetector is not None:
        lit = np.flatnonzero(photodetector.currents.min(axis=1) > 0)
        stuck["photodetector"] = np.zeros(len(photodetector.t_s), dtype=np.bool_)
        stuck["photodetector"][lit] = stuck_samples(photodetector.currents[lit])
    stuck = {name: bad for name, bad in stuck.items() if bad.any()}
    if not stuck:
        return flight, ()
    records = {n: one[~stuck[n]] if n in stuck else one for n, one in flight.records.items()}
    unused = {(f"{name} sample", STUCK): int(bad.sum()) for name, bad in stuck.items()}
    return flight.with_records(records), unused_of(unused)


def _stuck(x: FloatArray, noise: float) -> BoolArray:
    if coarse_step(x, noise) is not None:
        return np.zeros(len(x), dtype=np.bool_)
    return stuck_samples(x)
