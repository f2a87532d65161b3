"""Holes of a recording: keyframes within them, straight lines across, and notes on them."""

import dataclasses

import numpy as np
import pytest

from fgnav.alignment import gaps
from fgnav.geometry import rotations
from fgnav.types.flight import Imu
from tests.assembly.flights import ACCELEROMETER, GYROSCOPE

SECONDS = np.arange(0, 10, 0.01)


def record(t_s=SECONDS, gyro=False):
    f_b = np.stack([np.sin(t_s), 0 * t_s, -9.8 + 0 * t_s], axis=1)
    gyroscope = {"w_b_radps": f_b / 10, **GYROSCOPE} if gyro else {}
    return Imu(t_s=t_s, f_b_mps2=f_b, **ACCELEROMETER, **gyroscope)


def with_hole(imu, from_s, until_s):
    keep = (imu.t_s <= from_s) | (imu.t_s >= until_s)
    rates = None if imu.w_b_radps is None else imu.w_b_radps[keep]
    return dataclasses.replace(imu, t_s=imu.t_s[keep], f_b_mps2=imu.f_b_mps2[keep], w_b_radps=rates)


@pytest.mark.parametrize("gyro", [False, True])
def test_a_hole_is_filled_with_straight_lines_at_the_records_own_rate(gyro):
    holed = with_hole(record(gyro=gyro), 3.0, 5.0)
    bridge = gaps.bridged(holed)
    np.testing.assert_allclose(bridge.gaps_s, [[3.0, 5.0]])
    assert np.diff(bridge.imu.t_s).max() < 0.0151
    own = np.isin(bridge.imu.t_s, holed.t_s)
    assert (bridge.imu.f_b_mps2[own] == holed.f_b_mps2).all()
    middle = np.abs(bridge.imu.t_s - 4.0).argmin()
    assert bridge.imu.f_b_mps2[middle, 0] == pytest.approx((np.sin(3) + np.sin(5)) / 2, abs=0.01)
    assert (bridge.imu.w_b_radps is None) != gyro


@pytest.mark.parametrize("gyro", [False, True])
def test_noise_in_a_hole_is_half_the_specific_force_and_the_rates_own_spread(gyro):
    """Held for two seconds: of a variance s2 that is white noise of the density 4 s2."""
    imu = record(gyro=gyro)
    holed = with_hole(imu, 3.0, 5.0)
    inflated = gaps.bridged(holed).inflated
    size = 9.8**2 + 0.5  # mean square of the specific force
    density = inflated.accelerometer_noise_mps2_per_sqrt_hz**2
    assert density == pytest.approx(4 * (0.5 + size / 4), rel=0.1)
    if gyro:
        density = inflated.gyroscope_noise_radps_per_sqrt_hz**2
        assert density == pytest.approx(4 * holed.w_b_radps.var(axis=0).max(), rel=1e-9)


def test_a_filter_fills_nothing_and_knows_no_spread():
    """A line would end in a sample to come; the size of gravity and a radian a second are known."""
    holed = with_hole(record(gyro=True), 3.0, 5.0)
    bridge = gaps.bridged(holed, causal=True)
    assert bridge.imu is holed
    np.testing.assert_allclose(bridge.gaps_s, [[3.0, 5.0]])
    assert bridge.inflated.accelerometer_noise_mps2_per_sqrt_hz == pytest.approx(2 * 9.8)
    assert bridge.inflated.gyroscope_noise_radps_per_sqrt_hz == pytest.approx(2.0)


def test_a_record_without_holes_stays_as_it_is():
    imu = record()
    bridge = gaps.bridged(imu)
    assert bridge.imu is imu
    assert not bridge.overlaps(np.arange(0, 9.0, 0.1)).any()


def test_keyframes_from_which_the_way_leads_through_a_hole_are_named():
    bridge = gaps.bridged(with_hole(record(), 3.05, 5.05))
    t_s = np.arange(0, 9.05, 0.1)
    overlapping_s = t_s[bridge.overlaps(t_s)]
    assert (overlapping_s[0], overlapping_s[-1]) == pytest.approx((3.0, 5.0))
    assert len(overlapping_s) == 21


@pytest.mark.parametrize(
    ("epochs_s", "expected_s"),
    [
        ([0, 0.1, 0.2, 0.5, 0.6], [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]),
        ([0, 1, 2], np.arange(21) / 10),
        ([0, 0.1, 0.2, 0.31, 0.4], [0, 0.1, 0.2, 0.31, 0.4]),
        ([7.0], [7.0]),
    ],
    ids=["an outage", "one a second", "a late tag", "one epoch"],
)
def test_keyframes_fill_the_time_between_epochs_that_are_far_apart(epochs_s, expected_s):
    epochs_s = np.array(epochs_s, dtype=float)
    np.testing.assert_allclose(gaps.keyframe_times(epochs_s, epochs_s[-1]), expected_s)


def test_a_filters_keyframes_go_on_to_the_end_of_the_inertial_record():
    epochs_s = np.array([0.0, 0.1, 0.2])
    times_s = gaps.keyframe_times(epochs_s, 0.55, causal=True)
    np.testing.assert_allclose(times_s, [0, 0.1, 0.2, 0.3, 0.4, 0.5], rtol=0, atol=1e-12)
    np.testing.assert_allclose(gaps.keyframe_times(epochs_s, 0.55), epochs_s)


@pytest.mark.parametrize(
    ("causal", "expected"), [(False, [0, 0, 2, 2]), (True, [0, 0, 0, 2])], ids=["all", "causal"]
)
def test_a_body_that_spins_has_keyframes_every_seven_tenths_of_a_radian(causal, expected):
    """2.1 rad make three of 0.7; causal: by the turn over the interval before alone."""
    epochs_s, turn_rad = np.arange(5) / 10, np.array([0.1, 0.1, 2.09, 0.1])
    times_s = gaps.keyframe_times(epochs_s, 0.4, turn_rad, causal=causal)
    epoch = np.searchsorted(epochs_s, times_s + 1e-9) - 1
    assert (np.bincount(epoch)[:4] - 1).tolist() == expected
    assert np.isin(np.round(epochs_s, 9), np.round(times_s, 9)).all()


def test_a_filters_keyframes_depend_on_earlier_epochs_alone():
    """Of a flight cut anywhere, the keyframes up to there are those of the whole flight."""
    rng = np.random.default_rng(0)
    epochs_s = np.cumsum(rng.choice([0.1, 0.1, 0.1, 0.35, 1.0], 60))
    turn_rad = rng.uniform(0, 2, 59)
    whole = gaps.keyframe_times(epochs_s, epochs_s[-1] + 0.5, turn_rad, causal=True)
    for k in (3, 20, 41):
        part = gaps.keyframe_times(epochs_s[:k], epochs_s[k - 1], turn_rad[: k - 1], causal=True)
        np.testing.assert_allclose(part, whole[: len(part)], rtol=0, atol=1e-9)


def test_what_is_missing_is_noted_from_measurement_to_measurement():
    t_s = np.arange(0, 10.05, 0.1)
    missing = ((t_s > 2.05) & (t_s < 4.05)) | (np.abs(t_s - 6) < 0.15) | (t_s > 9.05)
    spans = gaps.spans(t_s, missing)
    np.testing.assert_allclose(spans, [[2.0, 4.1], [9.0, 10.0]])
    assert [*gaps.gap_notes("position", spans)] == [
        "No position from 2.00 to 4.10 s.",
        "No position from 9.00 to 10.00 s.",
    ]


def test_measurements_once_a_second_have_no_gaps_between_them():
    t_s = np.arange(0, 10.05, 0.1)
    assert not len(gaps.spans(t_s, np.arange(len(t_s)) % 10 != 0))


def test_many_gaps_end_in_their_number():
    spans = np.array([[k, k + 0.6] for k in range(8)], dtype=float)
    assert [*gaps.gap_notes("velocity", spans)][-1] == (
        "No velocity in 3 more gaps of up to 0.60 s."
    )


def test_a_steady_spin_is_carried_through_whole_turns():
    first, rate = np.eye(3)[None], np.array([[2 * np.pi * 2, 0.1, 0]])
    last = first @ rotations.exp(1.3 * rate)
    carried = gaps.rotation_cubic(first, last, rate, rate, 1.3, np.array(0.4))
    np.testing.assert_allclose(carried, rotations.exp(0.52 * rate), atol=1e-9)


def test_a_rate_that_changes_evenly_is_carried_along_its_cubic():
    """The angle 0.3 t^2: even turning would be off by 0.3 rad in the middle of two seconds."""
    t_s, axis = np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.0, 0.0])
    R_nb = rotations.exp(0.3 * t_s[:, None] ** 2 * axis)
    rates = 0.6 * t_s[:, None] * axis
    carried = gaps.rotation_cubic(R_nb[:1], R_nb[2:], rates[:1], rates[2:], 2.0, np.array(0.5))
    np.testing.assert_allclose(carried[0], R_nb[1], rtol=0, atol=1e-9)


def test_a_filter_counts_from_the_last_attitude_a_smoother_from_the_next_too():
    t_s, valid = np.arange(0, 1.05, 0.1), np.ones(11, dtype=bool)
    valid[3:8] = False
    both = gaps.time_from_attitude_s(t_s, valid)
    np.testing.assert_allclose(both[2:9], [0, 0.1, 0.2, 0.3, 0.2, 0.1, 0], atol=1e-9)
    last = gaps.time_from_attitude_s(t_s, valid, causal=True)
    np.testing.assert_allclose(last[2:9], [0, 0.1, 0.2, 0.3, 0.4, 0.5, 0], atol=1e-9)
