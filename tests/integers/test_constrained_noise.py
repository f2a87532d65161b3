import dataclasses

import numpy as np
import pytest

from fgnav.integers.constrained_noise import with_estimated_noise

from .arrays import make

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])


@pytest.mark.parametrize("factor", [1 / 3, 1.0, 3.0])
def test_noise_is_estimated_whatever_was_stated(factor):
    made = make(np.random.default_rng(7), epochs=300, code_m=0.5, antennas_b_m=PAIR_B_M)
    d = made.differences
    stated = dataclasses.replace(
        d,
        code_variance_m2=d.code_variance_m2 * factor**2,
        phase_variance_m2=d.phase_variance_m2 * factor**2,
    )
    estimated = with_estimated_noise(stated, 10**6)
    code = np.sqrt(estimated.code_variance_m2 / d.code_variance_m2).mean()
    phase = np.sqrt(estimated.phase_variance_m2 / d.phase_variance_m2).mean()
    # 1000 and 600 degrees of freedom, less what many candidates leave open
    assert code == pytest.approx(1.0, abs=0.10)
    assert phase == pytest.approx(1.0, abs=0.15)


def test_few_epochs_are_taken_as_stated():
    made = make(np.random.default_rng(8), epochs=29)
    assert with_estimated_noise(made.differences, 10**6) is made.differences


def test_noise_that_grows_less_towards_the_horizon_than_stated_is_found_out():
    rng = np.random.default_rng(13)
    made = make(rng, epochs=300, code_m=0.5, antennas_b_m=PAIR_B_M, satellites=(8,))
    d = made.differences
    steep = 1 / np.sin(d.elevation_rad) ** 2
    stated = dataclasses.replace(
        d,
        code_variance_m2=d.code_variance_m2 * steep,
        phase_variance_m2=d.phase_variance_m2 * steep,
    )
    estimated = with_estimated_noise(stated, 10**6)
    for true, found in [
        (d.code_variance_m2, estimated.code_variance_m2),
        (d.phase_variance_m2, estimated.phase_variance_m2),
    ]:
        power, _ = np.polyfit(np.log(steep).ravel(), np.log(found / true).ravel(), 1)
        assert abs(power) < 0.25  # 1 as stated; 0 is true
        assert np.exp(np.log(found / true).mean() / 2) == pytest.approx(1.0, abs=0.1)


def test_a_few_spoilt_epochs_do_not_raise_the_noise_of_all():
    made = make(np.random.default_rng(14), epochs=200, code_m=0.5, satellites=(7,))
    phase_m = made.differences.phase_m.copy()
    phase_m[::10, 2, 3] += 0.05
    spoilt = dataclasses.replace(made.differences, phase_m=phase_m)
    estimated = with_estimated_noise(spoilt, 10**6)
    phase = np.sqrt(estimated.phase_variance_m2 / spoilt.phase_variance_m2).mean()
    assert phase < 1.2  # the mean square would say 1.9
