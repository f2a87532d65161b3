"""What is left over of phases, drawn from the model, against the whole system's least squares."""

import numpy as np
from scipy.stats import chi2

from fgnav.graph.factors.antenna_phase import AntennaPhase, ArcBlock, PhaseRows
from fgnav.graph.innovation.phase_redundancy import phase_innovations
from fgnav.graph.types.parameters import Parameters

ARCS, ROWS, EPOCHS = 6, 7, 8
HALF = EPOCHS // 2


def drawn(rng, louder=1.0):
    """Return phases of two blocks: arcs go from the first to the second with white noise."""
    after = np.diag(1 / rng.uniform(0.5, 3.0, ARCS))
    first = np.linalg.solve(after, rng.normal(size=ARCS))
    walk = np.diag(1 / rng.uniform(0.01, 0.1, ARCS))
    second = first + np.linalg.solve(walk, rng.normal(size=ARCS))
    none = np.zeros(ARCS)
    blocks = (
        ArcBlock(0, np.zeros((ARCS, 0)), after, none),
        ArcBlock(HALF, walk, walk, none),
    )
    rows = []
    for k in range(EPOCHS):
        G, H = rng.normal(size=(ROWS, 3)), rng.normal(size=(ROWS, ARCS))
        arcs, place_n_m = (first if k < HALF else second), rng.normal(0.0, 1e3, 3)
        z = G @ place_n_m + H @ arcs + louder * rng.normal(size=ROWS)
        rows.append(PhaseRows(G, H, z))
    return AntennaPhase(
        row=np.arange(EPOCHS),
        rows=tuple(rows),
        block=np.repeat([0, 1], HALF),
        blocks=blocks,
        arm_b_m=np.zeros((EPOCHS, 3)),
        constants=Parameters(()),
    )


def test_innovations_add_up_to_what_least_squares_of_everything_leave():
    phase = drawn(np.random.default_rng(1))
    squared, freedom = phase_innovations(phase)
    places = 3 * EPOCHS
    system, right = [], []
    for k, (G, H, z) in enumerate(phase.rows):
        row = np.zeros((ROWS, places + 2 * ARCS))
        row[:, 3 * k : 3 * k + 3] = G
        row[:, places + ARCS * phase.block[k] :][:, :ARCS] = H
        system.append(row)
        right.append(z)
    leads = np.zeros((2 * ARCS, places + 2 * ARCS))
    leads[:ARCS, places : places + ARCS] = phase.blocks[0].after
    leads[ARCS:, places : places + ARCS] = -phase.blocks[1].before
    leads[ARCS:, places + ARCS :] = phase.blocks[1].after
    A, y = np.vstack([*system, leads]), np.concatenate([*right, np.zeros(2 * ARCS)])
    x = np.linalg.lstsq(A, y, rcond=None)[0]
    np.testing.assert_allclose(squared.sum(), ((A @ x - y) ** 2).sum(), rtol=1e-9)
    assert freedom.sum() == len(y) - len(x)
    np.testing.assert_array_equal(freedom, ROWS - 3)


def test_innovations_of_right_phases_are_chi_square_and_of_loud_ones_are_not():
    rng = np.random.default_rng(2)
    totals = {1.0: [], 3.0: []}
    for louder, of in totals.items():
        for _ in range(100):
            squared, freedom = phase_innovations(drawn(rng, louder))
            of.append(squared.sum())
    total = 100 * int(freedom.sum())
    assert chi2.ppf(1e-3, total) < sum(totals[1.0]) < chi2.ppf(1 - 1e-3, total)
    assert sum(totals[3.0]) > 5 * total
