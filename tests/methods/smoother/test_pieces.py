"""Positions of stretches that phase does not connect: each off by its own, told apart."""

import numpy as np
import pytest

from fgnav.integers.truth import Truth
from fgnav.methods.smoother import Batch, GtsamBatch
from fgnav.methods.smoother.keyframes import Timed
from fgnav.methods.smoother.pieces import in_pieces
from fgnav.methods.smoother.smoother import collected_for
from fgnav_sim.receiver_tables import OutageTable
from tests.methods.simulated import flown_with, nees

ARCS_M2 = np.concatenate([np.tile(0.04 * np.eye(3), (6, 1, 1)), np.tile(np.eye(3), (4, 1, 1))])


def timed(piece):
    n = len(piece)
    value = np.zeros((n, 3))
    value[2] = np.nan
    covariance = np.tile(1e-4 * np.eye(3), (n, 1, 1))
    return Timed(value=value, covariance=covariance, arm_b_m=np.zeros(3), piece=np.array(piece))


def test_positions_that_phase_connects_are_off_alike():
    found = in_pieces(timed([7] * 10), ARCS_M2, offsets=True)
    assert found.constants == ()
    assert found.position.piece is None
    np.testing.assert_array_equal(found.common_m2, ARCS_M2)


def test_each_stretch_has_an_offset_the_longest_first():
    found = in_pieces(timed([2] * 6 + [-1] + [0] * 3), ARCS_M2, offsets=True)
    np.testing.assert_array_equal(found.position.piece, [0, 0, 0, 0, 0, 0, -1, 1, 1, 1])
    (constant,) = found.constants
    expected = np.repeat([0.04, 1.0], 3)
    np.testing.assert_allclose(constant.covariance, np.diag(expected), rtol=0, atol=1e-7)
    assert not found.common_m2.any()
    np.testing.assert_array_equal(found.position.covariance, timed([0] * 10).covariance)


def test_stretches_that_are_off_by_nothing_have_no_offset():
    arcs_m2 = ARCS_M2 * (np.arange(10) < 6)[:, None, None] + 1e-12 * np.eye(3)
    found = in_pieces(timed([0] * 6 + [1] * 4), arcs_m2, offsets=True)
    assert found.position.piece.max() == 0
    assert len(found.constants[0].start) == 3


def test_without_offsets_a_stretch_is_as_uncertain_on_average():
    found = in_pieces(timed([0] * 6 + [1] * 4), ARCS_M2, offsets=False)
    assert found.constants == ()
    assert found.position.piece is None
    variance = found.position.covariance[:, 0, 0]
    assert variance[0] == pytest.approx(1e-4)
    assert variance[-1] / 4 == pytest.approx(1.04, rel=1e-3)
    np.testing.assert_allclose(found.common_m2, np.tile(0.04 * np.eye(3), (10, 1, 1)))


@pytest.fixture(scope="module")
def parted():
    """Flights with a gyroscope, ten seconds of them without any satellite."""
    outage = OutageTable(from_s=10.0, until_s=20.0)
    return [flown_with("surroundings", 30.0, seed=seed, outages=(outage,)) for seed in range(8)]


def test_velocity_across_an_outage_is_as_uncertain_as_both_its_ends(parted):
    squares = []
    for flight in parted:
        estimate = Batch(resolver=Truth())(flight)
        k = int(np.argmin(np.abs(estimate.t_s - 15.0)))
        truth = flight.truth
        row = int(np.argmin(np.abs(truth.t_s - estimate.t_s[k])))
        error = (truth.v_n_mps[row] - estimate.v_n_mps[k])[None]
        squares.append(nees(error, estimate.velocity_covariance_m2ps2[k][None]))
    assert 1.0 < np.mean(squares) < 5.5  # 24 degrees of freedom, 99.9 %


def test_gtsam_s_graph_of_a_parted_flight_has_no_offsets(parted):
    keyframes = collected_for(GtsamBatch(resolver=Truth()), parted[0]).keyframes
    assert all(one.name != "offsets of positions" for one in keyframes.constants)
    assert keyframes.position.piece is None
    ours = collected_for(Batch(resolver=Truth()), parted[0]).keyframes
    assert ours.position.piece.max() == 1
