from dataclasses import replace

import numpy as np
import pytest

from fgnav.integrity.imu_screen import (
    screen_imu,
    screen_imu_causally,
    without_repeated,
    without_spikes,
    without_stuck_axes,
)
from tests.imu import imu_of

T_S = np.arange(0, 10, 0.01)


@pytest.fixture
def imu():
    rng = np.random.default_rng(31_000)
    turn = np.sin(2 * T_S)[:, None] * [3.0, 1.0, 0.5]
    return imu_of(
        T_S,
        np.array([0.0, 0.0, -9.8]) + turn + 0.02 * rng.normal(size=(len(T_S), 3)),
        turn + 0.01 * rng.normal(size=(len(T_S), 3)),
    )


def test_a_record_without_spikes_is_itself(imu):
    same, unused = without_spikes(imu)
    assert same is imu
    assert unused == ()


def test_a_step_of_thrust_is_no_spike(imu):
    pushed = replace(imu, f_b_mps2=imu.f_b_mps2 + np.where(T_S > 5, 50.0, 0.0)[:, None])
    assert without_spikes(pushed)[0] is pushed


def test_spikes_are_replaced_by_their_neighbours_and_counted(imu):
    force, rate = imu.f_b_mps2.copy(), imu.w_b_radps.copy()
    force[[100, 500], 1] += [200.0, -40.0]
    rate[700, 2] -= 5.0
    mended, (loss,) = without_spikes(replace(imu, f_b_mps2=force, w_b_radps=rate))
    assert (loss.what, loss.count) == ("inertial sample", 3)
    assert "the accelerometer and the gyroscope" in loss.reason
    assert np.abs(mended.f_b_mps2 - imu.f_b_mps2).max() < 0.15
    assert np.abs(mended.w_b_radps - imu.w_b_radps).max() < 0.1


def test_spikes_beside_each_other_stand_for_none_of_the_other(imu):
    """A spike of the next sample, on another axis, and one of the sample after that."""
    force = imu.f_b_mps2.copy()
    force[100, 0] += 200.0
    force[101, 1] -= 200.0
    force[[500, 502], 2] += 200.0
    mended, (loss,) = without_spikes(replace(imu, f_b_mps2=force))
    assert loss.count == 5  # that between two of one axis among them
    assert np.abs(mended.f_b_mps2 - imu.f_b_mps2).max() < 0.2


def test_samples_of_a_louder_second_are_no_spikes(imu):
    rng = np.random.default_rng(31_001)
    loud = np.where((T_S > 5) & (T_S < 6.5), 1.0, 0.0)[:, None] * rng.normal(size=(len(T_S), 3))
    noisy = replace(imu, f_b_mps2=imu.f_b_mps2 + loud)
    assert without_spikes(noisy)[0] is noisy


def test_the_first_and_the_last_sample_may_be_spikes(imu):
    force = imu.f_b_mps2.copy()
    force[[0, -1], 0] += [30.0, -30.0]
    mended, (loss,) = without_spikes(replace(imu, f_b_mps2=force))
    assert loss.count == 2
    assert np.abs(mended.f_b_mps2 - imu.f_b_mps2).max() < 0.15


def test_a_short_record_and_one_without_gyroscope_are_taken(imu):
    assert (
        without_spikes(
            replace(imu, t_s=T_S[:50], f_b_mps2=imu.f_b_mps2[:50], w_b_radps=imu.w_b_radps[:50])
        )[1]
        == ()
    )
    force = imu.f_b_mps2.copy()
    force[100] += 200.0
    names = ("noise_radps_per_sqrt_hz", "bias_radps", "bias_walk_radps_per_sqrt_s")
    bare = replace(imu, f_b_mps2=force, w_b_radps=None, **{f"gyroscope_{n}": None for n in names})
    _, (loss,) = without_spikes(bare)
    assert loss.count == 1


def test_a_stuck_unit_leaves_a_gap_and_is_counted(imu):
    force, rate = imu.f_b_mps2.copy(), imu.w_b_radps.copy()
    force[300:400], rate[300:400] = force[300], rate[300]
    force[600:620], rate[600:620] = force[600], rate[600]
    left, (loss,) = screen_imu(replace(imu, f_b_mps2=force, w_b_radps=rate))
    assert loss.count == 99 + 19
    assert "repeat the sample before" in loss.reason
    assert sorted(np.round(np.diff(left.t_s), 6))[-2:] == [0.2, 1.0]


def test_an_axis_that_stands_while_others_move_leaves_a_gap_and_is_counted(imu):
    rate = imu.w_b_radps.copy()
    rate[300:400, 1] = rate[300, 1]
    left, (loss,) = screen_imu(replace(imu, w_b_radps=rate))
    assert loss.count == 100
    assert "axis y of the gyroscope stands still" in loss.reason
    np.testing.assert_array_equal(left.t_s, np.delete(T_S, slice(300, 400)))


def test_samples_at_the_end_of_a_range_are_left_out_the_first_of_a_run_too(imu):
    limit = 2.0  # of a sine of 3
    clipped = replace(imu, f_b_mps2=np.clip(imu.f_b_mps2, [-limit, -9, -20], [limit, 9, 9]))
    at_end = np.abs(imu.f_b_mps2[:, 0]) >= limit
    left, (loss,) = without_stuck_axes(clipped)
    assert loss.count == at_end.sum()
    np.testing.assert_array_equal(left.t_s, T_S[~at_end])


def test_a_record_that_is_all_at_the_end_of_its_range_is_kept(imu):
    clipped = replace(imu, f_b_mps2=np.clip(imu.f_b_mps2, [-0.02, -9, -20], [0.02, 9, 9]))
    assert without_stuck_axes(clipped)[0] is clipped


def test_of_a_record_that_is_mostly_at_the_end_of_its_range_the_rest_is_left(imu):
    limit, short = 1.0, imu[:400]  # of a sine of 3
    clipped = replace(short, f_b_mps2=np.clip(short.f_b_mps2, [-limit, -9, -20], [limit, 9, 9]))
    left, (loss,) = without_stuck_axes(clipped)
    np.testing.assert_array_equal(left.t_s, short.t_s[np.abs(short.f_b_mps2[:, 0]) < limit])
    assert len(left.t_s) < 100
    assert len(left.t_s) + loss.count == len(short.t_s)


def test_a_record_stuck_soon_after_it_begins_is_kept(imu):
    rate = imu.w_b_radps.copy()
    rate[50:, 1] = rate[50, 1]
    stuck = replace(imu, w_b_radps=rate)
    assert without_stuck_axes(stuck)[0] is stuck


def test_a_right_record_and_one_at_rest_without_noise_are_kept(imu):
    assert screen_imu(imu)[0] is imu
    still = replace(imu, f_b_mps2=0 * imu.f_b_mps2, w_b_radps=0 * imu.w_b_radps)
    assert screen_imu(still)[0] is still


def test_a_stuck_unit_is_known_by_what_came_before(imu):
    force, rate = imu.f_b_mps2.copy(), imu.w_b_radps.copy()
    force[300:400], rate[300:400] = force[300], rate[300]
    stuck = replace(imu, f_b_mps2=force, w_b_radps=rate)
    left, (loss,) = screen_imu_causally(stuck)
    assert loss.count > 90
    assert np.isin(stuck.t_s[:302], left.t_s).all()
    assert np.isin(stuck.t_s[400:], left.t_s).all()
    for end in (250, 330, 420):  # what comes later does not matter
        parts = {n: getattr(stuck, n)[:end] for n in ("t_s", "f_b_mps2", "w_b_radps")}
        part, _ = screen_imu_causally(replace(stuck, **parts))
        np.testing.assert_array_equal(part.t_s, left.t_s[left.t_s <= stuck.t_s[end - 1]])


def test_right_records_so_far_are_kept(imu):
    assert screen_imu_causally(imu)[0] is imu
    still = replace(imu, f_b_mps2=0 * imu.f_b_mps2, w_b_radps=0 * imu.w_b_radps)
    assert screen_imu_causally(still)[0] is still


@pytest.mark.parametrize("causal", [False, True])
def test_a_slower_sensor_keeps_what_it_measured(imu, causal):
    k = np.arange(len(T_S))
    held = replace(imu, w_b_radps=imu.w_b_radps[k // 4 * 4])
    left, unused = without_repeated(held, causal=causal)
    fresh = (k % 4 == 0) | (causal & (k < 99))  # fewer samples tell nothing
    at = np.searchsorted(left.t_s, T_S[fresh])
    np.testing.assert_array_equal(left.w_b_radps[at], held.w_b_radps[fresh])
    assert len(left.t_s) == (fresh.sum() if causal else k[fresh][-1] + 1)
    assert [one.count for one in unused] == [(~fresh).sum()]
    assert "the gyroscope repeats the sample before at even intervals" in unused[0].reason


def test_what_is_held_beside_keeps_all_of_the_other_sensor(imu):
    k = np.arange(len(T_S))
    left, _ = without_repeated(replace(imu, w_b_radps=imu.w_b_radps[k // 4 * 4]))
    np.testing.assert_array_equal(left.f_b_mps2, imu.f_b_mps2[: len(left.t_s)])
    off = left.w_b_radps - imu.w_b_radps[: len(left.t_s)]
    assert off.std() < 2 * 0.01  # both have their noise; held, it is .02 to .09 off


def test_coarse_steps_and_samples_as_drawn_are_not_held(imu):
    assert without_repeated(imu)[0] is imu
    coarse = replace(imu, f_b_mps2=np.round(imu.f_b_mps2 / 3.0) * 3.0)
    assert (np.diff(coarse.f_b_mps2, axis=0) == 0).all(axis=1).mean() > 0.5
    assert without_repeated(coarse)[0] is coarse


def test_what_is_held_so_far_does_not_depend_on_what_comes(imu):
    held = replace(imu, f_b_mps2=imu.f_b_mps2[np.arange(len(T_S)) // 5 * 5])
    whole, part = (without_repeated(one, causal=True)[0].t_s for one in (held, held[:600]))
    np.testing.assert_array_equal(whole[whole <= T_S[599]], part)
