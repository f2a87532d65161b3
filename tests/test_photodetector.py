import numpy as np
import pytest

from fgnav.checks import BadInputError
from fgnav.photodetector import LineOfSight, line_of_sight, spot_fraction, to_landmark_b_m
from fgnav.types.flight import Photodetector

FOCAL_M, RADIUS_M = 0.02, 0.005


def calibration():
    """A smooth curve of the usual shape: steep logarithms towards the rim."""
    r_c = np.linspace(0, 0.9, 19)
    return np.column_stack([2 * np.arctanh(r_c), r_c])


def photodetector(currents, curve=None, position_b_m=(0.0, 0.0, 0.0)):
    currents = np.asarray(currents, dtype=float)
    return Photodetector(
        t_s=np.arange(len(currents), dtype=float),
        currents=currents,
        position_b_m=np.array(position_b_m),
        landmark_n_m=np.array([1000.0, 0.0, 0.0]),
        detector_radius_m=RADIUS_M,
        focal_length_m=FOCAL_M,
        calibration=calibration() if curve is None else curve,
    )


def currents_of(spot_m):
    """Currents, (k, 4), of spots, (k, 2): the inverse of Eqs. 34-36 for this calibration."""
    r_c = np.linalg.norm(spot_m, axis=1) / RADIUS_M
    logs = 2 * np.arctanh(r_c)[:, None] * spot_m / (r_c * RADIUS_M)[:, None]
    x, y = logs.T / 2
    return np.exp(np.stack([y, -x, -y, x], axis=1))


def test_a_current_cut_at_its_limit_is_a_counted_gap():
    x_m = np.linspace(-0.2, 0.6, 9)[:, None] * RADIUS_M
    currents = currents_of(np.hstack([x_m, 0.1 * RADIUS_M + 0 * x_m]))
    limit = currents[6, 3]  # the last three reach it
    sight = line_of_sight(photodetector(np.minimum(currents, limit)))
    np.testing.assert_array_equal(sight.t_s, np.arange(6))
    assert [(loss.reason, loss.count) for loss in sight.unused] == [
        ("a current stands at its limit", 3)
    ]
    whole = line_of_sight(photodetector(currents))
    np.testing.assert_array_equal(whole.e_b[:6], sight.e_b)
    assert whole.unused == ()


def test_a_record_that_does_not_change_is_not_cut():
    assert line_of_sight(photodetector([[1.0, 2.0, 1.5, 1.2]] * 5)).unused == ()


def test_equal_currents_look_along_the_boresight():
    sight = line_of_sight(photodetector([[1, 1, 1, 1], [7, 7, 7, 7]]))
    np.testing.assert_array_equal(sight.e_b, [[1, 0, 0], [1, 0, 0]])
    assert sight.unused == ()


@pytest.mark.parametrize(
    ("bright", "towards"), [(0, (2, 1)), (1, (1, -1)), (2, (2, -1)), (3, (1, 1))]
)
def test_each_quadrant_looks_its_own_way(bright, towards):
    currents = np.ones((1, 4))
    currents[0, bright] = 1.5
    axis, sign = towards
    e_b = line_of_sight(photodetector(currents)).e_b[0]
    assert e_b[axis] * sign > 0.01
    np.testing.assert_allclose(e_b[3 - axis], 0, atol=1e-15)


def test_direction_comes_back_from_its_currents():
    rng = np.random.default_rng(5)
    angle, r_m = rng.uniform(0, 2 * np.pi, 200), rng.uniform(0.01, 0.85, 200) * RADIUS_M
    spot_m = np.column_stack([r_m * np.cos(angle), r_m * np.sin(angle)])
    sight = line_of_sight(photodetector(3.0 * currents_of(spot_m)))
    ray_b = np.column_stack([np.full(200, FOCAL_M), spot_m])
    expected = ray_b / np.linalg.norm(ray_b, axis=1, keepdims=True)
    # The spline of 19 points follows the curve to 1e-3 of the radius at its rim.
    np.testing.assert_allclose(sight.e_b, expected, rtol=0, atol=0.3e-3)


def test_brightness_does_not_move_the_line_of_sight():
    currents = np.array([[1.0, 2.0, 1.5, 1.2]])
    dim, bright = (line_of_sight(photodetector(scale * currents)).e_b for scale in (1e-9, 1e6))
    np.testing.assert_allclose(dim, bright, rtol=0, atol=1e-12)


def test_dark_quadrants_and_spots_off_the_detector_are_counted_gaps():
    currents = [[1, 1, 1, 1], [0, 1, 1, 1], [1, -1, 1, 1], [1e9, 1, 1, 1], [2, 1, 1, 1]]
    sight = line_of_sight(photodetector(currents))
    np.testing.assert_array_equal(sight.t_s, [0, 4])
    assert {loss.reason: loss.count for loss in sight.unused} == {
        "a current is zero or below": 2,
        "spot off the detector or beyond its calibration": 1,
    }


def test_calibration_past_the_rim_makes_a_gap():
    past_rim = np.array([[0.0, 0.0], [1.0, 0.6], [2.0, 1.2]])
    sight = line_of_sight(photodetector([[np.exp(1.9), 1, 1, 1]], curve=past_rim))
    assert len(sight.t_s) == 0
    assert sight.unused[0].count == 1


def test_calibration_that_starts_off_the_centre_is_led_to_it():
    off_centre = np.array([[0.5, 0.25], [1.0, 0.5], [2.0, 1.0]])
    np.testing.assert_allclose(
        spot_fraction(off_centre, np.array([0.0, 0.2, 1.5])), [0, 0.1, 0.75], atol=1e-12
    )


def test_covariance_lies_across_the_line_of_sight():
    sight = line_of_sight(photodetector([[1.3, 1, 1, 1.2]]), sigma_rad=2e-3)
    np.testing.assert_allclose(sight.covariance[0] @ sight.e_b[0], 0, atol=1e-18)
    assert np.trace(sight.covariance[0]) == pytest.approx(2 * 2e-3**2)


def test_lever_arms_need_no_attitude_to_reach_the_landmark():
    rng = np.random.default_rng(8)
    landmark_b_m = rng.normal((200, 0, 0), 40, (50, 3))
    mounted_b_m, antenna_b_m = np.array([1.0, 0.1, 0.0]), np.array([-0.8, 0.0, 0.2])
    ray_b = landmark_b_m - mounted_b_m
    e_b = ray_b / np.linalg.norm(ray_b, axis=1, keepdims=True)
    distance_m = np.linalg.norm(landmark_b_m - antenna_b_m, axis=1)
    mounted = photodetector([[1, 1, 1, 1]], position_b_m=mounted_b_m)
    answer_m = to_landmark_b_m(mounted, e_b, antenna_b_m, distance_m)
    np.testing.assert_allclose(answer_m, landmark_b_m - antenna_b_m, rtol=0, atol=1e-9)


def test_a_distance_shorter_than_the_lever_arm_has_no_direction():
    mounted = photodetector([[1, 1, 1, 1]], position_b_m=(0.0, 1.0, 0.0))
    answer_m = to_landmark_b_m(mounted, np.array([[1.0, 0, 0]]), np.zeros(3), np.array([0.5]))
    assert np.isnan(answer_m).all()


def test_line_of_sight_without_noise_is_rejected():
    with pytest.raises(BadInputError, match="line of sight sigma_rad: must be positive, got 0"):
        LineOfSight(t_s=np.zeros(1), e_b=np.ones((1, 3)), sigma_rad=0.0)
