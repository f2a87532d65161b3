"""The turning flight of these tests is what it says: what it measures is off the truth by noise."""

import numpy as np
import pytest

from tests.assembly.flights import turning


@pytest.fixture(scope="module", params=[False, True], ids=["without a gyroscope", "with one"])
def case(request):
    return turning(np.random.default_rng(0), span_s=20.0, gyro=request.param)


def test_what_is_measured_is_off_the_truth_by_white_noise_of_its_size(case):
    for part in case.problem.sensors:
        which = np.arange(len(part.row))
        value = part.linearise(case.true_states.at(part.row), which).value
        # The array's form has nine rows, of which a rotation has three; noise of all nine is white.
        degrees = part.freedom.sum()
        assert abs((value**2).sum() / degrees - 1) < 5 * np.sqrt(2 / degrees), part.name


def test_the_motion_leads_from_each_true_state_to_the_next(case):
    """But for biases, 0.05 m/s2 at most, and a rate that states without a gyroscope only begin."""
    states, k = case.true_states, np.arange(0, 200, 7)
    after = case.problem.motion.predict(states.at(k), k)
    off_m = np.linalg.norm(after.p_n_m - states.p_n_m[k + 1], axis=1)
    off_mps = np.linalg.norm(after.v_n_mps - states.v_n_mps[k + 1], axis=1)
    assert off_m.max() < 0.002
    assert off_mps.max() < 0.04
