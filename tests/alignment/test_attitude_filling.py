"""Attitudes where no epoch has one: held, or turned from one to the next."""

import numpy as np

from fgnav.alignment.filling import interpolated_attitudes, zero_order_hold
from fgnav.geometry import rotations


def turn_with_gap(t_s, from_s, until_s):
    R_nb = rotations.exp(np.stack([t_s, 0 * t_s, 0 * t_s], axis=1))
    valid = (t_s < from_s) | (t_s > until_s)
    return R_nb, np.where(valid[:, None, None], R_nb, np.eye(3)), valid


def test_the_last_attitude_is_held_or_turned_to_the_next():
    t_s = np.arange(0, 1.05, 0.1)
    R_nb, seen, valid = turn_with_gap(t_s, 0.25, 0.75)
    held = zero_order_hold(t_s, seen, valid)
    np.testing.assert_allclose(held[3:8], np.tile(R_nb[2], (5, 1, 1)))
    np.testing.assert_allclose(interpolated_attitudes(t_s, seen, valid), R_nb, atol=1e-9)


def test_after_the_last_attitude_it_stays():
    t_s = np.arange(0, 1.05, 0.1)
    R_nb, seen, valid = turn_with_gap(t_s, 0.75, 2.0)
    filled = interpolated_attitudes(t_s, seen, valid)
    np.testing.assert_allclose(filled[8:], np.tile(R_nb[7], (3, 1, 1)), atol=1e-9)


def test_across_more_than_four_seconds_it_turns_evenly():
    """Rates at the ends say nothing of the middle then."""
    t_s = np.arange(0, 12.05, 0.1)
    R_nb, seen, valid = turn_with_gap(t_s, 2.05, 8.95)
    filled = interpolated_attitudes(t_s, seen, valid)
    # Seven radians on from the first are seven less a whole turn.
    between = rotations.log(rotations.transpose(filled[20:89]) @ filled[21:90])
    step = (7.0 - 2 * np.pi) / 70
    np.testing.assert_allclose(between, np.tile([step, 0, 0], (69, 1)), rtol=0, atol=1e-9)
    np.testing.assert_allclose(filled[valid], R_nb[valid])


def test_attitudes_that_are_all_valid_stay_as_they_are():
    t_s = np.arange(0, 1.05, 0.1)
    R_nb, _, _ = turn_with_gap(t_s, 5.0, 6.0)
    assert interpolated_attitudes(t_s, R_nb, np.ones(11, dtype=bool)) is R_nb
