"""In-motion alignment: heading from the first motion, and none from rest."""

from dataclasses import replace

import numpy as np
import pytest

from fgnav.alignment.in_motion.windows import in_motion, in_motion_smoothed
from fgnav.assembly.truncation import truncated
from fgnav.attitude.flight_vectors import track_of
from fgnav.evaluation.reference import truth_at
from fgnav.geometry.rotations import log, transpose
from tests.assembly.standing import standing


def aligned(flight, align=in_motion):
    gravity_n_mps2 = flight.origin.gravity_n_mps2(np.zeros((2, 3)))[0]
    return align(flight.imu, track_of(flight), gravity_n_mps2)


@pytest.mark.parametrize("align", [in_motion, in_motion_smoothed])
@pytest.mark.parametrize("seed", range(20_000, 20_004))
def test_motion_tells_the_heading_within_seconds_and_as_well_as_stated(seed, align):
    flight = standing(seed)
    found = aligned(flight, align)
    assert 15.0 < found.until_s[0] < 25.0
    assert (np.diff(found.until_s) > 0).all()
    order = np.unique(found.middle_s, return_index=True)[1]
    real = truth_at(flight.truth, found.middle_s[order]).R_nb
    R_nb = (found.R_nu @ found.rotation.at(found.middle_s))[order]
    off_n = np.einsum("nij,nj->ni", R_nb, log(transpose(R_nb) @ real))
    assert np.abs(off_n[:, 2]).max() < 0.15  # half of what half a radian asks for
    assert (
        np.abs(off_n[:, :2]).max() < 0.06
    )  # a bias of 0.005 rad/s in seven seconds, and 0.05 m/s2
    assert (off_n[:, 2] ** 2 / found.sigma_rad[order] ** 2).mean() < 4.0


def test_no_heading_is_told_at_rest():
    """Windows of two minutes and five flights, of which chance would pass one in a million."""
    for seed in range(20_000, 20_005):
        assert not len(aligned(standing(seed, stands_s=200.0, span_s=120.0)).until_s)


@pytest.mark.parametrize("seed", range(20_001, 20_004))
@pytest.mark.parametrize("bias_radps", [0.0, 0.05])
def test_the_gyroscope_s_bias_is_told_by_one_attitude_over_minutes(seed, bias_radps):
    """3 deg/s about each axis turn the axes of a window by more than a right angle."""
    flight = standing(seed, span_s=60.0)
    imu = replace(
        flight.imu,
        w_b_radps=flight.imu.w_b_radps + bias_radps,
        gyroscope_bias_radps=0.02 if bias_radps else 0.005,
    )
    flight = replace(flight, imu=imu)
    rest = imu.t_s < 14.0
    real = imu.w_b_radps[rest].mean(axis=0)
    found = aligned(flight, in_motion_smoothed)
    assert found.bias_sigma_radps < 2e-3  # of 5e-3
    assert np.abs(found.bias_b_radps - real).max() < 3 * found.bias_sigma_radps
    attitude = truth_at(flight.truth, found.middle_s[[-1]]).R_nb[0]
    off = log((found.R_nu[-1] @ found.rotation.at(found.middle_s[[-1]])[0]).T[None] @ attitude)
    assert np.abs(off).max() < 0.2


def test_what_came_later_changes_no_window():
    flight = standing(20_002)
    whole, part = aligned(flight), aligned(truncated(flight, 30.0))
    k = len(part.until_s)
    assert k
    np.testing.assert_array_equal(whole.until_s[:k], part.until_s)
    np.testing.assert_allclose(whole.R_nu[:k], part.R_nu, atol=1e-12)
