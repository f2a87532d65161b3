"""Every fault and every loss makes a flight that can be written; what becomes of it: benchmarks."""

import numpy as np
import pytest

from fgnav.io.flight.folder import load_flight, save_flight
from tests.robustness.drawn.dirty import FAULTS, dirty
from tests.robustness.drawn.flights import KINDS, right_flight
from tests.robustness.drawn.lacking import lacking


@pytest.fixture(scope="module", params=KINDS)
def right(request):
    return right_flight(request.param, 1)


def test_a_fault_changes_a_flight_and_says_how(right):
    texts = [dirty(right, seed)[1] for seed in range(60)]
    assert len(set(texts)) > 0.9 * len(texts)  # some are drawn alike
    assert dirty(right, 7)[1] == dirty(right, 7)[1]


def test_every_fault_can_be_drawn(right):
    rng = np.random.default_rng(0)
    for sensor, faults in FAULTS.items():
        is_there = {"gyroscope": "imu", "array": "observations"}.get(sensor, sensor)
        if getattr(right, is_there) is None or (sensor == "array" and len(right.antennas) < 2):
            continue
        if sensor == "gyroscope" and right.imu.w_b_radps is None:
            continue
        for fault in faults:
            flight, text = fault(right, rng)
            assert flight is not right
            assert text


def test_what_is_left_of_a_flight_can_be_written_and_read(right, tmp_path):
    for seed in range(3):
        flight, text = lacking(right, seed)
        assert text
        save_flight(flight, tmp_path / str(seed))
        load_flight(tmp_path / str(seed))
