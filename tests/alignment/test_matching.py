"""Times of measurements matched with times of keyframes."""

import numpy as np
from numpy.testing import assert_array_equal

from fgnav.alignment.matching import SAME_S, nearest, unmatched


def test_each_wanted_time_gets_the_nearest_and_whether_it_is_the_same():
    have_s, want_s = np.array([0.0, 1.0, 2.0]), np.array([-5.0, 0.4, 0.6, 1.0 + SAME_S / 2, 9.0])
    row, same = nearest(have_s, want_s)
    assert_array_equal(row, [0, 0, 1, 1, 2])
    assert_array_equal(same, [False, False, False, True, False])


def test_a_single_time_is_the_nearest_of_all():
    row, same = nearest(np.array([3.0]), np.array([0.0, 3.0, 7.0]))
    assert_array_equal(row, [0, 0, 0])
    assert_array_equal(same, [False, True, False])


def test_measurements_at_no_keyframe_are_counted():
    (loss,) = unmatched("fix", 5, np.array([True, False, True]))
    assert (loss.what, loss.reason, loss.count) == ("fix", "not at a keyframe", 3)
    assert unmatched("fix", 2, np.array([True, False, True])) == ()
