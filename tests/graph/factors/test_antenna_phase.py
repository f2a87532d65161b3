"""Phases with ambiguities: Jacobians, what clocks leave, and what leads from block to block."""

import gtsam
import numpy as np
import pytest
from numpy.testing import assert_allclose

from fgnav.graph import keys
from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock, PhaseRows
from fgnav.graph.factors.check import jacobian_misfit
from fgnav.graph.factors.position import LEVER_ARM
from fgnav.graph.types.parameters import Parameters
from tests.graph.factors import cases, sensors


def phases(rng, shared, *, lever=False, sizes=(5, 4)):
    rows = tuple(
        PhaseRows(rng.normal(size=(6, 3)), rng.normal(size=(6, size)), rng.normal(size=6))
        for size in sizes
    )
    blocks, before = [], 0
    for k, size in enumerate(sizes):
        q = size + 2
        blocks.append(
            ArcBlock(
                begin_row=3 * k,
                before=rng.normal(size=(q, before)),
                after=rng.normal(size=(q, size)),
                right=rng.normal(size=q),
            )
        )
        before = size
    return AntennaPhase(
        row=3 * np.arange(len(sizes)),
        rows=rows,
        block=np.arange(len(sizes)),
        blocks=tuple(blocks),
        arm_b_m=rng.normal(size=(len(sizes), 3)),
        constants=shared if lever else Parameters(),
    )


def values_of(at, arcs):
    values = gtsam.Values()
    values.insert(keys.pose(0), gtsam.Pose3(gtsam.Rot3(at.R_nb[0]), at.p_n_m[0]))
    values.insert(keys.constant(0), at.constants[:3])
    for j, A in enumerate(arcs):
        values.insert(keys.arcs(j), A)
    return values


@pytest.mark.parametrize("lever", [False, True])
def test_jacobians_equal_differences(lever):
    rng, shared = np.random.default_rng(1), sensors.constants(LEVER_ARM)
    at = cases.random_states(1, rng, shared)
    factor = phases(rng, shared, lever=lever).factor(0, 0)
    values = values_of(at, [rng.normal(size=5)])
    assert jacobian_misfit(factor, values) < 1e-8


def test_the_residual_is_the_equation():
    rng, shared = np.random.default_rng(2), sensors.constants(LEVER_ARM)
    at, of = cases.random_states(1, rng, shared), phases(rng, shared, lever=True)
    A, one = rng.normal(size=5), of.rows[0]
    place = at.p_n_m[0] + at.R_nb[0] @ (of.arm_b_m[0] + at.constants[:3])
    expected = one.G @ place + one.H @ A - one.z
    found = of.factor(0, 0).unwhitenedError(values_of(at, [A]))
    assert_allclose(found, expected, rtol=1e-12)


def test_a_block_follows_from_the_one_before():
    rng, shared = np.random.default_rng(3), sensors.constants(LEVER_ARM)
    at, of = cases.random_states(1, rng, shared), phases(rng, shared)
    arcs = [rng.normal(size=5), rng.normal(size=4)]
    values, one = values_of(at, arcs), of.blocks[1]
    r = one.after @ arcs[1] - one.before @ arcs[0] - one.right
    assert_allclose(2 * of.transition_factor(1).error(values), r @ r, rtol=1e-12)
    first = of.blocks[0].after @ arcs[0] - of.blocks[0].right
    assert_allclose(2 * of.transition_factor(0).error(values), first @ first, rtol=1e-12)


def test_blocks_end_before_the_next_begins_and_move_with_their_keyframes():
    of = phases(np.random.default_rng(4), sensors.constants(LEVER_ARM))
    assert of.ending(9) == {2: (0,), 9: (1,)}
    moved = of.move(np.array([4, 8]))
    assert [one.begin_row for one in moved.blocks] == [4, 8]
