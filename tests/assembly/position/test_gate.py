"""Fixes that jump are left out; those that only are noisy stay."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.assembly.position.antenna_motion import AntennaMotion
from fgnav.assembly.position.gate import InertialTrack, gated
from fgnav.assembly.position.series import VectorSeries
from tests.assembly.flights import turning


def case(seed=0, velocity=True):
    """A turning flight, its fixes, 1 m and 0.05 m/s, and what they are held against."""
    flight = turning(np.random.default_rng(seed), span_s=30.0)
    return flight, flight.position, flight.velocity if velocity else None


def gate(flight, position, velocity, untested=None):
    problem = flight.problem
    n, R_nb = len(problem.t_s), problem.start.R_nb
    track = InertialTrack(
        t_s=problem.t_s,
        R_nb=R_nb,
        R_nu=R_nb,
        w_b_radps=problem.start.aux[:, 3:6],
        imu=flight.imu,
        gravity_n_mps2=problem.motion.gravity_n_mps2,
        untested=np.zeros(n, dtype=bool) if untested is None else untested,
        attitude_sigma_rad=np.zeros(n),
    )
    antenna = AntennaMotion(
        positions=() if position is None else (replace(position, antenna="a1"),),
        velocities=() if velocity is None else (replace(velocity, antenna="a1"),),
    )
    return gated(track, antenna)


def moved(series, rows, by):
    value = series.value.copy()
    value[rows] += by
    return VectorSeries(value=value, covariance=series.covariance, arm_b_m=series.arm_b_m)


@pytest.mark.parametrize("velocity", [True, False], ids=["with velocities", "without"])
def test_jumps_of_twenty_metres_and_more_are_found_and_nothing_else(velocity):
    for seed in range(3):
        flight, position, speeds = case(seed, velocity)
        rng = np.random.default_rng(seed)
        rows = np.flatnonzero(rng.random(len(flight.problem.t_s)) < 0.05)
        way = rng.standard_normal((len(rows), 3))
        way *= rng.uniform(20, 100, (len(rows), 1)) / np.linalg.norm(way, axis=1, keepdims=True)
        result = gate(flight, moved(position, rows, way), speeds)
        assert (np.flatnonzero(np.isnan(result.antenna.position.value[:, 0])) == rows).all()
        assert [(loss.what, loss.count) for loss in result.unused] == [("position", len(rows))]
        listed = sum(round(10 * (r.until_s - r.from_s)) + 1 for r in result.rejections)
        assert listed == len(rows)


def test_fixes_that_are_only_noisy_all_stay():
    for seed in range(5):
        result = gate(*case(seed))
        assert result.rejections == ()
        assert result.unused == ()


@pytest.mark.parametrize("seed", range(3))
def test_positions_by_phase_are_not_held_against_the_drift_of_the_inertial_track(seed):
    """They are good to millimetres, the track to centimetres, and worst at a flight's ends."""
    rng = np.random.default_rng(seed)
    flown = turning(rng, span_s=20.0)
    p_n_m = flown.truth.p_n_m + 2e-3 * rng.standard_normal(flown.truth.p_n_m.shape)
    covariance = np.tile(2e-3**2 * np.eye(3), (len(p_n_m), 1, 1))
    position = VectorSeries(value=p_n_m, covariance=covariance, arm_b_m=np.zeros(3))
    result = gate(flown, position, flown.velocity)
    assert result.rejections == ()


def test_a_second_of_wrong_fixes_in_a_row_is_one_rejection_with_its_size():
    flight, position, speeds = case(1)
    result = gate(flight, moved(position, slice(100, 110), [50.0, 0, 0]), speeds)
    (one,) = result.rejections
    assert (one.what, one.link) == ("position", "a1")
    assert (one.from_s, one.until_s) == pytest.approx((10.0, 10.9))
    assert float(one.reason.split()[0]) == pytest.approx(50, abs=5)


def test_a_velocity_that_jumps_goes_and_does_not_take_positions_along():
    flight, position, speeds = case(2)
    result = gate(flight, position, moved(speeds, [50, 51, 200], [0, 3.0, 0]))
    assert np.isnan(result.antenna.velocities[0].value[[50, 51, 200], 0]).all()
    assert [(loss.what, loss.count) for loss in result.unused] == [("velocity", 3)]


def test_nothing_is_tested_near_an_untested_keyframe():
    flight, position, speeds = case(3)
    untested = np.zeros(len(flight.problem.t_s), dtype=bool)
    untested[95] = True
    result = gate(flight, moved(position, [100, 200], [50.0, 0, 0]), speeds, untested)
    assert np.flatnonzero(np.isnan(result.antenna.position.value[:, 0])).tolist() == [200]


def test_without_fixes_there_is_nothing_to_test():
    flight, _, _ = case()
    result = gate(flight, None, None)
    assert (result.antenna.positions, result.antenna.velocities) == ((), ())
    assert result.rejections == ()


def test_a_spinning_antenna_off_the_accelerometer_is_not_rejected():
    flight = turning(np.random.default_rng(5), span_s=20.0)
    arm_b_m, truth = np.array([1.5, -0.5, 0.2]), flight.truth
    w_b = flight.problem.start.aux[:, 3:6]
    swing_n_mps = np.einsum("nij,nj->ni", truth.R_nb, np.cross(w_b, arm_b_m))
    parts = (
        (flight.position, truth.R_nb @ arm_b_m),
        (flight.velocity, swing_n_mps),
    )
    at_antenna = [
        VectorSeries(value=one.value + by, covariance=one.covariance, arm_b_m=arm_b_m)
        for one, by in parts
    ]
    result = gate(flight, *at_antenna)
    assert result.rejections == ()
