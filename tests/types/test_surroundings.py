import dataclasses

import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.types.surroundings import Barometer, Magnetometer

BAROMETER = Barometer(
    t_s=np.arange(3.0), height_m=np.array([700.0, 701.0, 702.0]), noise_m=0.3, offset_m=20.0
)
MAGNETOMETER = Magnetometer(
    t_s=np.arange(3.0),
    field_b_ut=np.ones((3, 3)),
    field_n_ut=np.array([25.8, -0.2, 36.6]),
    noise_ut=0.3,
    hard_iron_ut=2.0,
)


def test_arrays_are_read_only_copies():
    for array in (BAROMETER.height_m, MAGNETOMETER.field_b_ut, MAGNETOMETER.field_n_ut):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    ("part", "change", "text"),
    [
        (BAROMETER, {"t_s": np.array([0.0, 2.0, 1.0])}, "barometer t_s: time must increase"),
        (BAROMETER, {"height_m": np.zeros(2)}, r"barometer height_m: expected shape \(3,\)"),
        (BAROMETER, {"noise_m": 0.0}, "barometer noise_m: must be positive"),
        (BAROMETER, {"wander_m": -1.0}, "barometer wander_m: must be 0 or positive, got -1"),
        (MAGNETOMETER, {"t_s": np.zeros(3)}, "magnetometer t_s: time must increase"),
        (MAGNETOMETER, {"field_n_ut": np.zeros(3)}, "field_n_ut: must not be zero"),
        (MAGNETOMETER, {"hard_iron_ut": np.nan}, "hard_iron_ut: must be positive"),
    ],
)
def test_bad_values_are_named(part, change, text):
    with pytest.raises(BadInputError, match=text):
        dataclasses.replace(part, **change)
