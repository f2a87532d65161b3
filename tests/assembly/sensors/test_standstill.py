"""Seconds in which a body stands still."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.alignment.gaps import bridged
from fgnav.assembly.sensors.standstill import standing
from fgnav.assembly.truncation import truncated
from fgnav.integrity.imu_screen import screen_imu
from tests.assembly.stops import AT_REST, SIGMA_MPS, STOPS_S, measured, stops

LOST_S = (50.0, 75.0)
T_S = np.arange(0.0, 79.9, 0.25)


def seconds(of_spans):
    """Return keyframes, once a second, whose two seconds before lie within spans."""
    inside = [(first + 2.0 <= T_S) & (last >= T_S) for first, last in of_spans]
    return np.flatnonzero(np.any(inside, axis=0) & (T_S % 1.0 == 0))


def found(flight, t_s=T_S, *, causal=False, velocities=True):
    record = bridged(screen_imu(flight.imu)[0], causal=causal)
    return standing(record, t_s, measured(flight, t_s, velocities=velocities), causal=causal)


@pytest.mark.parametrize("velocities", [True, False], ids=["velocities", "positions alone"])
@pytest.mark.parametrize("lost_s", [(np.inf, np.inf), LOST_S], ids=["fixes", "fixes lost"])
def test_the_seconds_of_stops_and_no_others_are_found(lost_s, velocities):
    missed, rest = 0, seconds(STOPS_S)
    for seed in range(1, 21):
        flight = stops(seed, lost_s=lost_s)
        stands = found(flight, velocities=velocities)
        missed += len(np.setdiff1d(rest, stands.row))
        # The car creeps at less than 5 cm/s in the first and last .2 s of a drive.
        speed = np.interp(T_S, flight.truth.t_s, flight.truth.v_n_mps[:, 0])
        assert speed[np.setdiff1d(stands.row, rest)].max(initial=0.0) < 3 * SIGMA_MPS
    # 5 % of 620 are to be missed, three sigmas of which are 2.6 %.
    assert missed < 0.076 * 20 * len(rest)


def test_sigma_is_what_gnss_measures_at_rest():
    stands = found(stops(1))
    # Of 100 velocities, three axes: 4 %; positions a quarter of a second late creep.
    np.testing.assert_allclose(stands.sigma_mps, SIGMA_MPS, rtol=0.2)


def test_zero_velocity_weighs_little_where_gnss_is_lost_and_samples_do_not_show_rest():
    flight = stops(4, on_road=AT_REST, lost_s=LOST_S)
    stands = found(flight)
    lost = (T_S[stands.row] >= 51.0) & (T_S[stands.row] <= 75.0)
    assert lost.sum() > 10
    assert np.any(T_S[stands.row[lost]] < 54.0)  # at 8 m/s
    speed = np.interp(T_S[stands.row], flight.truth.t_s, flight.truth.v_n_mps[:, 0])
    assert speed[~lost].max() < 3 * SIGMA_MPS
    assert np.all(stands.sigma_mps[lost] > 4.0)  # 8 m/s along one of three axes: 4.6


def test_a_hover_is_as_fast_as_gnss_measures_it():
    rng, flight = np.random.default_rng(3), stops(1)
    sway = 0.3 * np.sin(np.outer(flight.fixes[0].t_s, [0.7, 0.9, 0.5]))
    fixes = replace(flight.fixes[0], v_n_mps=sway + rng.normal(0, SIGMA_MPS, sway.shape))
    stands = found(replace(flight, fixes=(fixes,)))
    # At its turning points alone: 4 of 79 seconds may seem to.
    assert len(stands.row) <= 4


@pytest.mark.parametrize(("speed_mps", "is_told"), [(0.4, False), (8.0, True)])
def test_rest_is_told_only_from_speeds_beyond_what_gnss_resolves(speed_mps, is_told):
    """At 2 m/s noise: a vehicle that goes 8 m/s else stands, one that may creep does not."""
    flight, rng = stops(1), np.random.default_rng(4)
    v_n_mps = np.array(flight.fixes[0].v_n_mps)
    moving = np.abs(v_n_mps[:, :1]) > 3 * SIGMA_MPS
    v_n_mps = np.where(moving, [speed_mps, 0.0, 0.0], 0.0) + rng.normal(0, 2.0, v_n_mps.shape)
    fixes = replace(
        flight.fixes[0], v_n_mps=v_n_mps, velocity_sigma_mps=np.full(v_n_mps.shape, 2.0)
    )
    assert (len(found(replace(flight, fixes=(fixes,))).row) > 0) == is_told


def test_a_second_of_even_acceleration_is_no_rest():
    """It shakes no more than rest does; GNSS says nothing of it."""
    flight = stops(1, lost_s=(35.0, 40.0))
    force = flight.imu.f_b_mps2.copy()
    force[(flight.imu.t_s > 36.0) & (flight.imu.t_s <= 37.0), 0] += 0.3
    moved = found(replace(flight, imu=replace(flight.imu, f_b_mps2=force)))
    assert np.isin([37.0, 38.0], T_S[found(flight).row]).all()
    assert not np.isin([37.0, 38.0], T_S[moved.row]).any()


def test_a_unit_that_repeats_its_samples_does_not_stand():
    flight = stops(1, lost_s=(18.0, 27.0))
    force, rate = flight.imu.f_b_mps2.copy(), flight.imu.w_b_radps.copy()
    stuck = (flight.imu.t_s > 20.0) & (flight.imu.t_s < 25.0)
    force[stuck], rate[stuck] = force[2000], rate[2000]
    imu = replace(flight.imu, f_b_mps2=force, w_b_radps=rate)
    stands = found(replace(flight, imu=imu))
    assert not np.any((T_S[stands.row] > 18.0) & (T_S[stands.row] < 27.0))


def test_nothing_looks_ahead():
    flight = stops(1, lost_s=LOST_S)
    whole = found(flight, causal=True)
    assert len(whole.row) > 20
    for cut_s in (9.1, 33.7, 61.2):
        part, known = truncated(flight, cut_s), T_S[cut_s >= T_S]
        stands = found(part, known, causal=True)
        due = whole.row < len(known)
        np.testing.assert_array_equal(stands.row, whole.row[due])
        np.testing.assert_allclose(stands.sigma_mps, whole.sigma_mps[due], rtol=1e-9)


def test_velocities_known_in_some_directions_are_left_out():
    flight = stops(1)
    record, motion = bridged(screen_imu(flight.imu)[0]), measured(flight, T_S)
    (speed,) = motion.velocities
    some = speed.valid & (np.abs(T_S - np.mean(LOST_S)) < np.ptp(LOST_S) / 2)
    value, covariance = speed.value.copy(), speed.covariance.copy()
    value[some], covariance[some] = np.nan, 0.0
    none = replace(speed, value=value, covariance=covariance)
    value, root = np.where(some[:, None], 0.0, value), np.zeros((len(T_S), 3, 3))
    root[some, 0] = 1 / SIGMA_MPS
    partial = replace(none, value=value, partial=root)
    found, expected = (
        standing(record, T_S, replace(motion, velocities=(one,))) for one in (partial, none)
    )
    assert len(expected.row) > 20
    np.testing.assert_array_equal(found.row, expected.row)
    np.testing.assert_array_equal(found.sigma_mps, expected.sigma_mps)
