"""Dirty series drawn from a seed: one fault of one of a right flight's sensors.

Values are well-formed, and wrong: by which sensor, axis, when and by how much is drawn.
"""

import numpy as np

from fgnav.types.flight import Flight
from tests.robustness.drawn.draws import Change
from tests.robustness.drawn.gnss import ARRAY, FIXES, OBSERVATIONS
from tests.robustness.drawn.instruments import BAROMETER, MAGNETOMETER, PHOTODETECTOR
from tests.robustness.drawn.series import gravity_free, of_times, of_triad, samples_lost

FAULTS: dict[str, tuple[Change, ...]] = {
    "imu": (*of_triad("imu", "f_b_mps2"), *of_times("imu"), samples_lost, gravity_free),
    "gyroscope": of_triad("imu", "w_b_radps"),
    "fixes": FIXES,
    "observations": OBSERVATIONS,
    "array": ARRAY,
    "barometer": (*BAROMETER, *of_times("barometer")),
    "magnetometer": (
        *of_triad("magnetometer", "field_b_ut"), *of_times("magnetometer"), *MAGNETOMETER,
    ),
    "photodetector": (*PHOTODETECTOR, *of_times("photodetector")),
}  # fmt: skip


def dirty(right: Flight, seed: int) -> tuple[Flight, str]:
    """Return a flight with a fault that is drawn from a seed, of a sensor it has, and its name."""
    rng = np.random.default_rng([91, seed])
    faults = [one for sensor, of in FAULTS.items() if _has(right, sensor) for one in of]
    return faults[int(rng.integers(len(faults)))](right, rng)


def _has(flight: Flight, sensor: str) -> bool:
    if sensor == "gyroscope":
        return flight.imu is not None and flight.imu.w_b_radps is not None
    if sensor == "array":
        return len(flight.antennas) > 1
    return getattr(flight, sensor) not in (None, ())
