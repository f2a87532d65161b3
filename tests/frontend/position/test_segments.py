"""Positions of segments that phase does not connect: each off by its own."""

import numpy as np
import pytest

from fgnav.frontend.position.segments import NAME, segmented
from fgnav.frontend.position.series import VectorSeries
from fgnav.frontend.problem import build_problem
from fgnav.frontend.settings import ProblemSettings
from fgnav.integers.truth import Truth
from fgnav_sim.receiver_tables import OutageTable
from tests.methods.simulated import flown_with

ARCS_M2 = np.concatenate([np.tile(0.04 * np.eye(3), (6, 1, 1)), np.tile(np.eye(3), (4, 1, 1))])


def series(segment):
    n = len(segment)
    value = np.zeros((n, 3))
    value[2] = np.nan
    return VectorSeries(
        value=value,
        covariance=np.tile(1e-4 * np.eye(3), (n, 1, 1)),
        arm_b_m=np.zeros(3),
        segment=np.array(segment),
    )


def test_positions_that_phase_connects_are_off_alike():
    segments = segmented(series([7] * 10), ARCS_M2)
    assert segments.constants == ()
    assert segments.position.segment is None
    np.testing.assert_array_equal(segments.common_m2, ARCS_M2)


def test_each_segment_has_a_bias_the_longest_first():
    segments = segmented(series([2] * 6 + [-1] + [0] * 3), ARCS_M2)
    np.testing.assert_array_equal(segments.position.segment, [0, 0, 0, 0, 0, 0, -1, 1, 1, 1])
    (constant,) = segments.constants
    expected = np.repeat([0.04, 1.0], 3)
    np.testing.assert_allclose(constant.covariance, np.diag(expected), rtol=0, atol=1e-7)
    assert constant.linear
    assert not constant.reported
    assert constant.axes[3] == "segment 1 n"
    assert not segments.common_m2.any()
    np.testing.assert_array_equal(segments.position.covariance, series([0] * 10).covariance)


def test_segments_that_are_off_by_nothing_have_no_bias():
    arcs_m2 = ARCS_M2 * (np.arange(10) < 6)[:, None, None] + 1e-12 * np.eye(3)
    segments = segmented(series([0] * 6 + [1] * 4), arcs_m2)
    assert segments.position.segment.max() == 0
    assert segments.constants[0].size == 3


def test_the_ninth_segment_is_as_uncertain_on_average_without_a_bias_of_its_own():
    """Two positions of it: noise of twice the variance each is as uncertain a mean."""
    segment = np.repeat(np.arange(9), 2)
    arcs_m2 = np.tile(0.04 * np.eye(3), (18, 1, 1))
    value = np.zeros((18, 3))
    position = VectorSeries(
        value=value,
        covariance=np.tile(1e-4 * np.eye(3), (18, 1, 1)),
        arm_b_m=np.zeros(3),
        segment=segment,
    )
    segments = segmented(position, arcs_m2)
    assert segments.constants[0].size == 8 * 3
    np.testing.assert_array_equal(segments.position.segment, [*segment[:16], -1, -1])
    mean_m2 = segments.position.covariance[16:, 0, 0] / 2
    np.testing.assert_allclose(mean_m2, 0.04 + 1e-4 / 2, rtol=1e-9)
    np.testing.assert_allclose(segments.position.covariance[:16, 0, 0], 1e-4)


def test_positions_by_code_alone_stay_as_they_are():
    position = VectorSeries(
        value=np.zeros((10, 3)), covariance=np.tile(np.eye(3), (10, 1, 1)), arm_b_m=np.zeros(3)
    )
    segments = segmented(position, 0 * ARCS_M2)
    assert segments.position is position
    assert segments.constants == ()


@pytest.fixture(scope="module")
def parted():
    """A flight with a gyroscope, five seconds of it without any satellite."""
    outage = OutageTable(from_s=7.0, until_s=12.0)
    flight = flown_with("surroundings", 16.0, seed=0, outages=(outage,))
    return build_problem(flight, ProblemSettings(resolver=Truth())).problem


def test_positions_before_and_after_an_outage_have_columns_of_their_own(parted):
    position = next(m for m in parted.measurements if m.name == "position")
    columns = parted.constants.columns(NAME)
    assert columns.stop - columns.start == 6
    t_s = parted.t_s[position.row]
    first = set(position.segment_column[t_s < 7.0].tolist())
    last = set(position.segment_column[t_s >= 12.0].tolist())
    assert first == {columns.start}
    assert last == {columns.start + 3}
