import numpy as np
import pytest

from fgnav.methods.smoother.gate import gated
from fgnav.methods.smoother.keyframes import Timed
from tests.methods.smoother.flights import turning


def case(seed=0, velocity=True):
    """A turning flight's fixes, 1 m and 0.05 m/s, and what they are held against."""
    made = turning(np.random.default_rng(seed), span_s=30.0)
    k = made.keyframes
    return k, k.position, k.velocity if velocity else None


def gate(keyframes, position, velocity, blind=None):
    blind = np.zeros(len(keyframes.t_s), dtype=bool) if blind is None else blind
    fixes = (position, velocity)
    return gated(keyframes.preintegrate, keyframes.t_s, keyframes.R_nb, fixes, blind, "a1")


def moved(timed, rows, by):
    value = timed.value.copy()
    value[rows] += by
    return Timed(value=value, covariance=timed.covariance, arm_b_m=timed.arm_b_m)


@pytest.mark.parametrize("velocity", [True, False], ids=["with velocities", "without"])
def test_jumps_of_twenty_metres_and_more_are_found_and_nothing_else(velocity):
    for seed in range(3):
        keyframes, position, speeds = case(seed, velocity)
        rng = np.random.default_rng(seed)
        rows = np.flatnonzero(rng.random(len(keyframes.t_s)) < 0.05)
        way = rng.standard_normal((len(rows), 3))
        way *= rng.uniform(20, 100, (len(rows), 1)) / np.linalg.norm(way, axis=1, keepdims=True)
        found = gate(keyframes, moved(position, rows, way), speeds)
        assert (np.flatnonzero(np.isnan(found.position.value[:, 0])) == rows).all()
        assert [(loss.what, loss.count) for loss in found.losses] == [("position", len(rows))]
        listed = sum(round(10 * (r.until_s - r.from_s)) + 1 for r in found.rejections)
        assert listed == len(rows)


def test_fixes_that_are_only_noisy_all_stay():
    for seed in range(5):
        found = gate(*case(seed))
        assert found.rejections == ()
        assert found.losses == ()


@pytest.mark.parametrize("seed", range(3))
def test_positions_by_phase_are_not_held_against_the_drift_of_the_inertial_track(seed):
    """They are good to millimetres, the track to centimetres, and worst at a flight's ends."""
    rng = np.random.default_rng(seed)
    flown = turning(rng, span_s=20.0)
    p_n_m = flown.truth.p_n_m + 2e-3 * rng.standard_normal(flown.truth.p_n_m.shape)
    covariance = np.tile(2e-3**2 * np.eye(3), (len(p_n_m), 1, 1))
    position = Timed(value=p_n_m, covariance=covariance, arm_b_m=np.zeros(3))
    found = gate(flown.keyframes, position, flown.keyframes.velocity)
    assert found.rejections == ()


def test_a_second_of_wrong_fixes_in_a_row_is_one_rejection_with_its_size():
    keyframes, position, speeds = case(1)
    found = gate(keyframes, moved(position, slice(100, 110), [50.0, 0, 0]), speeds)
    (one,) = found.rejections
    assert (one.what, one.link) == ("position", "a1")
    assert (one.from_s, one.until_s) == pytest.approx((10.0, 10.9))
    assert float(one.reason.split()[0]) == pytest.approx(50, abs=5)


def test_a_velocity_that_jumps_goes_and_does_not_take_positions_along():
    keyframes, position, speeds = case(2)
    found = gate(keyframes, position, moved(speeds, [50, 51, 200], [0, 3.0, 0]))
    assert np.isnan(found.velocity.value[[50, 51, 200], 0]).all()
    assert [(loss.what, loss.count) for loss in found.losses] == [("velocity", 3)]


def test_nothing_is_tested_near_a_blind_keyframe():
    keyframes, position, speeds = case(3)
    blind = np.zeros(len(keyframes.t_s), dtype=bool)
    blind[95] = True
    found = gate(keyframes, moved(position, [100, 200], [50.0, 0, 0]), speeds, blind)
    assert np.flatnonzero(np.isnan(found.position.value[:, 0])).tolist() == [200]


def test_without_fixes_there_is_nothing_to_test():
    keyframes, _, _ = case()
    found = gate(keyframes, None, None)
    assert (found.position, found.velocity, found.rejections) == (None, None, ())
