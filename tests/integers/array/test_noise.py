import dataclasses

import numpy as np
import pytest

from fgnav.integers.array.noise import with_estimated_noise
from fgnav.integers.array.search import search_constrained
from tests.integers.arrays import make, simulated

PAIR_B_M = np.array([[0.0, 0.0, 0.0], [1.6, 0.0, 0.0]])
LOW, AROUND = np.radians(15.0), 2 * np.pi / 3 * np.arange(3)
THREE_LOW_N = np.stack(
    [np.cos(LOW) * np.cos(AROUND), np.cos(LOW) * np.sin(AROUND), np.full(3, -np.sin(LOW))], axis=1
)
ONE_ABOVE_THREE_LOW_N = np.vstack([[0.0, 0.0, -1.0], THREE_LOW_N])
CORNER_B_M = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.5, 0.0]])


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


def test_noise_is_not_calmed_by_wrong_integers_that_fit():
    rng = np.random.default_rng(4)
    sky = make(rng, antennas_b_m=CORNER_B_M, satellites=(4,), code_m=0.3).differences
    sky = dataclasses.replace(sky, e_n=ONE_ABOVE_THREE_LOW_N[None])
    d = simulated(sky, np.zeros(40, dtype=np.int64), rng)
    wrong = (search_constrained(d, 10**6).cycles != 0).any(axis=(1, 2))
    assert wrong.mean() > 0.2
    estimated = with_estimated_noise(d, 10**6)
    code = np.sqrt(estimated.code_variance_m2 / d.code_variance_m2).mean()
    phase = np.sqrt(estimated.phase_variance_m2 / d.phase_variance_m2).mean()
    # 0.6 of both where epochs that take long count for calm noise alone
    assert code == pytest.approx(1.0, abs=0.15)
    assert phase == pytest.approx(1.0, abs=0.25)


def test_attitudes_where_two_lines_of_position_touch_are_no_error():
    made = make(np.random.default_rng(1), epochs=150, satellites=(2, 2), antennas_b_m=PAIR_B_M / 3)
    estimated = with_estimated_noise(made.differences, 10**6)
    assert np.isfinite(estimated.phase_variance_m2).all()


def test_few_epochs_are_taken_as_stated():
    made = make(np.random.default_rng(8), epochs=29)
    assert with_estimated_noise(made.differences, 10**6) is made.differences


def test_epochs_that_no_search_gets_through_are_taken_as_stated():
    d = make(np.random.default_rng(9), epochs=40, antennas_b_m=PAIR_B_M).differences
    same = with_estimated_noise(d, nodes=1)
    np.testing.assert_allclose(same.code_variance_m2, d.code_variance_m2, rtol=1e-12)
    np.testing.assert_allclose(same.phase_variance_m2, d.phase_variance_m2, rtol=1e-12)


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
